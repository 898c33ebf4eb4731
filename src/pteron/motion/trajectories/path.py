"""Paths of the tool without a time law: straight lines, rounded corners, there and back.

A path is a function of s, the metres that the tool has gone; one radian of the platform counts as
`TURN` metres. Poses are twice continuously differentiable in s, but for the rests, where the
platform stops: at both ends, at corners that are not rounded, and where the path turns back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from pteron.arguments import expect
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics.evaluate import finite_rows
from pteron.manipulator import RobotLike, as_manipulator
from pteron.motion.trajectories.tool import Curve, pose_motion, tool_motion
from pteron.platforms import Platform
from pteron.tolerances import ROUNDING

TURN = 0.1
"""Metres of path that one radian of the platform's rotation counts as."""

_SHARP = -0.9
"""Cosine between the directions before and after a corner below which the platform stops there."""

_STRAIGHT = 1.0 - 1e-12
"""Cosine between those directions above which the path counts as straight there."""


@runtime_checkable
class Path(Protocol):
    """A path of the platform as a function of s, the metres that the tool has moved along it."""

    @property
    def length(self) -> float:
        """The path's arc length, m."""

    @property
    def rests(self) -> tuple[float, ...]:
        """The arc lengths s, m, at which the platform stops, ascending, from 0 to the length."""

    def at(self, s: Array) -> Curve:
        """Return poses (T, m) at arc lengths s (T,), m, and two derivatives by s."""

    def place(self, s: float) -> str:
        """Return as text where the arc length s, m, lies on the path."""


@dataclass(frozen=True)
class LinePath:
    """Straight lines between poses, their corners rounded. Made by `line_path`.

    Attributes
    ----------
    platform : Platform
        What moves, with its tool's centre point.
    knots : array, shape (K + 1,)
        Where its pieces meet, m.
    controls : array, shape (K, 6, m)
        Each piece as a Bezier curve of the fifth degree, by its control points: a line has them
        evenly apart, so that s is its length.
    rests : tuple of float
        Where the platform stops, m.
    corners : tuple of float
        Where the given poses are, or are passed by, m.
    """

    platform: Platform
    knots: Array
    controls: Array
    rests: tuple[float, ...]
    corners: tuple[float, ...]

    @property
    def length(self) -> float:
        """The path's arc length, m."""
        return float(self.knots[-1])

    def at(self, s: Array) -> Curve:
        """Return poses (T, m) at arc lengths s (T,), m, and two derivatives by s."""
        s = np.clip(np.asarray(s, dtype=float), 0.0, self.length)
        k = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, len(self.controls) - 1)
        span = (self.knots[k + 1] - self.knots[k])[:, None]
        u = (s - self.knots[k])[:, None] / span
        points = self.controls[k]
        first = 5.0 * np.diff(points, axis=1)
        second = 4.0 * np.diff(first, axis=1)
        curve = _bezier(points, u), _bezier(first, u) / span, _bezier(second, u) / span**2
        return pose_motion(self.platform, *curve)

    def place(self, s: float) -> str:
        """Return as text where the arc length s, m, lies on the path, and between which poses."""
        k = int(np.clip(np.searchsorted(self.corners, s, side="right"), 1, len(self.corners) - 1))
        between = f", between poses {k} and {k + 1}" if len(self.corners) > 2 else ""
        return f"{s:.4g} m along its {self.length:.4g} m{between}"


def _bezier(points: Array, u: Array) -> Array:
    """Return Bezier curves (T, m) of control points (T, d + 1, m) at u (T, 1)."""
    while points.shape[1] > 1:  # De Casteljau
        points = points[:, :-1] + u[:, None] * np.diff(points, axis=1)
    return points[:, 0]


