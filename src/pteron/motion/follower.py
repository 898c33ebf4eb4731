"""A follower: a point that follows a moving target with limits of position, speed, acceleration."""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array

_SPAN = 3.0
"""Time constant of the follower's linear zone in ticks: from 2 on its discrete poles are stable and
do not oscillate."""


class Follower:
    """A point that follows a moving target with limits of position, speed and acceleration.

    Acceleration is constant within a tick. Near the target the error decays with two equal poles,
    far from it the point accelerates and brakes as fast as it may (time-optimal in discrete time;
    J. Han, IEEE Trans. Ind. Electron. 56(3), 2009). Whatever the target does, it can always brake
    before its end of travel: with c = L - |y| - |v| h / 2 the next speed towards the end is at most
    A (sqrt(h^2 + 2 c / A) - h).

    Parameters
    ----------
    half, speed, acceleration : array, shape (k,)
        Ends of travel on both sides of 0, L, and limits of speed, V, and acceleration, A.
    step : float
        The tick h, s.
    """

    def __init__(self, half: Array, speed: Array, acceleration: Array, step: float) -> None:
        self._half, self._speed, self._most, self._step = half, speed, acceleration, step
        self.position, self.velocity = np.zeros_like(half), np.zeros_like(half)
        self.acceleration = np.zeros_like(half)
        self._target: tuple[Array, Array] | None = None

    def place(self, position: Array) -> None:
        """Set the point at rest at a position."""
        self.position, self.velocity = position, np.zeros_like(position)
        self.acceleration = np.zeros_like(position)
        self._target = None

    def retarget(self) -> None:
        """Forget the target: the next one is another."""
        self._target = None

    def advance(self, target: Array, rate: Array, share: float = 1.0) -> None:
        """Advance by a tick towards a target and its rate (k,), at a share of the acceleration."""
        h, y, v = self._step, self.position, self.velocity
        last_target, last_rate = (target, rate) if self._target is None else self._target
        self._target = target, rate
        most = share * self._most
        change = (rate - last_rate) / h
        change = change + _time_optimal(y - last_target, v - last_rate, most, _SPAN * h)
        change = np.minimum(np.maximum(change, -most), most)
        a, halfway = self._most, 0.5 * h * v
        upper = a * (np.sqrt(h * h + 2.0 * np.maximum(self._half - y - halfway, 0.0) / a) - h)
        lower = -a * (np.sqrt(h * h + 2.0 * np.maximum(self._half + y + halfway, 0.0) / a) - h)
        velocity = np.minimum(v + h * change, np.minimum(upper, self._speed))
        velocity = np.maximum(velocity, np.maximum(lower, -self._speed))
        self.position = y + 0.5 * h * (v + velocity)
        self.velocity, self.acceleration = velocity, (velocity - v) / h


def _time_optimal(error: Array, rate: Array, most: Array, span: float) -> Array:
    """Return the acceleration (k,) that removes an error soonest without overshoot."""
    zone = most * span * span
    drift = span * rate
    ahead = error + drift
    far = drift + 0.5 * np.sign(ahead) * (np.sqrt(zone * (zone + 8.0 * np.abs(ahead))) - zone)
    near = drift + ahead
    aim = np.where(np.abs(ahead) <= zone, near, far)
    return -most * np.clip(aim / zone, -1.0, 1.0)
