"""Paths of the tool without a time law: straight lines, rounded corners, the way of a cycle.

A path is told by s, the metres that the tool has gone; a turn of the platform by one radian counts
as `TURN` metres. Poses are twice continuously differentiable in s, but for the rests, where the
platform stops: at both ends, at corners that are not rounded, and where the path turns back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics.evaluate import checked
from pteron.manipulator import Manipulator
from pteron.motion.trajectories.cycle import Cycle
from pteron.motion.trajectories.tool import Curve, pose_motion, tool_motion
from pteron.platforms import Platform

TURN = 0.1
"""Metres of a path that a radian counts as."""

_SAME = 1e-9
"""Metres of a path that are none."""

_SHARP = -0.9
"""Cosine between the directions before and after a corner below which the platform stops there."""

_STRAIGHT = 1.0 - 1e-12
"""The same, above which there is no corner."""

_EDGE = 1e-3
"""Share of a cycle's move, at its ends, that is a straight line but for rounding."""

_NODES = 2001


class Path(Protocol):
    """A way of the platform, by the metres s that the tool has gone on it."""

    @property
    def length(self) -> float:
        """Where it ends, m."""

    @property
    def rests(self) -> tuple[float, ...]:
        """Where the platform stops, ascending: 0, the length, and what is between them."""

    def at(self, s: Array) -> Curve:
        """Return poses (T, m) at s (T,), and two derivatives by s."""

    def place(self, s: float) -> str:
        """Return where s is, as words."""


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
        """Where it ends, m."""
        return float(self.knots[-1])

    def at(self, s: Array) -> Curve:
        """Return poses (T, m) at s (T,), and two derivatives by s."""
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
        """Return where s is, as words."""
        k = int(np.clip(np.searchsorted(self.corners, s, side="right"), 1, len(self.corners) - 1))
        between = f", between poses {k} and {k + 1}" if len(self.corners) > 2 else ""
        return f"{s:.4g} m along its {self.length:.4g} m{between}"


def _bezier(points: Array, u: Array) -> Array:
    """Return Bezier curves (T, m) of control points (T, d + 1, m) at u (T, 1)."""
    while points.shape[1] > 1:  # De Casteljau
        points = points[:, :-1] + u[:, None] * np.diff(points, axis=1)
    return points[:, 0]


