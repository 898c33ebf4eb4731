"""Early ends of a simulation (limits, singularities, divergence): the state, and a sentence why."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array, numeric
from pteron.kernels.functions import TYPE_II
from pteron.kinematics.limits import limited_joints
from pteron.kinematics.singularities import best_type_ii
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
    """Return the first index of poses (T, m) at or beyond a type-II singularity, or None.

    Of legs whose couples vary with the pose, constraint singularities count too.
    """
    beyond = _has_crossed(robot, "type_ii", poses, TYPE_II * best_type_ii(robot))
    if any(leg.couples_vary for leg in robot.legs):
        beyond |= _has_crossed(robot, "constraint", poses, TYPE_II)
    return int(beyond.argmax()) if beyond.any() else None


def _has_crossed(robot: Manipulator, what: str, poses: Array, least: float) -> NDArray[np.bool_]:
    """Return whether a measure has no longer the sign of the first pose and a size of `least`."""
    measure = numeric(robot, what)(poses)[0]
    return np.asarray(~(measure * np.sign(measure[0]) > least))


def singularity_text(robot: Manipulator, pose: Array) -> str:
    """Return the sentence that a pose (m,) is a type-II or a constraint singularity."""
    type_ii = float(np.abs(numeric(robot, "type_ii")(pose)[0])) / best_type_ii(robot)
    if any(leg.couples_vary for leg in robot.legs) and type_ii > float(
        np.abs(numeric(robot, "constraint")(pose)[0])
    ):
        return (
            f"constraint singularity at pose {pose_text(pose)}: the legs leave the platform free "
            "to turn"
        )
    return (
        f"singular (type II) at pose {pose_text(pose)}: the actuators no longer hold the platform"
    )
