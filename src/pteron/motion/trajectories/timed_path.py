"""Curves of poses traversed in a given duration, and paths timed stretch by stretch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pteron.kernels import Array
from pteron.motion.trajectories.path import Path
from pteron.motion.trajectories.time_polynomials import Progress
from pteron.motion.trajectories.tool import Curve


@dataclass(frozen=True)
class Timed:
    """A curve of poses over a unit of time, traversed in a duration.

    Attributes
    ----------
    curve : callable
        From tau (T,) in [0, 1] to poses (T, m) and two derivatives by tau.
    duration : float
        The duration, s.
    """

    curve: Callable[[Array], Curve]
    duration: float

    def slow_down(self, factor: float) -> Timed:
        """Return the timed curve with its duration multiplied by a factor."""
        return Timed(self.curve, factor * self.duration)

    def at(self, time: Array) -> Curve:
        """Return poses, velocities and accelerations, (T, m) each, at times (T,), s."""
        pose, first, second = self.curve(time / self.duration)
        return pose, first / self.duration, second / self.duration**2


def timed_path(
    path: Path,
    durations: Sequence[float],
    laws: Sequence[Progress],
    rests: Sequence[float] | None = None,
) -> Timed:
    """Return a path with time: a duration, s, and a time law for each part between rests.

    The rests are arc lengths s, m; by default the path's.
    """
    rests = path.rests if rests is None else rests
    duration = float(sum(durations))
    starts = np.concatenate([[0.0], np.cumsum(durations)]) / duration

    def curve(tau: Array) -> Curve:
        """Return poses and their first two derivatives by tau, (T, m) each, at tau from 0 to 1."""
        k = np.clip(np.searchsorted(starts, tau, side="right") - 1, 0, len(laws) - 1)
        s, rate, gain = np.zeros((3, len(tau)))
        for j, law in enumerate(laws):
            in_stretch, span = k == j, starts[j + 1] - starts[j]
            begin, end = rests[j : j + 2]
            share, first, second = law((tau[in_stretch] - starts[j]) / span)
            s[in_stretch] = begin + (end - begin) * share
            rate[in_stretch] = (end - begin) * first / span
            gain[in_stretch] = (end - begin) * second / span**2
        pose, by_s, bend = path.at(s)
        rate, gain = rate[:, None], gain[:, None]
        return pose, by_s * rate, bend * rate**2 + by_s * gain

    return Timed(curve, duration)
