"""The table of functions that can be compiled, by name: those of forces, and performance indices.

Functions of poses are in `pose_functions`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

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
    sticking,
    transmissions,
)
from pteron.equations.friction import passive_friction
from pteron.equations.laws import LAWS
from pteron.equations.machine import Machine
from pteron.equations.virtual_work import (
    generalized_forces,
    inverse_dynamics,
    rigid_forces,
)
from pteron.kernels.entries import (
    ANGLES as ANGLES,
    MOTION,
    NEEDS_ANGLES,
    NEEDS_CONSTANT_ROWS,
    NEEDS_REACH,
    NEEDS_TYPE_I,
    NEEDS_TYPE_II,
    POSE,
    RATE,
    TABLE as TABLE,
    TYPE_I as TYPE_I,
    TYPE_II as TYPE_II,
    Entry as Entry,
    Inputs as Inputs,
    Need,
    Output as Output,
    Outputs,
    as_vector,
    equation_entry,
    state,
    state_entry,
)
from pteron.kernels.pose_functions import platform_points

_SAMPLE = (*MOTION, "joints", "joint_rates", "memory", "gains")


def _as_matrix(matrix: Expression) -> tuple[Expression, tuple[int, ...]]:
    """Return an expression with its two-dimensional shape, also for a single column."""
    return matrix, matrix.shape


def _set_payload(m: Machine, v: Inputs) -> Outputs:
    """Return the inertial parameters with a payload's mass and inertia added to the platform."""
    platform, inertial = m.robot.platform, v.parameters
    on_axis, inertia = platform.carries_on_axis, ca.vertsplit(v.inertia)
    center = ca.SX(3, 1) if on_axis else v.center
    load = carried_values(type(platform.inertia), v.mass, ca.vertsplit(center), inertia)
    start = inertial.shape[0] - len(load)  # the platform's are the last
    return {"loaded_parameters": ca.vertcat(inertial[:start], inertial[start:] + ca.vertcat(*load))}


def _rigid(m: Machine, v: Inputs, at: Any, drive_loads: Expression) -> Expression:
    """Return the actuator forces (n, 1) in a motion state, with those of the drives themselves."""
    arguments = m, at, v.parameters, v.wrench
    return drive_loads + rigid_forces(*arguments, carried=v.carried, drive_loads=drive_loads)


def _inverse_dynamics(m: Machine, v: Inputs) -> Outputs:
    """Return the actuator forces (n,) of a motion, N or N m."""
    at = state(m, v)
    return {"forces": rigid_forces(m, at, v.parameters, v.wrench, carried=v.carried)}


def _dynamics_arguments(m: Machine, v: Inputs) -> Any:
    """Return pose, velocity, forces, parameters and wrench; the wrench is zero if absent."""
    wrench = ca.SX.zeros(m.wrench_size) if v.wrench is None else v.wrench
    return v.pose, v.velocity, v.forces, v.parameters, wrench


def _forward_dynamics(m: Machine, v: Inputs) -> Outputs:
    """Return the platform's acceleration (m,) under actuator forces, without drive friction."""
    return {"acceleration": lagrangian.forward_dynamics(m, *_dynamics_arguments(m, v))}


def _drive_forces(m: Machine, v: Inputs, *, smooth: bool) -> Outputs:
    """Return the drives' forces (n,): of rigid bodies, friction and rotors, N or N m."""
    at, drive_numbers = state(m, v), drives.Drives.from_vector(v.drives)
    moving = drives.joint_motion(at)
    drive_loads = drives.drive_forces(drive_numbers, *moving, smooth=smooth)
    return {"forces": _rigid(m, v, at, drive_loads)}


