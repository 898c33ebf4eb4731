"""A motion of the platform, sampled in time."""

from __future__ import annotations

from dataclasses import dataclass

from pteron.kernels import Array


@dataclass(frozen=True)
class Motion:
    """A motion of the platform, sampled in time; the derivatives are exact.

    Attributes
    ----------
    time : array, shape (T,)
        s, ascending from 0.
    pose, velocity, acceleration : array, shape (T, m)
        m, rad and s.
    """

    time: Array
    pose: Array
    velocity: Array
    acceleration: Array

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.time[-1] - self.time[0])
