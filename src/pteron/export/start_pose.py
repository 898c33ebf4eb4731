"""A pose for an exported model to start from: well in reach, within the joints' limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.kinematics.sampling import holding_measures
from pteron.manipulator import Manipulator
from pteron.workspace import home_pose
from pteron.workspace.home import has_exact_home
from pteron.workspace.margins import joint_distances

_TYPE_I, _TYPE_II = 0.01, 0.001
"""Least type-I and type-II measures of random poses that are tried."""

_SHARE = 0.5
"""Least measure of a good pose, as a share of the best pose's."""


def start_pose(robot: Manipulator) -> Array:
    """Return a start pose (m,): zero if it is far from singularities, else amid such poses.

    Of a platform that tilts it is the home pose, which is level where that can be; so it is where
    the machine's file names its home.

    Raises
    ------
    ModelError
        If the machine has no such pose.
    """
    if has_exact_home(robot):
        return home_pose(robot)
    poses = good_poses(robot)
    if len(poses) == 0:
        raise ModelError(f"{robot.name}: no pose was found within the joints' limits to start from")
    measures = _measures(robot, poses)
    enough = _SHARE * measures.max()
    poses = poses[measures >= enough]
    distances = np.linalg.norm(poses - np.median(poses, axis=0), axis=1)
    middle: Array = poses[distances.argmin()]
    rounded = np.array([float(f"{v:.3g}") for v in middle])
    for pose in (np.zeros(robot.freedom), rounded):
        if keeps_limits(robot, pose) and _measures(robot, pose) >= 0.9 * enough:
            return pose
    return middle


def good_poses(robot: Manipulator) -> Array:
    """Return random poses (k, m) away from singularities, within the joints' limits."""
    try:
        poses = random_poses(robot, 500, seed=1, type_i=_TYPE_I, type_ii=_TYPE_II)
    except ModelError:  # its measures are small everywhere: those that are large beside them
        poses = random_poses(robot, 500, seed=1)
    return poses[keeps_limits(robot, poses)]


def measures_of(robot: Manipulator, poses: Array) -> Array:
    """Return poses' distance (...) from singularities: least of type-I and twice type-II measures.

    It is NaN where a leg does not reach, or a joint is beyond its limits.
    """
    is_within = keeps_limits(robot, poses)
    measures = np.full(is_within.shape, np.nan)
    measures[is_within] = _measures(robot, poses[is_within])
    return measures


def _measures(robot: Manipulator, poses: Array) -> Array:
    """Return min(type-I measure, twice the holding measures) at poses (..., m) in reach."""
    bent = np.sqrt(evaluate_unchecked(robot, "squared_type_i", poses).min(axis=-1))
    measures = [evaluate_unchecked(robot, name, poses) for name in holding_measures(robot)]
    least: Array = np.minimum.reduce([bent, *(2.0 * np.abs(measure) for measure in measures)])
    return least


def keeps_limits(robot: Manipulator, poses: Array) -> NDArray[np.bool_]:
    """Return whether poses (..., m) are in reach with every joint within its limits."""
    joints = inverse_kinematics(robot, poses, on_failure="nan")
    return np.asarray((joint_distances(robot, joints) >= 0.0).all(axis=-1))
