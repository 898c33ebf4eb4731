"""The table of what can be compiled: each public function's inputs, outputs and expressions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.equations.bodies import Inertia
from pteron.equations.circles import squared_reach
from pteron.equations.closure import regularity
from pteron.equations.friction import passive_friction
from pteron.equations.geometry import Expression, Geometry
from pteron.equations.jacobians import jacobian, link_jacobians
from pteron.equations.lagrangian import (
    coriolis_matrix,
    forward_dynamics,
    kinetic_energy,
    mass_matrix,
    potential_energy,
)
from pteron.equations.legs import closing_vector
from pteron.equations.position import (
    beyond_reach,
    direct_position,
    inverse_position,
    links,
    platform_at,
    reach,
)
from pteron.equations.rates import joint_motion, platform_rates
from pteron.equations.reduced import ReducedLeg, reduced_dynamics, reduced_inertia
from pteron.equations.regressor import paper_regressor, terms
from pteron.equations.screws import joint_screws
from pteron.equations.virtual_work import generalized_forces, inverse_dynamics
from pteron.errors import ModelError
from pteron.kernels.kernel import Port
from pteron.manipulator import Manipulator, PlanarInertia

__all__ = [
    "FUNCTIONS",
    "Columns",
    "Program",
    "bare",
    "general_program",
    "program",
    "specialised",
]

Outputs = dict[str, tuple[Expression, tuple[int, ...]]]
"""Each output's expression and its shape; a matrix is (rows, columns), a stack of them vertical."""


@dataclass(frozen=True)
class Program:
    """A named CasADi function of one state, with its ports."""

    name: str
    function: ca.Function
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    scale: ca.DM | None = None
    """For a reduced model: what takes base parameters to the numbers that it works with."""


@dataclass(frozen=True)
class _Entry:
    inputs: tuple[str, ...]
    build: Callable[[Geometry, dict[str, Expression]], Outputs]


def _count(g: Geometry) -> int:
    return 9 * g.freedom + 4


def _coordinates(g: Geometry, v: dict[str, Expression]) -> Outputs:
    return {"sliders": (inverse_position(g, v["pose"]), (g.freedom,))}


def _position(g: Geometry, v: dict[str, Expression]) -> Outputs:
    # The coordinates themselves exist out of reach too; a machine that cannot be there has none.
    points = [point.position for point in platform_at(g, v["pose"]).points]
    sliders = inverse_position(g, v["pose"]) + beyond_reach(g, points)
    return {"sliders": (sliders, (g.freedom,))}


def _links(g: Geometry, v: dict[str, Expression]) -> Outputs:
    l_u, l_l = links(g, v["pose"])
    return {"l_u": (l_u, (g.freedom, 3)), "l_l": (l_l, (g.freedom, 3))}


def _direct(g: Geometry, v: dict[str, Expression]) -> Outputs:
    poses = direct_position(g, v["sliders"]).T
    return {"poses": (poses, poses.shape)}


def _closures(g: Geometry, v: dict[str, Expression]) -> Outputs:
    poses = direct_position(g, v["sliders"], reached=False).T
    return {"poses": (poses, poses.shape)}


def _reach(g: Geometry, v: dict[str, Expression]) -> Outputs:
    distance, margin, sine = reach(g, v["pose"])
    shape = (g.freedom,)
    return {"distance": (distance, shape), "margin": (margin, shape), "sine": (sine, shape)}


def _platform_points(g: Geometry, v: dict[str, Expression]) -> Outputs:
    points = platform_at(g, v["pose"]).points
    return {"points": (ca.vertcat(*(point.position.T for point in points)), (g.freedom, 3))}


def _discriminants(g: Geometry, v: dict[str, Expression]) -> Outputs:
    points = platform_at(g, v["pose"]).points
    deltas = (
        squared_reach(leg, closing_vector(leg, point.position))
        for leg, point in zip(g.legs, points, strict=True)
    )
    return {"discriminants": (ca.vertcat(*deltas), (g.freedom,))}


def _regularity(g: Geometry, v: dict[str, Expression]) -> Outputs:
    return {"regularity": (regularity(g, v["pose"]), ())}


def _jacobian(g: Geometry, v: dict[str, Expression]) -> Outputs:
    return {"jacobian": (jacobian(g, v["pose"]), (g.freedom, g.freedom))}


def _link_jacobians(g: Geometry, v: dict[str, Expression]) -> Outputs:
    upper, lower = link_jacobians(g, v["pose"])
    shape = (g.freedom, 6, g.freedom)
    return {"upper": (ca.vertcat(*upper), shape), "lower": (ca.vertcat(*lower), shape)}


