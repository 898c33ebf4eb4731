"""Places of a cycle in a workspace: where its middle is, and how it is turned about the vertical.

A cycle that is moved keeps its shape and its time: the path of the tool is turned about the
vertical through its middle, and the middle is put elsewhere. The platform's angles are shifted by
a place: by nothing, or by as much as the path is turned.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import checked_arguments, expect
from pteron.bodies.vectors import rotation_matrices
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion, pose_text
from pteron.motion.trajectories.cycle import moves
from pteron.motion.trajectories.scaling import keeps_margin, least_margin
from pteron.motion.trajectories.tool import Curve, pose_motion, tool_motion
from pteron.result import Result
from pteron.tolerances import ROUNDING
from pteron.workspace import Box, Region, bounding_box, home_pose

TURNS = 12
"""Turns of a cycle that are tried, round the vertical."""

_COUNTS = {0: 1, 1: 9, 2: 7, 3: 5, 4: 3}
"""Places along each coordinate, by the number of those that vary; 2, the ends, of more."""

_SPREAD = 300
"""Places tried beside those of the grid, of which the corners leave many workspaces."""

_TILT = np.pi / 2.0
"""Largest angle, rad, tried of a platform that moves along fewer than two directions."""


@checked_arguments
@dataclass(frozen=True, eq=False, repr=False)
class CyclePlace(Result):
    """A place of a cycle.

    Parameters
    ----------
    pose : tuple of float
        The pose in the middle of the cycle, half way between its least and greatest coordinates, m
        and rad; where the tool is off P, they are the coordinates of the tool's path.
    turn : float
        By how much the path is turned about the vertical, rad; about its normal in a level plane.
    """

    pose: tuple[float, ...]
    turn: float = 0.0

    def __str__(self) -> str:
        """Return the place as text: the pose of its middle and its turn in degrees."""
        turned = f" turned {np.degrees(self.turn) % 360:.4g} deg" if self.turn else ""
        return f"about {pose_text(np.round(self.pose, 4))}{turned}"


@dataclass(frozen=True)
class Course:
    """Motions that are moved as a unit: the tool's path of each, from their common middle.

    Attributes
    ----------
    robot : Manipulator
        The machine.
    middle : array, shape (m,)
        The middle of all, m and rad.
    curves : tuple of Curve
        Of each motion its poses less the middle, and two derivatives, (T, m).
    axis : array, shape (3,), or None
        What they may be turned about; None where they may not.
    yaw : array, shape (m,)
        By how much the pose grows where the platform turns about that, too, by 1 rad; zero where
        it has no such angle.
    """

    robot: Manipulator
    middle: Array
    curves: tuple[Curve, ...]
    axis: Array | None
    yaw: Array

    @classmethod
    def from_motions(cls, robot: Manipulator, motions: Sequence[Motion]) -> Course:
        """Return the tool's course in `motions`, relative to the middle of the box around it."""
        platform = robot.platform
        curves = [tool_motion(platform, m.pose, m.velocity, m.acceleration) for m in motions]
        ends = Box.around(np.vstack([curve[0] for curve in curves])).box
        middle = ends.mean(axis=0)
        axis = _axis(robot)
        relative = tuple((c[0] - middle, *c[1:]) for c in curves)
        return cls(robot, middle, relative, axis, _yaw(robot, axis))

    def curves_at(self, places: Sequence[CyclePlace]) -> Iterator[Curve]:
        """Yield each motion's poses and two derivatives (T, W, m), moved to W places."""
        platform = self.robot.platform
        lengths = ~platform.angular
        poses = np.array([place.pose for place in places])
        turns = np.stack([self.rotation(place.turn) for place in places])
        for curve in self.curves:
            parts = []
            for part in curve:
                rotated = np.repeat(part[:, None], len(places), axis=1)
                rotated[..., lengths] = np.einsum("wij,tj->twi", turns, part[:, lengths])
                parts.append(rotated)
            yield pose_motion(platform, parts[0] + poses, parts[1], parts[2])

    def rotation(self, turn: float) -> Array:
        """Return the matrix (l, l) that rotates the pose's length coordinates by `turn`, rad."""
        directions = self.robot.platform.directions
        if self.axis is None:
            return np.eye(len(directions))
        matrix = rotation_matrices(turn * self.axis)
        return np.asarray(directions @ matrix @ directions.T)

    def extent(self, turn: float) -> Array:
        """Return least and greatest coordinates (2, m) of the turned course about its middle."""
        poses = np.vstack([curve[0] for curve in self.curves])
        lengths = ~self.robot.platform.angular
        poses[:, lengths] = poses[:, lengths] @ self.rotation(turn).T
        return np.array([poses.min(axis=0), poses.max(axis=0)])


