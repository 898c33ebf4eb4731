"""Regions of poses proved to be free of type-II singularities, in interval arithmetic.

A region is cut into boxes until the type-II measure, whose bounds in a box are proved, has one sign
in each. A pose at which it vanishes is sought in floating point: between poses at which it has
opposite signs, and from boxes that are left by Newton's steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pteron.equations.machine import closure_of, numbers
from pteron.errors import DataError
from pteron.kernels import Array, as_array, bounds, numeric
from pteron.kernels.bisection import bisect_condition
from pteron.kinematics.architecture import is_singular_everywhere
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result
from pteron.workspace.boxes import halve_boxes
from pteron.workspace.conditions import conditions
from pteron.workspace.regions import Box
from pteron.workspace.smooth_conditions import smooth_conditions

_SAMPLES = 4096
"""Random poses at which the measure's sign is evaluated first."""

_PAIRS = 64
"""Pairs of poses of opposite sign between which a singular pose is sought."""

_HALVINGS = 60
"""Bisections between the poses of a pair."""

_STEPS = 12
"""Newton's steps towards a singular pose from the middle of a box."""

_STARTS = 32
"""Boxes from whose middles a singular pose is sought, between two rounds."""

_SINGULAR = 1e-10
"""Largest measure of a pose that counts as singular."""


@dataclass(frozen=True, eq=False, repr=False)
class FreeRegion(Result):
    """Whether a region of poses is free of type-II singularities.

    Attributes
    ----------
    free : bool or None
        True: proved, for every pose of the region that is in reach. False: `pose` is singular.
        None: neither was found within the number of boxes.
    pose : array, shape (m,), or None
        A singular pose in the region.
    measure : float
        Size of the type-II measure: its proved floor where the region is free, that of
        `pose` where it is not; 0 where it is undecided.
    boxes : int
        Number of boxes that were examined.
    undecided : array, shape (K, 2, m)
        The boxes that are left, least and greatest pose of each; none where it is decided.
    """

    free: bool | None
    pose: Array | None
    measure: float
    boxes: int
    undecided: Array


def free_of_singularities(
    robot: RobotLike, region: Box | ArrayLike, *, floor: float = 0.0, most: int = 100_000
) -> FreeRegion:
    """Return whether a region is proved free of type-II singularities, or a singular pose in it.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    region : Box, or array of shape (2, m)
        The least and the greatest pose, m and rad; a coordinate may have one value.
    floor : float
        Least size of the type-II measure that is to be proved, 1e-10 at least; a pose counts as
        singular only where the measure vanishes, to that size.
    most : int
        Boxes after which it is given up.

    Returns
    -------
    FreeRegion

    Raises
    ------
    DataError
        If the region is none.

    Examples
    --------
    >>> from pteron.workspace import free_of_singularities
    >>> low, high = [-0.03, -0.03, -0.03, -1.2], [0.03, 0.03, 0.03, 1.2]
    >>> free_of_singularities("quadrupteron", [low, high]).free
    True
    >>> found = free_of_singularities("quadrupteron", [low, [0.03, 0.03, 0.03, 2.0]])
    >>> found.free, round(float(found.pose[3]), 9)
    (False, 1.570796327)
    """
    robot = as_manipulator(robot)
    corners = region.box if isinstance(region, Box) else region
    box = as_array(corners, "region", (2, robot.freedom))
    if box.ndim != 2 or not np.isfinite(box).all() or (box[0] > box[1]).any():
        raise DataError(
            f"region: {box.tolist()} given, the least and the greatest pose expected, finite"
        )
    no_boxes = np.empty((0, 2, robot.freedom))
    singular_pose = _singular_between_samples(robot, box)
    if singular_pose is not None:
        return _refutation(robot, singular_pose, 0)
    sizes = np.where(box[1] > box[0], box[1] - box[0], np.inf)
    if closure_of(robot).orientation is not None:
        sizes[~robot.platform.angular] = np.inf  # it depends on the angle alone
    boxes, examined, least = box[None], 0, np.inf
    nearest = max(floor, _SINGULAR)  # no float is a root of cos: an end of the region may be one
    while len(boxes):
        examined += len(boxes)
        measure = bounds(robot, "type_ii", boxes)["type_ii"]
        size = np.where(measure.low > 0.0, measure.low, -measure.high)
        nonsingular = (size > nearest) & (size < np.inf)  # NaN is neither
        reach = bounds(robot, "squared_type_i", boxes)["squares"].high
        unreachable = (reach < 0.0).any(axis=-1)
        least = float(np.min(size[nonsingular], initial=least))
        boxes = boxes[~(nonsingular | unreachable)]
        if not len(boxes):
            break
        singular_pose = _singular_by_steps(robot, box, boxes)
        if singular_pose is not None:
            return _refutation(robot, singular_pose, examined)
        if examined + 2 * len(boxes) > most:
            return FreeRegion(None, None, 0.0, examined, boxes)
        boxes = halve_boxes(boxes, sizes)
    return FreeRegion(True, None, least if np.isfinite(least) else 0.0, examined, no_boxes)


