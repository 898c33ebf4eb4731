"""How far a machine can go from a pose along and about each coordinate, and what stops it.

From the pose steps lead along each coordinate, each proved by intervals as a whole: a step doubles
where the proof holds, and halves where it does not. What is reached is proved; that not much more
is possible is shown by the condition that fails at the next steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kernels.functions import TYPE_II
from pteron.kinematics.architecture import expect_regular
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import RobotLike, as_manipulator
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

_FIRST, _LAST = 1e-3, 1e-4
"""First step, and the last one, as a share of what is reached: a length of the legs' mean size, or
a radian, counts as reached at first."""

_MOST = 100.0
"""Greatest travel, as a share of the legs' mean size; of an angle it is one turn."""

_BEYOND = 16
"""Number of last steps beyond what is proved, at most, at which the cause of the end is sought."""

_GRID, _TOLERANCE = 9, 5e-3
"""Poses along each side by which a box's size is sought, and by which share the proved one is
smaller at least."""


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
    test, angular, freedom = interval_test(robot, required), robot.platform.angular, robot.freedom
    size = float(np.mean([leg.size or 1.0 for leg in robot.legs]))
    unit = np.tile(np.where(angular, 1.0, size), 2)
    most = np.tile(np.where(angular, 2.0 * math.pi, _MOST * size), 2)
    # The first m directions lead to lesser values.
    ways = np.vstack([-np.eye(freedom), np.eye(freedom)])
    reached, step = np.zeros(2 * freedom), _FIRST * unit
    open_bits, active = np.full(2 * freedom, test.all), np.arange(2 * freedom)
    while len(active):
        ends = np.minimum(reached[active] + step[active], most[active])
        corners = center + ways[active][:, None] * np.stack([reached[active], ends], -1)[..., None]
        low, high = corners.min(axis=1), corners.max(axis=1)
        outside, undecided = test(low, high, np.full(len(active), test.all))
        is_proved = ~outside & (undecided == 0)
        open_bits[active] = np.where(is_proved, open_bits[active], undecided)
        reached[active] = np.where(is_proved, ends, reached[active])
        step[active] *= np.where(is_proved, 2.0, 0.5)
        smallest = _LAST * np.maximum(reached[active], _FIRST * unit[active])
        is_last = (~is_proved & (step[active] < smallest)) | (reached[active] >= most[active])
        active = active[~is_last]
    stops: list[Condition | None] = []
    for k, way in enumerate(ways):
        if reached[k] >= most[k]:
            reached[k] = np.inf
            stops.append(None)
            continue
        beyond = center + (reached[k] + 2.0 * step[k] * np.arange(1, _BEYOND + 1))[:, None] * way
        margins = np.nan_to_num(condition_margins(robot, required, beyond), nan=-np.inf)
        is_open = [bool(int(open_bits[k]) >> c & 1) for c in range(len(required))]
        stops.append(required[int(np.where(is_open, margins.min(axis=0), np.inf).argmin())])
    pairs = tuple(zip(stops[:freedom], stops[freedom:], strict=True))
    return Travel(center, -reached[:freedom], reached[freedom:], pairs)


def largest_box(
    robot: RobotLike, pose: PoseLike, *, given: tuple[Condition, ...] | None = None
) -> Box:
    """Return a box of positions about a pose, proved; its sides are one share of the travels.

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
        The largest one, to 0.5 % or as far as intervals prove it.

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
    [0.76, 0.74, 0.4]
    """
    robot = as_manipulator(robot)
    travels = travel(robot, pose, given=given)
    required = conditions(robot, type_ii=TYPE_II) if given is None else given
    lengths = ~robot.platform.angular
    low, high = (np.where(lengths, part, 0.0) for part in (travels.low, travels.high))
    if not np.isfinite([low, high]).all():
        raise ModelError("nothing stops it in a direction: give limits", subject=robot.name)
    sides = zip(low, high, strict=True)
    grids = np.meshgrid(*(np.linspace(a, b, _GRID if a < b else 1) for a, b in sides))
    inner = np.stack([grid.ravel() for grid in grids], axis=-1)

    def region(share: float) -> Box:
        """Return the box whose sides are a share of the travels."""
        return Box(*(tuple((travels.pose + share * part).tolist()) for part in (low, high)))

    shares = [(1.0 - _TOLERANCE) ** k for k in range(1, 21)]
    share, proof = largest_proved(
        robot, required, region, lambda size: travels.pose + size * inner, 1.0, 30, shares
    )
    return region(share if proof.holds else 0.0)
