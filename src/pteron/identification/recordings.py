"""Recordings: logs in memory, or files read in pieces, divided into rows to fit and to hold out.

Held-out rows judge the fit. `read_recording` mends time stamps first, and leaves lead-in and
lead-out aside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from pteron.errors import DataError
from pteron.identification.logs import Finding, Log, LogFile
from pteron.identification.logs.bridging import fill_gaps
from pteron.identification.logs.time_stamps import TimeStamps
from pteron.identification.signals.repetition import repeating_rows
from pteron.kernels import Array

_LOOKED_AT = 2_000_000
"""Most rows of a long file from which the errors of a fit to it are computed."""

_END = int(np.iinfo(np.int64).max)
"""A row beyond the last one of every file: its number of rows is known only when it has been
read."""

_ROUNDINGS = 2.0
"""Distance of time stamps from an even clock, in spacings of floats, that counts as rounding."""

FITTED = 0.7
"""Share of a log that is fitted, about, where no other log is held out."""


@dataclass(frozen=True)
class Recording:
    """A log, or its rows `start` to `stop`, that can be read more than once.

    Rows count from 0, without row `stop`, which may lie beyond the last. `tell` is called with the
    number of rows just read.
    """

    log: Log | LogFile
    start: int
    stop: int
    tell: Callable[[int], None] | None = field(default=None, repr=False, compare=False)

    @property
    def source(self) -> str:
        """Its name in messages."""
        return self.log.source

    @property
    def rows(self) -> int:
        """Number of rows, by estimate for a file."""
        known = self.log.rows if isinstance(self.log, Log) else self.log.rows_estimate or 0
        return max(min(self.stop, known) - self.start, 1)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Oddities that were noticed as it was read."""
        return self.log.findings

    def head(self) -> Log:
        """Return the log itself where it is in memory, else its first piece."""
        if isinstance(self.log, Log):
            return self.log.part(self.start, self.stop)
        return next(iter(replace(self, tell=None).pieces()))

    def pieces(self) -> Iterator[Log]:
        """Yield the rows in order, a piece at a time."""
        if isinstance(self.log, Log):
            yield self.log.part(self.start, self.stop)
            if self.tell is not None:
                self.tell(self.rows)
            return
        for piece in self.log.pieces(progress=self.tell):
            if piece.first_row >= self.stop:
                return
            first = max(self.start - piece.first_row, 0)
            last = min(self.stop - piece.first_row, piece.rows)
            if first < last:
                yield piece.part(first, last)

    def first_rows(self) -> Recording:
        """Return the first rows of a large file, enough to look at; else the whole log."""
        if isinstance(self.log, Log):
            return self
        return replace(self, stop=min(self.stop, self.start + _LOOKED_AT))

    def samples(self) -> Log | Iterator[Log]:
        """Return the log where it is in memory, else its pieces."""
        return self.head() if isinstance(self.log, Log) else self.pieces()


def read_recording(
    log: Log | LogFile, progress: Callable[[int], None] | None = None, period: float | None = None
) -> Recording:
    """Return a log as a recording, with gaps filled; files of a usual length are read whole.

    Of a log whose description says that its motion leads in and out, the rows that repeat after the
    period (s; by default as described) are taken.
    """
    if isinstance(log, LogFile) and (log.rows_estimate or 0) <= log.rows_in_memory:
        log = log.read(progress)
    if isinstance(log, Log):
        log = fill_gaps(replace(log, time=_rebase_times(log.time), findings=_stamp_findings(log)))
        log = periodic_part(log, period)
        return Recording(log, 0, log.rows)
    return Recording(log, 0, _END)


def _stamp_findings(log: Log) -> tuple[Finding, ...]:
    """Return a log's findings, or those of its time stamps if it has none."""
    if log.findings or log.rows < 2:
        return log.findings
    stamps = TimeStamps(1.0 / log.rate, "t", log.source)
    stamps.take(log.time)
    return stamps.findings()


