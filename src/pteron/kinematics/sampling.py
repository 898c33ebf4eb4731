"""Reachable poses drawn at random."""

from __future__ import annotations

import numpy as np

from pteron.conventions import BatchOfPoses
from pteron.errors import ModelError
from pteron.kernels import Array, numeric
from pteron.kinematics.singularities import is_singular_everywhere
from pteron.manipulator import Manipulator

__all__ = ["random_poses"]

_BATCH = 4096
_ATTEMPTS = 250
_SCOUTS = 100


def random_poses(
    robot: Manipulator,
    count: int,
    *,
    seed: int | np.random.Generator = 0,
    bend: float = 0.1,
    hold: float = 0.1,
) -> BatchOfPoses:
    """Return poses drawn at random from those in reach and away from singularities.

    Uniformly in position and orientation, within a box that holds all but the rarest corners.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    count : int
        How many poses.
    seed : int or numpy Generator
        Where the randomness comes from.
    bend : float
        Least sine of every elbow's angle (0 at a type-I singularity).
    hold : float
        Least ratio of abs(det J) to its largest value over all orientations (type II).

    Returns
    -------
    array, shape (count, m)
        m and rad.

    Raises
    ------
    ModelError
        If the legs have next to no common reach.

    Examples
    --------
    >>> import pteron
    >>> pteron.random_poses(pteron.load("quadrupteron"), 5).shape
    (5, 4)
    """
    rng = np.random.default_rng(seed)
    center, radius = _search_ball(robot)
    low, high = center - radius, center + radius
    coarse = _drawn(robot, low, high, min(count, _SCOUTS), rng, bend, hold)
    if len(coarse) >= count:
        return coarse[:count]
    # The ball is generous: with scouts in, their bounding box, widened, serves the rest.
    least, most = coarse[:, :3].min(axis=0), coarse[:, :3].max(axis=0)
    margin = 0.25 * (most - least)
    low, high = np.maximum(least - margin, low), np.minimum(most + margin, high)
    return _drawn(robot, low, high, count, rng, bend, hold)[:count]


def _drawn(
    robot: Manipulator,
    low: Array,
    high: Array,
    count: int,
    rng: np.random.Generator,
    bend: float,
    hold: float,
) -> Array:
    """Return at least `count` usable poses with positions drawn from a box."""
    held = 0.0 if is_singular_everywhere(robot) else hold
    found: list[Array] = []
    total = 0
    for _ in range(_ATTEMPTS + count // 16):
        poses = rng.uniform(-1.0, 1.0, (_BATCH, robot.freedom))
        poses[:, :3] = 0.5 * (low + high) + 0.5 * (high - low) * poses[:, :3]
        if robot.platform.turns:
            poses[:, 3] *= np.pi
        _, _, sine = numeric(robot, "reach")(poses)
        good = (sine >= bend).all(axis=-1)
        if held:
            good &= np.abs(numeric(robot, "regularity")(poses)) >= held
        found.append(poses[good])
        total += int(good.sum())
        if total >= count:
            return np.concatenate(found)
    raise ModelError(
        f"{robot.name}: only {total} of {_ATTEMPTS * _BATCH} random poses are in reach of all legs "
        "and away from singularities; bring the guide points nearer or lengthen the links"
    )


def _search_ball(robot: Manipulator) -> tuple[Array, float]:
    """Return a centre and a radius about it that hold every pose in reach.

    Leg i reaches c only within lu + ll of its guide line, measured perpendicular to d along e: at
    most (lu + ll) / abs(d . e) away. The centre is the point nearest to all the lines.
    """
    normal, right = np.zeros((3, 3)), np.zeros(3)
    reach = 0.0
    for leg in robot.legs:
        e, r = np.array(leg.e), np.array(leg.guide_point)
        across = np.eye(3) - np.outer(e, e)
        normal += across
        right += across @ r
        s = float(np.linalg.norm(leg.platform_point))
        slant = abs(float(np.dot(leg.direction, leg.e)))
        reach = max(reach, s + (leg.upper_length + leg.lower_length) / slant)
    center = np.linalg.lstsq(normal, right, rcond=None)[0]
    return np.asarray(center, dtype=float), 1.5 * reach
