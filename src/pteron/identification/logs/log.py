"""A log: the recorded motion of a machine, in SI units."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Int

from pteron.conventions import BatchOfNumbers, BatchOfPoses, BatchOfSliders
from pteron.identification.logs.description import Description
from pteron.identification.logs.finding import Finding
from pteron.identification.logs.time_stamps import GAP

__all__ = ["Log"]

_Phases = Int[np.ndarray, "*batch"]


@dataclass(frozen=True)
class Log:
    """Samples of a motion, or a part of them; the arrays are not copied and not to be changed.

    Parameters
    ----------
    source : str
        What messages call the file.
    time : array, shape (T,)
        s, rising.
    sliders : array, shape (T, n)
        Slider coordinates, m.
    forces : array, shape (T, n)
        Actuator forces in `description.force_unit`: N, or the drive's own unit where no gains are
        known.
    pose : array, shape (T, m), optional
        Measured poses, m and rad.
    payload : array of int, shape (T,), optional
        1 where the payload is carried, 0 where not.
    description : Description
        What is known beside the numbers.
    findings : tuple of Finding
        What was noticed and left as it is.
    first_row : int
        Index from 0 of the first sample among the data rows of its file.
    step : float, optional
        The usual time step of the file, s; the median step of these samples if it is not given.
    """

    source: str
    time: BatchOfNumbers
    sliders: BatchOfSliders
    forces: BatchOfSliders
    pose: BatchOfPoses | None = None
    payload: _Phases | None = None
    description: Description = field(default_factory=Description)
    findings: tuple[Finding, ...] = ()
    first_row: int = 0
    step: float | None = None

    def __len__(self) -> int:
        return len(self.time)

    @property
    def rows(self) -> int:
        """Number of samples T."""
        return len(self.time)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.time[-1] - self.time[0]) if self.rows else 0.0

    @property
    def rate(self) -> float:
        """Samples a second: one over the usual step, Hz; NaN for fewer than two samples."""
        if self.step is not None:
            return 1.0 / self.step
        return 1.0 / float(np.median(np.diff(self.time))) if self.rows > 1 else float("nan")

    @property
    def segments(self) -> tuple[slice, ...]:
        """The stretches without a gap, in order; together they are the whole log."""
        if not self.rows:
            return ()
        gaps = np.flatnonzero(np.diff(self.time) * self.rate > GAP) + 1
        edges = [0, *(int(i) for i in gaps), self.rows]
        return tuple(slice(a, b) for a, b in pairwise(edges))

    def place(self, index: int) -> str:
        """Return where in its file a sample is, its row counted from 1."""
        return f"{self.source}: row {self.first_row + index + 1}"

    def part(self, start: int, stop: int) -> Log:
        """Return the samples from `start` up to, not including, `stop`, as views.

        The findings stay those of the whole file; their rows are rows of the file.
        """
        start, stop, _ = slice(start, stop).indices(self.rows)
        return replace(
            self,
            time=self.time[start:stop],
            sliders=self.sliders[start:stop],
            forces=self.forces[start:stop],
            pose=None if self.pose is None else self.pose[start:stop],
            payload=None if self.payload is None else self.payload[start:stop],
            first_row=self.first_row + start,
        )