Fits = Callable[[Array], bool]
"""Function that says whether poses (K, m) lie in a region."""


def region_fits(course: Course, region: Region | None) -> tuple[Array, Fits]:
    """Return a region's box (2, m), and a function that tests whether poses lie in the region.

    Without a region the workspace is used: poses with singularity margins of at least
    `least_margin` and joints within their limits, at the home pose's angles, in a box wide enough
    for the angles of the course. For a platform with fewer than two lengths the angles vary, too.
    """
    robot = course.robot
    if region is not None:
        box = region.box
        return box, lambda poses: bool((region.holds(poses) | _is_in_box(region, poses)).all())
    home, platform = home_pose(robot), robot.platform
    box = np.array([home, home])
    count = len(platform.lengths)
    if count:
        box[:, :count] = bounding_box(robot, home)
    box[:, count:] += course.extent(0.0)[:, count:]
    if count < 2:
        box[:, count:] += [[-_TILT], [_TILT]]
    return box, partial(keeps_margin, robot, least=least_margin(robot, home))


def places_in(course: Course, box: Array, fits: Fits) -> tuple[CyclePlace, ...]:
    """Return places in a region's box at which the complete course lies in the region.

    Places are on a grid that includes the ends of the region's box, with turns in steps of 30
    degrees; the platform is turned with the path, and also not turned, unless the box has a range
    of that angle. If the course leaves the region at some of them, further places are spread over
    the box.
    """
    turns = np.linspace(0.0, 2.0 * np.pi, TURNS, endpoint=False) if course.axis is not None else [0]
    candidates = []
    for turn in map(float, turns):
        low, high = box - course.extent(turn)
        if (low > high + ROUNDING).any():
            continue
        varies = high - low > 2.0 * ROUNDING
        low, high = low + ROUNDING * varies, high - ROUNDING * varies
        counts = np.where(varies, _COUNTS.get(int(varies.sum()), 2), 1)
        grid = [CyclePlace(pose, turn) for pose in product(*map(np.linspace, low, high, counts))]
        if turn and course.yaw.any() and not (varies & (course.yaw != 0.0)).any():
            candidates += [with_platform(place, course.yaw, turn) for place in grid]
        candidates += grid
    accepted = [place for place in candidates if stays(course, place, fits)]
    others = _quasirandom_places(course, box) if len(accepted) < len(candidates) else ()
    return (*accepted, *(place for place in others if stays(course, place, fits)))


def _quasirandom_places(course: Course, box: Array) -> Iterator[CyclePlace]:
    """Yield quasi-random places of a course in a box (2, m), with turns in all directions.

    They are a quasirandom sequence of M. Roberts, "The unreasonable effectiveness of quasirandom
    sequences" (2018): multiples of powers of a generalised golden ratio.
    """
    count = len(box[0]) + 1
    ratio = 2.0
    for _ in range(32):
        ratio = (1.0 + ratio) ** (1.0 / (count + 1))
    steps = ratio ** -np.arange(1.0, count + 1.0)
    for k, (*units, part) in enumerate((0.5 + np.arange(_SPREAD)[:, None] * steps) % 1.0):
        turn = 2.0 * np.pi * part if course.axis is not None else 0.0
        low, high = box - course.extent(turn)
        if (low <= high + ROUNDING).all():
            place = CyclePlace(tuple(map(float, low + units * np.maximum(high - low, 0.0))), turn)
            turns = k % 2 and not (high - low > 2.0 * ROUNDING)[course.yaw != 0.0].any()
            yield with_platform(place, course.yaw, turn) if turns else place


def stays(course: Course, place: CyclePlace, fits: Fits) -> bool:
    """Return whether the complete course of a cycle lies in a region when moved to a place."""
    return all(fits(poses[:, 0]) for poses, *_ in course.curves_at([place]))


