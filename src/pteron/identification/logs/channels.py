"""Channels that stop or jump: dead ones are refused; clipped or frozen ones and spikes are said."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter  # type: ignore[import-untyped]

from pteron.errors import DataError
from pteron.identification.logs.log import Finding

_CLIPPED_ROWS = 3
_CLIPPED_RUNS = 2
"""A force is clipped that holds its extreme for this many rows, this many times."""
_FROZEN_ROWS = 1000
_MOVED = 0.01
"""A channel is frozen that stays for over so many rows while another joint moves this part of
its span."""
_ROUNDING = 1e-9
_FORCES, _JOINTS = 0.5, 0.05
"""Share of a channel's span by which a spike stands out; friction makes forces jump."""
_WINDOW = 5
"""Samples whose median a sample is compared with: steps pass, single samples do not."""
_USUAL = 20.0
"""Distance from the median that makes a spike, in that which one sample in a hundred exceeds."""
_SHARES = (1.0, 99.0)
"""Percentiles between which a channel's usual span lies."""

Values = NDArray[np.float64]


@dataclass
class _Run:
    """A stretch of equal values, and the joint coordinates' bounds meanwhile."""

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
    """What has been seen of one joint coordinate or force.

    Parameters
    ----------
    column, source : str
        What messages call it, and the file.
    spans : array, shape (n,)
        What the travel of each joint is compared with, m or rad.
    joint : int, optional
        Which joint's coordinate this is, from 0; a force if it is not given.
    limits : (float, float), optional
        Declared saturation of a force.
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
        self._column = column
        self._source = source
        self._moved = _MOVED * spans
        self._joint = joint
        self._limits = limits
        self._rows = 0
        self._run: _Run | None = None
        self._high, self._low = _Extreme(), _Extreme()
        self._frozen = 0
        self._first_frozen = (0, 0, 0.0)
        self._beyond = 0
        self._first_beyond = 0
        self._spikes = _Spikes(column, source, _FORCES if joint is None else _JOINTS)

    def take(self, values: Values, joints: Values) -> None:
        """Look at the next piece: this channel, (rows,), and all joint coordinates, (rows, n)."""
        self._spikes.take(values)
        self._high.raise_to(float(values.max()))
        self._low.raise_to(float(-values.min()))
        if self._limits is not None:
            self._compare(values, *self._limits)
        starts = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1])
        firsts = starts + self._rows
        held = values[starts]
        last = joints[starts[-1] :]
        run = _Run(float(held[-1]), int(firsts[-1]), last.min(axis=0), last.max(axis=0))
        open_run = self._run
        if open_run is not None and open_run.value != held[0]:
            self._close(open_run, self._rows)
        elif open_run is not None:
            firsts[0] = open_run.start
            first = joints[: starts[1] if len(starts) > 1 else None]
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
                part = joints[starts[i] : starts[i + 1]]
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
                f"{stop} while other joints move: frozen channel"
            )
            if self._frozen > 1:
                message += f" ({self._frozen} such stretches in all)"
            found.append(Finding("frozen", message, start + 1, self._column, self._frozen))
        if self._joint is None:
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
            moved = run.greatest - run.least > self._moved
            if np.delete(moved, [] if self._joint is None else [self._joint]).any():
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


class _Spikes:
    """The spikes of one channel.

    Parameters
    ----------
    column, source : str
        What messages call it, and the file.
    share : float
        Distance from the median, as a share of the channel's usual span, beyond which it is no
        motion.
    """

    def __init__(self, column: str, source: str, share: float) -> None:
        self._column = column
        self._source = source
        self._share = share
        self._rows = 0
        self._count = 0
        self._first = (0, 0.0)

    def take(self, values: NDArray[np.float64]) -> None:
        """Look at the next piece, shape (rows,); its first and last samples have no neighbours."""
        if len(values) > _WINDOW:
            apart = np.abs(values - median_filter(values, _WINDOW, mode="nearest"))
            low, high = np.percentile(values, _SHARES)
            usual = _USUAL * np.percentile(apart, _SHARES[1])
            found = np.flatnonzero(apart > max(usual, self._share * (high - low)))
            if len(found) and not self._count:
                self._first = (self._rows + int(found[0]), float(values[found[0]]))
            self._count += len(found)
        self._rows += len(values)

    def findings(self) -> tuple[Finding, ...]:
        """Return what was found, once all pieces are taken."""
        if not self._count:
            return ()
        row, value = self._first
        more = f" ({self._count} such samples in all)" if self._count > 1 else ""
        message = (
            f"{self._source}: row {row + 1}, column {self._column}: {value:g} stands out from its "
            f"neighbours: spike{more}"
        )
        return (Finding("spike", message, row + 1, self._column, self._count),)