def _refutation(robot: Manipulator, pose: Array, examined: int) -> FreeRegion:
    """Return the result for a region with a singular pose, which is not free of them."""
    measure = abs(float(numeric(robot, "type_ii")(pose)[0]))
    return FreeRegion(False, pose, measure, examined, np.empty((0, 2, robot.freedom)))


def _reachable_measures(robot: Manipulator, poses: Array) -> Array:
    """Return the type-II measure of poses (..., m), NaN out of reach."""
    measures = numeric(robot, "type_ii")(poses)[0]
    reachable = (numeric(robot, "squared_type_i")(poses)[0] >= 0.0).all(axis=-1)
    return np.where(reachable, measures, np.nan)


def _singular_between_samples(robot: Manipulator, region: Array) -> Array | None:
    """Return a singular pose between random poses of opposite sign, or None."""
    rng = np.random.default_rng(0)
    poses = rng.uniform(region[0], region[1], (_SAMPLES, robot.freedom))
    measures = _reachable_measures(robot, poses)
    if is_singular_everywhere(robot) and (~np.isnan(measures)).any():
        return np.asarray(poses[~np.isnan(measures)][0])
    order = np.argsort(np.abs(measures))
    negatives, positives = (
        poses[order[side[order]]][:_PAIRS] for side in (measures < 0.0, measures > 0.0)
    )
    count = min(len(negatives), len(positives))
    if not count:
        return None
    negative, _ = bisect_condition(
        lambda poses: (_reachable_measures(robot, poses) < 0.0)[:, None],
        negatives[:count],
        positives[:count],
        _HALVINGS,
    )
    return _least_singular(robot, negative)


def _singular_by_steps(robot: Manipulator, region: Array, boxes: Array) -> Array | None:
    """Return a singular pose of the region, by Newton's method from boxes' middles."""
    chosen = boxes[np.linspace(0, len(boxes) - 1, min(len(boxes), _STARTS)).astype(int)]
    poses = chosen.mean(axis=1)
    smooth = smooth_conditions(robot, conditions(robot, type_ii=_SINGULAR)[-1:])
    geometry = np.array(numbers(robot))
    free = region[1] > region[0]
    for _ in range(_STEPS):
        slopes = np.where(free, smooth.slopes(geometry, poses, 1.0)[1][:, 0], 0.0)
        squares = (slopes * slopes).sum(axis=-1)
        steps = _reachable_measures(robot, poses) / np.where(squares > 0.0, squares, np.inf)
        stepped_poses = np.clip(poses - steps[:, None] * slopes, *region)
        poses = np.where(
            np.isfinite(stepped_poses).all(axis=-1, keepdims=True), stepped_poses, poses
        )
    return _least_singular(robot, poses)


def _least_singular(robot: Manipulator, poses: Array) -> Array | None:
    """Return the pose of a batch with the least measure if it is singular, else None."""
    sizes = np.abs(_reachable_measures(robot, poses))
    if np.isnan(sizes).all():
        return None
    best = int(np.nanargmin(sizes))
    return np.asarray(poses[best]) if sizes[best] <= _SINGULAR else None
