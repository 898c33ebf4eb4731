"""The dynamic model in several forms, each compiled to a kernel, to compare their operations.

All return the same actuator forces. `regressor` is the paper's Eq. (15) times the parameters P as
it is written, J^-T taken first or last, complete or reduced to the base parameters; `factored` is
the inverse dynamics as `pteron.inverse_dynamics` evaluates it, and, reduced, the model of the
cheapest base parameters.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.machine import Machine
from pteron.equations.regressor import generalized_regressor
from pteron.kernels import TARGETS, Kernel, Port, compile
from pteron.kernels.passes import optimised
from pteron.manipulator import parameters
from pteron.reduction.cheapest import cheapest_parameters
from pteron.reduction.result import BaseParameters

Form = Callable[[Expression, Expression, Expression, Expression], Expression]
"""Forces from J^-T (n, m), the bracket of Eq. (15) (m, N), columns (N, K), parameters (K, 1)."""


_GRAPHS: dict[str, Form] = {
    "regressor": lambda j, bracket, s, p: ca.mtimes(ca.mtimes(j, ca.mtimes(bracket, s)), p),
    "regressor, J^-T last": lambda j, bracket, s, p: ca.mtimes(
        j, ca.mtimes(ca.mtimes(bracket, s), p)
    ),
}

FORMS = (*_GRAPHS, "factored")
"""The forms by name."""


def model_forms(base: BaseParameters) -> dict[tuple[str, str], Kernel]:
    """Return a kernel for each form and each parameter set, "complete" and "reduced".

    Parameters
    ----------
    base : BaseParameters
        The base parameters, which hold the machine too.

    Returns
    -------
    dict of Kernel
        The kernels by form and parameter set; each is called with pose, velocity and acceleration,
        with the parameters as a fixed input.
    """
    robot = base.robot
    machine = Machine.of(robot)
    values = parameters(robot)
    sets = {
        "complete": (ca.SX.eye(len(values)), values),
        "reduced": (ca.sparsify(ca.SX(ca.DM(base.selection))), base.values()),
    }
    ports = [Port(name, (machine.freedom,)) for name in ("pose", "velocity", "acceleration")]
    kernels: dict[tuple[str, str], Kernel] = {}
    x, dx, ddx = (ca.SX.sym(port.name, *port.shape) for port in ports)
    state = machine.state(x, dx, ddx)
    bracket = generalized_regressor(machine, state)
    unit = state.platform.quasi_forces(ca.SX.eye(machine.freedom))
    inverse = -machine.closure.forces(unit, state.platform, state.legs)
    for form, build in _GRAPHS.items():
        for name, (selection, numbers) in sets.items():
            symbols = ca.SX.sym("parameters", len(numbers))
            forces = build(inverse, bracket, selection, symbols)
            function = optimised(ca.Function("forces", [x, dx, ddx, symbols], [ca.cse(forces)]))
            kernels[form, name] = TARGETS["vm"](
                f"{form}, {name}",
                function,
                (*ports, Port("parameters", numbers.shape, shared=True)),
                (Port("forces", (machine.freedom,)),),
                {"parameters": numbers},
            )
    cheapest = cheapest_parameters(robot)
    for name, chosen in (("complete", None), ("reduced", cheapest)):
        kernels["factored", name] = compile(
            robot, "inverse_dynamics", base=chosen, grade="parametric"
        )
    return kernels
