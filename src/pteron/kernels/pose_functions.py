"""The table of functions of poses and rates that can be compiled.

Each has its inputs, its equations, and the conditions on the pose under which its result is valid.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations import closing, kinematics
from pteron.equations.clearance import clearances, least_clearances
from pteron.equations.constraints import constraint_measure
from pteron.equations.edges import edges
from pteron.equations.machine import Machine
from pteron.equations.singular_distance import type_ii_distances
from pteron.kernels.entries import (
    MOTION,
    NEEDS_ANGLES,
    NEEDS_CONSTANT_ROWS,
    NEEDS_REACH,
    NEEDS_TYPE_I,
    POSE,
    RATE,
    TABLE,
    TYPE_II,
    Entry,
    Inputs,
    Outputs,
    as_vector,
    equation_entry,
    state,
    state_entry,
)


def _inverse_kinematics(m: Machine, pose: Expression) -> Expression:
    """Return the joint coordinates (n,) of a pose, m or rad; NaN out of reach."""
    # A slider's equation has a value out of reach too; `reach_validity` makes it NaN there.
    return kinematics.inverse_position(m, pose) + kinematics.reach_validity(m, pose)


def _poses(m: Machine, v: Inputs, *, reached: bool) -> Outputs:
    """Return the poses (modes, n) of joint coordinates in closed form; NaN where there is none."""
    poses = kinematics.direct_position(m, v.joints, reached=reached).T
    return {"poses": (poses, poses.shape)}


def _closure_rows(m: Machine, v: Inputs) -> Outputs:
    """Return the closure equations of fixed joints, with their origin and unit length, m."""
    closures = closing.closure_rows(m, v.joints)
    rows = {name: (part, part.shape) for name, part in closures._asdict().items()}
    return {**rows, "origin": closures.origin, "size": closures.size}


def _direct_step(m: Machine, joints: Expression, pose: Expression) -> Any:
    """Return the pose of joint coordinates near a start pose, by Newton's method."""
    return closing.direct_step(m, joints, pose, TYPE_II)


def _followed_step(m: Machine, joints: Expression, pose: Expression) -> Any:
    """Return the pose of joint coordinates, across singularities, and its type-II measure."""
    step = closing.converged_step(m, joints, pose, TYPE_II)
    return step.pose, step.measure


def _leg_equation(
    quantity: Callable[[Any], Expression],
) -> Callable[[Machine, Expression], Expression]:
    """Return the function of (machine, pose) that stacks quantity(reach) of each leg, (n, 1)."""
    return lambda m, pose: ca.vertcat(*map(quantity, kinematics.reach(m, pose)))


def _reach(m: Machine, pose: Expression) -> Any:
    """Return the legs' reach margins, m, type-I measures and spreads at a pose, (n,) each."""
    reaches = kinematics.reach(m, pose)
    names = ("margin", "type_i", "spread")
    return [ca.vertcat(*(getattr(leg, name) for leg in reaches)) for name in names]


def _room(m: Machine, pose: Expression) -> Expression:
    """Return the conditions (K, 1) at a pose that are not negative within reach and limits."""
    return ca.vertcat(*(edge.value for edge in edges(m, pose)))


def _platform(m: Machine, pose: Expression) -> Any:
    """Return the platform's motion state at a pose with zero rates."""
    return m.platform.motion(pose, *[ca.SX.zeros(m.freedom)] * 2)


def platform_points(m: Machine, pose: Expression) -> Expression:
    """Return the platform points (n, 3) at a pose in the base frame, m."""
    return ca.vertcat(*(point.position.T for point in _platform(m, pose).points))


def _type_ii(m: Machine, v: Inputs) -> Outputs:
    """Return the type-II measure of a pose: 0 at a singularity."""
    at = state(m, v)
    return {"type_ii": m.closure.measure(at.platform, at.legs)}


def _twist(m: Machine, pose: Expression, velocity: Expression) -> Expression:
    """Return the twist (6,) of the platform, m/s and rad/s."""
    return ca.mtimes(_platform(m, pose).twist_rows, velocity)


def _velocity_of_twist(m: Machine, pose: Expression, twist: Expression) -> Any:
    """Return the pose rates (m,) for a twist (6,), and the part of it that they cannot give."""
    return _platform(m, pose).velocity_of(twist)


