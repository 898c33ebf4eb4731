"""Early ends of a simulation (limits, singularities, divergence): the state, and a sentence why."""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array, numeric
from pteron.kernels.functions import TYPE_II
from pteron.kinematics.limits import limited_joints
from pteron.kinematics.sampling import holding_measures, holding_sizes
from pteron.kinematics.singularities import best_holding
from pteron.manipulator import Manipulator
from pteron.motion.motion import pose_text
from pteron.shapes import PerJoint
from pteron.tolerances import ROUNDING
from pteron.workspace.margins import joint_distances

_FAST = 1e3
"""Speed, m/s or rad/s, beyond which the numbers count as diverging."""


def why_not_further(robot: Manipulator, pose: Array, velocity: Array) -> str:
    """Return as text why the equations of motion have no solution beyond a state, (m,) each."""
    if not np.abs(velocity).max() < _FAST:
        return (
            "the motion diverges: the controller is unstable, or the forces are far too large; "
            "lower the gains, or the delay"
        )
    type_i = numeric(robot, "reach")(pose)[1]
    i = int(np.nanargmin(type_i))
    return (
        f"leg {i + 1} comes to the edge of its reach, where {robot.legs[i].singular_text} (type I; "
        f"measure {type_i[i]:.1e}), at pose {pose_text(pose)}"
    )


def first_beyond_limits(robot: Manipulator, poses: Array, joints: PerJoint) -> int | None:
    """Return the first index of poses (T, m) at which a joint is beyond its limits, or None."""
    beyond = (joint_distances(robot, joints) < -ROUNDING).any(axis=-1)
    beyond |= (numeric(robot, "passive_room")(poses)[1] < -ROUNDING).any(axis=-1)
    return int(beyond.argmax()) if beyond.any() else None


def limit_text(robot: Manipulator, pose: Array) -> str:
    """Return as text which joint is beyond its limits at a pose (m,), and by how much."""
    worst = max(
        limited_joints(robot, pose),
        key=lambda joint: max(joint.least - joint.value, joint.value - joint.most),
    )
    joint = f"leg {worst.leg}: the {worst.noun}" if worst.leg else worst.noun
    limits = worst.limits_text(lambda number, _: f"{number:g}")
    return f"{joint} comes to its limit, {worst.value:.5g} {worst.unit} of {limits}"


def first_singular(robot: Manipulator, poses: Array) -> int | None:
    """Return the first index of poses (T, m) at or beyond a singularity, or None.

    It is one of type II, or a constraint singularity of legs whose couples turn with the pose.
    """
    names = holding_measures(robot)
    measures = np.stack([numeric(robot, name)(poses)[0] for name in names], axis=-1)
    beyond = ~(measures * np.sign(measures[0]) > TYPE_II * best_holding(robot)).all(axis=-1)
    return int(beyond.argmax()) if beyond.any() else None


def singularity_text(robot: Manipulator, pose: Array) -> str:
    """Return the sentence that a pose (m,) is a type-II singularity, or one of the constraints."""
    if (holding_sizes(robot, pose) / best_holding(robot)).argmin():
        return f"constraint singularity at pose {pose_text(pose)}: the legs let the platform turn"
    return (
        f"singular (type II) at pose {pose_text(pose)}: the actuators no longer hold the platform"
    )
