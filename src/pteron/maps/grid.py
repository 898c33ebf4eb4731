"""Grids of poses: coordinates that vary in equal steps, and fixed values of the others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import product
from math import isfinite, prod
from numbers import Integral
from sys import float_info
from typing import Any, Self

import numpy as np

from pteron.arguments import checked_arguments
from pteron.errors import DataError, ModelError, shorten
from pteron.kernels import Array
from pteron.kinematics.evaluate import finite_pose
from pteron.kinematics.unlikely_values import unlikely_values
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.platforms.coordinates import COORDINATES, coordinate
from pteron.renamed import former_attribute
from pteron.shapes import PoseLike
from pteron.workspace import bounding_box, home_pose

_POINTS = {1: 400, 2: 200, 3: 100, 4: 40, 5: 16, 6: 10}
"""Points along each axis, by the number of axes, where none is given: enough for a picture."""

_TURNS = 5
"""Values of one varying angle at which the box of the reach is found; the grid spans all boxes."""

_HUGE = float_info.max
"""The largest finite number."""

_CHUNK = 1 << 17
"""Greatest number of poses of a chunk: a second's work or less, a megabyte for each index."""

Region = tuple[slice, ...]
"""A part of a grid: a slice of each axis."""


@dataclass(frozen=True)
class Axis:
    """A coordinate that varies, in equal steps.

    Attributes
    ----------
    name : str
        A coordinate of `pteron.platforms.coordinates`, such as ``x`` or ``phi``.
    least, greatest : float
        The first and the last value, m or rad.
    count : int
        Number of values, 2 or more.

    Raises
    ------
    DataError
        If the name is no coordinate, the values do not ascend, or the count is below 2.
    """

    name: str
    least: float
    greatest: float
    count: int

    def __post_init__(self) -> None:
        if self.name not in COORDINATES:
            raise DataError(
                f"name: {shorten(self.name)} given, one of {', '.join(COORDINATES)} expected"
            )
        least, greatest = (
            _number(f"{self.name}: {key}", getattr(self, key)) for key in ("least", "greatest")
        )
        if not least < greatest or not isfinite(greatest - least):
            raise DataError(
                f"{self.name}: from {least:g} to {greatest:g} given, an ascending range expected"
            )
        if isinstance(self.count, bool) or not isinstance(self.count, Integral):
            raise DataError(
                f"{self.name}: {shorten(self.count)} points given, a whole number expected"
            )
        if self.count < 2:
            raise DataError(f"{self.name}: {self.count} points given, at least 2 expected")
        for key, bound in (("least", least), ("greatest", greatest), ("count", int(self.count))):
            object.__setattr__(self, key, bound)

    @property
    def values(self) -> Array:
        """The values, shape (count,), m or rad."""
        return np.linspace(self.least, self.greatest, self.count)

    @property
    def unit(self) -> str:
        """Unit of the values: ``m`` or ``rad``."""
        return coordinate(self.name).unit


