"""The pick-and-place cycle as a path in time: up, across, down, and back, over one unit of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator

LIFT = 0.025
"""Height of the standard cycle, m."""

ACROSS = 0.305
"""Width of the standard cycle, m."""

_LIFT_ENDS = 0.4
"""Share of one way in which the platform rises, and again in which it sinks."""

_ACROSS_BEGINS = 0.15
"""Share of one way after which it sets off across: it rounds the corners, and saves time."""


def quintic(tau: Array, begin: float, end: float) -> tuple[Array, Array, Array]:
    """Return a move from 0 to 1 within [begin, end], and its first two derivatives.

    s = 10 t^3 - 15 t^4 + 6 t^5 with t = (tau - begin) / (end - begin): velocity and acceleration
    are zero at both ends, so that it joins rest without a jump of either.

    Parameters
    ----------
    tau : array
        Time, in any unit.
    begin, end : float
        When the move starts and ends, in the same unit.

    Returns
    -------
    s, ds, dds : array
        With the shape of `tau`; per unit of time, and per unit squared.

    Examples
    --------
    >>> import numpy as np
    >>> [float(v) for v in quintic(np.array(0.5), 0.0, 1.0)]
    [0.5, 1.875, 0.0]
    """
    span = end - begin
    t = np.clip((tau - begin) / span, 0.0, 1.0)
    rest = 1.0 - t
    return (
        t**3 * (10.0 - 15.0 * t + 6.0 * t**2),
        30.0 * t**2 * rest**2 / span,
        60.0 * t * rest * (rest - t) / span**2,
    )


@dataclass(frozen=True)
class Cycle:
    """The cycle about a pose, which is half way across and half way up.

    Attributes
    ----------
    around : array, shape (m,)
        The pose in the middle, m and rad.
    across, up : array, shape (3,)
        Unit vectors of the two moves.
    turn : float
        By how much the platform turns on its way across, rad; 0 for 3T.
    scale : float
        Factor on lift, width and turn alike, so that a cycle of scale 0 stays at `around`.
    """

    around: Array
    across: Array
    up: Array
    turn: float
    scale: float

    def at(self, tau: Array) -> tuple[Array, Array, Array]:
        """Return poses (T, m) at times `tau` (T,) in [0, 1], and two derivatives by tau.

        The first half of the time is the way out, the second the same path back.
        """
        way = np.where(tau <= 0.5, 2.0 * tau, 2.0 - 2.0 * tau)
        rate = np.where(tau <= 0.5, 2.0, -2.0)
        across = quintic(way, _ACROSS_BEGINS, 1.0 - _ACROSS_BEGINS)
        rise, sink = quintic(way, 0.0, _LIFT_ENDS), quintic(way, 1.0 - _LIFT_ENDS, 1.0)
        lift = [up - down for up, down in zip(rise, sink, strict=True)]
        move = np.concatenate([ACROSS * self.across, [self.turn]])[: len(self.around)]
        climb = np.concatenate([LIFT * self.up, [0.0]])[: len(self.around)]
        pose, first, second = (
            self.scale * (np.multiply.outer(a, move) + np.multiply.outer(b, climb))
            for a, b in zip(across, lift, strict=True)
        )
        middle = self.around - self.scale * (move + climb) / 2.0
        return middle + pose, rate[:, None] * first, 4.0 * second


def up(robot: Manipulator) -> Array:
    """Return the unit vector against gravity, or the platform's axis where there is none."""
    gravity = np.array(robot.gravity)
    strength = float(np.linalg.norm(gravity))
    return -gravity / strength if strength > 0.0 else np.array(robot.platform.axis)


def across_directions(robot: Manipulator, direction: ArrayLike | None, count: int) -> Array:
    """Return horizontal unit vectors: the given direction made horizontal, or `count` of them.

    These start at the platform's x axis (or y, where x is nearer to the vertical) and go round.
    """
    vertical = up(robot)

    def level(v: Array) -> Array:
        return np.asarray(v - (v @ vertical) * vertical, dtype=float)

    if direction is not None:
        given = np.asarray(direction, dtype=float)
        flat = level(given)
        length = float(np.linalg.norm(flat))
        if not length > 1e-9 * float(np.linalg.norm(given)):
            raise DataError(f"direction: {given.tolist()} has no horizontal part")
        return flat[None] / length
    x, y, _ = (level(np.array(axis)) for axis in robot.platform.frame)
    first = x if np.linalg.norm(x) > 0.5 else y
    first = first / np.linalg.norm(first)
    angles = 2.0 * np.pi * np.arange(count) / count
    second = np.cross(vertical, first)
    return np.asarray(np.outer(np.cos(angles), first) + np.outer(np.sin(angles), second))
