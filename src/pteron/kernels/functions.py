"""The table of functions that can be compiled, by name: those of forces, and performance indices.

Functions of poses are in `pose_functions`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

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
from pteron.equations.friction import passive_friction
from pteron.equations.laws import LAWS
from pteron.equations.machine import Machine
from pteron.equations.virtual_work import generalized_forces, inverse_dynamics
from pteron.kernels.entries import (
    ANGLES as ANGLES,
    BENT,
    HELD,
    MOTION,
    MOVED,
    POSE,
    RATE,
    TABLE as TABLE,
    TYPE_I as TYPE_I,
    TYPE_II as TYPE_II,
    Entry as Entry,
    Need,
    Output as Output,
    Outputs,
    Symbols as Symbols,
    entry,
    stacked,
    state,
)
from pteron.kernels.pose_functions import platform_points

_SAMPLE = (*MOTION, "joints", "joint_rates", "memory", "gains")


@entry(RATE, HELD)
def _passive_friction(m: Machine, v: Symbols) -> Outputs:
    forces = passive_friction(m, state(m, v))
    return {"forces": (forces, forces.shape)}


@entry(("mass", "center", "inertia", "parameters"))
def _set_payload(m: Machine, v: Symbols) -> Outputs:
    platform, given = m.robot.platform, v["parameters"]
    # What a platform that slides carries is on its axis.
    center = ca.SX(3, 1) if platform.slides else v["center"]
    inertia = ca.vertsplit(v["inertia"])
    load = carried_values(type(platform.inertia), v["mass"], ca.vertsplit(center), inertia)
    start = given.shape[0] - len(load)  # the platform's are the last
    return {"loaded_parameters": ca.vertcat(given[:start], given[start:] + ca.vertcat(*load))}


@entry((*MOTION, "parameters"), HELD)
def _inverse_dynamics(m: Machine, v: Symbols) -> Outputs:
    carried = v.get("carried", True)
    forces = inverse_dynamics(m, state(m, v), v["parameters"], v.get("wrench"), carried=carried)
    return {"forces": forces}


@entry((*RATE, "forces", "parameters"), MOVED)
def _forward_dynamics(m: Machine, v: Symbols) -> Outputs:
    wrench = v.get("wrench", ca.SX.zeros(m.wrench_size))
    acceleration = lagrangian.forward_dynamics(
        m, v["pose"], v["velocity"], v["forces"], v["parameters"], wrench
    )
    return {"acceleration": acceleration}


def _drive_forces(m: Machine, v: Symbols, *, smooth: bool) -> Outputs:
    at = state(m, v)
    carried = v.get("carried", True)
    rigid = inverse_dynamics(m, at, v["parameters"], v.get("wrench"), carried=carried)
    own = drives.Drives.of(v["drives"])
    moving = drives.joint_motion(at)
    return {"forces": rigid + drives.drive_forces(own, *moving, smooth=smooth)}


for _name, _smooth in (("drive_forces", False), ("feed_forward", True)):
    TABLE[_name] = Entry(
        (*MOTION, "parameters", "drives"), partial(_drive_forces, smooth=_smooth), HELD
    )


@entry(("joints", "joint_rates", "joint_accelerations", "pose", "parameters", "drives"))
def _joint_feed_forward(m: Machine, v: Symbols) -> Outputs:
    moving = v["joint_rates"], v["joint_accelerations"]
    found, *_ = closing.direct_step(m, v["joints"], v["pose"], TYPE_II)
    at = m.state(found, *kinematics.platform_rates(m, found, *moving))
    rigid = inverse_dynamics(
        m, at, v["parameters"], v.get("wrench"), carried=v.get("carried", True)
    )
    own = drives.drive_forces(drives.Drives.of(v["drives"]), *moving, smooth=True)
    return {"forces": rigid + own, "found": found}


@entry((*RATE, "forces", "parameters", "drives"), MOVED)
def _drive_accelerations(m: Machine, v: Symbols) -> Outputs:
    wrench = v.get("wrench", ca.SX.zeros(m.wrench_size))
    given = v["pose"], v["velocity"], v["forces"], v["parameters"], wrench
    acceleration = drives.drive_accelerations(m, *given, drives.Drives.of(v["drives"]))
    return {"acceleration": acceleration}


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


for _name in LAWS:
    _known = () if "learnt" in control.MEMORY[_name] else ("parameters",)
    TABLE[_name] = Entry((*_SAMPLE, *_known, "drives"), partial(_controlled, what=_name), HELD)


@entry((*POSE, "parameters"), BENT)
def _mass_matrix(m: Machine, v: Symbols) -> Outputs:
    return {"mass": lagrangian.mass_matrix(m, v["pose"], v["parameters"])}


@entry((*RATE, "parameters"), BENT)
def _coriolis_matrix(m: Machine, v: Symbols) -> Outputs:
    return {"coriolis": lagrangian.coriolis_matrix(m, v["pose"], v["velocity"], v["parameters"])}


def _forces(m: Machine, v: Symbols) -> Expression:
    """Return the forces of a state that lacks an acceleration, and perhaps a velocity."""
    return generalized_forces(m, state(m, v), v["parameters"])


@entry((*RATE, "parameters"), BENT)
def _bias_forces(m: Machine, v: Symbols) -> Outputs:
    return {"bias": _forces(m, v)}


@entry((*POSE, "parameters"), BENT)
def _gravity_forces(m: Machine, v: Symbols) -> Outputs:
    return {"gravity": _forces(m, v)}


@entry((*RATE, "parameters"), BENT)
def _kinetic_energy(m: Machine, v: Symbols) -> Outputs:
    return {"energy": lagrangian.kinetic_energy(m, v["pose"], v["velocity"], v["parameters"])}


@entry((*POSE, "parameters"), ("reach",))
def _potential_energy(m: Machine, v: Symbols) -> Outputs:
    return {"energy": lagrangian.potential_energy(m, v["pose"], v["parameters"])}


@entry(MOTION, HELD)
def _regressor(m: Machine, v: Symbols) -> Outputs:
    selection = v.get("selection", ca.SX.eye(len(m.parameters)))
    matrix = inverse_dynamics(m, state(m, v), selection)
    return {"regressor": (matrix, matrix.shape)}


TABLE["base_regressor"] = TABLE["regressor"]


@entry(MOTION, HELD)
def _paper_regressor(m: Machine, v: Symbols) -> Outputs:
    return {"regressor": regressor.paper_regressor(m, state(m, v))}


@entry(MOTION, BENT)
def _paper_terms(m: Machine, v: Symbols) -> Outputs:
    parts = regressor.terms(m, state(m, v))
    return {
        "jacobian": parts.jacobian,
        "sliders": parts.sliders,
        "link_jacobians": list(parts.link_jacobians),
        "links": [ca.horzcat(link, ca.SX(6, 4 - link.shape[1])) for link in parts.links],
        "platform": parts.platform,
    }


FUNCTIONS = tuple(TABLE)
"""The functions that `compile` accepts, beside the indices and their ingredients."""


_DEFINED = (
    *("condition", "condition_points", "speed_least", "speed_most", "turning_speed"),
    *("force_least", "turning_moment", "pressure_angle", "output_pressure_angle"),
)
"""The indices of geometry that are defined at type-II singularities too, if only as infinite."""


def _geometric_index(m: Machine, v: Symbols, *, what: str) -> Outputs:
    return {"value": indices.OF_GEOMETRY[what](m, state(m, v))}


for _name in indices.OF_GEOMETRY:
    _needed = BENT if _name in _DEFINED else HELD
    TABLE[_name] = Entry(POSE, partial(_geometric_index, what=_name), _needed)


@entry((*POSE, "parameters"), BENT)
def _kappa(m: Machine, v: Symbols) -> Outputs:
    mass = lagrangian.mass_matrix(m, v["pose"], v["parameters"])
    return {"value": indices.kappa(m, state(m, v), mass)}


@entry(POSE, ("rows",))
def _homogeneous_jacobian(m: Machine, v: Symbols) -> Outputs:
    found = indices.homogeneous(m, state(m, v))
    return {"jacobian": found.matrix, "length": found.length}


def _padded(columns: Sequence[Expression], count: int) -> Expression:
    """Return columns as rows (count, k), NaN where there are too few."""
    rows = ca.horzcat(*columns).T
    return ca.vertcat(rows, ca.SX.nan(count - rows.shape[0], rows.shape[1]))


@entry((*MOTION, "parameters"), HELD)
def _reactions(m: Machine, v: Symbols) -> Outputs:
    found = reactions.equilibrium(m, state(m, v), v["parameters"])
    wrenches = [[ca.vertcat(at.force, at.moment) for at in leg.wrenches] for leg in found.legs]
    points, passed = (
        ca.vertcat(*(_padded(rows, max(map(len, columns))) for rows in columns))
        for columns in ([leg.points for leg in found.legs], wrenches)
    )
    return {
        "rows": (found.rows, found.rows.shape),
        "right": found.right,
        "presumed_rows": (found.presumed_rows, found.presumed_rows.shape),
        "presumed_right": stacked(found.presumed_right),
        "loads": (found.loads, found.loads.shape),
        "driven_rows": (found.driven_rows, found.driven_rows.shape),
        "driven": found.driven,
        "ends": platform_points(m, v)["points"],
        "points": (points, (m.freedom, points.shape[0] // m.freedom, 3)),
        "passed": (passed, (m.freedom, passed.shape[0] // m.freedom, 6)),
    }


@entry(POSE, BENT)
def _beams(m: Machine, v: Symbols) -> Outputs:
    found = reactions.beams(m, state(m, v))
    *links, couples = found._asdict().items()
    rows = ca.horzcat(*couples[1]).T
    return {**dict(links), "couples": (rows, rows.shape)}


@entry(POSE)
def _standing(m: Machine, v: Symbols) -> Outputs:
    status, way = kinematics.standing(m, v["pose"])
    return {"standing": status, "way": way}


def needs_of(what: str) -> tuple[Need, ...]:
    """Return the conditions on the pose under which a function's result counts."""
    return TABLE[what].needs
