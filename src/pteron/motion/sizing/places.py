"""Places of a cycle in a workspace: where its middle is, and how it is turned about the vertical.

A cycle that is moved keeps its shape and its time: the path of the tool is turned about the
vertical through its middle, and the middle is put elsewhere. The platform's angles are not turned
with it; a place may shift them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation  # type: ignore[import-untyped]

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion, told_pose
from pteron.motion.trajectories.cycle import moves
from pteron.motion.trajectories.scaling import keeps_margin, least_margin
from pteron.motion.trajectories.tool import Curve, pose_motion, tool_motion
from pteron.workspace import Box, Region, bounding_box, home_pose

TURNS = 12
"""Turns of a cycle that are tried, round the vertical."""

_COUNTS = {0: 1, 1: 9, 2: 7, 3: 5, 4: 3}
"""Places along each coordinate, by the number of those that vary; 2, the ends, of more."""

_TILT = np.pi / 2.0
"""Largest angle, rad, tried of a platform that moves along fewer than two directions."""

_ROUNDING = 1e-9
"""Distance from a region's border that is rounding, m and rad."""


@dataclass(frozen=True)
class Place:
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
        """Return it in words."""
        turned = f" turned {np.degrees(self.turn) % 360:.4g} deg" if self.turn else ""
        return f"about {told_pose(np.round(self.pose, 6))}{turned}"


@dataclass(frozen=True)
class Course:
    """Motions that are moved as one: the tool's path of each, from their middle.

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
    """

    robot: Manipulator
    middle: Array
    curves: tuple[Curve, ...]
    axis: Array | None

    @classmethod
    def of(cls, robot: Manipulator, motions: Sequence[Motion]) -> Course:
        """Return the course of motions."""
        platform = robot.platform
        curves = [tool_motion(platform, m.pose, m.velocity, m.acceleration) for m in motions]
        ends = Box.around(np.vstack([curve[0] for curve in curves])).box
        middle = ends.mean(axis=0)
        return cls(robot, middle, tuple((c[0] - middle, *c[1:]) for c in curves), _axis(robot))

    def at(self, places: Sequence[Place]) -> Iterator[Curve]:
        """Yield each motion's poses and their derivatives (T, W, m) at places."""
        platform = self.robot.platform
        lengths = ~platform.angular
        poses = np.array([place.pose for place in places])
        turns = np.stack([self.turned(place.turn) for place in places])
        for curve in self.curves:
            parts = []
            for part in curve:
                moved = np.repeat(part[:, None], len(places), axis=1)
                moved[..., lengths] = np.einsum("wij,tj->twi", turns, part[:, lengths])
                parts.append(moved)
            yield pose_motion(platform, parts[0] + poses, parts[1], parts[2])

    def turned(self, turn: float) -> Array:
        """Return the rotation of the pose's lengths (l, l)."""
        directions = self.robot.platform.directions
        if self.axis is None:
            return np.eye(len(directions))
        matrix = Rotation.from_rotvec(turn * self.axis).as_matrix()
        return np.asarray(directions @ matrix @ directions.T)

    def around(self, turn: float) -> Array:
        """Return the least and the greatest coordinates (2, m) of the path from its middle."""
        poses = np.vstack([curve[0] for curve in self.curves])
        lengths = ~self.robot.platform.angular
        poses[:, lengths] = poses[:, lengths] @ self.turned(turn).T
        return np.array([poses.min(axis=0), poses.max(axis=0)])


Fits = Callable[[Array], bool]
"""Function that says whether poses (K, m) lie in a region."""


def within(robot: Manipulator, region: Region | None) -> tuple[Array, Fits]:
    """Return the box (2, m) of a region, and the function that says whether it holds poses.

    Without a region it is the workspace: poses that keep `least_margin` to singularities and the
    joints within their limits, at the home pose's angles. Of a platform that moves along fewer than
    two directions the angles vary, too.
    """
    if region is not None:
        box = region.box
        return box, lambda poses: bool((region.holds(poses) | _inside(region, poses)).all())
    home, platform = home_pose(robot), robot.platform
    box = np.array([home, home])
    count = len(platform.lengths)
    if count:
        box[:, :count] = bounding_box(robot, home)
    if count < 2:
        box[:, count:] += [[-_TILT], [_TILT]]
    return box, partial(keeps_margin, robot, least=least_margin(robot, home))


