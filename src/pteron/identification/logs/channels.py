"""Channels that stop or jump: dead ones are refused; clipped or frozen ones and spikes are said."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.finding import Finding
from pteron.identification.logs.spikes import Spikes

__all__ = ["Channel"]

_CLIPPED_ROWS = 3
_CLIPPED_RUNS = 2
"""A force is clipped that holds its extreme for this many rows, this many times."""
_FROZEN_ROWS = 1000
_MOVED = 0.01
"""A channel is frozen that stays for over so many rows while another slider moves this part of the
machine's size."""
_ROUNDING = 1e-9
_FORCES, _SLIDERS = 0.5, 0.05
"""Share of a channel's span by which a spike stands out; friction makes forces jump."""

Values = NDArray[np.float64]


@dataclass
class _Run:
    """A stretch of equal values, and between what the sliders were meanwhile."""

    value: float
    start: int
    least: Values
    greatest: Values


@dataclass
class _Extreme:
    """How often the greatest value so far was held."""

    value: float = -np.inf
    runs: int = 0
    rows: int = 0
    first: int = 0

    def raise_to(self, value: float) -> None:
        if value > self.value:
            self.value, self.runs, self.rows = value, 0, 0

    def count(self, start: int, rows: int) -> None:
        if not self.runs:
            self.first = start
        self.runs += 1
        self.rows += rows


class Channel:
    """What has been seen of one slider or force.

    Parameters
    ----------
    column : str
        What the file calls it.
    source : str
        What messages call the file.
    size : float
        The machine's size, m.
    slider : int, optional
        Which slider this is, from 0; a force if it is not given.
    limits : (float, float), optional
        Declared saturation of a force.
    """

    def __init__(
        self,
        column: str,
        source: str,
        size: float,
        *,
        slider: int | None = None,
        limits: tuple[float, float] | None = None,
    ) -> None:
        self._column = column
        self._source = source
        self._moved = _MOVED * size
        self._slider = slider
        self._limits = limits
        self._rows = 0
        self._run: _Run | None = None
        self._high, self._low = _Extreme(), _Extreme()
        self._frozen = 0
        self._first_frozen = (0, 0, 0.0)
        self._beyond = 0
        self._first_beyond = 0
        self._spikes = Spikes(column, source, _FORCES if slider is None else _SLIDERS)

    def take(self, values: Values, sliders: Values) -> None:
        """Look at the next piece: this channel, shape (rows,), and all sliders, (rows, n), in m."""
        self._spikes.take(values)
        self._high.raise_to(float(values.max()))
        self._low.raise_to(float(-values.min()))
        if self._limits is not None:
            self._compare(values, *self._limits)
        starts = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1])
        firsts = starts + self._rows
        held = values[starts]
        last = sliders[starts[-1] :]
        run = _Run(float(held[-1]), int(firsts[-1]), last.min(axis=0), last.max(axis=0))
        open_run = self._run
        if open_run is not None and open_run.value != held[0]:
            self._close(open_run, self._rows)
        elif open_run is not None:
            firsts[0] = open_run.start
            first = sliders[: starts[1] if len(starts) > 1 else None]
            open_run.least = np.minimum(open_run.least, first.min(axis=0))
            open_run.greatest = np.maximum(open_run.greatest, first.max(axis=0))
            if len(starts) == 1:
                run = open_run
            else:
                self._close(open_run, int(firsts[1]))
        # The first run is closed above where it began in an earlier piece.
        begun_here = 1 if len(starts) > 1 and firsts[0] < self._rows else 0
        lengths = np.diff(firsts)
        for i in np.flatnonzero(lengths >= _CLIPPED_ROWS):
            if i >= begun_here:
                part = sliders[starts[i] : starts[i + 1]]
                closed = _Run(float(held[i]), int(firsts[i]), part[0], part[0])
                if lengths[i] > _FROZEN_ROWS:
                    closed.least, closed.greatest = part.min(axis=0), part.max(axis=0)
                self._close(closed, int(firsts[i + 1]))
        self._run = run
        self._rows += len(values)

    def finish(self) -> tuple[Finding, ...]:
        """Return what was found, once all pieces are taken.

        Raises
        ------
        DataError
            If the channel held one value throughout.
        """
        if self._run is not None:
            if self._run.start == 0:
                raise DataError(
                    f"{self._source}: column {self._column} holds {self._run.value:g} in all "
                    f"{self._rows} rows: dead channel; record it again, or correct which columns "
                    "are read"
                )
            self._close(self._run, self._rows)
            self._run = None
        found = []
        if self._frozen:
            start, stop, value = self._first_frozen
            message = (
                f"{self._source}: column {self._column} holds {value:g} in rows {start + 1} to "
                f"{stop} while other sliders move: frozen channel"
            )
            if self._frozen > 1:
                message += f" ({self._frozen} such stretches in all)"
            found.append(Finding("frozen", message, start + 1, self._column, self._frozen))
        if self._slider is None:
            found += self._clipped()
        found += self._spikes.findings()
        return tuple(found)

    def _compare(self, values: Values, low: float, high: float) -> None:
        room = _ROUNDING * max(abs(low), abs(high))
        beyond = (values <= low + room) | (values >= high - room)
        count = int(np.count_nonzero(beyond))
        if count and not self._beyond:
            self._first_beyond = self._rows + int(np.argmax(beyond))
        self._beyond += count

    def _close(self, run: _Run, stop: int) -> None:
        rows = stop - run.start
        if rows >= _CLIPPED_ROWS:
            for extreme, value in ((self._high, run.value), (self._low, -run.value)):
                if value == extreme.value:
                    extreme.count(run.start, rows)
        if rows > _FROZEN_ROWS:
            moved = run.greatest - run.least
            others = np.delete(moved, [] if self._slider is None else [self._slider])
            if others.max() > self._moved:
                if not self._frozen:
                    self._first_frozen = (run.start, stop, run.value)
                self._frozen += 1

    def _clipped(self) -> list[Finding]:
        if self._limits is not None:
            if not self._beyond:
                return []
            low, high = self._limits
            message = (
                f"{self._source}: column {self._column} is at or beyond its limits {low:g} and "
                f"{high:g} in {self._beyond} rows, first in row {self._first_beyond + 1}: clipped"
            )
            row = self._first_beyond + 1
            return [Finding("clipped", message, row, self._column, self._beyond)]
        found = []
        for extreme, word, sign in ((self._high, "greatest", 1), (self._low, "least", -1)):
            if extreme.runs >= _CLIPPED_RUNS:
                message = (
                    f"{self._source}: column {self._column} holds its {word} value "
                    f"{sign * extreme.value:g} in {extreme.runs} stretches, {extreme.rows} rows in "
                    f"all, first from row {extreme.first + 1}: clipped"
                )
                row = extreme.first + 1
                found.append(Finding("clipped", message, row, self._column, extreme.rows))
        return found
