"""The table of what can be compiled: each public function's inputs, outputs and expressions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.bodies.motion import Expression
from pteron.equations import kinematics, lagrangian, regressor
from pteron.equations.friction import passive_friction
from pteron.equations.machine import Machine
from pteron.equations.virtual_work import generalized_forces, inverse_dynamics
from pteron.errors import ModelError
from pteron.kernels.kernel import Port, count_operations
from pteron.kernels.passes import optimised
from pteron.manipulator import Manipulator, expect_manipulator

Outputs = dict[str, tuple[Expression, tuple[int, ...]]]
"""Each output's expression and its shape; a matrix is (rows, columns), a stack of them vertical."""

Need = Literal["rows", "reach", "type I", "type II"]
"""What a pose must be: in reach, not singular of type I, of type II; "rows" asks for the first two
of those legs alone whose row [dq/dc | dq/dphi] depends on the pose."""

TYPE_I = 1e-4
"""The type-I measure of a leg below which what is divided by it is refused: the relative error is
1e-15 to 1e-14 over the measure's square: six digits are left here."""

TYPE_II = 1e-9
"""The type-II measure below which what is computed from J^-1 is refused: six digits are left."""

_HUGE = 1e75
"""Inputs or outputs beyond this count as not finite: their squares might overflow."""

_TINY = 1e-300


@dataclass(frozen=True)
class Program:
    """A named CasADi function of one state, with its ports."""

    name: str
    function: ca.Function
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]


@dataclass(frozen=True)
class _Entry:
    inputs: tuple[str, ...]
    build: Callable[[Machine, dict[str, Expression]], Outputs]
    needs: tuple[Need, ...] = ()
    """What a pose must be for the result to count, in the order in which it is told."""


def _state(m: Machine, v: dict[str, Expression]) -> Any:
    return m.state(v["pose"], v.get("velocity"), v.get("acceleration"))


def _coordinates(m: Machine, v: dict[str, Expression]) -> Outputs:
    return {"joints": (kinematics.inverse_position(m, v["pose"]), (m.freedom,))}


def _position(m: Machine, v: dict[str, Expression]) -> Outputs:
    # A slider's coordinate exists out of reach too; a machine that cannot be there has none.
    beyond = kinematics.beyond_reach(m, v["pose"])
    return {"joints": (kinematics.inverse_position(m, v["pose"]) + beyond, (m.freedom,))}


def _links(m: Machine, v: dict[str, Expression]) -> Outputs:
    l_u, l_l = kinematics.link_vectors(_state(m, v))
    return {"l_u": (l_u, (m.freedom, 3)), "l_l": (l_l, (m.freedom, 3))}


def _direct(m: Machine, v: dict[str, Expression]) -> Outputs:
    poses = kinematics.direct_position(m, v["joints"]).T
    return {"poses": (poses, poses.shape)}


def _closures(m: Machine, v: dict[str, Expression]) -> Outputs:
    poses = kinematics.direct_position(m, v["joints"], reached=False).T
    return {"poses": (poses, poses.shape)}


def _reach(m: Machine, v: dict[str, Expression]) -> Outputs:
    found, shape = kinematics.reach(m, v["pose"]), (m.freedom,)
    return {
        "margin": (ca.vertcat(*(leg.margin for leg in found)), shape),
        "type_i": (ca.vertcat(*(leg.type_i for leg in found)), shape),
        "spread": (ca.vertcat(*(leg.spread for leg in found)), shape),
    }


def _points(m: Machine, v: dict[str, Expression]) -> Outputs:
    points = kinematics.chain_points(_state(m, v))
    return {"points": (ca.vertcat(*points), (m.freedom, *points[0].shape))}


def _platform_points(m: Machine, v: dict[str, Expression]) -> Outputs:
    points = m.platform.motion(v["pose"], *[ca.SX.zeros(m.freedom)] * 2).points
    return {"points": (ca.vertcat(*(point.position.T for point in points)), (m.freedom, 3))}


