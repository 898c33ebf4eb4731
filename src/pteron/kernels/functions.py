"""The table of what can be compiled: each public function's inputs, outputs and expressions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.bodies.motion import Expression
from pteron.equations import closing, kinematics, lagrangian, regressor
from pteron.equations.friction import passive_friction
from pteron.equations.machine import Machine
from pteron.equations.virtual_work import generalized_forces, inverse_dynamics
from pteron.errors import ModelError
from pteron.kernels.kernel import Port, count_operations
from pteron.kernels.passes import optimised
from pteron.manipulator import Manipulator, expect_manipulator

Output = Expression | list[Expression] | tuple[Expression, tuple[int, ...]]
"""An expression, some of one shape to be stacked, or one whose shape is given: else a column is a
vector."""

Outputs = dict[str, Output]

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


Symbols = dict[str, Any]
"""What an entry builds with, by name: the inputs, and what a caller puts in place of some."""


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
    build: Callable[[Machine, Symbols], Outputs]
    needs: tuple[Need, ...] = ()
    """What a pose must be for the result to count, in the order in which it is told."""


def _state(m: Machine, v: Symbols) -> Any:
    return m.state(v["pose"], v.get("velocity"), v.get("acceleration"))


def _position(m: Machine, v: Symbols) -> Outputs:
    # A slider's coordinate exists out of reach too; a machine that cannot be there has none.
    beyond = kinematics.beyond_reach(m, v["pose"])
    return {"joints": kinematics.inverse_position(m, v["pose"]) + beyond}


def _links(m: Machine, v: Symbols) -> Outputs:
    l_u, l_l = kinematics.link_vectors(_state(m, v))
    return {"l_u": l_u, "l_l": l_l}


def _poses(m: Machine, v: Symbols, *, reached: bool) -> Outputs:
    poses = kinematics.direct_position(m, v["joints"], reached=reached).T
    return {"poses": (poses, poses.shape)}


def _closure_rows(m: Machine, v: Symbols) -> Outputs:
    found = closing.closure_rows(m, v["joints"])
    rows = {name: (part, part.shape) for name, part in found._asdict().items()}
    return {**rows, "origin": found.origin, "size": found.size}


def _newton_step(m: Machine, v: Symbols) -> Outputs:
    stepped, missed = closing.newton_step(m, v["joints"], v["pose"])
    return {"stepped": stepped, "missed": missed}


def _direct_step(m: Machine, v: Symbols) -> Outputs:
    found, measure = closing.direct_step(m, v["joints"], v["pose"], TYPE_II)
    return {"found": found, "type_ii": measure}


def _reach(m: Machine, v: Symbols) -> Outputs:
    found = kinematics.reach(m, v["pose"])
    return {
        name: ca.vertcat(*(getattr(leg, name) for leg in found))
        for name in ("margin", "type_i", "spread")
    }


def _passive_room(m: Machine, v: Symbols) -> Outputs:
    shares, metres = kinematics.passive_room(m, v["pose"])
    return {"shares": shares, "metres": metres}


def _platform_points(m: Machine, v: Symbols) -> Outputs:
    points = m.platform.motion(v["pose"], *[ca.SX.zeros(m.freedom)] * 2).points
    return {"points": ca.vertcat(*(point.position.T for point in points))}


def _discriminants(m: Machine, v: Symbols) -> Outputs:
    found = kinematics.reach(m, v["pose"])
    return {"discriminants": ca.vertcat(*(leg.discriminant for leg in found))}


def _squared_type_i(m: Machine, v: Symbols) -> Outputs:
    # Finite and smooth out of reach too, where it is negative.
    found = kinematics.reach(m, v["pose"])
    return {"squares": ca.vertcat(*(leg.discriminant / leg.scale for leg in found))}


def _type_ii(m: Machine, v: Symbols) -> Outputs:
    state = _state(m, v)
    return {"type_ii": m.closure.measure(state.platform, state.legs)}


def _link_jacobians(m: Machine, v: Symbols) -> Outputs:
    upper, lower = kinematics.link_jacobians(_state(m, v))
    return {"upper": upper, "lower": lower}


def _joint_motion(m: Machine, v: Symbols) -> Outputs:
    state, order = _state(m, v), int("acceleration" in v)
    chain = kinematics.chain_motion(state, order)
    links = kinematics.link_turning(state, order)
    passive = chain[:, 1:]
    return {
        "actuated": chain[:, 0],
        "upper_links": links[:, 0],
        "lower_links": links[:, 1],
        "passive": (passive, passive.shape),
    }


def _platform_motion(m: Machine, v: Symbols) -> Outputs:
    velocity, acceleration = kinematics.platform_rates(
        m, v["pose"], v["joint_rates"], v["joint_accelerations"]
    )
    return {"velocity": velocity, "acceleration": acceleration}


def _passive_friction(m: Machine, v: Symbols) -> Outputs:
    forces = passive_friction(m, _state(m, v))
    return {"forces": (forces, forces.shape)}


def _inverse_dynamics(m: Machine, v: Symbols) -> Outputs:
    carried = v.get("carried", True)
    forces = inverse_dynamics(m, _state(m, v), v["parameters"], v.get("wrench"), carried=carried)
    return {"forces": forces}


def _forward_dynamics(m: Machine, v: Symbols) -> Outputs:
    wrench = v.get("wrench", ca.SX.zeros(m.freedom))
    acceleration = lagrangian.forward_dynamics(
        m, v["pose"], v["velocity"], v["forces"], v["parameters"], wrench
    )
    return {"acceleration": acceleration}


def _coriolis_matrix(m: Machine, v: Symbols) -> Outputs:
    return {"coriolis": lagrangian.coriolis_matrix(m, v["pose"], v["velocity"], v["parameters"])}


def _kinetic_energy(m: Machine, v: Symbols) -> Outputs:
    return {"energy": lagrangian.kinetic_energy(m, v["pose"], v["velocity"], v["parameters"])}


def _forces(m: Machine, v: Symbols) -> Expression:
    """Return the forces of a state that lacks an acceleration, and perhaps a velocity."""
    return generalized_forces(m, _state(m, v), v["parameters"])


def _regressor(m: Machine, v: Symbols) -> Outputs:
    selection = v.get("selection", ca.SX.eye(len(m.parameters)))
    matrix = inverse_dynamics(m, _state(m, v), selection)
    return {"regressor": (matrix, matrix.shape)}


def _paper_terms(m: Machine, v: Symbols) -> Outputs:
    parts = regressor.terms(m, _state(m, v))
    return {
        "jacobian": parts.jacobian,
        "sliders": parts.sliders,
        "link_jacobians": list(parts.link_jacobians),
        "links": [ca.horzcat(link, ca.SX(6, 4 - link.shape[1])) for link in parts.links],
        "platform": parts.platform,
    }


_POSE, _RATE = ("pose",), ("pose", "velocity")
_MOTION = ("pose", "velocity", "acceleration")
_BENT: tuple[Need, ...] = ("reach", "type I")
_HELD: tuple[Need, ...] = ("reach", "type I", "type II")

_TABLE: dict[str, _Entry] = {
    "inverse_kinematics": _Entry(_POSE, _position, ("reach",)),
    "joint_coordinates": _Entry(
        _POSE, lambda m, v: {"joints": kinematics.inverse_position(m, v["pose"])}
    ),
    "link_vectors": _Entry(_POSE, _links, ("reach",)),
    "direct_kinematics": _Entry(("joints",), partial(_poses, reached=True)),
    "closure_poses": _Entry(("joints",), partial(_poses, reached=False)),
    "closure_rows": _Entry(("joints",), _closure_rows),
    "newton_step": _Entry(("joints", "pose"), _newton_step),
    "direct_step": _Entry(("joints", "pose"), _direct_step),
    "reach": _Entry(_POSE, _reach),
    "passive_room": _Entry(_POSE, _passive_room),
    "joint_points": _Entry(
        _POSE, lambda m, v: {"points": kinematics.chain_points(_state(m, v))}, ("reach",)
    ),
    "platform_points": _Entry(_POSE, _platform_points),
    "discriminants": _Entry(_POSE, _discriminants),
    "squared_type_i": _Entry(_POSE, _squared_type_i),
    "type_ii": _Entry(_POSE, _type_ii),
    "jacobian": _Entry(
        _POSE, lambda m, v: {"jacobian": kinematics.jacobian(_state(m, v))}, ("rows",)
    ),
    "link_jacobians": _Entry(_POSE, _link_jacobians, _BENT),
    "joint_screws": _Entry(
        _POSE, lambda m, v: {"screws": [s.T for s in kinematics.joint_screws(_state(m, v))]}, _BENT
    ),
    "joint_rates": _Entry(_RATE, _joint_motion, _BENT),
    "joint_accelerations": _Entry(_MOTION, _joint_motion, _BENT),
    "platform_motion": _Entry(
        ("pose", "joint_rates", "joint_accelerations"), _platform_motion, _HELD
    ),
    "passive_friction": _Entry(_RATE, _passive_friction, _HELD),
    "inverse_dynamics": _Entry((*_MOTION, "parameters"), _inverse_dynamics, _HELD),
    "forward_dynamics": _Entry((*_RATE, "forces", "parameters"), _forward_dynamics, _BENT),
    "mass_matrix": _Entry(
        (*_POSE, "parameters"),
        lambda m, v: {"mass": lagrangian.mass_matrix(m, v["pose"], v["parameters"])},
        _BENT,
    ),
    "coriolis_matrix": _Entry((*_RATE, "parameters"), _coriolis_matrix, _BENT),
    "bias_forces": _Entry((*_RATE, "parameters"), lambda m, v: {"bias": _forces(m, v)}, _BENT),
    "gravity_forces": _Entry(
        (*_POSE, "parameters"), lambda m, v: {"gravity": _forces(m, v)}, _BENT
    ),
    "kinetic_energy": _Entry((*_RATE, "parameters"), _kinetic_energy, _BENT),
    "potential_energy": _Entry(
        (*_POSE, "parameters"),
        lambda m, v: {"energy": lagrangian.potential_energy(m, v["pose"], v["parameters"])},
        ("reach",),
    ),
    "regressor": _Entry(_MOTION, _regressor, _HELD),
    "base_regressor": _Entry(_MOTION, _regressor, _HELD),
    "paper_regressor": _Entry(
        _MOTION, lambda m, v: {"regressor": regressor.paper_regressor(m, _state(m, v))}, _HELD
    ),
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
    """Return a plain program with numbers in place of some of its inputs, after the pass."""
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
    inputs = tuple(given.inputs[k] for k in left)
    return Program(given.name, optimised(function), inputs, given.outputs)


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
    platform = robot.platform.with_joined(plain(robot.platform.joined))
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
        constants: Symbols = {"selection": selection}
        return _program(machine, what, constants=constants, guarded=guarded, plain=plain)
    base = ca.SX.sym("base_parameters", len(columns))
    # A mass on a platform point may be the leg's or the platform's, whichever costs less.
    given, extra = ca.mtimes(selection, base), {"base_parameters": base}
    forms = [
        _program(
            machine,
            what,
            constants={"parameters": given, "carried": carried},
            extra=extra,
            wrench=wrench,
            plain=plain,
        )
        for carried in (True, False)
    ]
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
    constants: Symbols | None = None,
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
    built = entry.build(machine, symbols | (constants or {}))
    outputs = {name: _shaped(output) for name, output in built.items()}
    if guarded:
        results = [expression for expression, _ in outputs.values()]
        outputs["status"] = _status(machine, entry, symbols, results), ()
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


def _shaped(output: Output) -> tuple[Expression, tuple[int, ...]]:
    """Return an output's expression and its shape; one that is stacked is vertical."""
    if isinstance(output, tuple):
        return output
    if isinstance(output, list):
        return ca.vertcat(*output), (len(output), *output[0].shape)
    rows, columns = output.shape
    return output, (rows, columns) if columns > 1 else (rows,) if rows > 1 else ()


def _status(
    machine: Machine, entry: _Entry, symbols: dict[str, Expression], results: list[Expression]
) -> Expression:
    """Return 1 where everything holds that the result needs, else 0; also for NaN."""
    states = [symbol for name, symbol in symbols.items() if name not in _SHARED]
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