@checked_arguments
@dataclass(frozen=True)
class Grid:
    """Poses with some coordinates varied on a grid and the others fixed.

    Attributes
    ----------
    coordinates : tuple of str
        All coordinates of a pose, in order.
    pose : tuple of float
        A pose with the values that are held, m and rad; coordinates that vary are at the middle of
        their range.
    axes : tuple of Axis
        The coordinates that vary, in the order of the pose; one array axis each.

    Raises
    ------
    DataError
        If the pose does not have a finite number for each coordinate, or the axes are not some of
        the coordinates, each once and in their order.
    """

    coordinates: tuple[str, ...]
    pose: tuple[float, ...]
    axes: tuple[Axis, ...]

    def __post_init__(self) -> None:
        names, varying = list(self.coordinates), [axis.name for axis in self.axes]
        if not names or names != [name for name in COORDINATES if name in names]:
            raise DataError(
                f"coordinates: {shorten(names)} given, some of {', '.join(COORDINATES)} expected, "
                "each once and in this order"
            )
        if varying != [name for name in names if name in varying]:
            raise DataError(
                f"axes: {shorten(varying)} given, some of {', '.join(names)} expected, each once "
                "and in this order"
            )
        if len(self.pose) != len(names):
            raise DataError(f"pose: {len(self.pose)} numbers given, {' '.join(names)} expected")
        pose = tuple(_number(f"pose: {n}", x) for n, x in zip(names, self.pose, strict=True))
        object.__setattr__(self, "pose", pose)

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Self:
        """Return the grid from its `plain` form."""
        axes = tuple(Axis(**axis) for axis in plain["axes"])
        return cls(tuple(plain["coordinates"]), tuple(plain["pose"]), axes)

    def plain(self) -> dict[str, Any]:
        """Return the grid as plain data for JSON."""
        return {
            "coordinates": list(self.coordinates),
            "pose": list(self.pose),
            "axes": [asdict(axis) for axis in self.axes],
        }

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of values of each axis."""
        return tuple(axis.count for axis in self.axes)

    @property
    def size(self) -> int:
        """The number of poses."""
        return prod(self.shape)

    @property
    def fixed_coordinates(self) -> dict[str, float]:
        """The coordinates that do not vary, with their values, m or rad."""
        varying = {axis.name for axis in self.axes}
        pairs = zip(self.coordinates, self.pose, strict=True)
        return {name: coordinate_value for name, coordinate_value in pairs if name not in varying}

    held = former_attribute("held", "fixed_coordinates")

    @cached_property
    def chunk(self) -> tuple[int, ...]:
        """The shape of a chunk: the longest side is halved until there are few enough poses."""
        sides = list(self.shape)
        while prod(sides) > _CHUNK:
            longest = sides.index(max(sides))
            sides[longest] = -(-sides[longest] // 2)
        return tuple(sides)

    def regions(self) -> list[Region]:
        """Return the chunks as parts of the grid; their order depends on its shape alone."""
        cuts = [
            [slice(i, min(i + side, count)) for i in range(0, count, side)]
            for side, count in zip(self.chunk, self.shape, strict=True)
        ]
        return list(product(*cuts))

    def poses(self, region: Region = ()) -> Array:
        """Return the poses (..., m) of the grid, or of a part of it, m and rad."""
        parts = region or (slice(None),) * len(self.axes)
        axis_values = [axis.values[part] for axis, part in zip(self.axes, parts, strict=True)]
        poses = np.empty((*map(len, axis_values), len(self.pose)))
        poses[...] = self.pose
        for k, (axis, steps) in enumerate(zip(self.axes, axis_values, strict=True)):
            lead = (-1,) + (1,) * (len(axis_values) - 1 - k)
            poses[..., self.coordinates.index(axis.name)] = steps.reshape(lead)
        return poses


def pose_grid(
    robot: RobotLike,
    held: Mapping[str, float] | None = None,
    ranges: Mapping[str, tuple[float, ...]] | None = None,
    *,
    points: int | None = None,
    center: PoseLike | None = None,
    rim: float = 0.0,
) -> Grid:
    """Return a grid of a machine's poses.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    held : mapping, optional
        Coordinates that do not vary, with their values, m or rad. All others vary. If it is left
        out, those in `ranges` vary, by default the first two lengths (or two angles where there are
        not two lengths), and the others are held at `center`.
    ranges : mapping, optional
        Least and greatest value of coordinates that vary, m or rad, and the number of values where
        it is not `points`. Other lengths vary over the bounding box of the reach, angles over their
        limits, without limits over a whole turn, or half a turn where the platform tilts.
    points : int, optional
        Number of values along each axis; by default 200 in a plane, 100 in three dimensions.
    center : array, shape (m,), optional
        Pose with the values that are held where `held` is left out, m and rad; by default the home
        pose.
    rim : float
        Share of the bounding box by which lengths go beyond it on each side: pictures show where
        the reach ends.

    Returns
    -------
    Grid

    Raises
    ------
    DataError
        If a coordinate is unknown, none varies, or a value is not a sensible length or angle.
    ModelError
        If a range is left to the reach and no position is in reach at this orientation.

    Examples
    --------
    >>> import pteron
    >>> from pteron.maps import pose_grid
    >>> grid = pose_grid(pteron.load("quadrupteron"), {"z": 0.0, "phi": 0.0}, points=50)
    >>> grid.shape, [axis.name for axis in grid.axes], grid.fixed_coordinates
    ((50, 50), ['x', 'y'], {'z': 0.0, 'phi': 0.0})
    """
    robot = as_manipulator(robot)
    fixed, spans = dict(held or {}), dict(ranges or {})
    expect_coordinates(robot, fixed, spans)
    if _number("rim", rim) < 0.0:
        raise DataError(f"rim: {rim:g} given, 0 or more expected")
    names = robot.coordinates
    pose = np.zeros(len(names))
    if held is None:
        # A coordinate that varies is needed only as the start of the search for the reach.
        pose = home_pose(robot) if center is None else finite_pose(robot, center, "center").copy()
        platform = robot.platform
        pair = platform.lengths if len(platform.lengths) > 1 else platform.angles
        varying = set(spans or pair[:2])
        fixed = {n: float(v) for n, v in zip(names, pose, strict=True) if n not in varying}
    for name, coordinate_value in fixed.items():
        pose[names.index(name)] = coordinate_value
    varying_names = [name for name in names if name not in fixed]
    if not varying_names:
        raise DataError(f"nothing varies: leave one of {', '.join(names)} out of what is held")
    count = _POINTS[len(varying_names)] if points is None else points
    free = [name for name in varying_names if name not in spans]
    angles = [name for name in free if name in robot.platform.angles]
    moved = [name for name in free if name not in angles]
    most = robot.platform.angle_range
    spans |= {name: robot.platform.angle_limits.get(name, (-most, most)) for name in angles}
    if moved:
        box = _box(robot, pose, spans)
        box += rim * np.array([-1.0, 1.0])[:, None] * np.ptp(box, axis=0)
        spans |= {name: tuple(box[:, names.index(name)].tolist()) for name in moved}
    axes = []
    for name in varying_names:
        least, greatest, *span_count = spans[name]
        number = span_count[0] if span_count else count
        # A range is of floats, its count among them.
        if isinstance(number, float) and number.is_integer():
            number = int(number)
        axes.append(Axis(name, least, greatest, number))  # type: ignore[arg-type]
        pose[names.index(name)] = 0.5 * (least + greatest)
    return Grid(names, tuple(pose.tolist()), tuple(axes))


def _box(robot: Manipulator, pose: Array, spans: Mapping[str, tuple[float, ...]]) -> Array:
    """Return the box (2, k) of the reach at a pose's orientation, or over the spans of angles."""
    varying = [k for k in np.flatnonzero(robot.platform.angular) if robot.coordinates[k] in spans]
    ends = [spans[robot.coordinates[k]][:2] for k in varying]
    turns = _TURNS if len(varying) < 2 else 3
    boxes, at = [], pose.copy()
    for turned in product(*(np.linspace(low, high, turns) for low, high in ends)):
        at[varying] = turned
        try:
            boxes.append(bounding_box(robot, at))
        except ModelError as error:
            nowhere = error
    if not boxes:
        raise nowhere
    return np.array([np.min(boxes, axis=(0, 1)), np.max(boxes, axis=(0, 1))])