def _discriminants(m: Machine, v: dict[str, Expression]) -> Outputs:
    found = kinematics.reach(m, v["pose"])
    return {"discriminants": (ca.vertcat(*(leg.discriminant for leg in found)), (m.freedom,))}


def _squared_type_i(m: Machine, v: dict[str, Expression]) -> Outputs:
    # Finite and smooth out of reach too, where it is negative.
    found = kinematics.reach(m, v["pose"])
    squares = ca.vertcat(*(leg.discriminant / leg.scale for leg in found))
    return {"squares": (squares, (m.freedom,))}


def _type_ii(m: Machine, v: dict[str, Expression]) -> Outputs:
    state = _state(m, v)
    return {"type_ii": (m.closure.measure(state.platform, state.legs), ())}


def _jacobian(m: Machine, v: dict[str, Expression]) -> Outputs:
    return {"jacobian": (kinematics.jacobian(_state(m, v)), (m.freedom, m.freedom))}


def _link_jacobians(m: Machine, v: dict[str, Expression]) -> Outputs:
    upper, lower = kinematics.link_jacobians(_state(m, v))
    shape = (m.freedom, 6, m.freedom)
    return {"upper": (ca.vertcat(*upper), shape), "lower": (ca.vertcat(*lower), shape)}


def _screws(m: Machine, v: dict[str, Expression]) -> Outputs:
    rows = [screws.T for screws in kinematics.joint_screws(_state(m, v))]
    return {"screws": (ca.vertcat(*rows), (m.freedom, *rows[0].shape))}


def _joint_motion(order: int) -> Callable[[Machine, dict[str, Expression]], Outputs]:
    def build(m: Machine, v: dict[str, Expression]) -> Outputs:
        state = _state(m, v)
        chain = kinematics.chain_motion(state, order)
        links = kinematics.link_turning(state, order)
        n, joints = chain.shape
        return {
            "actuated": (chain[:, 0], (n,)),
            "upper_links": (links[:, 0], (n,)),
            "lower_links": (links[:, 1], (n,)),
            "passive": (chain[:, 1:], (n, joints - 1)),
        }

    return build


def _platform_motion(m: Machine, v: dict[str, Expression]) -> Outputs:
    velocity, acceleration = kinematics.platform_rates(
        m, v["pose"], v["joint_rates"], v["joint_accelerations"]
    )
    return {"velocity": (velocity, (m.freedom,)), "acceleration": (acceleration, (m.freedom,))}


def _passive_friction(m: Machine, v: dict[str, Expression]) -> Outputs:
    forces = passive_friction(m, _state(m, v))
    return {"forces": (forces, forces.shape)}


def _inverse_dynamics(m: Machine, v: dict[str, Expression]) -> Outputs:
    carried = v.get("carried", True)
    forces = inverse_dynamics(m, _state(m, v), v["parameters"], v.get("wrench"), carried=carried)
    return {"forces": (forces, (m.freedom,))}


def _forward_dynamics(m: Machine, v: dict[str, Expression]) -> Outputs:
    wrench = v.get("wrench", ca.SX.zeros(m.freedom))
    acceleration = lagrangian.forward_dynamics(
        m, v["pose"], v["velocity"], v["forces"], v["parameters"], wrench
    )
    return {"acceleration": (acceleration, (m.freedom,))}


def _mass_matrix(m: Machine, v: dict[str, Expression]) -> Outputs:
    matrix = lagrangian.mass_matrix(m, v["pose"], v["parameters"])
    return {"mass": (matrix, (m.freedom, m.freedom))}


def _coriolis_matrix(m: Machine, v: dict[str, Expression]) -> Outputs:
    matrix = lagrangian.coriolis_matrix(m, v["pose"], v["velocity"], v["parameters"])
    return {"coriolis": (matrix, (m.freedom, m.freedom))}