def _joint_feed_forward(m: Machine, v: Inputs) -> Outputs:
    """Return the drive forces (n,) of a motion of the joints, and the platform's pose."""
    moving = v.joint_rates, v.joint_accelerations
    pose, *_ = closing.direct_step(m, v.joints, v.pose, TYPE_II)
    at = m.state(pose, *kinematics.platform_rates(m, pose, *moving))
    drive_loads = drives.drive_forces(drives.Drives.from_vector(v.drives), *moving, smooth=True)
    return {"forces": _rigid(m, v, at, drive_loads), "found": pose}


def _drive_accelerations(m: Machine, v: Inputs) -> Outputs:
    """Return the platform's acceleration (m,) under drive forces, with friction and rotors."""
    drive_numbers = drives.Drives.from_vector(v.drives)
    return {
        "acceleration": drives.drive_accelerations(m, *(*_dynamics_arguments(m, v), drive_numbers))
    }


def _control_outputs(m: Machine, v: Inputs, *, what: str) -> Outputs:
    """Return the drive forces and next memory of the control law `what`."""
    count = len(m.parameters)
    selection = ca.SX(count, 0) if v.selection is None else v.selection
    n = len(m.legs)
    estimates = control.estimate_count(what, n, selection.shape[1])
    gains, memory = (
        control.split_parts(vector, control.lengths(parts[what], m.freedom, n, estimates))
        for vector, parts in ((v.gains, control.GAINS), (v.memory, control.MEMORY))
    )
    sample = control.Sample(
        m,
        control.DesiredMotion(v.pose, v.velocity, v.acceleration),
        v.joints,
        v.joint_rates,
        gains,
        memory,
        drives.Drives.from_vector(v.drives),
        ca.SX.nan(count) if v.parameters is None else v.parameters,
        selection,
        TYPE_II,
    )
    forces, next_memory = LAWS[what](sample)
    return {"forces": forces, "next_memory": ca.vertcat(*(next_memory[name] for name in memory))}


def _law(name: str) -> Entry:
    """Return the table entry of a control law."""
    known = () if "learnt" in control.MEMORY[name] else ("parameters",)
    return Entry((*_SAMPLE, *known, "drives"), partial(_control_outputs, what=name), NEEDS_TYPE_II)


def _forces(m: Machine, v: Inputs, *, name: str) -> Outputs:
    """Return the generalized forces of a state, under `name`; missing rates are zero."""
    return {name: generalized_forces(m, state(m, v), v.parameters)}


def _regressor(m: Machine, v: Inputs) -> Outputs:
    """Return the regressor (n, K): its product with the parameters is the actuator forces."""
    selection = ca.SX.eye(len(m.parameters)) if v.selection is None else v.selection
    return {"regressor": _as_matrix(inverse_dynamics(m, state(m, v), selection))}


def _load_regressor(m: Machine, v: Inputs) -> Outputs:
    """Return the regressor (m, K) of the load M x'' + h along the pose's coordinates."""
    load = generalized_forces(m, state(m, v), ca.SX.eye(len(m.parameters)))
    return {"regressor": _as_matrix(load)}


def _paper_terms(m: Machine, v: Inputs) -> Outputs:
    """Return the factors of the inverse dynamics in the paper's form, by the paper's names."""
    parts = regressor.terms(m, state(m, v))
    return {
        "jacobian": parts.jacobian,
        "sliders": parts.sliders,
        "link_jacobians": list(parts.link_jacobians),
        "links": [ca.horzcat(link, ca.SX(6, 4 - link.shape[1])) for link in parts.links],
        "platform": parts.platform,
    }


_LOADED = (*MOTION, "parameters")
_DRIVEN = (*_LOADED, "drives")
_PUSHED = (*RATE, "forces", "parameters")
_AT_REST, _MOVING = (*POSE, "parameters"), (*RATE, "parameters")
_OF_JOINTS = ("joints", "joint_rates", "joint_accelerations", "pose", "parameters", "drives")

