"""Channels that stop during a log: dead ones are refused, clipped or frozen ones are findings."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.log import Finding, Kind

_CLIPPED_ROWS = 3
"""Rows for which a force holds its extreme value, in each of the stretches that tell of
clipping."""

_CLIPPED_RUNS = 2
"""Stretches from which on a force counts as clipped."""

_FROZEN_ROWS = 1000
"""Rows for which a channel stays, and beyond which it counts as frozen if a joint moves."""

_MOVED = 0.01
"""Share of its span by which a joint must move meanwhile."""
_RESTED = 10.0
"""Factor on that share at the beginning and the end of a log: a motion starts slowly, and not with
all joints at once."""

_ROUNDING = 1e-9
"""Difference from a declared limit that counts as rounding, over the limits' size."""

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


@dataclass
class _Tally:
    """A count of an event, with the row and values of the first."""

    count: int = 0
    row: int = 0
    first: tuple[float, ...] = ()

    def add(self, count: int, row: int, *first: float) -> None:
        if count and not self.count:
            self.row, self.first = row, first
        self.count += count


@dataclass
class _Extreme:
    """A count of the runs that hold the greatest value so far, or the least."""

    word: str
    sign: float
    value: float = -np.inf
    runs: int = 0
    rows: _Tally = field(default_factory=_Tally)

    def look(self, values: Values) -> None:
        greatest = float((self.sign * values).max())
        if greatest > self.value:
            self.value, self.runs, self.rows = greatest, 0, _Tally()


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
        self._moved = _MOVED * spans
        if joint is not None:
            self._moved[joint] = np.inf
        self._is_force, self._limits = joint is None, limits
        self._rows = 0
        self._run: _Run | None = None
        self._extremes = (_Extreme("greatest", 1.0), _Extreme("least", -1.0))
        self._frozen, self._beyond = _Tally(), _Tally()

    def take(self, values: Values, joints: Values) -> None:
        """Look at the next piece: this channel, (rows,), and all joint coordinates, (rows, n)."""
        for extreme in self._extremes:
            extreme.look(values)
        if self._limits is not None:
            low, high = self._limits
            rounding = _ROUNDING * max(abs(low), abs(high))
            beyond = (values <= low + rounding) | (values >= high - rounding)
            self._beyond.add(int(beyond.sum()), self._rows + int(np.argmax(beyond)))
        starts = np.flatnonzero(np.diff(values, prepend=np.nan))
        lengths = np.diff(starts, append=len(values))
        held = values[starts]
        extreme_held = np.isin(held, [one.sign * one.value for one in self._extremes])
        telling = (lengths > _FROZEN_ROWS) | extreme_held & (lengths >= _CLIPPED_ROWS)
        # The first may go on with the run of the piece before, the last is still open.
        telling[[0, -1]] = True
        for i in np.flatnonzero(telling):
            start, stop, last = int(starts[i]), int(starts[i] + lengths[i]), self._run
            least, greatest = joints[start:stop].min(axis=0), joints[start:stop].max(axis=0)
            run = _Run(float(held[i]), self._rows + start, self._rows + stop, least, greatest)
            if last is not None and i == 0 and last.value == run.value:
                run.start = last.start
                run.least = np.minimum(last.least, least)
                run.greatest = np.maximum(last.greatest, greatest)
            elif last is not None:
                self._close(last)
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
            self._close(self._run, last=True)
            self._run = None
        column = f"column {self._column}"
        found = []
        if self._frozen.count:
            stop, value = self._frozen.first
            message = (
                f"{column} holds {value:g} in rows {self._frozen.row + 1} to {stop:.0f} while "
                f"other joints move: frozen channel{_more(self._frozen, 'stretches')}"
            )
            found.append(self._finding("frozen", message, self._frozen))
        if self._limits is not None and self._beyond.count:
            low, high = self._limits
            message = (
                f"{column} is at or beyond its limits {low:g} and {high:g} in "
                f"{self._beyond.count} rows, first in row {self._beyond.row + 1}: clipped"
            )
            found.append(self._finding("clipped", message, self._beyond))
        if self._limits is None and self._is_force:
            for one in self._extremes:
                if one.runs >= _CLIPPED_RUNS:
                    message = (
                        f"{column} holds its {one.word} value {one.sign * one.value:g} in "
                        f"{one.runs} stretches, {one.rows.count} rows in all, first from row "
                        f"{one.rows.row + 1}: clipped"
                    )
                    found.append(self._finding("clipped", message, one.rows))
        return tuple(found)

    def _close(self, run: _Run, *, last: bool = False) -> None:
        moved = self._moved * (_RESTED if last or run.start == 0 else 1.0)
        rows = run.stop - run.start
        for extreme in self._extremes:
            if rows >= _CLIPPED_ROWS and run.value == extreme.sign * extreme.value:
                extreme.runs += 1
                extreme.rows.add(rows, run.start)
        if rows > _FROZEN_ROWS and (run.greatest - run.least > moved).any():
            self._frozen.add(1, run.start, run.stop, run.value)

    def _finding(self, kind: Kind, message: str, tally: _Tally) -> Finding:
        message = f"{self._source}: {message}"
        return Finding(kind, message, tally.row + 1, self._column, tally.count)


def _more(tally: _Tally, what: str) -> str:
    return f" ({tally.count} such {what} in all)" if tally.count > 1 else ""
