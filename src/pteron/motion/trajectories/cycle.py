"""The pick-and-place cycle in time: the tool goes up, across, down, and back, in time from 0 to 1.

A planar machine stays in its plane: up is then against the part of gravity in the plane or, where
there is none, at a right angle to across.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.errors import DataError
from pteron.kernels import Array, as_array
from pteron.manipulator import Manipulator
from pteron.motion.trajectories.tool import arm_motion, carries, pose_motion, tool_path
from pteron.platforms import Platform
from pteron.tolerances import ROUNDING

LIFT = 0.025
"""Height of the standard cycle, m: makers of robots state cycle times for 25, 305 and 25 mm."""

ACROSS = 0.305
"""Width of the standard cycle, m: 305 mm, a foot, as makers of robots have it."""

_LIFT_ENDS = 0.4
"""Share of the path out in which the platform rises, and again in which it sinks. Chosen with
`_ACROSS_BEGINS`; both belong to the definition of the cycle, by which machines are compared."""

_ACROSS_BEGINS = 0.15
"""Share of the way out after which the platform sets off across: to start before it is up rounds
the corners and saves time."""

_TURNS = {
    2: np.array([[1.0, -1.0], [1.0, 1.0]]),
    3: np.array([[1.0, -1.0, 0.5], [0.5, 1.0, -1.0]]),
}
"""Turns of a platform that tilts, by its number of angles: on the way across, and on the way up.
They are not parallel: the angles go round a corner as the tool does, and nothing reverses."""


def quintic(tau: Array, begin: float, end: float) -> tuple[Array, Array, Array]:
    """Return a smooth step s(tau) from 0 to 1 within [begin, end], and its first two derivatives.

    s = 10 t^3 - 15 t^4 + 6 t^5 with t = (tau - begin) / (end - begin): velocity and acceleration
    are zero at both ends, so that the motion is continuous with rest.

    Derivatives are per unit of `tau`.

    Examples
    --------
    >>> import numpy as np
    >>> [float(v) for v in quintic(np.array(0.5), 0.0, 1.0)]
    [0.5, 1.875, 0.0]
    """
    span = end - begin
    t = np.clip((tau - begin) / span, 0.0, 1.0)
    remaining = 1.0 - t
    return (
        t**3 * (10.0 - 15.0 * t + 6.0 * t**2),
        30.0 * t**2 * remaining**2 / span,
        60.0 * t * remaining * (remaining - t) / span**2,
    )


@dataclass(frozen=True)
class Cycle:
    """The pick-and-place cycle about a pose, at which it is half way across and half way up.

    Attributes
    ----------
    platform : Platform
        What moves, with its tool's centre point.
    around : array, shape (m,)
        The pose in the middle, m and rad.
    across, up : array, shape (3,)
        Unit vectors of the two moves, in the base frame.
    turn : float
        By how much the platform turns on its way across, rad; without effect where it does not. A
        platform that tilts turns about all its axes, across and up.
    scale : float
        Factor on lift, width and turn alike, so that a cycle of scale 0 stays at `around`.
    """

    platform: Platform
    around: Array
    across: Array
    up: Array
    turn: float
    scale: float

    def path(self, tau: Array) -> tuple[Array, Array, Array]:
        """Return the tool's displacement from the cycle's middle (T, k), m, and two derivatives.

        k is the number of the pose's lengths; tau (T,) is in [0, 1].
        """
        move, climb = (
            self.scale * size * (self.platform.directions @ way)
            for size, way in ((ACROSS, self.across), (LIFT, self.up))
        )
        place, velocity, acceleration = (
            np.multiply.outer(a, move) + np.multiply.outer(b, climb)
            for a, b in zip(*_shares(tau), strict=True)
        )
        return place, velocity, acceleration

    def at(self, tau: Array) -> tuple[Array, Array, Array]:
        """Return poses (T, m) of the cycle at `tau` (T,) in [0, 1], and two derivatives by tau.

        If the platform tilts, P instead of the tool moves on the path, and the angles change with
        both moves.
        """
        place, velocity, acceleration = self.path(tau)
        angular = self.platform.angular
        if self.platform.tilts:
            turn, lift = self.scale * self.turn * _TURNS[int(angular.sum())]
            states = []
            for lengths, a, b in zip((place, velocity, acceleration), *_shares(tau), strict=True):
                state = np.empty((len(lengths), len(angular)))
                state[:, ~angular] = lengths
                state[:, angular] = np.multiply.outer(a, turn) + np.multiply.outer(b, lift)
                states.append(state)
            return self.around + states[0], states[1], states[2]
        place = self.around[~angular] + place
        if not self.platform.angles:
            return place, velocity, acceleration
        angle_changes, rate, growth = (
            self.scale * self.turn * (s[:, None] * self._turns_across + h[:, None] * self._turns_up)
            for s, h in zip(*_shares(tau), strict=True)
        )
        angle = self.around[angular] + angle_changes
        if carries(self.platform):
            # The middle is given as a pose of P, the path as that of the tool.
            zero_rates = np.zeros_like(self.around[angular])
            place = (
                place + arm_motion(self.platform, self.around[angular], zero_rates, zero_rates)[0]
            )
        return pose_motion(
            self.platform,
            np.hstack([place, angle]),
            np.hstack([velocity, rate]),
            np.hstack([acceleration, growth]),
        )

    @property
    def _turns_across(self) -> NDArray[np.bool_]:
        """Whether each platform angle (a,) rotates on the way across; only the last one does."""
        count = len(self.platform.angles)
        return np.asarray(np.arange(count) == count - 1)

    @property
    def _turns_up(self) -> NDArray[np.bool_]:
        """Whether each platform angle (a,) rises and falls: all but the last, for < 2 lengths."""
        return np.asarray(~self._turns_across & (len(self.platform.lengths) < 2))

    def acceleration(self, tau: Array, radius: float) -> Array:
        """Return second derivatives by tau (T, k) of tool position, and of angles by `radius`.

        If the platform tilts, the angular accelerations of a point at `radius` from P, m, follow as
        further columns.
        """
        if not self.platform.tilts:
            return self.path(tau)[2]
        state = self.at(tau)
        turning = radius * state[2][:, self.platform.angular]
        return np.hstack([tool_path(self.platform, *state)[2], turning])


_Shares = tuple[Array, Array, Array]


def _shares(tau: Array) -> tuple[_Shares, _Shares]:
    """Return the progress of the moves across and up (-1/2 to 1/2), with two derivatives each.

    The first half of the time is the path out, the second the same path back.
    """
    way = np.where(tau <= 0.5, 2.0 * tau, 2.0 - 2.0 * tau)
    rate = np.where(tau <= 0.5, 2.0, -2.0)
    level_move = quintic(way, _ACROSS_BEGINS, 1.0 - _ACROSS_BEGINS)
    rise, sink = quintic(way, 0.0, _LIFT_ENDS), quintic(way, 1.0 - _LIFT_ENDS, 1.0)
    lift = [up - down for up, down in zip(rise, sink, strict=True)]
    centred = [(s - 0.5, rate * ds, 4.0 * dds) for s, ds, dds in (level_move, lift)]
    return centred[0], centred[1]


def moves(
    robot: Manipulator, direction: ArrayLike | None, count: int
) -> tuple[tuple[Array, Array], ...]:
    """Return (across, up) unit vectors (3,) of a cycle: for one direction, or `count` candidates.

    Up is opposite to gravity; without gravity, and for a tripod, it is the platform's axis. For a
    planar machine it is opposite to gravity's component in the plane or, if that is zero, the axis
    times across. Across is horizontal and in the plane: the horizontal part of the given direction,
    or `count` directions all round from the platform's x axis (or y, if x is nearer to the
    vertical); in an upright plane these are two, to and fro.
    """
    platform, gravity = robot.platform, np.array(robot.gravity)
    axis, planar = np.array(platform.axis), platform.plane_normal is not None
    level = platform.directions.T @ platform.directions if planar else np.eye(3)
    weight = level @ gravity
    strength = float(np.linalg.norm(weight))
    upright: Array | None = None
    if strength > ROUNDING * float(np.linalg.norm(gravity)):
        upright = -weight / strength
    elif not planar:
        upright = axis
    if len(platform.lengths) == 1:  # a tripod, which moves along its axis however it is mounted
        upright = -axis if axis @ gravity > 0.0 else axis
    if upright is not None:
        level = level - np.outer(upright, upright)

    if direction is not None:
        vector = as_array(direction, "direction", (3,))
        first = level @ vector
        if not np.linalg.norm(first) > ROUNDING * np.linalg.norm(vector):
            place = " in the machine's plane" if planar else ""
            raise DataError(f"direction: {vector.tolist()} has no horizontal part{place}")
        count = 1
    else:
        x, y, _ = (level @ axis for axis in platform.frame)
        first = x if np.linalg.norm(x) > 0.5 else y
        if not np.linalg.norm(first) > ROUNDING:  # a platform that moves up at most
            return ((np.zeros(3), axis if upright is None else upright),)
        if planar and upright is not None:
            count = min(count, 2)
    first = first / np.linalg.norm(first)
    second = np.cross(axis if upright is None else upright, first)
    angles = 2.0 * np.pi * np.arange(count) / count
    ways = np.outer(np.cos(angles), first) + np.outer(np.sin(angles), second)
    return tuple((way, np.cross(axis, way) if upright is None else upright) for way in ways)