TABLE |= {
    "passive_friction": Entry(
        RATE, lambda m, v: {"forces": _as_matrix(passive_friction(m, state(m, v)))}, NEEDS_TYPE_II
    ),
    "set_payload": Entry(("mass", "center", "inertia", "parameters"), _set_payload),
    "inverse_dynamics": Entry(_LOADED, _inverse_dynamics, NEEDS_TYPE_II),
    "forward_dynamics": Entry(_PUSHED, _forward_dynamics, NEEDS_ANGLES),
    "drive_forces": Entry(_DRIVEN, partial(_drive_forces, smooth=False), NEEDS_TYPE_II),
    "feed_forward": Entry(_DRIVEN, partial(_drive_forces, smooth=True), NEEDS_TYPE_II),
    "joint_feed_forward": Entry(_OF_JOINTS, _joint_feed_forward),
    "drive_accelerations": Entry((*_PUSHED, "drives"), _drive_accelerations, NEEDS_ANGLES),
    **{name: _law(name) for name in LAWS},
    "mass_matrix": equation_entry(lagrangian.mass_matrix, _AT_REST, "mass", NEEDS_TYPE_I),
    "coriolis_matrix": equation_entry(
        lagrangian.coriolis_matrix, _MOVING, "coriolis", NEEDS_TYPE_I
    ),
    "bias_forces": Entry(_MOVING, partial(_forces, name="bias"), NEEDS_TYPE_I),
    "gravity_forces": Entry(_AT_REST, partial(_forces, name="gravity"), NEEDS_TYPE_I),
    "kinetic_energy": equation_entry(lagrangian.kinetic_energy, _MOVING, "energy", NEEDS_TYPE_I),
    "potential_energy": equation_entry(
        lagrangian.potential_energy, _AT_REST, "energy", NEEDS_REACH
    ),
    **dict.fromkeys(("regressor", "base_regressor"), Entry(MOTION, _regressor, NEEDS_TYPE_II)),
    "load_regressor": Entry(MOTION, _load_regressor, NEEDS_TYPE_I),
    "paper_regressor": Entry(
        MOTION, lambda m, v: {"regressor": regressor.paper_regressor(m, state(m, v))}, NEEDS_TYPE_II
    ),
    "paper_terms": Entry(MOTION, _paper_terms, NEEDS_TYPE_I),
}

FUNCTIONS = tuple(TABLE)
"""The functions that `compile` accepts, beside the indices and their ingredients."""

INTERNAL = ("driven_motion",)
"""Functions of the table whose inputs depend on the drives: the simulation's alone."""


def _driven_motion(m: Machine, v: Inputs) -> Outputs:
    """Return the rates of machine and drive states under stick-slip friction, by name."""
    kind: transmissions.DriveKind = v.kind
    sides = sticking.Sides(v.side, v.hold, v.brake) if kind.dry else None
    drive_numbers = drives.Drives.from_vector(v.drives)
    if not kind.stribeck:  # a sixth of the operations less
        drive_numbers = drive_numbers._replace(stribeck=ca.SX.zeros(*drive_numbers.stribeck.shape))
    zero, parts = ca.SX.zeros(len(m.legs)), (v.motor, v.motor_rate, v.current, v.bristle)
    motor, motor_rate, current, bristle = (zero if part is None else part for part in parts)
    pace, numbers = (
        ca.SX(0) if v.pace is None else v.pace,
        transmissions.Actuators(kind, v.actuators),
    )
    motors = sticking.Motors(kind, numbers, motor, motor_rate, current, bristle, pace)
    dynamics = v.pose, v.velocity, v.forces, v.parameters, v.wrench
    return dict(sticking.stick_slip_rates(m, *dynamics, drive_numbers, motors, sides))


def _sensed_joints(at: Any) -> Any:
    """Return the joint coordinates and rates of a motion state, (n,) each."""
    return control.coordinates(at), drives.joint_motion(at)[0]


def _geometric_index(m: Machine, v: Inputs, *, what: str) -> Outputs:
    """Return the geometric performance index `what` at a pose."""
    return {"value": indices.GEOMETRIC_INDICES[what](m, state(m, v))}


