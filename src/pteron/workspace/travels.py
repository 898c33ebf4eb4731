"""How far a machine can go from a pose along and about each coordinate, and what stops it.

Samples along each coordinate find where a condition fails first; intervals prove the way there, in
pieces that halve towards that end and are divided further where the proof needs it. What is reached
is proved; that not much more is possible is shown by the condition that fails beyond it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kernels.bisection import bisect_condition
from pteron.kernels.functions import TYPE_II
from pteron.kinematics.architecture import expect_regular
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace.conditions import (
    Condition,
    condition_margins,
    conditions,
    interval_test,
    keeps,
)
from pteron.workspace.largest_proved import largest_proved
from pteron.workspace.regions import Box

_LAST = 1e-4
"""Length of the smallest piece that is proved, as a share of the travel that samples find."""

_HALVINGS = 13
"""Number of pieces of a travel, which halve towards its end: the last is about as long as _LAST."""

_SAMPLES, _FAR = 2000, 4.0
"""Poses sampled along each coordinate, and how far at first, in the legs' mean size or radians."""

_MOST = 100.0
"""Greatest travel, as a share of the legs' mean size; of an angle it is one turn."""

_BEYOND = 16
"""Number of last steps beyond what is proved, at most, at which the cause of the end is sought."""

_GRID, _TOLERANCE = 9, 5e-3
"""Poses along each side by which a box's size is sought, and by which share the proved one is
smaller at least."""

_FACES = 3
"""Poses along each side of a box by which its sides are chosen: the search costs little by them,
and the sides found are scaled and proved afterwards."""


@dataclass(frozen=True, eq=False, repr=False)
class Travel(Result):
    """How far a machine can go from a pose along each coordinate, the others held.

    Attributes
    ----------
    pose : array, shape (m,)
        The pose, m and rad.
    low, high : array, shape (m,)
        Travel to lesser values of each coordinate, not positive, and to greater ones, m or rad:
        every pose between is proved to keep the conditions. Infinite where nothing stops it.
    stops : tuple of pair of Condition or None
        What stops it there, to lesser and to greater values; None where nothing does.
    """

    pose: Array
    low: Array
    high: Array
    stops: tuple[tuple[Condition | None, Condition | None], ...]

    SHOWN = "pose low high"


def travel(
    robot: RobotLike, pose: PoseLike, *, given: tuple[Condition, ...] | None = None
) -> Travel:
    """Return how far a machine can go from a pose along each coordinate, proved, and what stops it.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, in its working mode.
    pose : array, shape (m,)
        The pose, m and rad.
    given : tuple of Condition, optional
        The conditions on a pose; by default reach, all joints' limits and no type-II singularity.

    Returns
    -------
    Travel
        At most 0.1 % shorter than the travel itself, unless intervals prove less.

    Raises
    ------
    ModelError
        If the pose itself does not keep the conditions.
    SingularPose
        If the machine is singular at every pose.

    Examples
    --------
    >>> from pteron.workspace import travel
    >>> found = travel("delta", [0.0, 0.0, -0.9])
    >>> found.low.round(3), str(found.stops[2][0])
    (array([-0.744, -0.765, -0.557]), 'leg 1: crank at its least')
    """
    robot = as_manipulator(robot)
    expect_regular(robot)
    center = finite_pose(robot, pose, "pose")
    required = conditions(robot, type_ii=TYPE_II) if given is None else given
    if not keeps(robot, required, center):
        margins = condition_margins(robot, required, center)
        failed = required[int(np.nan_to_num(margins, nan=-np.inf).argmin())]
        raise ModelError(f"pose: {center.tolist()} cannot be used: {failed}", subject=robot.name)
    angular, freedom = robot.platform.angular, robot.freedom
    size = float(np.mean([leg.size or 1.0 for leg in robot.legs]))
    farthest = np.tile(np.where(angular, 2.0 * math.pi, _MOST * size), 2)
    first = np.minimum(np.tile(np.where(angular, _FAR, _FAR * size), 2), farthest)
    # The first m directions lead to lesser values.
    ways = np.vstack([-np.eye(freedom), np.eye(freedom)])
    ends = [
        _sampled_end(robot, required, center + np.zeros_like(way), way, start, last)
        for way, start, last in zip(ways, first, farthest, strict=True)
    ]
    reached, open_bits = _proved_ways(robot, required, center, ways, np.array(ends))
    stops: list[Condition | None] = []
    for k, way in enumerate(ways):
        if reached[k] >= farthest[k]:
            reached[k] = np.inf
            stops.append(None)
            continue
        steps = _LAST * max(ends[k], _LAST * size) * np.arange(1, _BEYOND + 1)
        margins = condition_margins(robot, required, center + (reached[k] + steps)[:, None] * way)
        margins = np.nan_to_num(margins, nan=-np.inf)
        is_open = [bool(int(open_bits[k]) >> c & 1) for c in range(len(required))]
        stops.append(required[int(np.where(is_open, margins.min(axis=0), np.inf).argmin())])
    pairs = tuple(zip(stops[:freedom], stops[freedom:], strict=True))
    return Travel(center, -reached[:freedom], reached[freedom:], pairs)


