"""The check of a log's time stamps: order, gaps and uneven steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.findings import Finding
from pteron.identification.logs.gaps import gaps

_CONTEXT = 32
"""Rows of the piece before that are kept."""

_JITTER = 0.01
"""Steps that differ from the usual one by more than this part of it are uneven."""


class TimeStamps:
    """The record of a log's time stamps; `step` is the usual one, s."""

    def __init__(self, step: float, column: str, source: str) -> None:
        self._step, self._column, self._source = step, column, source
        self._previous = np.zeros(0)
        self._rows = 0
        self._gaps: list[tuple[int, float, float]] = []
        self._uneven = 0
        self._worst = (0.0, 0)

    def take(self, time: NDArray[np.float64]) -> None:
        """Check the next piece, in seconds.

        Raises
        ------
        DataError
            If a time stamp is repeated, runs backward, or is too large to tell its steps.
        """
        vague = np.spacing(np.abs(time)) > self._step
        if vague.any():
            i = int(np.argmax(vague))
            raise DataError(
                f"{self._source}: row {self._rows + i + 1}, column {self._column}: at "
                f"{time[i]:g} s a number's digits cannot tell time steps apart; correct the cell, "
                "or declare the unit of time"
            )
        first = not len(self._previous)
        earlier_times = time[:1] if first else self._previous
        steps = np.diff(time, prepend=earlier_times[-1:])
        if first:
            steps[:1] = self._step
        if (steps <= 0.0).any():
            i = int(np.argmax(steps <= 0.0))
            earlier = float(time[i - 1] if i else earlier_times[-1])
            what = "is repeated" if time[i] == earlier else "runs backward"
            raise DataError(
                f"{self._source}: row {self._rows + i + 1}, column {self._column}: time {what} "
                f"({time[i]:.12g} s behind {earlier:.12g} s); put the rows in order, each with its "
                "own time"
            )
        missing = gaps(np.concatenate([earlier_times, time]), self._step)[len(earlier_times) - 1 :]
        self._gaps += [
            (self._rows + int(i), float(time[i] - steps[i]), float(steps[i]))
            for i in np.flatnonzero(missing)
        ]
        deviations = np.where(missing, 0.0, np.abs(steps - self._step))
        self._uneven += int((deviations > _JITTER * self._step).sum())
        worst = int(np.argmax(deviations))
        if deviations[worst] > self._worst[0]:
            self._worst = (float(deviations[worst]), self._rows + worst)
        self._previous = np.concatenate([earlier_times, time])[-_CONTEXT:]
        self._rows += len(time)

    def findings(self) -> tuple[Finding, ...]:
        """Return the findings of the pieces taken so far."""
        findings = []
        if self._gaps:
            row, start, step = self._gaps[0]
            lost = np.maximum(np.rint([gap[2] / self._step for gap in self._gaps]) - 1.0, 1.0)
            count = len(lost)
            message = (
                f"{self._source}: {count} gap{'s' * (count > 1)}, {lost.sum():.0f} samples missing "
                f"in all; the first is before row {row + 1}, behind t = {start:.9g} s: "
                f"{lost[0]:.0f} missing (a step of {step:.6g} s where {self._step:.6g} s is usual)"
            )
            findings.append(Finding("gap", message, row + 1, self._column, count))
        if self._uneven:
            worst, row = self._worst
            message = (
                f"{self._source}: {self._uneven} time steps differ from the usual "
                f"{self._step:.6g} s by over {_JITTER:.0%}; the worst, at row {row + 1}, by "
                f"{worst / self._step:.1%} ({worst:.3g} s)"
            )
            findings.append(Finding("jitter", message, row + 1, self._column, self._uneven))
        return tuple(findings)
