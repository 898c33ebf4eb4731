"""Every pose of given joint coordinates of a machine whose platform tilts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator

_STARTS = 160
"""Poses to start from for each state."""

_STEPS = 30
"""Newton's steps from each."""

_ROUNDING = 1e-13
"""Greatest miss of a pose's closures, as a share of their terms."""

_SAME = 1e-7
"""Two poses within this, in rad and sizes of the machine, are one, found twice."""


def tilting_poses(robot: Manipulator, joints: Array) -> tuple[NDArray[np.int64], Array]:
    """Return which row of joint coordinates (B, n) each pose is of, in order, and the poses (K, m).

    Newton's steps lead there from many poses.
    """
    step, size = numeric(robot, "newton_step"), max(leg.size for leg in robot.legs)
    rows, poses = [np.empty(0, dtype=np.int64)], [np.empty((0, robot.freedom))]
    for row, q in enumerate(joints):
        if not np.isfinite(q).all():
            continue
        at = _starts(robot, size)
        with np.errstate(all="ignore"):
            for _ in range(_STEPS):
                before = at
                at = step(q, before)[0]
                at = at[np.isfinite(at).all(axis=-1)]
            missed = step(q, at)[1]
        found = _canonical(robot, at[missed <= _ROUNDING])
        place, axes = robot.platform.at(found)
        all_of = np.concatenate([place / size, axes.reshape(len(found), 9)], axis=-1)
        near = np.abs(all_of[:, None] - all_of).max(axis=-1, initial=0.0) < _SAME
        kept = found[near.argmax(axis=-1) == np.arange(len(found))] if len(found) else found
        rows.append(np.full(len(kept), row))
        poses.append(kept)
    return np.concatenate(rows), np.concatenate(poses)


def _starts(robot: Manipulator, size: float) -> Array:
    rng = np.random.default_rng(0)
    middle = np.mean([leg.guide_point for leg in robot.legs], axis=0)
    way = rng.normal(size=(_STARTS, 3))
    way *= size * np.cbrt(rng.uniform(size=(_STARTS, 1))) / np.linalg.norm(way, axis=-1)[:, None]
    angles = rng.uniform(-np.pi, np.pi, (_STARTS, len(robot.platform.angles)))
    lengths = (middle + way) @ robot.platform.directions.T
    return np.concatenate([lengths, angles], axis=-1)


def _canonical(robot: Manipulator, poses: Array) -> Array:
    """Return poses whose middle angle is within half a turn."""
    around = 2.0 * np.pi * np.round(poses / (2.0 * np.pi))
    poses = np.where(robot.platform.angular, poses - around, poses)
    for name, others in (("pitch", ("roll", "yaw")), ("ry", ("rx", "rz"))):
        if name in robot.coordinates:
            k = robot.coordinates.index(name)
            over = np.abs(poses[:, k]) > 0.5 * np.pi
            poses[over, k] = np.copysign(np.pi, poses[over, k]) - poses[over, k]
            for other in others:
                if other in robot.coordinates:
                    j = robot.coordinates.index(other)
                    poses[over, j] -= np.copysign(np.pi, poses[over, j])
    return poses