def _number(key: str, number: object) -> float:
    """Return a finite float, or raise an error that names its key."""
    if (
        isinstance(number, int | float | np.integer | np.floating)
        and not isinstance(number, bool)
        and -_HUGE <= number <= _HUGE
    ):
        return float(number)
    raise DataError(f"{key}: {shorten(number)} given, a finite number expected")


def expect_coordinates(
    robot: Manipulator, fixed: Mapping[str, float], ranges: Mapping[str, tuple[float, ...]]
) -> None:
    """Raise DataError on coordinates that a machine lacks, or values infinite or in wrong units."""
    names = robot.coordinates
    for name in (*fixed, *ranges):
        if name not in names:
            raise DataError(
                f"{name}: is no coordinate of {robot.name}, whose poses have {', '.join(names)}"
            )
        if name in fixed and name in ranges:
            raise DataError(f"{name}: both held and given a range; choose one")
    for name, span in {**{n: (v,) for n, v in fixed.items()}, **ranges}.items():
        if not np.isfinite(span).all():
            raise DataError(f"{name}: a finite number expected")
        if len(span) > 1 and not span[0] < span[1]:
            raise DataError(
                f"{name}: from {span[0]:g} to {span[1]:g} given, an ascending range expected"
            )
        for warning in unlikely_values(robot, [name], np.array([span[:2]])):
            raise DataError(warning)