def _forces_without_acceleration(name: str) -> Callable[[Machine, dict[str, Expression]], Outputs]:
    def build(m: Machine, v: dict[str, Expression]) -> Outputs:
        return {name: (generalized_forces(m, _state(m, v), v["parameters"]), (m.freedom,))}

    return build


def _kinetic_energy(m: Machine, v: dict[str, Expression]) -> Outputs:
    energy = lagrangian.kinetic_energy(m, v["pose"], v["velocity"], v["parameters"])
    return {"energy": (energy, ())}


def _potential_energy(m: Machine, v: dict[str, Expression]) -> Outputs:
    return {"energy": (lagrangian.potential_energy(m, v["pose"], v["parameters"]), ())}


def _regressor(m: Machine, v: dict[str, Expression]) -> Outputs:
    selection = v.get("selection", ca.SX.eye(len(m.parameters)))
    matrix = inverse_dynamics(m, _state(m, v), selection)
    return {"regressor": (matrix, matrix.shape)}


def _paper_regressor(m: Machine, v: dict[str, Expression]) -> Outputs:
    matrix = regressor.paper_regressor(m, _state(m, v))
    return {"regressor": (matrix, matrix.shape)}


def _paper_terms(m: Machine, v: dict[str, Expression]) -> Outputs:
    parts = regressor.terms(m, _state(m, v))
    links, n = len(parts.links), m.freedom
    padded = [ca.horzcat(link, ca.SX(6, 4 - link.shape[1])) for link in parts.links]
    return {
        "jacobian": (parts.jacobian, (n, n)),
        "sliders": (parts.sliders, (n, n)),
        "link_jacobians": (ca.vertcat(*parts.link_jacobians), (links, 6, n)),
        "links": (ca.vertcat(*padded), (links, 6, 4)),
        "platform": (parts.platform, (n, 4)),
    }


_POSE, _RATE = ("pose",), ("pose", "velocity")
_MOTION = ("pose", "velocity", "acceleration")
_BENT: tuple[Need, ...] = ("reach", "type I")
_HELD: tuple[Need, ...] = ("reach", "type I", "type II")

_TABLE: dict[str, _Entry] = {
    "inverse_kinematics": _Entry(_POSE, _position, ("reach",)),
    "joint_coordinates": _Entry(_POSE, _coordinates),
    "link_vectors": _Entry(_POSE, _links, ("reach",)),
    "direct_kinematics": _Entry(("joints",), _direct),
    "closure_poses": _Entry(("joints",), _closures),
    "reach": _Entry(_POSE, _reach),
    "joint_points": _Entry(_POSE, _points, ("reach",)),
    "platform_points": _Entry(_POSE, _platform_points),
    "discriminants": _Entry(_POSE, _discriminants),
    "squared_type_i": _Entry(_POSE, _squared_type_i),
    "type_ii": _Entry(_POSE, _type_ii),
    "jacobian": _Entry(_POSE, _jacobian, ("rows",)),
    "link_jacobians": _Entry(_POSE, _link_jacobians, _BENT),
    "joint_screws": _Entry(_POSE, _screws, _BENT),
    "joint_rates": _Entry(_RATE, _joint_motion(0), _BENT),
    "joint_accelerations": _Entry(_MOTION, _joint_motion(1), _BENT),
    "platform_motion": _Entry(
        ("pose", "joint_rates", "joint_accelerations"), _platform_motion, _HELD
    ),
    "passive_friction": _Entry(_RATE, _passive_friction, _HELD),
    "inverse_dynamics": _Entry((*_MOTION, "parameters"), _inverse_dynamics, _HELD),
    "forward_dynamics": _Entry((*_RATE, "forces", "parameters"), _forward_dynamics, _BENT),
    "mass_matrix": _Entry((*_POSE, "parameters"), _mass_matrix, _BENT),
    "coriolis_matrix": _Entry((*_RATE, "parameters"), _coriolis_matrix, _BENT),
    "bias_forces": _Entry((*_RATE, "parameters"), _forces_without_acceleration("bias"), _BENT),
    "gravity_forces": _Entry(
        (*_POSE, "parameters"), _forces_without_acceleration("gravity"), _BENT
    ),
    "kinetic_energy": _Entry((*_RATE, "parameters"), _kinetic_energy, _BENT),
    "potential_energy": _Entry((*_POSE, "parameters"), _potential_energy, ("reach",)),
    "regressor": _Entry(_MOTION, _regressor, _HELD),
    "base_regressor": _Entry(_MOTION, _regressor, _HELD),
    "paper_regressor": _Entry(_MOTION, _paper_regressor, _HELD),
    "paper_terms": _Entry(_MOTION, _paper_terms, _BENT),
}

