"""Slices through the reach: poses over a plane of two coordinates, in reach or not, and why not."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect, expect_to_fit
from pteron.errors import DataError
from pteron.kernels import Array, numeric
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace.boxes import vary_coordinates
from pteron.workspace.volume import bounding_box

REACHABLE = 0
"""Status of a pose in reach and within limits."""

BEYOND_LIMITS = -1
"""Status of a pose that the legs reach but a joint's limits forbid."""

_RIM = 0.08
"""Share of the reach's width that a slice shows around it."""

_UPSIDE = np.pi / 2.0
"""Greatest angle, rad, either way, that a slice along an angle of the platform shows."""

Plane = str | tuple[str, str]
"""The two coordinates of the pose that vary: "xy", "xz", "yz", or a pair of names."""


@dataclass(frozen=True, eq=False, repr=False)
class ReachSlice(Result):
    """A grid of poses that vary in two coordinates.

    Attributes
    ----------
    plane : str or (str, str)
        The two coordinates that vary: ``"xy"``, ``"xz"`` or ``"yz"``, or their names.
    center : array, shape (m,)
        The pose the slice goes through; its other coordinates hold for the whole grid.
    first, second : array, shape (A,) and (B,)
        Values of the two coordinates, m or rad.
    status : array of int, shape (B, A)
        `REACHABLE`; `BEYOND_LIMITS`; or the leg, from 1, that misses the pose by most.
    margin : array, shape (B, A)
        Metres to the nearest end of a leg's reach or of an actuated body's travel; negative
        outside.
    leg_margins : array, shape (B, A, n)
        Metres within what each leg reaches: zero on the leg's type-I singularity.
    places : (int, int)
        Where the two coordinates stand in a pose.
    """

    ROWS = "margin status poses:1 leg_margins:1"

    plane: Plane
    center: Array
    first: Array
    second: Array
    status: NDArray[np.int_]
    margin: Array
    leg_margins: Array
    places: tuple[int, int]

    @property
    def poses(self) -> Array:
        """The poses of the grid, shape (B, A, m), m and rad."""
        return _grid(self.center, self.places, self.first, self.second)


def slice_planes(robot: Manipulator) -> tuple[Plane, ...]:
    """Return the planes of slices in pictures: three in space, a single one if planar.

    Of a platform that tilts they are those of its lengths with two of its angles, or all pairs of
    coordinates where these are few.
    """
    lengths = robot.platform.lengths
    angles = [name for name in slice_coordinates(robot) if name not in lengths]
    planes = tuple(first + second for first, second in combinations(lengths, 2))
    if planes or not angles:
        return *planes, *combinations(angles[:2], 2)
    mixed = ((angle, length) for length in lengths for angle in angles)
    return *combinations(angles, 2), *mixed


def slice_coordinates(robot: Manipulator) -> tuple[str, ...]:
    """Return the coordinates that slices may vary in pairs: lengths, and tilt angles."""
    return robot.coordinates if robot.platform.tilts else robot.platform.lengths


def reach_slice(
    robot: RobotLike,
    center: PoseLike,
    plane: Plane = "xy",
    *,
    extent: tuple[float, float, float, float] | None = None,
    points: int = 81,
) -> ReachSlice:
    """Return a slice through the reach of P at the orientation of a pose.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    center : array, shape (m,)
        The pose the slice goes through, m and rad.
    plane : {"xy", "xz", "yz"} or (str, str)
        The two coordinates that vary; a planar machine has but x and y. Of a platform that tilts,
        any two names of coordinates.
    extent : (float, float, float, float), optional
        Least and greatest value of the first coordinate, then of the second, m or rad; by default
        what shows the whole reach at this orientation, and of angles up to 90 degrees.
    points : int
        Number of grid points along each side.

    Returns
    -------
    ReachSlice

    Raises
    ------
    DataError
        If the machine's poses have no such plane or there are fewer than 2 points.
    ModelError
        If no extent is given and no position is in reach at this orientation.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import reach_slice
    >>> cut = reach_slice(pteron.load("quadrupteron"), [0.0, 0.0, 0.0, 0.0], "xz", points=3)
    >>> cut.status[1, 1], cut.margin[1, 1].round(3)
    (np.int64(0), np.float64(0.095))
    """
    robot = as_manipulator(robot)
    planes, names, varying = slice_planes(robot), tuple(plane), slice_coordinates(robot)
    if varying == robot.platform.lengths:
        if plane not in planes:
            valid = ", ".join(f'"{option}"' for option in planes)
            raise DataError(f"plane: {plane!r} is not one of {valid}")
    elif len(set(names)) != 2 or not set(names) <= set(varying):
        raise DataError(f"plane: {plane!r} given, two of {', '.join(varying)} expected")
    expect(points >= 2, "points", points, "at least 2")
    expect_to_fit("points", points, 2.0 * points**2 * (robot.freedom + robot.joint_count))
    pose = finite_pose(robot, center, "center")
    i, j = (robot.coordinates.index(name) for name in names)
    if extent is None and robot.platform.angular[[i, j]].any():
        wide = reach_slice(
            robot, pose, plane, extent=_widest_sides(robot, pose, i, j), points=points
        )
        extent = reach_sides(wide)
    if extent is None:
        box = bounding_box(robot, pose)
        rim = _RIM * (box[1] - box[0])
        low, high = box[0] - rim, box[1] + rim
        extent = (float(low[i]), float(high[i]), float(low[j]), float(high[j]))
    first = np.linspace(extent[0], extent[1], points)
    second = np.linspace(extent[2], extent[3], points)
    poses = _grid(pose, (i, j), first, second)
    leg_margins = numeric(robot, "reach")(poses)[0]
    status, margin, _ = numeric(robot, "standing")(poses)
    return ReachSlice(plane, pose, first, second, status.astype(int), margin, leg_margins, (i, j))


def _grid(center: Array, places: tuple[int, int], first: Array, second: Array) -> Array:
    """Return poses (S, F, m) about a centre, with two coordinates varied over (F,) and (S,)."""
    return vary_coordinates(center, np.stack(np.meshgrid(first, second), axis=-1), list(places))


def reach_sides(cut: ReachSlice) -> tuple[float, float, float, float]:
    """Return the sides of a rectangle about the reach in a slice, with a margin."""
    inside = cut.status == REACHABLE
    sides: list[float] = []
    for coordinates, axis in ((cut.first, 0), (cut.second, 1)):
        in_reach = coordinates[inside.any(axis=axis)]
        if not len(in_reach):
            in_reach = coordinates
        rim = max(_RIM * float(np.ptp(in_reach)), float(coordinates[1] - coordinates[0]))
        sides += [float(in_reach[0]) - rim, float(in_reach[-1]) + rim]
    return sides[0], sides[1], sides[2], sides[3]


def _widest_sides(
    robot: Manipulator, pose: Array, i: int, j: int
) -> tuple[float, float, float, float]:
    """Return the sides of a rectangle that bounds the reach in a slice through a pose."""
    sides: list[float] = []
    limits = robot.platform.angle_limits
    for k in (i, j):
        if robot.platform.angular[k]:
            low, high = limits.get(robot.coordinates[k], (-_UPSIDE, _UPSIDE))
            sides += [max(low, -_UPSIDE), min(high, _UPSIDE)]
        else:
            at = robot.platform.lengths.index(robot.coordinates[k])
            sides += bounding_box(robot, pose)[:, at].tolist()
    return sides[0], sides[1], sides[2], sides[3]