def _kappa(m: Machine, v: Inputs) -> Outputs:
    """Return the condition number of the mass matrix at a pose."""
    mass = lagrangian.mass_matrix(m, v.pose, v.parameters)
    return {"value": indices.kappa(m, state(m, v), mass)}


def _homogeneous_jacobian(m: Machine, v: Inputs) -> Outputs:
    """Return the Jacobian in homogeneous units and its characteristic length L, m."""
    homogeneous = indices.homogeneous(m, state(m, v))
    return {"jacobian": homogeneous.matrix, "length": homogeneous.length}


def _pad_rows(columns: Sequence[Expression], count: int) -> Expression:
    """Return columns as rows (count, k), padded with NaN rows."""
    rows = ca.horzcat(*columns).T
    return ca.vertcat(rows, ca.SX.nan(count - rows.shape[0], rows.shape[1]))


def _reactions(m: Machine, v: Inputs) -> Outputs:
    """Return the linear equations of the joint reaction forces, by name."""
    n, equilibrium = len(m.legs), reactions.equilibrium(m, state(m, v), v.parameters)
    wrenches = [
        [ca.vertcat(at.force, at.moment) for at in leg.wrenches] for leg in equilibrium.legs
    ]
    points, passed = (
        ca.vertcat(*(_pad_rows(rows, max(map(len, columns))) for rows in columns))
        for columns in ([leg.points for leg in equilibrium.legs], wrenches)
    )
    return {
        "rows": _as_matrix(equilibrium.rows),
        "right": equilibrium.right,
        "presumed_rows": _as_matrix(equilibrium.presumed_rows),
        "presumed_right": as_vector(equilibrium.presumed_right),
        "loads": _as_matrix(equilibrium.loads),
        "driven_rows": _as_matrix(equilibrium.driven_rows),
        "driven": equilibrium.driven,
        "ends": platform_points(m, v.pose),
        "points": (points, (n, points.shape[0] // n, 3)),
        "passed": (passed, (n, passed.shape[0] // n, 6)),
    }


def _beams(m: Machine, v: Inputs) -> Outputs:
    """Return the leg links as beams and the rods' couples (n, 3), by name."""
    beams = reactions.beams(m, state(m, v))
    *links, couples = beams._asdict().items()
    return {**dict(links), "couples": _as_matrix(ca.horzcat(*couples[1]).T)}


_DEFINED_AT_TYPE_II = (
    *("condition", "condition_points", "speed_least", "speed_most", "turning_speed"),
    *("force_least", "turning_moment", "pressure_angle", "output_pressure_angle"),
)
"""The indices of geometry that are defined at type-II singularities too, if only as infinite."""

TABLE |= {
    "driven_motion": Entry((*_PUSHED, "drives"), _driven_motion, NEEDS_ANGLES),
    "sensed": state_entry(_sensed_joints, RATE, "joints rates", NEEDS_TYPE_I),
    **{
        name: Entry(
            POSE,
            partial(_geometric_index, what=name),
            NEEDS_TYPE_I if name in _DEFINED_AT_TYPE_II else NEEDS_TYPE_II,
        )
        for name in indices.GEOMETRIC_INDICES
    },
    "kappa": Entry(_AT_REST, _kappa, NEEDS_TYPE_I),
    "homogeneous_jacobian": Entry(POSE, _homogeneous_jacobian, NEEDS_CONSTANT_ROWS),
    "reactions": Entry(_LOADED, _reactions, NEEDS_TYPE_II),
    "beams": Entry(POSE, _beams, NEEDS_TYPE_I),
    "standing": equation_entry(kinematics.pose_status, POSE, "standing way"),
}


def needs_of(what: str) -> tuple[Need, ...]:
    """Return the conditions on the pose that the function `what` needs for valid results."""
    return TABLE[what].needs