def periodic_part(log: Log, period: float | None = None) -> Log:
    """Return the part of a log with lead-in and lead-out that repeats, and a finding of its rows.

    Another log is returned as it is. Where nothing repeats after the period (s; by default as
    described), or the log has a phase with a payload and one without, all of it is returned as a
    motion that is not periodic.
    """
    about = log.description
    period = period or about.period
    if period is None or (about.start is None and about.end is None):
        return log
    phases = log.payload is not None and bool(np.ptp(log.payload))
    rows = None if phases else repeating_rows(log.time, log.joints, period)
    if rows is None:
        reason = "it has two phases of payload" if phases else "nothing in it repeats"
        part, part_period = log, None
        consequence = "the whole log is taken as a motion that is not periodic"
    else:
        first, last = (log.first_row + row + 1 for row in (rows.start, rows.stop - 1))
        reason = f"rows {first} to {last} repeat"
        part, part_period = log.part(rows.start, rows.stop), period
        consequence = "lead-in, lead-out and rest are left out"
    if not phases:
        reason += f" after the period of {period:g} s"
    return replace(
        part,
        time=part.time - part.time[0],
        description=replace(about, period=part_period, start=None, end=None),
        findings=(
            *log.findings,
            Finding("periodic", f"{log.source}: {reason}; {consequence}", part.first_row + 1),
        ),
    )


def hold_same_samples(first: Recording, other: Recording) -> bool:
    """Return whether two recordings have the same samples."""
    a, b = first.head(), other.head()
    return np.array_equal(a.forces, b.forces) and np.array_equal(a.joints, b.joints)


def _rebase_times(time: Array) -> Array:
    """Return times (T,), s, relative to the first, without the rounding of large time stamps.

    Those of a steady clock are put on its ticks again, with the roundest step that fits them.
    """
    if len(time) == 0:
        return time
    since: Array = time - time[0]
    rounding = float(np.spacing(np.abs(time).max(initial=0.0)))
    steps = np.diff(since)
    if len(steps) == 0 or not steps.min() > 0.0:
        return since
    ticks = np.r_[0.0, np.cumsum(np.round(steps / np.median(steps)))]
    step = float(since[-1] / ticks[-1])
    rounded = (float(f"{step:.{digits}g}") for digits in range(1, 17))
    roundest = (candidate for candidate in rounded if abs(candidate - step) * ticks[-1] <= rounding)
    step = next(roundest, step)
    steady: Array = ticks * step
    return steady if np.abs(since - steady).max() <= _ROUNDINGS * rounding else since


def split_test_data(recording: Recording, period: float | None) -> tuple[Recording, Recording]:
    """Return the part of a recording to fit, and the part to hold out: its end.

    At a whole number of periods, where the motion is periodic: with `period`, or as it is declared.
    Of a log that carries a payload at times, the end of each phase is held out: both are fitted.
    """
    log = recording.log
    period = period or log.description.period
    if isinstance(log, Log) and log.payload is not None and np.ptp(log.payload):
        held_out = np.zeros(log.rows, dtype=bool)
        for start, stop in log.phases:
            count = _count_fitted_rows(log.part(start, stop), stop - start, period)
            held_out[start + count : stop] = True
        parts = log.drop_samples(held_out), log.drop_samples(~held_out)
        first, second = (Recording(part, 0, part.rows) for part in parts)
        return first, second
    cut = recording.start + _count_fitted_rows(log, recording.rows, period)
    if cut - recording.start < 2 or recording.start + recording.rows - cut < 2:
        raise DataError(
            f"{recording.source}: {recording.rows} rows are too few to hold some out; record longer"
        )
    return replace(recording, stop=cut), replace(recording, start=cut)


def _count_fitted_rows(log: Log | LogFile, rows: int, period: float | None) -> int:
    """Return how many of a log's rows are fitted."""
    if period is not None and isinstance(log, Log):
        whole_periods = int((log.duration + 1.0 / log.rate) / period + 1e-3)
        if whole_periods >= 2:
            share = min(max(round(FITTED * whole_periods), 1), whole_periods - 1)
            return int(np.searchsorted(log.time, log.time[0] + (share * period - 0.5 / log.rate)))
    return int(FITTED * rows)
