"""The numbers of a CSV file, some megabytes at a time."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pteron.errors import DataError

__all__ = ["CsvRows"]

_BLOCK = 16 << 20
"""Bytes read at a time: large enough for Polars to be fast, small beside any memory."""
_LONGEST_LINE = 1 << 20

Values = NDArray[np.float64]


class CsvRows:
    """A CSV file of numbers; it is read anew in every pass.

    Parameters
    ----------
    path : path
        A regular file.
    source : str
        What messages call it.

    Raises
    ------
    DataError
        If it is empty or not UTF-8 text.
    """

    def __init__(self, path: Path, source: str) -> None:
        self._path = path
        self._source = source
        with path.open("rb") as file:
            head = file.read(_LONGEST_LINE)
        mark = len(b"\xef\xbb\xbf") if head.startswith(b"\xef\xbb\xbf") else 0
        # Old spreadsheets end lines with CR alone.
        self._carriage_returns = b"\n" not in head and b"\r" in head
        lines = head[mark:].replace(b"\r", b"\n") if self._carriage_returns else head[mark:]
        content = lines.lstrip(b"\r\n \t")
        if not content:
            raise DataError(f"{source}: is empty; its first line must name the columns")
        skipped = len(lines) - len(content)
        end = lines.find(b"\n", skipped)
        end = len(lines) if end < 0 else end + 1
        try:
            header = lines[skipped:end].decode("utf-8").strip("\r\n")
        except UnicodeDecodeError:
            raise DataError(f"{source}: not UTF-8 text; save it as CSV in UTF-8") from None
        self.columns = tuple(name.strip() for name in next(csv.reader([header])))
        self._start = mark + end
        self._first_line = lines.count(b"\n", 0, end) + 1
        sample = lines[end:]
        rows = sample.count(b"\n")
        size = path.stat().st_size - self._start
        self.rows_estimate = round(size * rows / len(sample)) if rows else None
        self.hint = "the first line must name the columns"
        if len(self.columns) == 1 and any(sign in header for sign in ";\t"):
            self.hint = "separate the cells with commas and decimals with points"

    def blocks(self, columns: Sequence[int]) -> Iterator[Values]:
        """Yield the finite numbers in some columns, shape (rows, len(columns)), in order.

        Raises
        ------
        DataError
            If a row is ragged or a cell does not hold a finite number; the message names the row,
            the line and the column.
        """
        row, line, rest = 0, self._first_line, b""
        with self._path.open("rb") as file:
            file.seek(self._start)
            while chunk := file.read(_BLOCK):
                if self._carriage_returns:
                    chunk = chunk.replace(b"\r", b"\n")
                chunk = rest + chunk
                cut = chunk.rfind(b"\n") + 1
                rest = chunk[cut:]
                if cut:
                    values = self._parsed(chunk[:cut], columns, row, line)
                    row, line = row + len(values), line + chunk.count(b"\n", 0, cut)
                    yield values
            if rest:
                yield self._parsed(rest, columns, row, line)

    def _parsed(self, block: bytes, columns: Sequence[int], row: int, line: int) -> Values:
        values = self._parsed_at_once(block, columns)
        return self._parsed_by_line(block, columns, row, line) if values is None else values

    def _parsed_at_once(self, block: bytes, columns: Sequence[int]) -> Values | None:
        """Return the numbers as Polars reads them, or None where a cell or row may be at fault.

        Polars fills short rows and takes blank lines for rows; the count of commas shows both.
        """
        if b'"' in block:
            return None
        width = len(self.columns)
        wanted = sorted(set(columns))
        schema = {str(j): pl.Float64 if j in wanted else pl.String for j in range(width)}
        try:
            frame = pl.read_csv(block, has_header=False, schema=schema, columns=wanted)
        except pl.exceptions.PolarsError:
            return None
        if block.count(b",") != frame.height * (width - 1):
            return None
        if any(column.has_nulls() for column in frame.get_columns()):
            return None
        values: Values = frame.select(str(j) for j in columns).to_numpy()
        return values if np.isfinite(values).all() else None

    def _parsed_by_line(self, block: bytes, columns: Sequence[int], row: int, line: int) -> Values:
        try:
            text = block.decode("utf-8")
        except UnicodeDecodeError:
            raise DataError(
                f"{self._source}: not UTF-8 text behind row {row}; save it as CSV in UTF-8"
            ) from None
        reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        rows: list[list[float]] = []
        begins = line
        try:
            for cells in reader:
                if len(cells) > 1 or (cells and cells[0].strip()):
                    place = f"{self._source}: row {row + len(rows) + 1} (line {begins})"
                    rows.append(self._numbers(cells, columns, place))
                begins = line + reader.line_num
        except csv.Error as error:
            raise DataError(
                f"{self._source}: row {row + len(rows) + 1} (line {begins}) is not CSV ({error}); "
                "check its quotes"
            ) from None
        return np.array(rows, dtype=float).reshape(len(rows), len(columns))

    def _numbers(self, cells: list[str], columns: Sequence[int], place: str) -> list[float]:
        if len(cells) != len(self.columns):
            raise DataError(
                f"{place} has {len(cells)} cells, but the header names {len(self.columns)} columns "
                f"({', '.join(self.columns)}); mend the row"
            )
        return [_number(cells[j].strip(), f"{place}, column {self.columns[j]}") for j in columns]


def _number(cell: str, place: str) -> float:
    if not cell:
        raise DataError(f"{place}: the cell is empty; a number was expected; correct the cell")
    try:
        value = float(cell) if "_" not in cell else None
    except ValueError:
        value = None
    if value is None:
        raise DataError(f"{place}: {cell!r} given, a number expected; correct the cell")
    if not math.isfinite(value):
        raise DataError(f"{place}: {cell!r} given, a finite number expected; correct the cell")
    return value