def line_path(robot: RobotLike, poses: ArrayLike, corner: float = 0.0) -> LinePath:
    """Return the path of the tool's centre point along straight lines through poses.

    The pose's angles change linearly along a line; a single angle makes the platform turn evenly. A
    corner is rounded by a Bezier curve of the fifth degree whose ends lie `corner` metres before
    and after it, on both lines, without curvature: the path is twice continuously differentiable.
    At a right angle it passes the corner at 0.27 times that distance.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; `platform.tool` is what goes straight.
    poses : array, shape (K, m)
        At least two, m and rad.
    corner : float
        Metres before and after a corner at which the path leaves its lines; at most half of each
        line is taken. With 0 the platform stops at each corner; it always stops where it turns
        back, by more than about 154 degrees.

    Returns
    -------
    LinePath

    Raises
    ------
    DataError
        If there are fewer than two poses, two that follow each other are the same, or the corner
        is below 0.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import line_path
    >>> path = line_path(pteron.load("tripteron"), [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]], 0.02)
    >>> path.rests
    (0.0, 0.2)
    """
    robot = as_manipulator(robot)
    pose_rows = finite_rows(robot, poses, "poses")
    if pose_rows.ndim != 2 or len(pose_rows) < 2:
        raise DataError(
            f"poses: shape {pose_rows.shape} given, (K, {robot.freedom}) expected, K at least 2"
        )
    expect(np.isfinite(corner) and corner >= 0.0, "corner", corner, "0 m or more")
    places, _, _ = tool_motion(
        robot.platform, pose_rows, np.zeros_like(pose_rows), np.zeros_like(pose_rows)
    )
    directions = np.diff(places, axis=0)
    sizes = np.linalg.norm(directions * path_weights(robot.platform), axis=-1)
    if (sizes <= ROUNDING).any():
        k = int(np.argmax(sizes <= ROUNDING))
        raise DataError(f"poses: {k + 2} is the same as {k + 1}; leave one of them out")
    return _round_corners(robot.platform, places, directions / sizes[:, None], sizes, corner)


def path_weights(platform: Platform) -> Array:
    """Return the weight (m,) of each pose coordinate in the path's length: 1, or m per rad."""
    return np.where(platform.angular, TURN, 1.0)


def _round_corners(
    platform: Platform, places: Array, directions: Array, sizes: Array, corner: float
) -> LinePath:
    """Return the path of straight lines through places (K, m), with rounded corners."""
    controls: list[Array] = []
    knots, rests, corners = [0.0], [0.0], [0.0]
    here = places[0]
    weights = path_weights(platform)
    cosines = np.append(np.sum(directions[:-1] * directions[1:] * weights**2, axis=-1), 1.0)
    for k, cosine in enumerate(cosines):
        last = k + 1 == len(cosines)
        rounds = not last and corner > 0.0 and _SHARP < cosine < _STRAIGHT
        cut = min(corner, sizes[k] / 2.0, sizes[k + 1] / 2.0) if rounds else 0.0
        there = places[k + 1] - cut * directions[k]
        line = float(np.linalg.norm((there - here) * weights))
        if line > ROUNDING:
            controls.append(here + np.linspace(0.0, 1.0, 6)[:, None] * (there - here))
            knots.append(knots[-1] + line)
        corners.append(knots[-1] + cut)
        here = there
        if rounds:
            # Both ends as on a line of twice the cut: the pose is smooth in s to second order.
            steps = np.array([0.0, 0.4, 0.8])[:, None] * cut
            here = places[k + 1] + cut * directions[k + 1]
            controls.append(
                np.vstack([there + steps * directions[k], (here - steps * directions[k + 1])[::-1]])
            )
            knots.append(knots[-1] + 2.0 * cut)
        elif last or cosine < _STRAIGHT:
            rests.append(knots[-1])
    return LinePath(platform, np.array(knots), np.array(controls), tuple(rests), tuple(corners))


def path_corners(path: Path) -> tuple[float, ...]:
    """Return the arc lengths s, m, of a path's corners, rounded or not; none where it has none."""
    return tuple(getattr(path, "corners", ()))


class BackPath:
    """A path followed by its reverse."""

    def __init__(self, out: Path) -> None:
        self._out = out
        self.length = 2.0 * out.length
        self.rests = (*out.rests, *(self.length - s for s in out.rests[-2::-1]))
        corners = path_corners(out)
        self.corners = (*corners, *(self.length - s for s in corners[-2::-1]))

    def at(self, s: Array) -> Curve:
        """Return poses (T, m) at arc lengths s (T,), m, and two derivatives by s."""
        s = np.asarray(s, dtype=float)
        back = s > self._out.length
        pose, first, second = self._out.at(np.where(back, self.length - s, s))
        return pose, np.where(back[:, None], -first, first), second

    def place(self, s: float) -> str:
        """Return as text where the arc length s, m, lies on the path out or back."""
        if s <= self._out.length:
            return self._out.place(s)
        return f"{self._out.place(self.length - s)}, on the path back"


def return_path(path: Path) -> BackPath:
    """Return the path followed by a rest at its end and the same path in reverse."""
    return BackPath(path)


def poses_of(path: Path, count: int) -> tuple[Array, Array]:
    """Return about `count` arc lengths s (K,), m, along a path with its rests; poses (K, m)."""
    spans = np.diff(path.rests)
    parts: Sequence[Array] = [
        np.linspace(a, b, max(2, int(np.ceil(count * (b - a) / spans.sum()))), endpoint=False)
        for a, b in zip(path.rests[:-1], path.rests[1:], strict=True)
    ]
    s = np.append(np.concatenate(parts), path.length)
    return s, path.at(s)[0]
