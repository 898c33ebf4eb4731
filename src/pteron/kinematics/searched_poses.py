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
from pteron.kinematics.evaluate import evaluate_unchecked, same_joints
from pteron.kinematics.plane_poses import repeats
from pteron.kinematics.sampling import sample_poses, widest_box
from pteron.manipulator import Manipulator
from pteron.platforms.coordinates import wrap_angle
from pteron.tolerances import SAME

_STARTS = 16384
"""Number of starts. Of some thirty poses that `pteron.workspace.proved_poses` gives for machines
with five freedoms, those hardest to find are the end of one start in some thousands."""

_BATCH, _BATCHES = 4096, 128
"""Poses drawn at a time, and most batches."""

_ROWS = 4
"""Joint coordinates searched at a time: some ten megabytes."""

_STEPS = 20
"""Number of Newton steps from each start; those that converge need five to fifteen."""

_MOST = 0.3
"""Longest step of an angle, rad, and of a length as a share of the legs' mean size."""

_CLOSED = 1e-10
"""Longest last step to a pose, m or rad."""


def searched_poses(
    robot: Manipulator, joints: Array, *, any_branch: bool = False
) -> tuple[NDArray[np.int64], Array]:
    """Return poses (K, m) of joint coordinates (B, n) that Newton's method finds, and their rows.

    They are poses of the robot's working mode, or of any. Other poses may exist.
    """
    parts = [_search(robot, joints[k : k + _ROWS]) for k in range(0, len(joints), _ROWS)]
    all_rows = [k * _ROWS + rows for k, (rows, _) in enumerate(parts)]
    rows = np.concatenate([np.empty(0, np.int64), *all_rows])
    poses = np.concatenate([np.empty((0, robot.freedom)), *(poses for _, poses in parts)])
    if not any_branch:
        back = evaluate_unchecked(robot, "inverse_kinematics", poses)
        is_own = same_joints(robot, back, joints[rows]).all(axis=-1)
        rows, poses = rows[is_own], poses[is_own]
    return rows, poses


def _search(robot: Manipulator, joints: Array) -> tuple[NDArray[np.int64], Array]:
    """Return poses (K, m) of a few joint coordinates in all working modes, and their rows."""
    starts = _starts(robot)
    size = float(np.mean([leg.size for leg in robot.legs]))
    most = _MOST * np.where(robot.platform.angular, 1.0, size)
    rows, poses = np.repeat(np.arange(len(joints)), len(starts)), np.tile(starts, (len(joints), 1))
    step = numeric(robot, "any_branch_step")
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            change = step(joints[rows], poses)[0] - poses
            longest = np.abs(change / most).max(axis=-1, keepdims=True)
            poses = poses + change / np.maximum(longest, 1.0)
            is_finite = np.isfinite(poses).all(axis=-1)
            rows, poses = rows[is_finite], poses[is_finite]
        is_closed = step(joints[rows], poses)[1].reshape(-1) < _CLOSED
    rows, poses = rows[is_closed], poses[is_closed]
    turning = robot.wraps
    poses[:, turning] = wrap_angle(poses[:, turning])
    # Nearly all of the many that are the same are so in their first digits.
    digits = np.column_stack([rows, np.round(poses / SAME)])
    first = np.unique(digits, axis=0, return_index=True)[1]
    rows, poses = rows[first], poses[first]

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

    They are the file's home, and random ones: half of them in the usual range of poses, half at any
    orientation that the legs reach, as far as such are found.
    """
    rng, home = np.random.default_rng(0), [] if robot.home is None else [robot.home]
    usual = sample_poses(robot, _STARTS // 2, rng, 1e-3)
    low, high = widest_box(robot)
    turning = robot.wraps
    low[turning], high[turning] = -np.pi, np.pi
    anywhere = np.empty((0, robot.freedom))
    for _ in range(_BATCHES):
        poses = rng.uniform(low, high, (_BATCH, robot.freedom))
        joints = evaluate_unchecked(robot, "inverse_kinematics", poses)
        anywhere = np.vstack([anywhere, poses[np.isfinite(joints).all(axis=-1)]])
        if len(anywhere) >= _STARTS // 2:
            break
    return np.vstack([*home, usual, anywhere[: _STARTS // 2]])
