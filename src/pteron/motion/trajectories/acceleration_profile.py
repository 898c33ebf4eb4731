"""Time laws s(t) of piecewise constant acceleration, and their moving averages for less jerk."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pteron.kernels import Array


class Profile(NamedTuple):
    """s(t) with piecewise constant accelerations between nodes (K,)."""

    time: Array
    s: Array
    rate: Array
    gain: Array
    """Acceleration between nodes, (K - 1,)."""

    @classmethod
    def from_squares(cls, grid: Array, squares: Array) -> Profile:
        """Return the profile s(t) of squared speeds `squares` (K,) at the values `grid` of s."""
        rate = np.sqrt(np.maximum(squares, 0.0))
        spans = 2.0 * np.diff(grid) / (rate[1:] + rate[:-1])
        time = np.concatenate([[0.0], np.cumsum(spans)])
        return cls(time, grid, rate, 0.5 * np.diff(squares) / np.diff(grid))

    @property
    def duration(self) -> float:
        """Duration from rest to rest, in the unit of `time`."""
        return float(self.time[-1])

    def smooth(self, h: float) -> Callable[[Array], tuple[Array, Array, Array]]:
        """Return a function of tau (0 to 1): s averaged over +-h by a triangular weight.

        The acceleration is continuous; the jerk is continuous except for steps.
        """
        stretched_duration = self.duration + 2.0 * h

        def progress(tau: Array) -> tuple[Array, Array, Array]:
            """Return s and its first two derivatives by tau, (T,) each, at tau from 0 to 1."""
            t = np.clip(stretched_duration * tau - h, -h, self.duration + h)
            s, rate = self._state(t)
            ahead, behind = self._moments(t, h), self._moments(t, -h)
            gains, rates, parts = ((a + b) / h**2 for a, b in zip(ahead, behind, strict=True))
            return s + parts, (rate + rates) * stretched_duration, gains * stretched_duration**2

        return progress

    def _state(self, t: Array) -> tuple[Array, Array]:
        """Return the path parameter s and its rate s' (T,) at times (T,)."""
        clipped = np.clip(t, 0.0, self.duration)
        k = np.clip(np.searchsorted(self.time, clipped, side="right") - 1, 0, len(self.gain) - 1)
        d = clipped - self.time[k]
        inside = clipped == t
        return (
            self.s[k] + d * (self.rate[k] + d * self.gain[k] / 2.0),
            np.where(inside, self.rate[k] + d * self.gain[k], 0.0),
        )

    def _moments(self, t: Array, h: float) -> tuple[Array, Array, Array]:
        """Return integrals (T,) of s'' from t to t + h, weighted by (h - r)^k / k!, k = 1, 2, 3.

        The integrals of (h - r)^k / k! s''(t + r) over r, k = 1, 2, 3, vanish with h, so that
        averages over any h are exact to rounding.
        """
        edges = np.concatenate([[-np.inf], self.time, [np.inf]])
        gain = np.concatenate([[0.0], self.gain, [0.0]])
        ahead = int(h > 0.0)
        k = np.searchsorted(self.time, t, side="right" if ahead else "left")
        start, sums = np.zeros_like(t), [np.zeros_like(t) for _ in range(3)]
        while (start != h).any():
            end = edges[np.clip(k + ahead, 0, len(edges) - 1)] - t
            end = np.minimum(end, h) if ahead else np.maximum(end, h)
            u = gain[np.clip(k, 0, len(gain) - 1)]
            for order, total in enumerate(sums, start=2):
                total += u * ((h - start) ** order - (h - end) ** order) / math.factorial(order)
            start, k = end, k + (1 if ahead else -1)
        return sums[0], sums[1], sums[2]