FUNCTIONS = tuple(_TABLE)
"""What `compile` accepts."""

_REDUCIBLE = ("inverse_dynamics", "base_regressor")
"""What may be asked for base parameters."""

_LOADED = ("inverse_dynamics", "forward_dynamics")
"""What may take a wrench on the platform as well."""

_SHARED = ("geometry", "parameters", "base_parameters")
"""Inputs of which one value serves a whole batch."""

Columns = tuple[tuple[int, ...], ...]
"""For each column of a base regressor, the inertial parameters whose columns it adds up."""


def needs_of(what: str) -> tuple[Need, ...]:
    """Return what a pose must be for a function's result to count."""
    return _TABLE[what].needs


def program(
    robot: Manipulator,
    what: str,
    columns: Columns | None = None,
    *,
    wrench: bool = False,
    guarded: bool = False,
    plain: bool = False,
) -> Program:
    """Return the function `what` of a machine's geometry; inertial parameters stay inputs.

    With `columns` the dynamics are those of base parameters, which are then the input; with
    `wrench` a wrench on the platform is an input too; with `guarded` a last output, `status`, is 1
    where the result counts and 0 where the pose, or a number, does not serve; with `plain` the
    equations are as they are written, without the pass that saves operations.

    Raises
    ------
    ModelError
        If there is no function of that name, or an option is out of place.
    """
    if what not in _TABLE:
        raise ModelError(f"what: {what!r} cannot be compiled; choose from {', '.join(FUNCTIONS)}")
    if what == "base_regressor" and columns is None:
        raise ModelError('base: missing; "base_regressor" needs base=base_parameters(robot)')
    if what not in _REDUCIBLE and columns is not None:
        raise ModelError(f"base: {what!r} has no use for it; it goes with {', '.join(_REDUCIBLE)}")
    if what not in _LOADED and wrench:
        raise ModelError(f"wrench: {what!r} has no use for it; it goes with {', '.join(_LOADED)}")
    return _built(bare(robot), what, columns, wrench, guarded, plain)


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
    expect_manipulator(robot)
    unit = {"m": 1.0, "mgx": 0.0, "mgy": 0.0, "I": 1.0}

    def plain(body: Any) -> Any:
        return body.of_values([unit[kind] for kind in body.kinds])

    legs = tuple(
        leg.with_bodies({letter: plain(body) for letter, body in leg.bodies.items()})
        for leg in robot.legs
    )
    platform = replace(robot.platform, inertia=plain(robot.platform.inertia))
    return replace(robot, name="any", legs=legs, platform=platform)


@lru_cache(maxsize=512)
def _built(
    robot: Manipulator,
    what: str,
    columns: Columns | None,
    wrench: bool,
    guarded: bool,
    plain: bool,
) -> Program:
    machine = Machine.of(robot)
    if columns is None:
        return _program(machine, what, wrench=wrench, guarded=guarded, plain=plain)
    selection = ca.SX(len(machine.parameters), len(columns))
    for k, members in enumerate(columns):
        for j in members:
            selection[j, k] = 1
    if what == "base_regressor":
        return _program(machine, what, constants={"selection": selection}, guarded=guarded)
    base = ca.SX.sym("base_parameters", len(columns))
    # A mass on a platform point may be the leg's or the platform's, whichever costs less.
    forms = []
    for carried in (True, False):
        constants = {"parameters": ca.mtimes(selection, base), "carried": carried}
        extra = {"base_parameters": base}
        options: dict[str, Any] = {
            "constants": constants,
            "extra": extra,
            "wrench": wrench,
            "plain": plain,
        }
        forms.append(_program(machine, what, **options))
    return min(forms, key=lambda form: count_operations(form.function))