def with_platform(place: CyclePlace, yaw: Array, turn: float) -> CyclePlace:
    """Return a cycle's place with the platform turned further by `turn`, rad, along `yaw` (m,)."""
    pose = np.array(place.pose) + yaw * np.angle(np.exp(1j * turn))
    return CyclePlace(tuple(map(float, pose)), place.turn)


def neighbours(
    place: CyclePlace, steps: Array, turn: float, yaw: Array, *, oblique: bool
) -> Iterator[CyclePlace]:
    """Yield neighbours of a cycle's place at +- `steps` (m,) in coordinates and +- `turn`, rad.

    A turn is one of the path alone, and one of path and platform. For regions with an oblique
    boundary there are steps in all coordinates and turns at once, too.
    """
    for side in (1.0, -1.0):
        if turn:
            turned_place = CyclePlace(place.pose, place.turn + side * turn)
            yield turned_place
            if yaw.any():
                yield with_platform(turned_place, yaw, side * turn)
        for i in np.flatnonzero(steps):
            coordinates = list(place.pose)
            coordinates[i] += side * float(steps[i])
            yield CyclePlace(tuple(coordinates), place.turn)
    moving = np.flatnonzero(steps)
    for signs in product((1.0, -1.0), repeat=len(moving)) if oblique and len(moving) < 4 else ():
        pose = np.array(place.pose)
        pose[moving] += signs * steps[moving]
        for side in (0.0, 1.0, -1.0) if turn else (0.0,):
            neighbour = CyclePlace(tuple(map(float, pose)), place.turn + side * turn)
            yield with_platform(neighbour, yaw, side * turn) if yaw.any() else neighbour


def _axis(robot: Manipulator) -> Array | None:
    """Return the unit axis (3,) a cycle may be turned about, vertical or plane normal, or None."""
    platform = robot.platform
    if len(platform.lengths) < 2:
        return None
    if platform.plane_normal is None:
        return moves(robot, None, 1)[0][1]
    level = not (np.abs(platform.directions @ np.array(robot.gravity)) > ROUNDING).any()
    return np.array(platform.axis) if level else None


def _yaw(robot: Manipulator, axis: Array | None) -> Array:
    """Return the pose change (m,) for a platform rotation of 1 rad about an axis."""
    platform, rates = robot.platform, np.zeros(robot.freedom)
    last = len(rates) - 1
    about = platform.spin_axis
    if axis is None or about is None:
        return rates
    cosine = float(np.dot(about, axis))
    rates[last] = np.sign(cosine) if abs(cosine) > 1.0 - ROUNDING else 0.0
    return rates


def _is_in_box(region: Region, poses: Array) -> NDArray[np.bool_]:
    """Return which poses (..., m) lie in a region's box, up to rounding."""
    if not isinstance(region, Box):
        return np.zeros(poses.shape[:-1], dtype=bool)
    low, high = region.box
    return np.asarray(((poses >= low - ROUNDING) & (poses <= high + ROUNDING)).all(axis=-1))


def expect_places_of(robot: Manipulator, places: Sequence[CyclePlace]) -> tuple[CyclePlace, ...]:
    """Return the places; raise if there are none, or a pose has a wrong number of coordinates."""
    expect(places, "places", "none", "at least one")
    for i, place in enumerate(places):
        if len(place.pose) != robot.freedom:
            raise DataError(
                f"places[{i}]: pose {list(place.pose)} given, {' '.join(robot.coordinates)} "
                "expected"
            )
    return tuple(places)


def motion_at_place(robot: RobotLike, motion: Motion, place: CyclePlace) -> Motion:
    """Return a motion moved to another place, its shape and duration unchanged.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    motion : Motion
        The motion.
    place : CyclePlace
        Where its middle is to be, and how it is turned.

    Returns
    -------
    Motion

    Examples
    --------
    >>> from pteron.motion import CyclePlace, motion_at_place, pick_and_place
    >>> cycle = pick_and_place("delta", samples=51)
    >>> motion_at_place("delta", cycle, CyclePlace((0.1, 0.0, -0.8))).pose.mean(axis=0).round(2)
    array([ 0.1,  0. , -0.8])
    """
    robot = as_manipulator(robot)
    (curve,) = Course.from_motions(robot, [motion]).curves_at(expect_places_of(robot, [place]))
    return Motion(motion.time, *(part[:, 0] for part in curve))
