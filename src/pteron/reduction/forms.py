"""The dynamic model in several forms, each compiled to a kernel, to compare their operations.

All return the same actuator forces. `virtual work` is the paper's Eq. (13) as it is written, the
wrench of each body times the body's Jacobian; `regressor` is Eq. (15) times the parameters P, J^-T
taken first or last; `factored` is the inverse dynamics as `pteron.inverse_dynamics` evaluates it.
Each is complete, with all parameters, or reduced to base parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.machine import Machine
from pteron.equations.regressor import RegressorTerms, terms
from pteron.kernels import TARGETS, Kernel, Port, compile
from pteron.kernels.passes import optimise_function
from pteron.manipulator import parameters
from pteron.reduction.cheapest import cheapest_parameters
from pteron.reduction.result import BaseParameters

Form = Callable[[Expression, RegressorTerms, Expression, Expression], Expression]
"""Forces from J^-T (n, m), the factors of Eq. (15), columns (N, K), parameters (K, 1)."""


def _virtual_work(
    inverse: Expression, factors: RegressorTerms, selection: Expression, parameters: Expression
) -> Expression:
    """Return F_a = -F_p - J^-T (sum J_b^T F_b + F_e), each F_b = Om_b p_b."""
    sliders, *links, platform = factors.columns
    standard = ca.mtimes(selection, parameters)
    total = ca.mtimes(factors.platform, standard[platform])
    for jacobian, matrix, columns in zip(factors.link_jacobians, factors.links, links, strict=True):
        total = total + ca.mtimes(jacobian.T, ca.mtimes(matrix, standard[columns]))  # J_b^T F_b
    sliding = ca.mtimes(factors.sliders[:, factors.with_slider], standard[sliders])  # F_p
    if inverse.shape[0] > inverse.shape[1]:  # more legs than coordinates share all of it
        return ca.mtimes(inverse, total + ca.mtimes(factors.jacobian.T, sliding))
    return ca.mtimes(inverse, total) - sliding  # Eq. (13)


def _regressor(
    inverse: Expression, factors: RegressorTerms, selection: Expression, parameters: Expression
) -> Expression:
    """Return (J^-T [...]) P: the dynamic matrix is formed, then multiplied."""
    return ca.mtimes(ca.mtimes(inverse, ca.mtimes(factors.bracket, selection)), parameters)


def _regressor_inverse_last(
    inverse: Expression, factors: RegressorTerms, selection: Expression, parameters: Expression
) -> Expression:
    """Return J^-T ([...] P): one vector is multiplied by J^-T."""
    return ca.mtimes(inverse, ca.mtimes(ca.mtimes(factors.bracket, selection), parameters))


GRAPHS: Mapping[str, Form] = {
    "virtual work": _virtual_work,
    "regressor": _regressor,
    "regressor, J^-T last": _regressor_inverse_last,
}
"""The forms that are written out, by name."""

FORMS = (*GRAPHS, "factored")
"""The forms by name."""


def model_forms(base: BaseParameters) -> dict[tuple[str, str], Kernel]:
    """Return a kernel for each form and each parameter set.

    Parameters
    ----------
    base : BaseParameters
        The base parameters, which hold the machine too.

    Returns
    -------
    dict of Kernel
        The kernels by form and parameter set: "complete" has all parameters, "reduced" the base
        parameters that were given, and "cheapest", of the factored form alone, those of
        `cheapest_parameters`. Each is called with pose, velocity and acceleration, with the
        parameters as a fixed input.
    """
    robot = base.robot
    machine = Machine.numeric(robot)
    inertia = parameters(robot)
    sets = {
        "complete": (ca.SX.eye(len(inertia)), inertia),
        "reduced": (ca.sparsify(ca.SX(ca.DM(base.selection))), base.values()),
    }
    ports = [Port(name, (machine.freedom,)) for name in ("pose", "velocity", "acceleration")]
    kernels: dict[tuple[str, str], Kernel] = {}
    x, dx, ddx = (ca.SX.sym(port.name, *port.shape) for port in ports)
    state = machine.state(x, dx, ddx)
    factors = terms(machine, state)
    unit = state.platform.quasi_forces(ca.SX.eye(machine.freedom))
    inverse = -machine.closure.forces(unit, state.platform, state.legs)
    for form, build in GRAPHS.items():
        for name, (selection, numbers) in sets.items():
            symbols = ca.SX.sym("parameters", len(numbers))
            forces = build(inverse, factors, selection, symbols)
            function = optimise_function(
                ca.Function("forces", [x, dx, ddx, symbols], [ca.cse(forces)])
            )
            kernels[form, name] = TARGETS["vm"](
                f"{form}, {name}",
                function,
                (*ports, Port("parameters", numbers.shape, shared=True)),
                (Port("forces", (len(machine.legs),)),),
                {"parameters": numbers},
            )
    bases = {"complete": None, "reduced": base, "cheapest": cheapest_parameters(robot)}
    for name, chosen in bases.items():
        kernel = compile(robot, "inverse_dynamics", base=chosen, grade="parametric")
        kernels["factored", name] = kernel
    return kernels