def _screws(g: Geometry, v: dict[str, Expression]) -> Outputs:
    rows = [screws.T for screws in joint_screws(g, v["pose"])]
    return {"screws": (ca.vertcat(*rows), (g.freedom, *rows[0].shape))}


def _rates(g: Geometry, v: dict[str, Expression]) -> Outputs:
    rest = ca.SX.zeros(g.freedom)
    rates, _ = joint_motion(g, v["pose"], v["velocity"], rest)
    return {"rates": (rates, (g.freedom, 3))}


def _accelerations(g: Geometry, v: dict[str, Expression]) -> Outputs:
    _, accelerations = joint_motion(g, v["pose"], v["velocity"], v["acceleration"])
    return {"accelerations": (accelerations, (g.freedom, 3))}


def _platform_motion(g: Geometry, v: dict[str, Expression]) -> Outputs:
    velocity, acceleration = platform_rates(
        g, v["pose"], v["slider_rates"], v["slider_accelerations"]
    )
    return {"velocity": (velocity, (g.freedom,)), "acceleration": (acceleration, (g.freedom,))}


def _passive_friction(g: Geometry, v: dict[str, Expression]) -> Outputs:
    forces = passive_friction(g, v["pose"], v["velocity"])
    return {"forces": (forces, forces.shape)}


def _inverse_dynamics(g: Geometry, v: dict[str, Expression]) -> Outputs:
    if "reduced" in v:
        legs, platform = v["reduced"]
        forces = reduced_dynamics(
            g, v["pose"], v["velocity"], v["acceleration"], legs, platform, v.get("wrench")
        )
        return {"forces": (forces, (g.freedom,))}
    forces = inverse_dynamics(
        g, v["pose"], v["velocity"], v["acceleration"], v["parameters"], v.get("wrench")
    )
    return {"forces": (forces, (g.freedom,))}


def _forward_dynamics(g: Geometry, v: dict[str, Expression]) -> Outputs:
    wrench = v.get("wrench", ca.SX.zeros(g.freedom))
    acceleration = forward_dynamics(
        g, v["pose"], v["velocity"], v["forces"], v["parameters"], wrench
    )
    return {"acceleration": (acceleration, (g.freedom,))}


def _mass_matrix(g: Geometry, v: dict[str, Expression]) -> Outputs:
    return {"mass": (mass_matrix(g, v["pose"], v["parameters"]), (g.freedom, g.freedom))}


def _coriolis_matrix(g: Geometry, v: dict[str, Expression]) -> Outputs:
    matrix = coriolis_matrix(g, v["pose"], v["velocity"], v["parameters"])
    return {"coriolis": (matrix, (g.freedom, g.freedom))}


def _bias_forces(g: Geometry, v: dict[str, Expression]) -> Outputs:
    rest = ca.SX.zeros(g.freedom)
    bias = generalized_forces(g, v["pose"], v["velocity"], rest, v["parameters"])
    return {"bias": (bias, (g.freedom,))}


def _gravity_forces(g: Geometry, v: dict[str, Expression]) -> Outputs:
    rest = ca.SX.zeros(g.freedom)
    return {
        "gravity": (generalized_forces(g, v["pose"], rest, rest, v["parameters"]), (g.freedom,))
    }


def _kinetic_energy(g: Geometry, v: dict[str, Expression]) -> Outputs:
    return {"energy": (kinetic_energy(g, v["pose"], v["velocity"], v["parameters"]), ())}


def _potential_energy(g: Geometry, v: dict[str, Expression]) -> Outputs:
    return {"energy": (potential_energy(g, v["pose"], v["parameters"]), ())}


def _regressor(g: Geometry, v: dict[str, Expression]) -> Outputs:
    identity = ca.SX.eye(_count(g))
    matrix = inverse_dynamics(g, v["pose"], v["velocity"], v["acceleration"], identity)
    return {"regressor": (matrix, matrix.shape)}


def _base_regressor(g: Geometry, v: dict[str, Expression]) -> Outputs:
    matrix = inverse_dynamics(g, v["pose"], v["velocity"], v["acceleration"], v["selection"])
    return {"regressor": (matrix, matrix.shape)}


def _paper_regressor(g: Geometry, v: dict[str, Expression]) -> Outputs:
    matrix = paper_regressor(g, v["pose"], v["velocity"], v["acceleration"])
    return {"regressor": (matrix, matrix.shape)}