def line_path(robot: Manipulator, poses: ArrayLike, corner: float = 0.0) -> LinePath:
    """Return the path of the tool's centre point along straight lines through poses.

    The platform turns evenly along a line. A corner is rounded by a Bezier curve of the fifth
    degree whose ends are `corner` metres before and after it, on both lines, without curvature: the
    path is twice continuously differentiable. It passes a right angle at 0.27 times that distance.

    Parameters
    ----------
    robot : Manipulator
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
    given = checked(robot, poses, "poses")
    if given.ndim != 2 or len(given) < 2:
        raise DataError(
            f"poses: shape {given.shape} given, (K, {robot.freedom}) expected, K at least 2"
        )
    if not (np.isfinite(corner) and corner >= 0.0):
        raise DataError(f"corner: {corner} given, 0 m or more expected")
    places, _, _ = tool_motion(robot.platform, given, np.zeros_like(given), np.zeros_like(given))
    ways = np.diff(places, axis=0)
    sizes = np.linalg.norm(ways * _weights(robot.platform), axis=-1)
    if (sizes <= _SAME).any():
        k = int(np.argmax(sizes <= _SAME))
        raise DataError(f"poses: {k + 2} is the same as {k + 1}; leave one of them out")
    return _rounded(robot.platform, places, ways / sizes[:, None], sizes, corner)


def _weights(platform: Platform) -> Array:
    return np.array([TURN if name == "phi" else 1.0 for name in platform.coordinates])


def _rounded(
    platform: Platform, places: Array, ways: Array, sizes: Array, corner: float
) -> LinePath:
    """Return the path through places (K, m), its lines having these directions and lengths."""
    controls: list[Array] = []
    knots, rests, corners = [0.0], [0.0], [0.0]
    here = places[0]
    for k in range(len(ways)):
        last = k + 1 == len(ways)
        cosine = 1.0 if last else float(np.sum(ways[k] * ways[k + 1] * _weights(platform) ** 2))
        rounds = not last and corner > 0.0 and _SHARP < cosine < _STRAIGHT
        cut = min(corner, sizes[k] / 2.0, sizes[k + 1] / 2.0) if rounds else 0.0
        there = places[k + 1] - cut * ways[k]
        line = float(np.linalg.norm((there - here) * _weights(platform)))
        if line > _SAME:
            controls.append(here + np.linspace(0.0, 1.0, 6)[:, None] * (there - here))
            knots.append(knots[-1] + line)
        corners.append(knots[-1] + cut)
        here = there
        if rounds:
            # Both ends as on a line of twice the cut: the pose is smooth in s to second order.
            steps = np.array([0.0, 0.4, 0.8])[:, None] * cut
            here = places[k + 1] + cut * ways[k + 1]
            controls.append(
                np.vstack([there + steps * ways[k], (here - steps * ways[k + 1])[::-1]])
            )
            knots.append(knots[-1] + 2.0 * cut)
        elif last or cosine < _STRAIGHT:
            rests.append(knots[-1])
    return LinePath(platform, np.array(knots), np.array(controls), tuple(rests), tuple(corners))


class CyclePath:
    """The way of a pick-and-place cycle from its one end to the other, by its length.

    Parameters
    ----------
    cycle : Cycle
        The cycle in time, of which the first half is the way out.
    """

    def __init__(self, cycle: Cycle) -> None:
        self._cycle = cycle
        self._weights = _weights(cycle.platform)
        self._ends = 0.5 * _EDGE, 0.5 * (1.0 - _EDGE)
        tau = np.linspace(*self._ends, _NODES)
        nodes, shares = np.polynomial.legendre.leggauss(5)
        span = tau[1] - tau[0]
        speeds = self._speed((tau[:-1, None] + 0.5 * span * (nodes + 1.0)).ravel())
        pieces = 0.5 * span * (speeds.reshape(-1, 5) @ shares)
        # Before and after it goes straight, and starts from rest: its speed grows as tau^2.
        edges = self._weighted(np.array([0.0, self._ends[0], self._ends[1], 0.5]))
        first, last = (float(np.linalg.norm(edges[k + 1] - edges[k])) for k in (0, 2))
        self._tau, self._s = tau, first + np.concatenate([[0.0], np.cumsum(pieces)])
        self.length = float(self._s[-1]) + last
        self.rests = (0.0, self.length)

    def _curve(self, tau: Array) -> Curve:
        platform = self._cycle.platform
        return tool_motion(platform, *self._cycle.at(tau))

    def _weighted(self, tau: Array) -> Array:
        return self._curve(tau)[0] * self._weights

    def _speed(self, tau: Array) -> Array:
        return np.asarray(np.linalg.norm(self._curve(tau)[1] * self._weights, axis=-1))

    def at(self, s: Array) -> Curve:
        """Return poses (T, m) at s (T,), and two derivatives by s."""
        s = np.clip(np.asarray(s, dtype=float), 0.0, self.length)
        within = np.clip(s, self._s[0], self._s[-1])
        tau = self._times(within)
        place, rate, bend = self._curve(tau)
        speed = np.linalg.norm(rate * self._weights, axis=-1)[:, None]
        first = rate / speed
        along = np.sum(bend * first * self._weights**2, axis=-1)[:, None]
        second = (bend - along * first) / speed**2
        beyond = (s - within)[:, None]
        second = np.where(beyond == 0.0, second, 0.0)
        return pose_motion(self._cycle.platform, place + beyond * first, first, second)

    def _times(self, s: Array) -> Array:
        """Return tau (T,) at s (T,): Newton's steps on the length between nodes, by quadrature."""
        k = np.clip(np.searchsorted(self._s, s, side="right") - 1, 0, len(self._tau) - 2)
        low, high = self._tau[k], self._tau[k + 1]
        nodes, shares = np.polynomial.legendre.leggauss(5)
        tau = low + (high - low) * (s - self._s[k]) / (self._s[k + 1] - self._s[k])
        for _ in range(4):
            span = tau - low
            at = low[:, None] + 0.5 * span[:, None] * (nodes + 1.0)
            gone = 0.5 * span * (self._speed(at.ravel()).reshape(-1, 5) @ shares)
            tau = np.clip(tau - (self._s[k] + gone - s) / self._speed(tau), low, high)
        return tau

    def place(self, s: float) -> str:
        """Return where s is, as words."""
        return f"{s:.4g} m along its way of {self.length:.4g} m"


class BackPath:
    """A path and the same way back.

    Parameters
    ----------
    out : Path
        The way out.
    """

    def __init__(self, out: Path) -> None:
        self._out = out
        self.length = 2.0 * out.length
        self.rests = (*out.rests, *(self.length - s for s in out.rests[-2::-1]))

    def at(self, s: Array) -> Curve:
        """Return poses (T, m) at s (T,), and two derivatives by s."""
        s = np.asarray(s, dtype=float)
        back = s > self._out.length
        pose, first, second = self._out.at(np.where(back, self.length - s, s))
        return pose, np.where(back[:, None], -first, first), second

    def place(self, s: float) -> str:
        """Return where s is, as words."""
        if s <= self._out.length:
            return self._out.place(s)
        return f"{self._out.place(self.length - s)}, on the way back"


def there_and_back(path: Path) -> BackPath:
    """Return the path and, after a rest at its end, the same way back."""
    return BackPath(path)


def poses_of(path: Path, count: int) -> tuple[Array, Array]:
    """Return s (K,) evenly along a path, its rests included, about `count` of them, and poses."""
    spans = np.diff(path.rests)
    parts: Sequence[Array] = [
        np.linspace(a, b, max(2, int(np.ceil(count * (b - a) / spans.sum()))), endpoint=False)
        for a, b in zip(path.rests[:-1], path.rests[1:], strict=True)
    ]
    s = np.append(np.concatenate(parts), path.length)
    return s, path.at(s)[0]
