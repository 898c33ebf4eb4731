"""The cells of a CSV file, cut by the separator and decimal sign that make most of them numbers."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple, get_args

from pteron.tables.dialect import SEPARATORS, Decimal, Dialect, Separator

_MOST = 0.5
"""Share of numbers or times among its cells from which a column counts as one of these."""

_NUMBER = r"[+-]?(?:\d++(?:{0}\d*+)?|{0}\d++)(?:[eE][+-]?\d++)?|[+-]?(?:nan|inf)"
"""Pattern of a number; {0} is the decimal sign. Quantifiers are possessive: with backtracking, the
time for a cell of many digits would grow with the square of their number."""

_STAMP = r"(?:\d[\d./-]*[T ] ?)?\d\d?:\d\d:\d\d(?:[.,:]\d+)?(?: ?[AP]M|Z|[+-]\d\d:?\d\d)?"
"""Pattern of a date and time."""

_DATA = {
    sign: re.compile(f"{_NUMBER.format(re.escape(sign))}|{_STAMP}", re.IGNORECASE)
    for sign in (".", ",")
}
"""Patterns of a cell of data, a number or a time of day, by the decimal sign."""


class Record(NamedTuple):
    """A line that is not blank, or lines joined by a quoted line end; lines count from 0."""

    line: int
    """Number of its first line."""
    after: int
    """Number of the line after its last one."""
    cells: tuple[str, ...]


class Cut(NamedTuple):
    """A file's cells, split by a separator."""

    separator: Separator
    decimal: Decimal
    records: list[Record]
    width: int
    """Cells of most records."""
    columns: tuple[int, ...]
    """Columns that hold numbers or times."""
    matched: int
    """Cells that are a number or a time."""

    def is_row(self, record: Record) -> bool:
        """Return whether a record has a number or a time in every numeric column."""
        return (
            bool(self.columns)
            and len(record.cells) == self.width
            and all(_DATA[self.decimal].fullmatch(record.cells[j]) for j in self.columns)
        )

    def may_be_row(self, record: Record) -> bool:
        """Return whether a record is more likely a faulty row than a header line."""
        cells = record.cells
        if len(cells) == self.width and self.columns:
            cells = tuple(cells[j] for j in self.columns)
        good = sum(bool(_DATA[self.decimal].fullmatch(cell)) for cell in cells)
        return good > _MOST * len(cells)


def single_blanks(text: bytes) -> bytes:
    """Return the lines of a text with runs of blanks made single, and none at their ends."""
    return re.sub(rb"(?m)^ | $", b"", re.sub(rb" +", b" ", text))


def best_cut(text: Sequence[str], declared: Dialect) -> Cut | None:
    """Return the text split by the separator that makes most of its cells numbers."""
    separators = [declared.separator] if declared.separator else list(SEPARATORS)
    decimals = [declared.decimal] if declared.decimal else list(get_args(Decimal))
    cuts = [
        rows
        for separator in separators
        for decimal in decimals
        if separator != decimal and (rows := _split_cells(text, separator, decimal)).records
    ]

    def sense(rows: Cut) -> tuple[float, int, int]:
        """Return a sort key: share and number of numeric columns, count of matching cells."""
        return len(rows.columns) / rows.width, len(rows.columns), rows.matched

    several = [rows for rows in cuts if len(rows.columns) > 1]
    if several:
        return max(several, key=sense)
    # Without rows of numbers the names alone tell the separator.
    return max(cuts, key=lambda rows: len(rows.records[0].cells), default=None)


def _split_cells(text: Sequence[str], separator: Separator, decimal: Decimal) -> Cut:
    """Return a text split into records of cells, with its mostly numeric columns."""
    records = list(_records(text, separator))
    width = Counter(len(record.cells) for record in records).most_common(1)[0][0] if records else 0
    full_rows = [record.cells for record in records if len(record.cells) == width]
    is_data = _DATA[decimal].fullmatch
    counts = [sum(map(bool, map(is_data, column))) for column in zip(*full_rows, strict=True)]
    columns = tuple(j for j, count in enumerate(counts) if count > _MOST * len(full_rows))
    return Cut(separator, decimal, records, width, columns, sum(counts))


def _records(text: Sequence[str], separator: Separator) -> Iterator[Record]:
    """Yield the non-blank records with their line numbers, up to a fault of CSV."""
    if separator == " ":
        text = [single_blanks(line.encode()).decode() for line in text]
    reader, last_line = csv.reader(text, delimiter=separator), 0
    try:
        for cells in reader:
            stripped = tuple(cell.strip() for cell in cells)
            if any(stripped):
                yield Record(last_line, reader.line_num, stripped)
            last_line = reader.line_num
    except csv.Error:  # told where the rows are read
        return
