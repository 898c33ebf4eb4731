"""Poses of joint coordinates by Newton's method from many starts, where no method finds all.

P-R-U-R legs, and mixtures of legs that hold points in planes with others, have no list of all
poses. The starts are poses in reach, the same for every call, so that the result is repeatable; it
is not proved that no other pose exists.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array, numeric, sharing_programs
from pteron.kinematics.plane_poses import repeats
from pteron.kinematics.sampling import sample_poses
from pteron.manipulator import Manipulator
from pteron.platforms.coordinates import wrap_angle
from pteron.tolerances import SAME

_STARTS = 48
"""Number of starts, chosen: twice as many found no further pose for three of four joint vectors, on
eleven machines."""

_STEPS = 20
"""Number of Newton steps from each start; those that converge need five to fifteen."""

_MOST = 0.3
"""Longest step of an angle, rad, and of a length as a share of the legs' mean size."""

_CLOSED = 1e-10
"""Largest relative closure error of a pose."""


def searched_poses(
    robot: Manipulator, joints: Array, modes: Sequence[Manipulator] = ()
) -> tuple[NDArray[np.int64], Array]:
    """Return poses (K, m) of joint coordinates (B, n) that Newton's method finds, and their rows.

    They are poses of the robot's working mode, or of `modes`. Other poses may exist.
    """
    starts = _starts(robot)
    size = float(np.mean([leg.size for leg in robot.legs]))
    most = _MOST * np.where(robot.platform.angular, 1.0, size)
    count = len(starts)
    all_rows = np.repeat(np.arange(len(joints)), count)
    repeated = joints[all_rows]
    rows, poses = np.empty(0, dtype=np.int64), np.empty((0, robot.freedom))
    with sharing_programs() if modes else nullcontext(), np.errstate(all="ignore"):
        for machine in modes or (robot,):
            newton_step, tried = numeric(machine, "newton_step"), np.tile(starts, (len(joints), 1))
            for _ in range(_STEPS):
                step = newton_step(repeated, tried)[0] - tried
                longest = np.abs(step / most).max(axis=-1, keepdims=True)
                tried = tried + step / np.maximum(longest, 1.0)
            residuals = newton_step(repeated, tried)[1]
            closed = np.flatnonzero(residuals.reshape(-1) < _CLOSED)
            rows, poses = np.append(rows, all_rows[closed]), np.vstack([poses, tried[closed]])
    order = np.argsort(rows, kind="stable")
    rows, poses = rows[order], poses[order]
    turning = robot.wraps
    poses[:, turning] = wrap_angle(poses[:, turning])

    def are_same(later: slice, earlier: slice) -> NDArray[np.bool_]:
        """Return whether poses are equal up to full turns."""
        away = poses[later] - poses[earlier]
        away[:, turning] = wrap_angle(away[:, turning])
        return np.asarray(np.abs(away).max(axis=-1, initial=0.0) < SAME)

    single = ~repeats(rows, are_same, int(np.bincount(rows, minlength=1).max()))
    return rows[single], poses[single]


@lru_cache(maxsize=16)
def _starts(robot: Manipulator) -> Array:
    """Return the poses (k, m) from which poses are searched.

    They are the file's home, and random ones, half of them within the joints' limits.
    """
    rng, home = np.random.default_rng(0), [] if robot.home is None else [robot.home]
    drawn = [
        sample_poses(robot, _STARTS // 2, rng, 1e-3, limits=limits) for limits in (True, False)
    ]
    return np.vstack([np.empty((0, robot.freedom)), *home, *drawn])
