"""The workspace as a set of boxes: some proved inside, some undecided, all else proved outside."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.arguments import expect
from pteron.errors import DataError
from pteron.kernels import Array, as_array
from pteron.kinematics.architecture import expect_regular
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace.boxes import halve_boxes, vary_coordinates
from pteron.workspace.conditions import Condition, IntervalTest, conditions, interval_test
from pteron.workspace.enclosing import enclosing_box
from pteron.workspace.volume import expect_places

_SLICE = 1 << 16
"""Boxes between two looks at whether the tolerance is met."""

_FACE = 1e-6
"""Share of the smallest box's side within which a pose counts as on its face."""

_SMALLEST = 1e-18
"""Volume below which boxes are not halved."""


@dataclass(frozen=True, eq=False, repr=False)
class Paving(Result):
    """A machine's workspace in boxes, at an orientation or over an interval of orientations.

    Attributes
    ----------
    robot : Manipulator
        The machine, in its working mode.
    conditions : tuple of Condition
        The conditions on a pose.
    box : array, shape (2, m)
        The region: least and greatest pose. Nothing is said of poses outside of it.
    inner : array, shape (N, 2, k)
        Boxes that are proved to lie inside: their corners, of the k coordinates that vary.
    boundary : array, shape (M, 2, k)
        Boxes of which that is not decided. Everything else in `box` is proved to lie outside.
    axes : tuple of str
        The coordinates that vary: ``("x", "y", "z")`` at one orientation in space.
    inner_volume, outer_volume : float
        The volume is proved to be between them.
    unit : str
        Unit of both: "m^3", "m^2", or with "rad" where an angle varies.
    complete : bool
        Whether the tolerance was met before there were too many boxes.
    """

    ROWS = "inner:2"

    robot: Manipulator = field(repr=False)
    conditions: tuple[Condition, ...] = field(repr=False)
    box: Array = field(repr=False)
    inner: Array = field(repr=False)
    boundary: Array = field(repr=False)
    axes: tuple[str, ...]
    inner_volume: float
    outer_volume: float
    unit: str
    complete: bool

    @property
    def gap(self) -> float:
        """The undecided volume, as a share of that proved inside."""
        undecided = self.outer_volume - self.inner_volume
        if not undecided:
            return 0.0
        return undecided / self.inner_volume if self.inner_volume else math.inf

    @cached_property
    def causes(self) -> NDArray[np.bool_]:
        """Whether each condition (M, C) is undecided in each box of the boundary."""
        test, parts = interval_test(self.robot, self.conditions), []
        for start in range(0, len(self.boundary), _SLICE):
            low, high = self.corners(self.boundary[start : start + _SLICE])
            parts.append(test.undecided_conditions(low, high))
        return np.concatenate([np.empty((0, len(self.conditions)), bool), *parts])

    def corners(self, boxes: Array) -> tuple[Array, Array]:
        """Return the least and greatest poses (B, m) of boxes (B, 2, k)."""
        return _corners(self.box, np.flatnonzero(self.box[0] < self.box[1]), boxes)

    def boundary_of(self, condition: Condition) -> Array:
        """Return the boxes (B, 2, k) of the boundary in which only a condition is undecided.

        Where several are, edges meet.
        """
        alone = self.causes.sum(axis=1) == 1
        chosen = alone & self.causes[:, self.conditions.index(condition)]
        return np.asarray(self.boundary[chosen])

    @cached_property
    def boundary_shares(self) -> dict[str, float]:
        """The shares of the boundary's boxes in which a single condition is undecided, by cause.

        Conditions that end it nowhere are left out, the greatest share comes first. What is left of
        1 are boxes in which several are undecided: edges meet there, or boxes are large.
        """
        alone = self.causes[self.causes.sum(axis=1) == 1].sum(axis=0) / max(len(self.causes), 1)
        shares = {str(c): float(s) for c, s in zip(self.conditions, alone, strict=True) if s}
        return dict(sorted(shares.items(), key=lambda pair: -pair[1]))

    def group_by_size(self, boxes: Array) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """Yield how often each side was halved (k,) and lattice indices (P, k), by box size."""
        moving = np.flatnonzero(self.box[0] < self.box[1])
        start, size = self.box[0, moving], (self.box[1] - self.box[0])[moving]
        depths = np.round(np.log2(size / (boxes[:, 1] - boxes[:, 0]))).astype(np.int64)
        for depth in np.unique(depths, axis=0):
            least = boxes[(depths == depth).all(axis=1), 0]
            yield depth, np.round((least - start) / size * 2.0**depth).astype(np.int64)

    @cached_property
    def _cells(self) -> list[tuple[int, NDArray[np.int64], Array]]:
        """Boxes grouped by size: the verdict, the halvings of each side, and sorted keys."""
        return [
            (verdict, depth, np.sort(_keys(cells, depth)))
            for boxes, verdict in ((self.inner, 1), (self.boundary, 0))
            for depth, cells in self.group_by_size(boxes)
        ]

    def locate(self, poses: ArrayLike) -> NDArray[np.int8]:
        """Return 1 for poses (..., m) that are proved inside, -1 outside, 0 where undecided.

        Nothing is decided of poses outside of `box`, nor of those on the faces of boxes.
        """
        array = as_array(poses, "poses", (self.box.shape[1],))
        flat = array.reshape(-1, self.box.shape[1])
        moving = [self.robot.coordinates.index(axis) for axis in self.axes]
        start, size = self.box[0, moving], (self.box[1] - self.box[0])[moving]
        places = (flat[:, moving] - start) / size
        verdicts = np.full(len(flat), -1, np.int8)
        finest = np.zeros(len(moving))
        for verdict, depth, keys in self._cells:
            open_rows = np.flatnonzero(verdicts < 0)
            cell_keys = _keys(np.floor(places[open_rows] * 2.0**depth), depth)
            positions = np.minimum(np.searchsorted(keys, cell_keys), len(keys) - 1)
            verdicts[open_rows[keys[positions] == cell_keys]] = verdict
            finest = np.maximum(finest, depth)
        fine = places * 2.0**finest
        on_face = (np.abs(fine - np.round(fine)) < _FACE).any(axis=1)
        outside = ((flat < self.box[0]) | (flat > self.box[1])).any(axis=1)
        verdicts[on_face | outside] = 0
        return verdicts.reshape(array.shape[:-1])