def _paper_terms(g: Geometry, v: dict[str, Expression]) -> Outputs:
    parts = terms(g, v["pose"], v["velocity"], v["acceleration"])
    links, m = len(parts.links), g.freedom
    return {
        "jacobian": (parts.jacobian, (m, m)),
        "sliders": (parts.sliders, (m, m)),
        "link_jacobians": (ca.vertcat(*parts.link_jacobians), (links, 6, m)),
        "links": (ca.vertcat(*parts.links), (links, 6, 4)),
        "platform": (parts.platform, (m, 4)),
    }


_STATE = ("pose", "velocity", "acceleration")

_REDUCIBLE = ("inverse_dynamics", "inverse_dynamics_loaded", "base_regressor")
"""What may be asked for base parameters."""

_TABLE: dict[str, _Entry] = {
    "inverse_kinematics": _Entry(("pose",), _position),
    "slider_coordinates": _Entry(("pose",), _coordinates),
    "link_vectors": _Entry(("pose",), _links),
    "direct_kinematics": _Entry(("sliders",), _direct),
    "closure_poses": _Entry(("sliders",), _closures),
    "reach": _Entry(("pose",), _reach),
    "platform_points": _Entry(("pose",), _platform_points),
    "discriminants": _Entry(("pose",), _discriminants),
    "regularity": _Entry(("pose",), _regularity),
    "jacobian": _Entry(("pose",), _jacobian),
    "link_jacobians": _Entry(("pose",), _link_jacobians),
    "joint_screws": _Entry(("pose",), _screws),
    "joint_rates": _Entry(("pose", "velocity"), _rates),
    "joint_accelerations": _Entry(_STATE, _accelerations),
    "platform_motion": _Entry(("pose", "slider_rates", "slider_accelerations"), _platform_motion),
    "passive_friction": _Entry(("pose", "velocity"), _passive_friction),
    "inverse_dynamics": _Entry((*_STATE, "parameters"), _inverse_dynamics),
    "inverse_dynamics_loaded": _Entry((*_STATE, "wrench", "parameters"), _inverse_dynamics),
    "forward_dynamics": _Entry(("pose", "velocity", "forces", "parameters"), _forward_dynamics),
    "forward_dynamics_loaded": _Entry(
        ("pose", "velocity", "forces", "wrench", "parameters"), _forward_dynamics
    ),
    "mass_matrix": _Entry(("pose", "parameters"), _mass_matrix),
    "coriolis_matrix": _Entry(("pose", "velocity", "parameters"), _coriolis_matrix),
    "bias_forces": _Entry(("pose", "velocity", "parameters"), _bias_forces),
    "gravity_forces": _Entry(("pose", "parameters"), _gravity_forces),
    "kinetic_energy": _Entry(("pose", "velocity", "parameters"), _kinetic_energy),
    "potential_energy": _Entry(("pose", "parameters"), _potential_energy),
    "regressor": _Entry(_STATE, _regressor),
    "base_regressor": _Entry(_STATE, _base_regressor),
    "paper_regressor": _Entry(_STATE, _paper_regressor),
    "paper_terms": _Entry(_STATE, _paper_terms),
}

FUNCTIONS = tuple(_TABLE)
"""What `compile` accepts. The `_loaded` ones take a wrench on the platform as well."""


_SHARED = ("geometry", "parameters", "base_parameters")
"""Inputs of which one value serves a whole batch."""

Columns = tuple[tuple[int, ...], ...]
"""For each column of a base regressor, the inertial parameters whose columns it adds up."""


def program(robot: Manipulator, what: str, columns: Columns | None = None) -> Program:
    """Return the function `what` of a machine's geometry; inertial parameters stay inputs.

    With `columns` the dynamics are those of base parameters, which are then the input.

    Raises
    ------
    ModelError
        If there is no function of that name, or `columns` are missing or out of place.
    """
    if what not in _TABLE:
        raise ModelError(f"what: {what!r} cannot be compiled; choose from {', '.join(FUNCTIONS)}")
    if what == "base_regressor" and columns is None:
        raise ModelError('base: missing; "base_regressor" needs base=base_parameters(robot)')
    if what not in _REDUCIBLE and columns is not None:
        raise ModelError(f"base: {what!r} has no use for it; it goes with {', '.join(_REDUCIBLE)}")
    return _built(bare(robot), what, columns)