def places_in(course: Course, box: Array, fits: Fits) -> tuple[Place, ...]:
    """Return places at which the whole of a course lies in a region.

    They are on a grid that goes to the ends of the region's box, for turns by 30 degrees.
    """
    turns = np.linspace(0.0, 2.0 * np.pi, TURNS, endpoint=False) if course.axis is not None else [0]
    found = []
    for turn in map(float, turns):
        low, high = box - course.around(turn)
        if (low > high + _ROUNDING).any():
            continue
        varies = high - low > 2.0 * _ROUNDING
        low, high = low + _ROUNDING * varies, high - _ROUNDING * varies
        counts = np.where(varies, _COUNTS.get(int(varies.sum()), 2), 1)
        grid = map(np.linspace, low, high, counts)
        found += [Place(tuple(map(float, pose)), turn) for pose in product(*grid)]
    return tuple(place for place in found if stays(course, place, fits))


def stays(course: Course, place: Place, fits: Fits) -> bool:
    """Say whether the whole of a course lies in a region at a place."""
    return all(fits(poses[:, 0]) for poses, *_ in course.at([place]))


def near(place: Place, steps: Array, turn: float) -> Iterator[Place]:
    """Yield a place's neighbours: a step (m,) along each coordinate, and a turn, to both sides."""
    for side in (1.0, -1.0):
        if turn:
            yield Place(place.pose, place.turn + side * turn)
        for i in np.flatnonzero(steps):
            moved = list(place.pose)
            moved[i] += side * float(steps[i])
            yield Place(tuple(moved), place.turn)


def _axis(robot: Manipulator) -> Array | None:
    """Return what a cycle may be turned about: the vertical, or the normal of a level plane."""
    platform = robot.platform
    if len(platform.lengths) < 2:
        return None
    if not platform.planar:
        return moves(robot, None, 1)[0][1]
    level = not (np.abs(platform.directions @ np.array(robot.gravity)) > _ROUNDING).any()
    return np.array(platform.axis) if level else None


def _inside(region: Region, poses: Array) -> NDArray[np.bool_]:
    """Return which poses (..., m) lie in a box but for rounding."""
    if not isinstance(region, Box):
        return np.zeros(poses.shape[:-1], dtype=bool)
    low, high = region.box
    return np.asarray(((poses >= low - _ROUNDING) & (poses <= high + _ROUNDING)).all(axis=-1))


def checked(robot: Manipulator, places: Sequence[Place]) -> tuple[Place, ...]:
    """Return places, after refusing none, and those that have not the machine's coordinates."""
    if not places:
        raise DataError("places: none given, at least one expected")
    for i, place in enumerate(places):
        if len(place.pose) != robot.freedom:
            raise DataError(
                f"places[{i}]: pose {list(place.pose)} given, {' '.join(robot.coordinates)} "
                "expected"
            )
    return tuple(places)


def placed(robot: RobotLike, motion: Motion, place: Place) -> Motion:
    """Return a motion at another place: it keeps its shape and its time.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    motion : Motion
        The motion.
    place : Place
        Where its middle is to be, and how it is turned.

    Returns
    -------
    Motion

    Examples
    --------
    >>> from pteron.motion import Place, pick_and_place, placed
    >>> cycle = pick_and_place("delta", samples=51)
    >>> placed("delta", cycle, Place((0.1, 0.0, -0.8))).pose.mean(axis=0).round(2)
    array([ 0.1,  0. , -0.8])
    """
    robot = as_manipulator(robot)
    (curve,) = Course.of(robot, [motion]).at(checked(robot, [place]))
    return Motion(motion.time, *(part[:, 0] for part in curve))