def general_program(robot: Manipulator, what: str) -> Program:
    """Return the function `what` of a machine's topology: its first input is `geometry`.

    The vector's order is that of `equations.machine.numbers`.
    """
    return _general(bare(robot), what)


@lru_cache(maxsize=64)
def _general(robot: Manipulator, what: str) -> Program:
    machine, vector = Machine.symbols(robot)
    # Exact arithmetic wants the equations as they stand.
    return _program(machine, what, vector, plain=True)


def _program(
    machine: Machine,
    what: str,
    vector: Expression | None = None,
    constants: dict[str, Expression] | None = None,
    extra: dict[str, Expression] | None = None,
    wrench: bool = False,
    guarded: bool = False,
    plain: bool = False,
) -> Program:
    """Return a function of the table; `constants` stand for inputs, `extra` are more inputs."""
    entry = _TABLE[what]
    asked = [name for name in entry.inputs if name not in (constants or {})]
    asked += ["wrench"] if wrench else []
    asked.sort(key=lambda name: name in _SHARED)
    count = len(machine.parameters)
    symbols = {
        name: ca.SX.sym(name, count if name == "parameters" else machine.freedom) for name in asked
    } | (extra or {})
    outputs = entry.build(machine, symbols | (constants or {}))
    if guarded:
        outputs["status"] = (_status(machine, entry, symbols, outputs), ())
    # A matrix goes out transposed: CasADi stores columns, NumPy rows.
    dense = [ca.densify(expression).T for expression, _ in outputs.values()]
    if vector is not None:
        symbols = {"geometry": vector, **symbols}
    function = ca.Function(
        what, list(symbols.values()), ca.cse(dense), list(symbols), list(outputs)
    )
    if not plain:
        function = optimised(function)
    inputs = tuple(
        Port(name, symbol.shape[:1], shared=name in _SHARED) for name, symbol in symbols.items()
    )
    ports = tuple(Port(name, tuple(shape)) for name, (_, shape) in outputs.items())
    return Program(what, function, inputs, ports)


def _status(
    machine: Machine, entry: _Entry, symbols: dict[str, Expression], outputs: Outputs
) -> Expression:
    """Return 1 where everything holds that the result needs, else 0; also for NaN."""
    states = [symbol for name, symbol in symbols.items() if name not in _SHARED]
    results = [expression for expression, _ in outputs.values()]
    sums = [
        sum(
            ca.fabs(v)
            for group in groups
            for v in ca.vertsplit(ca.vec(ca.densify(group)))
            if not _is_nan(v)
        )
        for groups in (states, results)
    ]
    status = ca.SX(1)
    for total in sums if entry.needs == ("reach",) else sums[:1]:
        status = ca.if_else(total < _HUGE, status, 0)
    if {"reach", "rows"} & set(entry.needs):
        found = kinematics.reach(machine, symbols["pose"])
        for leg, at in zip(machine.legs, found, strict=True):
            if "reach" in entry.needs or not leg.row_is_constant:
                least = -_TINY if entry.needs == ("reach",) else TYPE_I**2 * at.scale
                status = ca.if_else(least < at.discriminant, status, 0)
    if "type II" in entry.needs:
        state = machine.state(symbols["pose"])
        measure = machine.closure.measure(state.platform, state.legs)
        status = ca.if_else(measure * measure > TYPE_II**2, status, 0)
    return status


def _is_nan(value: Expression) -> bool:
    return bool(value.is_constant()) and bool(np.isnan(float(value)))