def _keys(cells: NDArray[Any], depth: NDArray[np.int64]) -> Array:
    """Return a unique number of each cell (P, k) of a lattice, and others for cells outside."""
    weights = np.cumprod(np.append(1.0, 2.0 ** depth[:-1] + 2.0))
    return np.asarray(np.clip(cells + 1.0, 0.0, 2.0**depth + 1.0) @ weights)


def paving(
    robot: RobotLike,
    pose: PoseLike,
    *,
    tolerance: float = 0.01,
    within: ArrayLike | None = None,
    given: tuple[Condition, ...] | None = None,
    most: int = 6_000_000,
) -> Paving:
    """Return the workspace at the orientation of a pose, as boxes proved inside or outside.

    Boxes are halved until what is undecided is small enough beside what is inside. In each one
    interval arithmetic decides (see `pteron.kernels.bounds`): all that is kept in all of the box is
    not asked again of its halves.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, in its working mode.
    pose : array, shape (m,)
        Gives the orientation, m and rad.
    tolerance : float
        Greatest undecided volume, as a share of the inner one.
    within : array, shape (2, k) or (2, m), optional
        Least and greatest position that are looked at; by default a box that is proved to hold the
        whole workspace. With angles too, the workspace over an interval of orientations.
    given : tuple of Condition, optional
        The conditions on a pose; by default `conditions(robot)`: reach and limits.
    most : int
        Undecided boxes at which it ends, whatever the tolerance.

    Returns
    -------
    Paving
        Its volumes are 0 where it is proved that no position serves.

    Raises
    ------
    ModelError
        If the reach has no end.
    DataError
        If the tolerance is not positive, or the box is none.
    SingularPose
        If the machine is singular at every pose.

    Examples
    --------
    >>> from pteron.workspace import paving
    >>> found = paving("five-bar", [0.0, 0.3], tolerance=0.05)
    >>> found.complete, found.inner_volume < found.outer_volume < 1.05 * found.inner_volume
    (True, True)
    """
    robot = as_manipulator(robot)
    reference = finite_pose(robot, pose, "pose")
    # The undecided part may be larger than what is inside: a tolerance above 1.
    expect(0.0 < tolerance < np.inf, "tolerance", repr(tolerance), "a share above 0")
    expect_regular(robot)
    if within is None:
        expect_places(robot, "say within which angles")
    box = region_box(robot, reference, within)
    required = conditions(robot) if given is None else given
    inner, boundary, complete = _refine_boxes(interval_test(robot, required), box, tolerance, most)
    axes = tuple(robot.coordinates[i] for i in np.flatnonzero(box[0] < box[1]))
    volumes = [math.fsum(np.prod(b[:, 1] - b[:, 0], axis=1)) for b in (inner, boundary)]
    turning = sum(axis in robot.platform.angles for axis in axes)
    powers = (("m", len(axes) - turning), ("rad", turning))
    unit = " ".join(f"{name}^{k}" if k > 1 else name for name, k in powers if k)
    return Paving(
        robot, required, box, inner, boundary, axes, volumes[0], sum(volumes), unit, complete
    )


