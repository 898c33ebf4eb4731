"""The table of functions that can be compiled, by name.

For each: its inputs, its outputs as CasADi expressions, and the conditions on the pose under which
its result counts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import casadi as ca

from pteron.bodies.inertia import carried_values
from pteron.bodies.motion import Expression
from pteron.equations import (
    closing,
    control,
    drives,
    indices,
    kinematics,
    lagrangian,
    reactions,
    regressor,
)
from pteron.equations.clearance import clearances, least_clearances
from pteron.equations.constraints import constraint_measure
from pteron.equations.edges import edges
from pteron.equations.friction import passive_friction
from pteron.equations.laws import LAWS
from pteron.equations.machine import Machine
from pteron.equations.singular_distance import type_ii_distances
from pteron.equations.virtual_work import generalized_forces, inverse_dynamics

Output = Expression | list[Expression] | tuple[Expression, tuple[int, ...]]
"""An expression, of which a column becomes a vector; a list of expressions to be stacked; or an
expression with the shape it is to have."""

Outputs = dict[str, Output]
"""Outputs by name, in order."""

Need = Literal["rows", "reach", "type I", "angles", "type II"]
"""A condition on the pose: in reach, not singular of type I, of type II; "rows" asks for the first
two of those legs alone whose row [dq/dc | dq/dphi] depends on the pose; "angles" for angles of the
platform that are not singular."""

TYPE_I = 1e-4
"""Least type-I measure of a leg (0 where it is singular) where a result is divided by it: the
relative error is 1e-15 to 1e-14 over the measure's square, so that six digits are left here."""

TYPE_II = 1e-9
"""Least type-II measure of the machine where a result needs J^-1: six digits are left here."""

ANGLES = 1e-9
"""Least measure of the platform's angles where a result is the rate of one: six digits are left."""

Symbols = dict[str, Any]
"""The expressions an entry builds with, by name: the inputs, or what a caller puts for them."""


@dataclass(frozen=True)
class Entry:
    """A function: its inputs by name, the equations of its outputs, its conditions on the pose."""

    inputs: tuple[str, ...]
    build: Callable[[Machine, Symbols], Outputs]
    needs: tuple[Need, ...] = ()
    """Conditions on the pose for the result to count, in the order of the messages."""


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
    found, measure, bent = closing.direct_step(m, v["joints"], v["pose"], TYPE_II)
    return {"found": found, "type_ii": measure, "bent": bent}


def _followed_step(m: Machine, v: Symbols) -> Outputs:
    found = closing.followed_step(m, v["joints"], v["pose"], TYPE_II)
    return {"found": found.pose, "type_ii": found.measure}


def _reach(m: Machine, v: Symbols) -> Outputs:
    found = kinematics.reach(m, v["pose"])
    return {
        name: ca.vertcat(*(getattr(leg, name) for leg in found))
        for name in ("margin", "type_i", "spread")
    }


def _passive_room(m: Machine, v: Symbols) -> Outputs:
    shares, metres = kinematics.passive_margins(m, v["pose"])
    return {"shares": shares, "metres": metres}


def _standing(m: Machine, v: Symbols) -> Outputs:
    status, way = kinematics.standing(m, v["pose"])
    return {"standing": status, "way": way}


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


def _twist(m: Machine, v: Symbols) -> Outputs:
    platform = m.platform.motion(v["pose"], *[ca.SX.zeros(m.freedom)] * 2)
    return {"twist": ca.mtimes(platform.twist_rows, v["velocity"])}


def _velocity_of_twist(m: Machine, v: Symbols) -> Outputs:
    velocity, rest = m.platform.motion(v["pose"], *[ca.SX.zeros(m.freedom)] * 2).velocity_of(
        v["twist"]
    )
    return {"velocity": velocity, "rest": rest}


def _link_jacobians(m: Machine, v: Symbols) -> Outputs:
    upper, lower = kinematics.link_jacobians(_state(m, v))
    return {"upper": upper, "lower": lower}


def _joint_motion(m: Machine, v: Symbols) -> Outputs:
    state, order = _state(m, v), int("acceleration" in v)
    links, passive = kinematics.link_turning(state, order), kinematics.passive_motion(state, order)
    return {
        "actuated": kinematics.driven_motion(state, order),
        "upper_links": links[:, 0],
        "lower_links": links[:, 1],
        "passive": (passive, passive.shape),
    }


