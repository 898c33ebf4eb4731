"""The home pose of a machine in engines' files: the one given, or joints in mid-range."""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache

import numpy as np

from pteron.errors import ModelError
from pteron.kernels import Array, numeric
from pteron.kinematics import direct_kinematics, inverse_kinematics, random_poses
from pteron.kinematics.evaluate import finite_pose
from pteron.kinematics.sampling import holding_sizes
from pteron.manipulator import Manipulator
from pteron.shapes import PoseLike
from pteron.tolerances import ROUNDING
from pteron.workspace import home_pose
from pteron.workspace.home import has_exact_home

_GOOD = 0.1
"""Least singularity measures at which the middle of the joints' ranges is taken."""

_SEARCHES = ((200, 0.3), (200, 0.02), (200, 0.0))
"""Numbers of random poses, and least measures of them, that are tried in turn otherwise."""


def chosen_home(robot: Manipulator, home: PoseLike | None) -> Array:
    """Return the home pose argument, checked, or a default from the joints' ranges.

    Of a platform that tilts it is the home pose, which is level where that can be; so it is where
    the machine's file names its home.

    Raises
    ------
    DataError, UnreachablePose
        If the pose given is none, or out of reach.
    SingularPose
        If the machine is singular at every pose.
    """
    if home is None:
        return home_pose(robot) if has_exact_home(robot) else np.array(_middle(robot))
    pose = finite_pose(robot, home, "home")
    inverse_kinematics(robot, pose)
    return pose.copy()


@lru_cache(maxsize=64)
def _middle(robot: Manipulator) -> tuple[float, ...]:
    """Return the pose with all joints at mid-range; a joint without limits is at 0.

    Where no such pose is away from singularities it is the best of random ones, within the joints'
    limits if any are.
    """
    ranges = np.array([leg.limits or (0.0, 0.0) for leg in robot.legs])
    poses = np.empty((0, robot.freedom))
    if not robot.redundancy:  # whose mid-ranges belong to no pose
        poses = direct_kinematics(robot, ranges.mean(axis=1), on_failure="nan")
        poses = poses[np.isfinite(poses).all(axis=-1)]
    worth = _worth(robot, poses)
    if len(poses) and worth.max() >= _GOOD:
        return tuple((np.round(poses[_best(worth)], 12) + 0.0).tolist())
    for count, least in _SEARCHES:
        with suppress(ModelError):
            poses = random_poses(robot, count, type_i=least, type_ii=least)
            break
    else:
        raise ModelError(
            "no pose found in which all legs reach the platform; give one as home",
            subject=robot.name,
        )
    joints = inverse_kinematics(robot, poses)
    is_limited = np.array([leg.limits is not None for leg in robot.legs])
    beyond = (joints < ranges[:, 0]) | (joints > ranges[:, 1])
    worth = _worth(robot, poses) - (beyond & is_limited).any(axis=-1)
    return tuple((np.round(poses[_best(worth)], 6) + 0.0).tolist())


def _best(worth: Array) -> int:
    """Return the first index of the maximum up to rounding, which mirrored poses may share."""
    return int((worth >= worth.max() - ROUNDING).argmax())


def _worth(robot: Manipulator, poses: Array) -> Array:
    """Return the least measure (K,) of singularities of poses (K, m), below 0 beyond limits."""
    if not len(poses):
        return np.empty(0)
    bent = numeric(robot, "reach")(poses)[1].min(axis=-1)
    passive = numeric(robot, "passive_room")(poses)[0].min(axis=-1)
    worth = np.minimum(bent, holding_sizes(robot, poses).min(axis=-1))
    # A machine seldom works the wrong way round.
    turned = np.abs(poses[:, robot.platform.angular]).max(axis=1, initial=0.0)
    worth = np.minimum(worth, 1.0 - turned / np.pi)
    return np.asarray(np.nan_to_num(np.where(passive < 0.0, passive, worth), nan=-1.0))