def region_box(robot: Manipulator, reference: Array, within: ArrayLike | None) -> Array:
    """Return the least and the greatest pose (2, m) of the region to be paved."""
    box = np.array([reference, reference])
    count = len(robot.platform.lengths)
    if within is None:
        box[:, :count] = enclosing_box(robot, reference, reference)
        return box
    limits = np.asarray(within, dtype=float)
    shapes = (2, count), (2, len(reference))
    if limits.shape not in shapes or not (np.isfinite(limits) & (limits[0] <= limits[1])).all():
        raise DataError(
            f"within: least and greatest position expected, finite, shape (2, {count}) or, with "
            f"{' and '.join(robot.platform.angles) or 'all coordinates'}, (2, {len(reference)})"
        )
    box[:, : limits.shape[1]] = limits
    return box


def _refine_boxes(
    test: IntervalTest, box: Array, tolerance: float, most: int
) -> tuple[Array, Array, bool]:
    """Return inner and undecided boxes, and whether the tolerance is met."""
    moving = np.flatnonzero(box[0] < box[1])
    inner_boxes: list[Array] = []
    boxes, open_bits = box[None][:, :, moving], np.array([test.all])
    inside, undecided = 0.0, math.inf
    first = True
    while len(boxes):
        halves = boxes if first else halve_boxes(boxes[:1])
        volume = float(np.prod(halves[0, 1] - halves[0, 0]))
        undecided = volume * len(boxes) * len(halves)
        met, undecided_boxes, undecided_bits = False, [], []
        for start in range(0, len(boxes), _SLICE):
            untested = slice(start + _SLICE, None)
            part, bits = boxes[start : start + _SLICE], open_bits[start : start + _SLICE]
            if not first:
                part, bits = halve_boxes(part), np.repeat(bits, 2)
            outside, bits = test(*_corners(box, moving, part), bits)
            inner = (bits == 0) & ~outside
            inner_boxes.append(part[inner])
            undecided_boxes.append(part[~inner & ~outside])
            undecided_bits.append(bits[~inner & ~outside])
            inside += volume * int(inner.sum())
            undecided -= volume * int((inner | outside).sum())
            met = inside > 0.0 and undecided <= tolerance * inside
            if met or sum(map(len, undecided_boxes)) + len(boxes[untested]) > most:
                return (
                    np.concatenate(inner_boxes),
                    np.concatenate([*undecided_boxes, boxes[untested]]),
                    met,
                )
        boxes, open_bits = np.concatenate(undecided_boxes), np.concatenate(undecided_bits)
        first = False
        if volume < _SMALLEST:
            return np.concatenate(inner_boxes), boxes, False
    return np.concatenate(inner_boxes), boxes, True


def _corners(box: Array, moving: NDArray[np.intp], boxes: Array) -> tuple[Array, Array]:
    """Return the corners (B, m) of boxes (B, 2, k) of the varying coordinates."""
    return vary_coordinates(box[0], boxes[:, 0], moving), vary_coordinates(
        box[1], boxes[:, 1], moving
    )
