"""Which assembly mode a log was recorded in."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from pteron.errors import DataError
from pteron.identification.logs import Log
from pteron.kernels import Array, numeric
from pteron.kinematics import direct_kinematics
from pteron.manipulator import Manipulator
from pteron.workspace import home_pose

__all__ = ["assembly_mode"]

_LOOK = 1000
"""Samples of the measured pose that decide."""


def assembly_mode(robot: Manipulator, log: Log) -> int:
    """Return the column of `direct_kinematics`, from 0, that a log follows.

    A column stands for one assembly mode throughout, between the singular orientations: to follow
    it is to follow the motion by continuity. The description's choice counts first, then the
    measured pose, if there is one, and else the mode of the machine's home pose.

    Raises
    ------
    DataError
        If the description names a mode that the machine has not.
    """
    if not robot.platform.turns:
        return 0
    declared = log.description.assembly_mode
    if declared is not None:
        if declared not in (1, 2):
            raise DataError(f"{log.source}: assembly_mode = {declared}; {robot.name} has 1 and 2")
        return declared - 1
    if log.pose is not None:
        step = max(log.rows // _LOOK, 1)
        poses = direct_kinematics(robot, log.sliders[::step])
        return int(np.argmin(_distances(poses, log.pose[::step])))
    return _home_mode(robot)


@lru_cache(maxsize=64)
def _home_mode(robot: Manipulator) -> int:
    # The first mode has the positive determinant; see `pteron.direct_kinematics`.
    return int(numeric(robot, "regularity")(home_pose(robot)) < 0.0)


def _distances(poses: Array, measured: Array) -> Array:
    """Return how far each mode's poses are from the measured ones: position and half-chord."""
    position = np.linalg.norm(poses[..., :3] - measured[:, None, :3], axis=-1)
    angle = np.abs(np.sin(0.5 * (poses[..., 3] - measured[:, None, 3])))
    off = np.nan_to_num(position + angle, nan=np.inf)
    return np.asarray(np.median(off, axis=0))
