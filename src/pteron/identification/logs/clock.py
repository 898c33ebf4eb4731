"""The time of a log's rows, in seconds: from numbers in a unit, from text, or from two columns."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pteron.errors import DataError, shorten
from pteron.identification.logs.description import TimeFormat, TimeUnit
from pteron.tables import Table, declaration

PER_SECOND: dict[str, float] = {"s": 1.0, "ms": 1e3, "us": 1e6, "100 ns": 1e7, "ns": 1e9}
"""Units of time, with their number in a second."""

_EPOCHS: tuple[tuple[float, float, TimeUnit], ...] = (
    (1e8, 1e10, "s"),
    (1e11, 1e13, "ms"),
    (1e14, 1e16, "us"),
    (1.1e17, 1.5e17, "100 ns"),
    (2e17, 1e19, "ns"),
)
"""Least and greatest number that is taken as a present-day date, and its unit: since 1970 or, in
100 ns, since 1601."""

_DATES: dict[str, TimeFormat] = {
    r"\d{4}[-./]\d\d?[-./]\d\d?": "YYYY-MM-DD hh:mm:ss",
    r"\d\d?\.\d\d?\.\d{2,4}": "DD.MM.YYYY hh:mm:ss",
    r"\d\d?/\d\d?/\d{2,4}": "DD/MM/YYYY hh:mm:ss",
    "": "hh:mm:ss",
}
"""Formats of dates, by their pattern; with slashes the month may come first too."""

_DATE = ("YYYY", "MM", "DD")
"""Parts of a date."""

_MONTH_FIRST: TimeFormat = "MM/DD/YYYY hh:mm:ss"
"""The format with the month first."""

_TEXT = (
    r"^(?:(\d+)[-./](\d+)[-./](\d+)[T ] ?)?(\d\d?):(\d\d):(\d\d)(?:[.,:](\d{1,9}))?"
    r" ?([AaPp][Mm])?(?:[Zz]|([+-]\d\d):?(\d\d))?$"
)
"""Pattern of a time as text: date, time of day, fraction, AM or PM, and zone."""

_DAY = 86_400
"""Seconds in a day."""

_NANO = 1_000_000_000
"""Nanoseconds in a second."""

_EXACT = 1 << 53
"""Whole numbers from which floats have gaps: larger ones are counted from the first row's."""

Values = NDArray[np.float64]


@dataclass
class Clock:
    """The format of a file's times, and the state of a pass over its rows; a pass begins `fresh`.

    Parameters
    ----------
    columns : tuple of str
        The column of the times, or two: whole seconds, and nanoseconds.
    unit : {"s", "ms", "us", "ns", "100 ns"}
        Unit of times that are numbers.
    format : TimeFormat, optional
        Format of times that are text.
    guessed : bool
        Whether the unit was inferred from the size of the numbers alone.
    """

    columns: tuple[str, ...]
    unit: TimeUnit = "s"
    format: TimeFormat | None = None
    guessed: bool = False
    _origin: int | None = field(default=None, repr=False)
    _last: int = field(default=0, repr=False)
    _days: int = field(default=0, repr=False)

    def fresh(self) -> Clock:
        """Return a copy of the clock that is reset to before the first row."""
        return replace(self, _origin=None, _last=0, _days=0)

    def seconds(self, table: Table) -> Values:
        """Return the times of the next rows, s.

        Times as text count from the midnight before the first row, past later midnights.

        Raises
        ------
        DataError
            If a cell holds no time; the message names the row.
        """
        if len(self.columns) == 2:
            seconds_part, nanoseconds_part = (self._integer_column(table, n) for n in self.columns)
            if seconds_part is not None and nanoseconds_part is not None:
                return self._seconds_of_counts(seconds_part * _NANO + nanoseconds_part, _NANO)
            numbers = table.numbers(self.columns)
            return np.asarray(numbers[:, 0] + numbers[:, 1] / _NANO)
        name = self.columns[0]
        if table.frame[name].dtype.is_temporal():
            return self._seconds_of_counts(
                table.frame[name].cast(pl.Datetime("ns")).cast(pl.Int64), _NANO
            )
        if self.format is not None:
            return self._parse_timestamps(table, name)
        numbers = table.numbers(self.columns)[:, 0]
        if np.abs(numbers).max(initial=0.0) >= _EXACT:
            exact = self._integer_column(table, name)
            if exact is not None:
                return self._seconds_of_counts(exact, PER_SECOND[self.unit])
        return numbers / PER_SECOND[self.unit]

    def _seconds_of_counts(self, counts: pl.Series, per_second: float) -> Values:
        """Return whole counts, too large for floats, in seconds since the first row."""
        if self._origin is None:
            self._origin = int(counts[0]) if len(counts) else 0
        return np.asarray((counts - self._origin).to_numpy() / per_second)

    def _integer_column(self, table: Table, name: str) -> pl.Series | None:
        """Return a column of whole numbers, or None where it has others."""
        table.numbers([name])  # raises, with the row of a cell that is no number
        cells = table.frame[name]
        if cells.dtype == pl.String:
            cells = cells.str.strip_chars().cast(pl.Int64, strict=False)
        return None if cells.has_nulls() or not cells.dtype.is_integer() else cells

    def _parse_timestamps(self, table: Table, name: str) -> Values:
        """Return times (N,), s, of a column of text; raise at the first cell that is not a time."""
        assert self.format is not None
        stamps = _nanoseconds(table.frame[name], self.format)
        if stamps.has_nulls():
            row = int(np.argmax(stamps.is_null().to_numpy()))
            cell = str(table.frame[name][row] or "").strip()
            cell_text = f"{shorten(cell)} given" if cell else "the cell is empty"
            raise DataError(
                f"{table.place(row)}, column {shorten(name, bare=True)}: {cell_text}, a time like "
                f"{self.format} expected; correct the cell"
            )
        counts = stamps.to_numpy().astype(np.int64)
        if self.format == "hh:mm:ss" and len(counts):
            # A step back of half a day is a midnight; a smaller one is a fault, reported later.
            last_count = self._last if self._origin is not None else int(counts[0])
            passed = np.diff(counts, prepend=last_count) < -_DAY * _NANO // 2
            days = self._days + np.cumsum(passed)
            self._last, self._days = int(counts[-1]), int(days[-1])
            counts = counts + days * (_DAY * _NANO)
        if self._origin is None:
            self._origin = int(counts[0]) // (_DAY * _NANO) * (_DAY * _NANO) if len(counts) else 0
        return np.asarray((counts - self._origin) / _NANO)