def _joint_motion(m: Machine, v: Inputs) -> Outputs:
    """Return rates, or accelerations if given, of actuated joints, links and passive joints."""
    at, order = state(m, v), int(v.acceleration is not None)
    links, passive = kinematics.link_turning(at, order), kinematics.passive_motion(at, order)
    return {
        "actuated": kinematics.driven_motion(at, order),
        "upper_links": links[:, 0],
        "lower_links": links[:, 1],
        "passive": (passive, passive.shape),
    }


_STEP = ("joints", "pose")
_OF_JOINTS = ("pose", "joint_rates", "joint_accelerations")

TABLE |= {
    "inverse_kinematics": equation_entry(_inverse_kinematics, POSE, "joints", NEEDS_REACH),
    "joint_coordinates": equation_entry(kinematics.inverse_position, POSE, "joints"),
    "link_vectors": state_entry(kinematics.link_vectors, POSE, "l_u l_l", NEEDS_REACH),
    "direct_kinematics": Entry(("joints",), partial(_poses, reached=True)),
    "closure_poses": Entry(("joints",), partial(_poses, reached=False)),
    "closure_rows": Entry(("joints",), _closure_rows),
    "closure_errors": equation_entry(closing.closure_errors, _STEP, "errors any_branch"),
    "any_branch_step": equation_entry(closing.any_branch_step, _STEP, "stepped change"),
    "newton_step": equation_entry(closing.newton_step, _STEP, "stepped missed"),
    "direct_step": equation_entry(_direct_step, _STEP, "found type_ii bent"),
    "followed_step": equation_entry(_followed_step, _STEP, "found type_ii"),
    "reach": equation_entry(_reach, POSE, "margin type_i spread"),
    "passive_room": equation_entry(kinematics.passive_margins, POSE, "shares metres"),
    "room": equation_entry(_room, POSE, "room"),
    "joint_points": state_entry(kinematics.chain_points, POSE, "points", NEEDS_REACH),
    "platform_points": equation_entry(platform_points, POSE, "points"),
    "discriminants": equation_entry(
        _leg_equation(lambda leg: leg.discriminant), POSE, "discriminants"
    ),
    "radicands": equation_entry(kinematics.radicands, POSE, "radicands"),
    # Finite and smooth out of reach too, where it is negative.
    "squared_type_i": equation_entry(
        _leg_equation(lambda leg: leg.discriminant / leg.scale), POSE, "squares"
    ),
    "type_ii": Entry(POSE, _type_ii),
    "type_ii_distances": Entry(POSE, lambda m, v: dict(type_ii_distances(m, v.pose)), NEEDS_TYPE_I),
    "clearances": equation_entry(
        lambda *at: as_vector(clearances(*at)), POSE, "distances", NEEDS_REACH
    ),
    "least_clearances": equation_entry(
        lambda *at: as_vector(least_clearances(*at)), POSE, "distances", NEEDS_REACH
    ),
    "constraint": Entry(
        POSE, lambda m, v: {"constraint": constraint_measure(m, state(m, v))}, NEEDS_REACH
    ),
    "jacobian": state_entry(kinematics.jacobian, POSE, "jacobian", NEEDS_CONSTANT_ROWS),
    "twist_jacobian": state_entry(kinematics.twist_jacobian, POSE, "rows", NEEDS_CONSTANT_ROWS),
    "twist": equation_entry(_twist, RATE, "twist"),
    "velocity_of_twist": equation_entry(
        _velocity_of_twist, ("pose", "twist"), "velocity rest", ("angles",)
    ),
    "link_jacobians": state_entry(kinematics.link_jacobians, POSE, "upper lower", NEEDS_TYPE_I),
    "joint_screws": state_entry(
        lambda at: [s.T for s in kinematics.joint_screws(at)], POSE, "screws", NEEDS_TYPE_I
    ),
    "joint_rates": Entry(RATE, _joint_motion, NEEDS_TYPE_I),
    "joint_accelerations": Entry(MOTION, _joint_motion, NEEDS_TYPE_I),
    "motion_at_point": equation_entry(
        kinematics.motion_at_point,
        (*MOTION, "pivot"),
        "pivot_pose pivot_velocity pivot_acceleration",
    ),
    "platform_motion": equation_entry(
        kinematics.platform_rates, _OF_JOINTS, "velocity acceleration", (*NEEDS_ANGLES, "type II")
    ),
}
