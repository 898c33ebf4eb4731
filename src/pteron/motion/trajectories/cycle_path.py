"""The path of a pick-and-place cycle, one way, as a function of its arc length."""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array
from pteron.motion.trajectories.cycle import Cycle
from pteron.motion.trajectories.path import path_weights
from pteron.motion.trajectories.tool import Curve, pose_motion, tool_motion

_EDGE = 1e-3
"""Share of a cycle's travel, at each end, that is taken as a straight line."""

_NODES = 2001
"""Number of nodes between which the arc length is interpolated."""


class CyclePath:
    """The path of a pick-and-place cycle from one end to the other, as a function of its length.

    It is the first half of the cycle in time.
    """

    def __init__(self, cycle: Cycle) -> None:
        self._cycle = cycle
        self._weights = path_weights(cycle.platform)
        self._ends = 0.5 * _EDGE, 0.5 * (1.0 - _EDGE)
        tau = np.linspace(*self._ends, _NODES)
        nodes, shares = np.polynomial.legendre.leggauss(5)
        span = tau[1] - tau[0]
        speeds = self._speed((tau[:-1, None] + 0.5 * span * (nodes + 1.0)).ravel())
        pieces = 0.5 * span * (speeds.reshape(-1, 5) @ shares)
        # Before and after them the path is straight and starts from rest: speed grows as tau^2.
        edges = self._weighted_pose(np.array([0.0, self._ends[0], self._ends[1], 0.5]))
        first, last = (float(np.linalg.norm(edges[k + 1] - edges[k])) for k in (0, 2))
        self._tau, self._s = tau, first + np.concatenate([[0.0], np.cumsum(pieces)])
        self.length = float(self._s[-1]) + last
        self.rests = (0.0, self.length)

    def _curve(self, tau: Array) -> Curve:
        """Return the platform's poses (T, m) and two derivatives at cycle parameters tau (T,)."""
        platform = self._cycle.platform
        return tool_motion(platform, *self._cycle.at(tau))

    def _weighted_pose(self, tau: Array) -> Array:
        """Return poses (T, m) at cycle parameters tau (T,), with angles weighted to metres."""
        return self._curve(tau)[0] * self._weights

    def _speed(self, tau: Array) -> Array:
        """Return d s / d tau (T,), the arc length per cycle parameter, m, at tau (T,)."""
        return np.asarray(np.linalg.norm(self._curve(tau)[1] * self._weights, axis=-1))

    def at(self, s: Array) -> Curve:
        """Return poses (T, m) at arc lengths s (T,), m, and two derivatives by s."""
        s = np.clip(np.asarray(s, dtype=float), 0.0, self.length)
        clipped = np.clip(s, self._s[0], self._s[-1])
        tau = self._times(clipped)
        place, rate, bend = self._curve(tau)
        speed = np.linalg.norm(rate * self._weights, axis=-1)[:, None]
        first = rate / speed
        projection = np.sum(bend * first * self._weights**2, axis=-1)[:, None]
        second = (bend - projection * first) / speed**2
        excess = (s - clipped)[:, None]
        second = np.where(excess == 0.0, second, 0.0)
        return pose_motion(self._cycle.platform, place + excess * first, first, second)

    def _times(self, s: Array) -> Array:
        """Return the cycle parameters tau (T,) at arc lengths s (T,), m, by Newton's method."""
        k = np.clip(np.searchsorted(self._s, s, side="right") - 1, 0, len(self._tau) - 2)
        low, high = self._tau[k], self._tau[k + 1]
        nodes, shares = np.polynomial.legendre.leggauss(5)
        tau = low + (high - low) * (s - self._s[k]) / (self._s[k + 1] - self._s[k])
        for _ in range(4):
            span = tau - low
            nodes_of_span = low[:, None] + 0.5 * span[:, None] * (nodes + 1.0)
            covered = 0.5 * span * (self._speed(nodes_of_span.ravel()).reshape(-1, 5) @ shares)
            tau = np.clip(tau - (self._s[k] + covered - s) / self._speed(tau), low, high)
        return tau

    def place(self, s: float) -> str:
        """Return as text where the arc length s, m, lies on the path."""
        return f"{s:.4g} m along its path of {self.length:.4g} m"