def _platform_motion(m: Machine, v: Symbols) -> Outputs:
    velocity, acceleration = kinematics.platform_rates(
        m, v["pose"], v["joint_rates"], v["joint_accelerations"]
    )
    return {"velocity": velocity, "acceleration": acceleration}


def _reactions(m: Machine, v: Symbols) -> Outputs:
    found = reactions.equilibrium(m, _state(m, v), v["parameters"])
    wrenches = [[ca.vertcat(at.force, at.moment) for at in leg.wrenches] for leg in found.legs]
    points, passed = (
        ca.vertcat(*(_padded(rows, max(map(len, columns))) for rows in columns))
        for columns in ([leg.points for leg in found.legs], wrenches)
    )
    return {
        "rows": (found.rows, found.rows.shape),
        "right": found.right,
        "presumed_rows": (found.presumed_rows, found.presumed_rows.shape),
        "presumed_right": _stacked(found.presumed_right),
        "loads": (found.loads, found.loads.shape),
        "driven_rows": (found.driven_rows, found.driven_rows.shape),
        "driven": found.driven,
        "ends": _platform_points(m, v)["points"],
        "points": (points, (m.freedom, points.shape[0] // m.freedom, 3)),
        "passed": (passed, (m.freedom, passed.shape[0] // m.freedom, 6)),
    }


def _beams(m: Machine, v: Symbols) -> Outputs:
    found = reactions.beams(m, _state(m, v))
    *links, couples = found._asdict().items()
    rows = ca.horzcat(*couples[1]).T
    return {**dict(links), "couples": (rows, rows.shape)}


def _padded(columns: Sequence[Expression], count: int) -> Expression:
    """Return columns as rows (count, k), NaN where there are too few."""
    rows = ca.horzcat(*columns).T
    return ca.vertcat(rows, ca.SX.nan(count - rows.shape[0], rows.shape[1]))


def _passive_friction(m: Machine, v: Symbols) -> Outputs:
    forces = passive_friction(m, _state(m, v))
    return {"forces": (forces, forces.shape)}


def _set_payload(m: Machine, v: Symbols) -> Outputs:
    platform, given = m.robot.platform, v["parameters"]
    # What a platform that slides carries is on its axis.
    center = ca.SX(3, 1) if platform.slides else v["center"]
    inertia = ca.vertsplit(v["inertia"])
    load = carried_values(type(platform.inertia), v["mass"], ca.vertsplit(center), inertia)
    start = given.shape[0] - len(load)  # the platform's are the last
    return {"loaded_parameters": ca.vertcat(given[:start], given[start:] + ca.vertcat(*load))}


def _inverse_dynamics(m: Machine, v: Symbols) -> Outputs:
    carried = v.get("carried", True)
    forces = inverse_dynamics(m, _state(m, v), v["parameters"], v.get("wrench"), carried=carried)
    return {"forces": forces}


def _forward_dynamics(m: Machine, v: Symbols) -> Outputs:
    wrench = v.get("wrench", ca.SX.zeros(m.wrench_size))
    acceleration = lagrangian.forward_dynamics(
        m, v["pose"], v["velocity"], v["forces"], v["parameters"], wrench
    )
    return {"acceleration": acceleration}


def _drive_forces(m: Machine, v: Symbols, *, smooth: bool) -> Outputs:
    state = _state(m, v)
    carried = v.get("carried", True)
    rigid = inverse_dynamics(m, state, v["parameters"], v.get("wrench"), carried=carried)
    own = drives.Drives.of(v["drives"])
    moving = drives.joint_motion(state)
    return {"forces": rigid + drives.drive_forces(own, *moving, smooth=smooth)}


def _joint_feed_forward(m: Machine, v: Symbols) -> Outputs:
    moving = v["joint_rates"], v["joint_accelerations"]
    found, *_ = closing.direct_step(m, v["joints"], v["pose"], TYPE_II)
    state = m.state(found, *kinematics.platform_rates(m, found, *moving))
    rigid = inverse_dynamics(
        m, state, v["parameters"], v.get("wrench"), carried=v.get("carried", True)
    )
    own = drives.drive_forces(drives.Drives.of(v["drives"]), *moving, smooth=True)
    return {"forces": rigid + own, "found": found}


def _drive_accelerations(m: Machine, v: Symbols) -> Outputs:
    wrench = v.get("wrench", ca.SX.zeros(m.wrench_size))
    given = v["pose"], v["velocity"], v["forces"], v["parameters"], wrench
    acceleration = drives.drive_accelerations(m, *given, drives.Drives.of(v["drives"]))
    return {"acceleration": acceleration}


def _homogeneous_jacobian(m: Machine, v: Symbols) -> Outputs:
    found = indices.homogeneous(m, _state(m, v))
    return {"jacobian": found.matrix, "length": found.length}


def _geometric_index(m: Machine, v: Symbols, *, what: str) -> Outputs:
    return {"value": indices.OF_GEOMETRY[what](m, _state(m, v))}


def _kappa(m: Machine, v: Symbols) -> Outputs:
    mass = lagrangian.mass_matrix(m, v["pose"], v["parameters"])
    return {"value": indices.kappa(m, _state(m, v), mass)}


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


def _controlled(m: Machine, v: Symbols, *, what: str) -> Outputs:
    """Return a control law's forces and next memory; an adaptive law takes no parameters."""
    selection = v.get("selection", ca.SX(len(m.parameters), 0))
    estimates = control.estimated(what, m.freedom, selection.shape[1])
    gains, memory = (
        control.split(v[name], control.lengths(parts[what], m.freedom, estimates))
        for name, parts in (("gains", control.GAINS), ("memory", control.MEMORY))
    )
    sample = control.Sample(
        m,
        control.Wanted(v["pose"], v["velocity"], v["acceleration"]),
        v["joints"],
        v["joint_rates"],
        gains,
        memory,
        drives.Drives.of(v["drives"]),
        v.get("parameters", ca.SX.nan(len(m.parameters))),
        selection,
        TYPE_II,
    )
    forces, kept = LAWS[what](sample)
    return {"forces": forces, "next_memory": ca.vertcat(*(kept[name] for name in memory))}


def _stacked(column: Expression) -> tuple[Expression, tuple[int, ...]]:
    """Return a column as a vector, also where it has one element or none."""
    return column, column.shape[:1]


_POSE, _RATE = ("pose",), ("pose", "velocity")
_MOTION = ("pose", "velocity", "acceleration")
_BENT: tuple[Need, ...] = ("reach", "type I")
_HELD: tuple[Need, ...] = ("reach", "type I", "type II")
_MOVED: tuple[Need, ...] = (*_BENT, "angles")
_SAMPLE = (*_MOTION, "joints", "joint_rates", "memory", "gains")

TABLE: dict[str, Entry] = {
    "inverse_kinematics": Entry(_POSE, _position, ("reach",)),
    "joint_coordinates": Entry(
        _POSE, lambda m, v: {"joints": kinematics.inverse_position(m, v["pose"])}
    ),
    "link_vectors": Entry(_POSE, _links, ("reach",)),
    "direct_kinematics": Entry(("joints",), partial(_poses, reached=True)),
    "closure_poses": Entry(("joints",), partial(_poses, reached=False)),
    "closure_rows": Entry(("joints",), _closure_rows),
    "newton_step": Entry(("joints", "pose"), _newton_step),
    "direct_step": Entry(("joints", "pose"), _direct_step),
    "followed_step": Entry(("joints", "pose"), _followed_step),
    "reach": Entry(_POSE, _reach),
    "passive_room": Entry(_POSE, _passive_room),
    "room": Entry(
        _POSE, lambda m, v: {"room": ca.vertcat(*(edge.value for edge in edges(m, v["pose"])))}
    ),
    "joint_points": Entry(
        _POSE, lambda m, v: {"points": kinematics.chain_points(_state(m, v))}, ("reach",)
    ),
    "platform_points": Entry(_POSE, _platform_points),
    "discriminants": Entry(_POSE, _discriminants),
    "squared_type_i": Entry(_POSE, _squared_type_i),
    "type_ii": Entry(_POSE, _type_ii),
    "type_ii_distances": Entry(_POSE, lambda m, v: dict(type_ii_distances(m, v["pose"])), _BENT),
    "clearances": Entry(
        _POSE, lambda m, v: {"distances": _stacked(clearances(m, v["pose"]))}, ("reach",)
    ),
    "least_clearances": Entry(
        _POSE, lambda m, v: {"distances": _stacked(least_clearances(m, v["pose"]))}, ("reach",)
    ),
    "constraint": Entry(
        _POSE,
        lambda m, v: {"constraint": constraint_measure(m, _state(m, v))},
        ("reach",),
    ),
    "jacobian": Entry(
        _POSE, lambda m, v: {"jacobian": kinematics.jacobian(_state(m, v))}, ("rows",)
    ),
    "twist_jacobian": Entry(
        _POSE, lambda m, v: {"rows": kinematics.twist_jacobian(_state(m, v))}, ("rows",)
    ),
    "twist": Entry(_RATE, _twist),
    "velocity_of_twist": Entry((*_POSE, "twist"), _velocity_of_twist, ("angles",)),
    "link_jacobians": Entry(_POSE, _link_jacobians, _BENT),
    "joint_screws": Entry(
        _POSE, lambda m, v: {"screws": [s.T for s in kinematics.joint_screws(_state(m, v))]}, _BENT
    ),
    "joint_rates": Entry(_RATE, _joint_motion, _BENT),
    "joint_accelerations": Entry(_MOTION, _joint_motion, _BENT),
    "platform_motion": Entry(
        ("pose", "joint_rates", "joint_accelerations"), _platform_motion, (*_MOVED, "type II")
    ),
    "passive_friction": Entry(_RATE, _passive_friction, _HELD),
    "set_payload": Entry(("mass", "center", "inertia", "parameters"), _set_payload),
    "inverse_dynamics": Entry((*_MOTION, "parameters"), _inverse_dynamics, _HELD),
    "forward_dynamics": Entry((*_RATE, "forces", "parameters"), _forward_dynamics, _MOVED),
    "drive_forces": Entry(
        (*_MOTION, "parameters", "drives"), partial(_drive_forces, smooth=False), _HELD
    ),
    "feed_forward": Entry(
        (*_MOTION, "parameters", "drives"), partial(_drive_forces, smooth=True), _HELD
    ),
    "joint_feed_forward": Entry(
        ("joints", "joint_rates", "joint_accelerations", "pose", "parameters", "drives"),
        _joint_feed_forward,
    ),
    "drive_accelerations": Entry(
        (*_RATE, "forces", "parameters", "drives"), _drive_accelerations, _MOVED
    ),
    **{
        what: Entry(
            (*_SAMPLE, *([] if "learnt" in control.MEMORY[what] else ["parameters"]), "drives"),
            partial(_controlled, what=what),
            _HELD,
        )
        for what in LAWS
    },
    "mass_matrix": Entry(
        (*_POSE, "parameters"),
        lambda m, v: {"mass": lagrangian.mass_matrix(m, v["pose"], v["parameters"])},
        _BENT,
    ),
    "coriolis_matrix": Entry((*_RATE, "parameters"), _coriolis_matrix, _BENT),
    "bias_forces": Entry((*_RATE, "parameters"), lambda m, v: {"bias": _forces(m, v)}, _BENT),
    "gravity_forces": Entry((*_POSE, "parameters"), lambda m, v: {"gravity": _forces(m, v)}, _BENT),
    "kinetic_energy": Entry((*_RATE, "parameters"), _kinetic_energy, _BENT),
    "potential_energy": Entry(
        (*_POSE, "parameters"),
        lambda m, v: {"energy": lagrangian.potential_energy(m, v["pose"], v["parameters"])},
        ("reach",),
    ),
    "regressor": Entry(_MOTION, _regressor, _HELD),
    "base_regressor": Entry(_MOTION, _regressor, _HELD),
    "paper_regressor": Entry(
        _MOTION, lambda m, v: {"regressor": regressor.paper_regressor(m, _state(m, v))}, _HELD
    ),
    "paper_terms": Entry(_MOTION, _paper_terms, _BENT),
}

FUNCTIONS = tuple(TABLE)
"""The functions that `compile` accepts, beside the indices and their ingredients."""

_DEFINED = (
    *("condition", "condition_points", "speed_least", "speed_most", "turning_speed"),
    *("force_least", "turning_moment", "pressure_angle", "output_pressure_angle"),
)
"""The indices of geometry that are defined at type-II singularities too, if only as infinite."""

INDICES: dict[str, Entry] = {
    **{
        what: Entry(
            _POSE, partial(_geometric_index, what=what), _BENT if what in _DEFINED else _HELD
        )
        for what in indices.OF_GEOMETRY
    },
    "kappa": Entry((*_POSE, "parameters"), _kappa, _BENT),
}
"""The indices of performance, each one number for a pose: `pteron.indices` says what they mean."""

TABLE |= INDICES | {
    "homogeneous_jacobian": Entry(_POSE, _homogeneous_jacobian, ("rows",)),
    "reactions": Entry((*_MOTION, "parameters"), _reactions, _HELD),
    "beams": Entry(_POSE, _beams, _BENT),
    "standing": Entry(_POSE, _standing),
}


def needs_of(what: str) -> tuple[Need, ...]:
    """Return the conditions on the pose under which a function's result counts."""
    return TABLE[what].needs
