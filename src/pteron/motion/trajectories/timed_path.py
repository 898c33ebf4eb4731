"""Motions as functions of time that can be slowed as a whole: a path with time laws, or a curve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from pteron.kernels import Array
from pteron.motion.trajectories.path import Path
from pteron.motion.trajectories.time_polynomials import Progress
from pteron.motion.trajectories.tool import Curve


@dataclass(frozen=True)
class Course:
    """A path traversed in time, from rest to rest.

    Attributes
    ----------
    path : Path
        The path.
    durations : tuple of float
        Of each stretch between two rests, s.
    laws : tuple of Progress
        The time law of each of them.
    """

    path: Path
    durations: tuple[float, ...]
    laws: tuple[Progress, ...]

    @property
    def duration(self) -> float:
        """Duration of all stretches together, s."""
        return float(sum(self.durations))

    def slowed(self, factor: float) -> Course:
        """Return the course with all its times longer by a factor."""
        return Course(self.path, tuple(factor * d for d in self.durations), self.laws)

    def at(self, time: Array) -> Curve:
        """Return poses, velocities and accelerations, (T, m) each, at times (T,), s."""
        starts = np.concatenate([[0.0], np.cumsum(self.durations)])
        k = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(self.laws) - 1)
        s, rate, gain = (np.zeros(len(time)) for _ in range(3))
        for j, law in enumerate(self.laws):
            own = k == j
            begin, end = self.path.rests[j : j + 2]
            share, first, second = law((time[own] - starts[j]) / self.durations[j])
            s[own] = begin + (end - begin) * share
            rate[own] = (end - begin) * first / self.durations[j]
            gain[own] = (end - begin) * second / self.durations[j] ** 2
        pose, by_s, bend = self.path.at(s)
        rate, gain = rate[:, None], gain[:, None]
        return pose, by_s * rate, bend * rate**2 + by_s * gain


@dataclass(frozen=True)
class Timed:
    """A curve of poses over one unit of time, traversed in a given duration.

    Attributes
    ----------
    curve : callable
        From tau (T,) in [0, 1] to poses (T, m) and two derivatives by tau.
    duration : float
        s.
    """

    curve: Callable[[Array], Curve]
    duration: float

    def slowed(self, factor: float) -> Timed:
        """Return the same with all its times longer by a factor."""
        return Timed(self.curve, factor * self.duration)

    def at(self, time: Array) -> Curve:
        """Return poses, velocities and accelerations, (T, m) each, at times (T,), s."""
        pose, first, second = self.curve(time / self.duration)
        return pose, first / self.duration, second / self.duration**2


@runtime_checkable
class InTime(Protocol):
    """A motion in time that can be slowed: a `Course`, or a curve that is `Timed`."""

    @property
    def duration(self) -> float:
        """Duration, s."""

    def at(self, time: Array, /) -> Curve:
        """Return poses, velocities and accelerations, (T, m) each, at times (T,), s."""

    def slowed(self, factor: float, /) -> InTime:
        """Return the same with all its times longer by a factor."""
