"""A pose that a written model can start from: well in reach, within the joints' limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.kinematics.evaluate import unchecked
from pteron.manipulator import Manipulator

_LEAST = ((0.3, 0.15), (0.1, 0.05), (0.03, 0.01), (0.01, 0.001))
"""Type-I and type-II measures that are asked for, one after the other."""

_DIGITS = 3


def start_pose(robot: Manipulator) -> Array:
    """Return a pose (m,) to start from: zero if it is a good one, else amid the good ones.

    Raises
    ------
    ModelError
        If the machine has no such pose.
    """
    for type_i, type_ii in _LEAST:
        poses = good_poses(robot, type_i, type_ii)
        if len(poses) == 0:
            continue
        apart = np.linalg.norm(poses - np.median(poses, axis=0), axis=1)
        middle: Array = poses[apart.argmin()]
        rounded = np.array([float(f"{v:.{_DIGITS}g}") for v in middle])
        for pose in (np.zeros(robot.freedom), rounded):
            bent = (unchecked(robot, "squared_type_i", pose) >= type_i**2).all()
            held = abs(unchecked(robot, "type_ii", pose)) >= type_ii
            if bent and held and keeps_limits(robot, pose):
                return pose
        return middle
    raise ModelError(f"{robot.name}: no pose was found within the joints' limits to start from")


def good_poses(robot: Manipulator, type_i: float, type_ii: float) -> Array:
    """Return random poses (k, m) with at least these measures, within the joints' limits."""
    try:
        poses = random_poses(robot, 500, seed=1, type_i=type_i, type_ii=type_ii)
    except ModelError:
        return np.empty((0, robot.freedom))
    return poses[keeps_limits(robot, poses)]


def keeps_limits(robot: Manipulator, poses: Array) -> NDArray[np.bool_]:
    """Return whether poses (..., m) are in reach with every joint within its limits."""
    joints = inverse_kinematics(robot, poses, on_failure="nan")
    least, most = joint_limits(robot)
    return np.asarray((np.isfinite(joints) & ~((joints < least) | (joints > most))).all(axis=-1))


def joint_limits(robot: Manipulator) -> tuple[Array, Array]:
    """Return the joints' limits (n,) each, m or rad; NaN where there are none."""
    limits = [leg.limits or (np.nan, np.nan) for leg in robot.legs]
    least, most = np.array(limits).T
    return least, most