def _sampled_end(
    robot: Manipulator,
    required: tuple[Condition, ...],
    center: Array,
    way: Array,
    first: float,
    most: float,
) -> float:
    """Return the distance along a way at which a condition fails first, by samples; or `most`.

    `first` is how far samples go at once, before they go on to `most`.
    """
    low, high = 0.0, first
    while True:
        distances = np.linspace(low, high, _SAMPLES + 1)
        failing = ~keeps(robot, required, center + distances[:, None] * way)
        if not failing.any():
            if high >= most:
                return most
            low, high = high, min(10.0 * high, most)
            continue
        k = max(int(failing.argmax()), 1)
        if high - low <= _LAST * _LAST * first:
            return float(distances[k - 1])
        low, high = distances[k - 1], distances[k]


def _proved_ways(
    robot: Manipulator,
    required: tuple[Condition, ...],
    center: Array,
    ways: Array,
    ends: Array,
) -> tuple[Array, NDArray[np.uint64]]:
    """Return how far along each way (k, m) conditions are proved, and bits of those open there."""
    test = interval_test(robot, required)
    shares = 1.0 - 0.5 ** np.arange(_HALVINGS + 1.0)
    shares[-1] = 1.0
    pieces = [list(pairwise(shares.tolist())) for _ in ways]
    reached, open_bits = np.zeros(len(ways)), np.full(len(ways), test.all)
    open_ = {k for k in range(len(ways)) if ends[k] > 0.0}
    while open_:
        tried = [(k, a, b) for k in sorted(open_) for a, b in pieces[k]]
        owner = np.array([k for k, _, _ in tried])
        spans = np.array([piece[1:] for piece in tried]) * ends[owner, None]
        corners = center + ways[owner][:, None] * spans[..., None]
        outside, undecided = test(
            corners.min(axis=1), corners.max(axis=1), np.full(len(tried), test.all)
        )
        holds = ~outside & (undecided == 0)
        for k in sorted(open_):
            own = np.flatnonzero(owner == k)
            failed = own[~holds[own]]
            if not len(failed):
                reached[k] = ends[k]
                open_.remove(k)
                continue
            reached[k] = spans[failed[0], 0]
            _, a, b = tried[failed[0]]
            if b - a <= _LAST:
                open_bits[k] = undecided[failed[0]] if not outside[failed[0]] else test.all
                open_.remove(k)
                continue
            # Only the pieces that are not proved are asked again, divided; the rest stays proved.
            pieces[k] = [
                (low + i * (high - low) / 4.0, low + (i + 1) * (high - low) / 4.0)
                for _, low, high in (tried[j] for j in failed)
                for i in range(4)
            ]
    return reached, open_bits