def find_clock(
    table: Table, columns: tuple[str, ...], unit: str | None, declared: TimeFormat | None
) -> Clock:
    """Return the format of a file's times.

    Parameters
    ----------
    table : Table
        The first rows of the file.
    columns : tuple of str
        As in `Clock`.
    unit : str, optional
        The unit that is declared, or that the file says.
    declared : TimeFormat, optional
        The declared format of times that are text.

    Raises
    ------
    DataError
        If times are text in an unknown format, or with a date that can be read in two ways.
    """
    cells = table.frame[columns[0]]
    if declared is not None:
        return Clock(columns, format=declared)
    if len(columns) == 1 and unit is None and cells.dtype == pl.String:
        form = _format_of(table, columns[0])
        if form is not None:
            return Clock(columns, format=form)
    if unit is not None:
        return Clock(columns, unit=cast(TimeUnit, unit))
    if len(columns) == 1 and not cells.dtype.is_temporal() and len(table):
        first = abs(float(table.numbers(columns)[0, 0]))
        epoch = next((name for low, high, name in _EPOCHS if low <= first < high), None)
        if epoch is not None:
            return Clock(columns, unit=epoch, guessed=epoch != "s")
    return Clock(columns)


def _format_of(table: Table, name: str) -> TimeFormat | None:
    """Return the format of times as text, or None if most cells have none."""
    cells = table.frame[name].str.strip_chars()
    if cells.str.contains(_TEXT).sum() * 2 <= len(cells):
        return None
    dates = cells.str.extract(r"^(.*?)[T ]? ?\d\d?:\d\d:\d\d", 1)
    form = next((f for p, f in _DATES.items() if dates.str.contains(f"^(?:{p})$").all()), None)
    if form is None:
        raise DataError(
            f"{table.source}: column {shorten(name, bare=True)} has dates in several formats; "
            "write them all like 2026-11-22"
        )
    if form != "DD/MM/YYYY hh:mm:ss":
        return form
    first, second = (dates.str.extract(p, 1).cast(pl.Int64) for p in (r"^(\d+)/", r"/(\d+)/"))
    if (first > 12).any() or (second > 12).any():
        return form if (first > 12).any() else _MONTH_FIRST
    raise DataError(
        f"{table.source}: column {shorten(name, bare=True)}: {shorten(str(cells[0]))} may have the "
        f"day or the month first; if the month, declare {_MONTH_FIRST}, else say in a TOML file "
        "beside it:" + declaration("time", format=form)
    )


def _nanoseconds(cells: pl.Series, form: TimeFormat) -> pl.Series:
    """Return times as text in ns since a midnight, or since 1970 with a date; null for others."""
    groups = cells.str.strip_chars().str.extract_groups(_TEXT).struct.unnest()
    *date, h, m, s, fraction, half, zone, minutes = map(pl.col, groups.columns)
    hour, minute, second = (part.cast(pl.Int64) for part in (h, m, s))
    after_noon = (half.str.to_uppercase() == "PM").cast(pl.Int64)
    hour = pl.when(half.is_null()).then(hour).otherwise(hour % 12 + 12 * after_noon)
    total = (hour * 60 + minute) * 60 + second
    if form == "hh:mm:ss":
        total = pl.when(date[0].is_null()).then(total)
    else:
        order = re.split("[-./]", form.partition(" ")[0])
        year, month, day = (date[order.index(part)].cast(pl.Int64) for part in _DATE)
        year = pl.when(year < 100).then(year + 2000).otherwise(year)
        day_of = pl.concat_str(year, month, day, separator="-").str.to_date(
            "%Y-%m-%d", strict=False
        )
        total = total + day_of.cast(pl.Int64) * _DAY
    sign = pl.when(zone.str.starts_with("-")).then(-1).otherwise(1)
    offset = zone.cast(pl.Int64) * 60 + sign * minutes.cast(pl.Int64)
    nano = fraction.fill_null("0").str.pad_end(9, "0").cast(pl.Int64)
    return groups.select((total - offset.fill_null(0) * 60) * _NANO + nano).to_series()
