"""Poses of joint coordinates by Newton's method from many starts, where no method finds all.

P-R-U-R legs, and mixtures of legs that hold points in planes with others, have no list of all
poses. The starts are poses in reach, the same for every call, so that the result is repeatable; it
is not proved that no other pose exists.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array, numeric
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.kinematics.plane_poses import repeats
from pteron.kinematics.sampling import sample_poses, widest_box
from pteron.manipulator import Manipulator
from pteron.platforms.coordinates import wrap_angle
from pteron.tolerances import SAME

_STARTS = 1024
"""Number of starts. Of sixteen poses that `pteron.workspace.proved_poses` gives for a Pentapteron
and a 5-RPUR, the one that is hardest to find is the end of one start in 130: it is missed by one
set of starts in 2000."""

_BATCH, _BATCHES = 4096, 32
"""Poses drawn at a time, and batches after which random poses in the usual range fill up."""

_TOGETHER = 64
"""Joint coordinates searched at a time: some ten megabytes."""

_STEPS = 20
"""Number of Newton steps from each start; those that converge need five to fifteen."""

_MOST = 0.3
"""Longest step of an angle, rad, and of a length as a share of the legs' mean size."""

_CLOSED = 1e-10
"""Largest relative closure error of a pose."""


def searched_poses(robot: Manipulator, joints: Array) -> tuple[NDArray[np.int64], Array]:
    """Return poses (K, m) of joint coordinates (B, n) that Newton's method finds, and their rows.

    Joint coordinates are those of the robot's working mode. Other poses may exist.
    """
    parts = [_search(robot, joints[k : k + _TOGETHER]) for k in range(0, len(joints), _TOGETHER)]
    rows = [k * _TOGETHER + part for k, (part, _) in enumerate(parts)]
    return (
        np.concatenate([np.empty(0, np.int64), *rows]),
        np.concatenate([np.empty((0, robot.freedom)), *(poses for _, poses in parts)]),
    )


def _search(robot: Manipulator, joints: Array) -> tuple[NDArray[np.int64], Array]:
    """Return poses of a few joint coordinates, as `searched_poses` does."""
    starts = _starts(robot)
    size = float(np.mean([leg.size for leg in robot.legs]))
    most = _MOST * np.where(robot.platform.angular, 1.0, size)
    rows, poses = np.repeat(np.arange(len(joints)), len(starts)), np.tile(starts, (len(joints), 1))
    step = numeric(robot, "newton_step")
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            change = step(joints[rows], poses)[0] - poses
            longest = np.abs(change / most).max(axis=-1, keepdims=True)
            poses = poses + change / np.maximum(longest, 1.0)
            is_reached = np.isfinite(poses).all(axis=-1)
            rows, poses = rows[is_reached], poses[is_reached]
        is_closed = step(joints[rows], poses)[1].reshape(-1) < _CLOSED
    rows, poses = rows[is_closed], poses[is_closed]
    turning = robot.wraps
    poses[:, turning] = wrap_angle(poses[:, turning])

    def are_same(later: slice, earlier: slice) -> NDArray[np.bool_]:
        """Return whether poses are equal up to full turns."""
        away = poses[later] - poses[earlier]
        away[:, turning] = wrap_angle(away[:, turning])
        return np.asarray(np.abs(away).max(axis=-1, initial=0.0) < SAME)

    single = ~repeats(rows, are_same, len(starts))
    return rows[single], poses[single]


@lru_cache(maxsize=16)
def _starts(robot: Manipulator) -> Array:
    """Return the poses (k, m) from which poses are searched.

    They are the file's home, and random ones at any orientation that the legs reach.
    """
    rng, home = np.random.default_rng(0), [] if robot.home is None else [robot.home]
    low, high = widest_box(robot)
    turning = robot.wraps
    low[turning], high[turning] = -np.pi, np.pi
    starts = np.empty((0, robot.freedom))
    for _ in range(_BATCHES):
        poses = rng.uniform(low, high, (_BATCH, robot.freedom))
        joints = evaluate_unchecked(robot, "inverse_kinematics", poses)
        starts = np.vstack([starts, poses[np.isfinite(joints).all(axis=-1)]])
        if len(starts) >= _STARTS:
            return np.vstack([*home, starts[:_STARTS]])
    usual = sample_poses(robot, _STARTS - len(starts), rng, 1e-3, limits=False)
    return np.vstack([*home, starts, usual])