def largest_box(
    robot: RobotLike, pose: PoseLike, *, given: tuple[Condition, ...] | None = None
) -> Box:
    """Return the largest box of positions about a pose, by volume, proved.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, in its working mode.
    pose : array, shape (m,)
        The pose, m and rad; the box keeps its angles.
    given : tuple of Condition, optional
        As for `travel`.

    Returns
    -------
    Box
        Its sides are those of the largest volume that a search from the travels finds; the box is
        proved to within 0.5 % of them, or as far as intervals prove it.

    Raises
    ------
    ModelError
        If the pose does not keep the conditions, or nothing stops the machine in a direction.
    SingularPose
        If the machine is singular at every pose.

    Examples
    --------
    >>> from pteron.workspace import largest_box
    >>> box = largest_box("delta", [0.0, 0.0, -0.9])
    >>> [round(float(side), 2) for side in box.box[1] - box.box[0]]
    [0.78, 0.89, 0.35]
    """
    robot = as_manipulator(robot)
    travels = travel(robot, pose, given=given)
    required = conditions(robot, type_ii=TYPE_II) if given is None else given
    lengths = ~robot.platform.angular
    low, high = (np.where(lengths, part, 0.0) for part in (travels.low, travels.high))
    if not np.isfinite([low, high]).all():
        raise ModelError("nothing stops it in a direction: give limits", subject=robot.name)
    low, high = _best_sides(robot, required, travels.pose, low, high)
    inner = _grid(low, high, _GRID)

    def region(share: float) -> Box:
        """Return the box whose sides are a share of those sought."""
        return Box(*(tuple((travels.pose + share * part).tolist()) for part in (low, high)))

    shares = [(1.0 - _TOLERANCE) ** k for k in range(1, 21)]
    share, proof = largest_proved(
        robot, required, region, lambda size: travels.pose + size * inner, 1.0, 30, shares
    )
    return region(share if proof.holds else 0.0)


def _grid(low: Array, high: Array, count: int) -> Array:
    """Return a grid of poses (K, m) of a box, `count` along each side that has a length."""
    sides = zip(low, high, strict=True)
    grids = np.meshgrid(*(np.linspace(a, b, count if a < b else 1) for a, b in sides))
    return np.stack([grid.ravel() for grid in grids], axis=-1)


def _best_sides(
    robot: Manipulator, required: tuple[Condition, ...], center: Array, low: Array, high: Array
) -> tuple[Array, Array]:
    """Return the sides (m,), from the centre, of a large box: not beyond the travels low, high.

    The volume grows from that of the box whose sides are one share of the travels; where the search
    finds none that is larger, it is this box.
    """
    spans = np.stack([-low, high])
    moving = spans > 0.0
    lengths = moving.any(axis=0)
    corners = np.unique(
        np.where(lengths, _grid(-np.ones(len(low)), np.ones(len(low)), _FACES), 0.0), axis=0
    )

    def sides(shares: Array) -> Array:
        """Return the sides (2, m), m, of the box with these shares of the travels."""
        spread = np.zeros(spans.shape)
        spread[moving] = shares * spans[moving]
        return spread

    def margins(shares: Array) -> Array:
        """Return the conditions' margins at poses on the faces of a box."""
        less, more = sides(shares)
        poses = center + np.maximum(corners, 0.0) * more - np.maximum(-corners, 0.0) * less
        return np.nan_to_num(condition_margins(robot, required, poses), nan=-1.0).ravel()

    def loss(shares: Array) -> float:
        """Return minus the logarithm of a box's volume."""
        return -float(np.log(sides(shares).sum(axis=0)[lengths]).sum())

    count = int(moving.sum())
    first = np.full(
        count,
        bisect_condition(
            lambda share: bool((margins(np.full(count, share)) >= 0.0).all()), 0.0, 1.0, 20
        )[0],
    )
    if first[0] > 0.0:
        found = scipy.optimize.minimize(
            loss,
            first,
            bounds=[(1e-3, 1.0)] * count,
            constraints={"type": "ineq", "fun": margins},
            method="SLSQP",
        )
        shares = (1.0 - _LAST) * found.x
        if (margins(shares) >= 0.0).all() and loss(shares) < loss(first):
            less, more = sides(shares)
            return -less, more
    less, more = sides(np.ones(count))
    return -less, more