def specialised(given: Program, values: dict[str, NDArray[np.float64]]) -> Program:
    """Return the program with numbers in place of some of its inputs."""
    symbols = given.function.sx_in()
    folded = [
        ca.SX(ca.DM(values[port.name])) if port.name in values else symbol
        for port, symbol in zip(given.inputs, symbols, strict=True)
    ]
    left = [k for k, port in enumerate(given.inputs) if port.name not in values]
    outputs = given.function.call(folded)
    function = ca.Function(
        given.name,
        [symbols[k] for k in left],
        ca.cse([ca.densify(output) for output in outputs]),
        [given.inputs[k].name for k in left],
        [port.name for port in given.outputs],
    )
    return Program(given.name, function, tuple(given.inputs[k] for k in left), given.outputs)


@lru_cache(maxsize=256)
def bare(robot: Manipulator) -> Manipulator:
    """Return the machine with unit inertia, so that machines of one geometry share programs."""
    unit = PlanarInertia(1.0, (0.0, 0.0), 1.0)
    legs = tuple(replace(leg, slider_mass=1.0, upper=unit, lower=unit) for leg in robot.legs)
    return replace(robot, name="any", legs=legs, platform=replace(robot.platform, inertia=unit))


@lru_cache(maxsize=512)
def _built(robot: Manipulator, what: str, columns: Columns | None) -> Program:
    geometry = Geometry.of(robot)
    if columns is None:
        return _program(geometry, what)
    selection = ca.SX(_count(geometry), len(columns))
    for k, members in enumerate(columns):
        for j in members:
            selection[j, k] = 1
    if what == "base_regressor":
        return _program(geometry, what, constants={"selection": selection})
    return _reduced_program(geometry, what, selection)


def _reduced_program(geometry: Geometry, what: str, selection: Expression) -> Program:
    """Return the inverse dynamics from base parameters, in the cheapest form that they allow."""
    base = ca.SX.sym("base_parameters", selection.shape[1])
    columns = ca.mtimes(selection, base)
    legs = len(geometry.legs)
    lower = [columns[legs + 4 * (legs + i) + 1] for i in range(legs)]
    if not all(row.is_zero() for row in lower):
        # A first moment along a lower link is among them, which that form does without.
        constants = {"parameters": ca.densify(columns)}
        return _program(geometry, what, constants=constants, extra={"base_parameters": base})
    found, platform = reduced_inertia(geometry, columns)
    rows = ca.vertcat(*(ca.vertcat(*leg) for leg in found), *platform)
    kept = [k for k in range(rows.shape[0]) if not rows[k].is_zero()]
    scale = ca.evalf(ca.jacobian(rows[kept], base))
    numbers = ca.SX.sym("base_parameters", len(kept))
    full = ca.SX(rows.shape[0], 1)
    full[kept] = numbers
    size = len(ReducedLeg._fields)
    reduced = (
        [ReducedLeg(*ca.vertsplit(full[size * i : size * (i + 1)])) for i in range(legs)],
        Inertia(*ca.vertsplit(full[size * legs :])),
    )
    built = _program(
        geometry, what, constants={"reduced": reduced}, extra={"base_parameters": numbers}
    )
    return replace(built, scale=scale)


@lru_cache(maxsize=32)
def general_program(legs: int, turns: bool, what: str) -> Program:
    """Return the function `what` of a topology: the geometry is its first input, `geometry`.

    The vector's order is that of `Geometry.symbols`.
    """
    geometry, vector = Geometry.symbols(legs, turns)
    return _program(geometry, what, vector)


def _program(
    geometry: Geometry,
    what: str,
    vector: Expression | None = None,
    constants: dict[str, Any] | None = None,
    extra: dict[str, Expression] | None = None,
) -> Program:
    """Return a function of the table; `constants` stand for inputs, `extra` are more inputs."""
    entry = _TABLE[what]
    symbols = {
        name: ca.SX.sym(name, _count(geometry) if name == "parameters" else geometry.freedom)
        for name in entry.inputs
        if name != "parameters" or not extra
    } | (extra or {})
    outputs = entry.build(geometry, symbols | (constants or {}))
    # A matrix goes out transposed: CasADi stores columns, NumPy rows.
    dense = [ca.densify(expression).T for expression, _ in outputs.values()]
    if vector is not None:
        symbols = {"geometry": vector, **symbols}
    function = ca.Function(
        what, list(symbols.values()), ca.cse(dense), list(symbols), list(outputs)
    )
    inputs = tuple(
        Port(name, symbol.shape[:1], shared=name in _SHARED) for name, symbol in symbols.items()
    )
    return Program(
        what,
        function,
        inputs,
        tuple(Port(name, tuple(shape)) for name, (_, shape) in outputs.items()),
    )
