"""Channels that stop during a log: dead ones are refused, clipped or frozen ones are findings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.findings import Finding, Kind
from pteron.tolerances import ROUNDING

_CLIPPED_ROWS = 3
"""Rows for which a force holds its extreme value, in each of the stretches that tell of clipping:
two equal rows are common where forces are rounded."""

_CLIPPED_RUNS = 2
"""Stretches from which on a force counts as clipped: one may be the machine at rest against a
stop."""

_FROZEN_ROWS = 1000
"""Rows for which a channel stays, and beyond which it counts as frozen if a joint moves: a second
of a log at 1 kHz, much longer than a joint stands at its reversal."""

_MOVED = 0.01
"""Share of its span by which a joint must move meanwhile: more than any noise of an encoder."""
_RESTED = 10.0
"""Factor on that share at the beginning and the end of a log: a motion starts slowly, and not with
all joints at once."""

Values = NDArray[np.float64]
"""Values of a channel, or of all joints, row by row."""


@dataclass
class _Run:
    """A stretch of equal values, and the joint coordinates' bounds meanwhile."""

    value: float
    start: int
    stop: int
    least: Values
    greatest: Values

    @property
    def rows(self) -> int:
        """The number of rows in the stretch."""
        return self.stop - self.start


class Channel:
    """The record of one force, or of the coordinate of `joint`, counted from 0.

    The travel of each joint is compared with `spans`, (n,); `limits` are a force's, as declared.
    """

    def __init__(
        self,
        column: str,
        source: str,
        spans: Values,
        *,
        joint: int | None = None,
        limits: tuple[float, float] | None = None,
    ) -> None:
        self._column, self._source = column, source
        self._least_travel = _MOVED * spans
        if joint is not None:
            self._least_travel[joint] = np.inf
        self._is_force, self._limits = joint is None, limits
        self._rows = self._beyond = self._first_beyond = 0
        self._least, self._greatest = np.inf, -np.inf
        self._runs: list[_Run] = []

    def take(self, samples: Values, joints: Values) -> None:
        """Examine the next piece: this channel, (rows,), and all joint coordinates, (rows, n)."""
        self._least = min(self._least, float(samples.min()))
        self._greatest = max(self._greatest, float(samples.max()))
        if self._limits is not None:
            low, high = self._limits
            rounding = ROUNDING * max(abs(low), abs(high))
            beyond = (samples <= low + rounding) | (samples >= high - rounding)
            if not self._beyond:
                self._first_beyond = self._rows + int(np.argmax(beyond))
            self._beyond += int(beyond.sum())
        starts = np.flatnonzero(np.diff(samples, prepend=np.nan))
        lengths = np.diff(starts, append=len(samples))
        levels = samples[starts]
        extreme = np.isin(levels, [self._least, self._greatest])
        telling = (lengths > _FROZEN_ROWS) | extreme & (lengths >= _CLIPPED_ROWS)
        # The first may go on with the run of the piece before, and the last in the next one.
        telling[[0, -1]] = True
        for i in np.flatnonzero(telling):
            start, stop = int(starts[i]), int(starts[i] + lengths[i])
            least, greatest = joints[start:stop].min(axis=0), joints[start:stop].max(axis=0)
            run = _Run(float(levels[i]), self._rows + start, self._rows + stop, least, greatest)
            last = self._runs[-1] if self._runs else run
            if i == 0 and last is not run and last.value == run.value:
                last.stop = run.stop
                last.least = np.minimum(last.least, least)
                last.greatest = np.maximum(last.greatest, greatest)
            else:
                self._runs.append(run)
        self._rows += len(samples)

    def finish(self) -> tuple[Finding, ...]:
        """Return the findings, after all pieces.

        Raises
        ------
        DataError
            If the channel held one value throughout.
        """
        runs, column, findings = self._runs, f"column {self._column}", []
        if runs and runs[0].rows == self._rows:
            raise DataError(
                f"{self._source}: {column} holds {runs[0].value:g} in all {self._rows} rows: dead "
                "channel; record it again, or correct which columns are read"
            )
        frozen = [run for run in runs if run.rows > _FROZEN_ROWS and self._is_frozen(run)]
        if frozen:
            first, count_text = frozen[0], f" ({len(frozen)} such stretches in all)"
            message = (
                f"{column} holds {first.value:g} in rows {first.start + 1} to {first.stop} while "
                f"other joints move: frozen channel{count_text * (len(frozen) > 1)}"
            )
            findings.append(self._make_finding("frozen", message, first.start, len(frozen)))
        if self._limits is not None and self._beyond:
            low, high = self._limits
            message = (
                f"{column} is at or beyond its limits {low:g} and {high:g} in "
                f"{self._beyond} rows, first in row {self._first_beyond + 1}: clipped"
            )
            findings.append(
                self._make_finding("clipped", message, self._first_beyond, self._beyond)
            )
        for word, extreme in (("greatest", self._greatest), ("least", self._least)):
            extreme_runs = [r for r in runs if r.value == extreme and r.rows >= _CLIPPED_ROWS]
            if self._limits is None and self._is_force and len(extreme_runs) >= _CLIPPED_RUNS:
                rows, start = sum(run.rows for run in extreme_runs), extreme_runs[0].start
                message = (
                    f"{column} holds its {word} value {extreme:g} in {len(extreme_runs)} "
                    f"stretches, {rows} rows in all, first from row {start + 1}: clipped"
                )
                findings.append(self._make_finding("clipped", message, start, rows))
        return tuple(findings)

    def _is_frozen(self, run: _Run) -> bool:
        """Return whether other joints move too far in a stretch for the channel to be at rest."""
        at_the_end = run.start == 0 or run.stop == self._rows
        moved = self._least_travel * (_RESTED if at_the_end else 1.0)
        return bool((run.greatest - run.least > moved).any())

    def _make_finding(self, kind: Kind, message: str, start: int, count: int) -> Finding:
        """Return a finding about this channel; `start` counts rows from 0."""
        return Finding(kind, f"{self._source}: {message}", start + 1, self._column, count)
