"""The dynamic model in every form that a claim of speed may mean, each as a kernel.

All return the same actuator forces. `regressor` is the paper's Eq. (15) times P, complete or
reduced to the base parameters, with J^-T taken first or last; `factored` is the inverse dynamics
as `pteron.inverse_dynamics` evaluates it, for the inertial parameters or for the base parameters.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from pteron.equations.closure import Load, actuator_forces
from pteron.equations.geometry import Expression, Geometry
from pteron.equations.platforms import platform_motion
from pteron.equations.regressor import generalized_regressor, paper_regressor, terms
from pteron.equations.virtual_work import inverse_dynamics
from pteron.kernels import TARGETS, Kernel, Port
from pteron.manipulator import parameters
from pteron.reduction.result import BaseParameters

__all__ = ["FORMS", "model_forms"]

Form = Callable[[Geometry, Expression, Expression, Expression, Expression, Expression], Expression]
"""Of geometry, pose, velocity, acceleration, selection (N, K) and parameters (K, 1)."""


def _regressor(
    g: Geometry, x: Expression, dx: Expression, ddx: Expression, s: Expression, p: Expression
) -> Expression:
    return ca.mtimes(ca.mtimes(paper_regressor(g, x, dx, ddx), s), p)


def _regressor_late(
    g: Geometry, x: Expression, dx: Expression, ddx: Expression, s: Expression, p: Expression
) -> Expression:
    total = ca.mtimes(ca.mtimes(generalized_regressor(terms(g, x, dx, ddx)), s), p)
    return -actuator_forces(g, Load.of(total), platform_motion(g, x, dx, ddx).turn)


def _factored(
    g: Geometry, x: Expression, dx: Expression, ddx: Expression, s: Expression, p: Expression
) -> Expression:
    return inverse_dynamics(g, x, dx, ddx, ca.densify(ca.mtimes(s, p)))


FORMS: dict[str, Form] = {
    "regressor": _regressor,
    "regressor, J^-T last": _regressor_late,
    "factored": _factored,
}
"""The forms by name."""


def model_forms(base: BaseParameters) -> dict[tuple[str, str], Kernel]:
    """Return a kernel for each form and each parameter set, "complete" and "reduced".

    Parameters
    ----------
    base : BaseParameters
        The base parameters, and with them the machine.

    Returns
    -------
    dict of Kernel
        By form and parameter set; each is called with pose, velocity and acceleration.
    """
    robot = base.robot
    geometry = Geometry.of(robot)
    values = parameters(robot)
    sets = {
        "complete": (ca.SX.eye(len(values)), values),
        "reduced": (ca.sparsify(ca.SX(ca.DM(base.selection))), base.values()),
    }
    ports = [Port(name, (geometry.freedom,)) for name in ("pose", "velocity", "acceleration")]
    kernels: dict[tuple[str, str], Kernel] = {}
    for form, build in FORMS.items():
        for name, (selection, numbers) in sets.items():
            x, dx, ddx = (ca.SX.sym(port.name, *port.shape) for port in ports)
            symbols = ca.SX.sym("parameters", len(numbers))
            forces = build(geometry, x, dx, ddx, selection, symbols)
            function = ca.Function("forces", [x, dx, ddx, symbols], [ca.cse(forces)])
            kernels[form, name] = TARGETS["vm"](
                f"{form}, {name}",
                function,
                (*ports, Port("parameters", numbers.shape, shared=True)),
                (Port("forces", (geometry.freedom,)),),
                {"parameters": numbers},
            )
    return kernels
