"""A table: rows with named columns, and the words for where in its file a row is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import ArrayLike, NDArray

from pteron.conventions import OnFailure
from pteron.errors import DataError
from pteron.tables.csv_text import line_of_row

__all__ = ["Table", "typed"]

_ROWS_AT_A_TIME = 10_000


@dataclass(frozen=True)
class Table:
    """Rows with named columns, and where they came from.

    Parameters
    ----------
    source : str
        What messages call it: the path of the file.
    frame : polars.DataFrame
        The cells; those of a CSV file are text.
    csv : bytes, optional
        The file's text, from which the line of a row is found.
    """

    source: str
    frame: pl.DataFrame
    csv: bytes | None = None

    def __len__(self) -> int:
        return self.frame.height

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, in order."""
        return tuple(self.frame.columns)

    def place(self, index: int) -> str:
        """Return where a row is: its number from 1 and, in a CSV file, its line."""
        row = f"{self.source}: row {index + 1}"
        if self.csv is None:
            return row
        return f"{row} (line {line_of_row(self.csv, index)})"

    def numbers(self, columns: Sequence[str], on_failure: OnFailure = "raise") -> NDArray[Any]:
        """Return columns as an array of floats.

        Parameters
        ----------
        columns : sequence of str
            Their names.
        on_failure : {"raise", "nan"}
            Whether a cell that is empty or not finite raises, or becomes NaN. Text always raises.

        Returns
        -------
        array, shape (rows, len(columns))

        Raises
        ------
        DataError
            If a column is missing, or a cell does not hold a finite number; the message names the
            row, the line and the column.
        """
        self._require(columns)
        values = np.empty((len(self), len(columns)))
        text = np.zeros(values.shape, dtype=bool)
        for j, name in enumerate(columns):
            values[:, j], text[:, j] = self._cells(name)
        bad = text if on_failure == "nan" else text | ~np.isfinite(values)
        if bad.any():
            row, j = (int(i) for i in np.argwhere(bad)[0])
            raise DataError(self._fault(row, columns[j], is_text=bool(text[row, j])))
        values[~np.isfinite(values)] = np.nan
        return values

    def extended(self, results: Mapping[str, ArrayLike]) -> Table:
        """Return the table with columns added behind its own; one of the same name is replaced.

        NaN becomes an empty cell.
        """
        added = [
            pl.Series(name, np.asarray(values), nan_to_null=True)
            for name, values in results.items()
        ]
        kept = self.frame.drop(*results, strict=False)
        return replace(self, frame=kept.hstack(added))

    def json(self) -> str:
        """Return the rows as a JSON list of objects; what is not a finite number is null."""
        for name, kind in self.frame.schema.items():
            # Polars would panic, which nobody can catch quietly.
            if any(word in str(kind) for word in ("Binary", "Object")):
                raise self._unfit("JSON", f"column {name} holds {kind}")
        return typed(self.frame).write_json()

    def text(self) -> Iterator[str]:
        """Yield the rows as CSV, some at a time, the header first."""
        for start in range(0, len(self), _ROWS_AT_A_TIME):
            part = self.frame.slice(start, _ROWS_AT_A_TIME)
            try:
                yield part.write_csv(include_header=start == 0)
            except pl.exceptions.PolarsError as error:
                raise self._unfit("CSV", str(error).splitlines()[0]) from None

    def _unfit(self, kind: str, reason: str) -> DataError:
        return DataError(f"{self.source}: cannot be written as {kind} ({reason}); drop the column")

    def _require(self, columns: Sequence[str]) -> None:
        missing = [name for name in columns if name not in self.columns]
        if not missing:
            return
        found = ", ".join(self.columns[:20]) + (", ..." if len(self.columns) > 20 else "")
        noun = "column" if len(missing) == 1 else "columns"
        hint = "the first line must name the columns"
        if len(self.columns) == 1 and any(mark in found for mark in ";\t"):
            hint = "separate the cells with commas"
        raise DataError(
            f"{self.source}: no {noun} {', '.join(missing)} (found: {found}; needed: "
            f"{', '.join(columns)}); {hint if self.csv is not None else 'add what is missing'}"
        )

    def _cells(self, name: str) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return a column's numbers, NaN where there is none, and where there is text instead."""
        given = self.frame[name]
        if given.dtype == pl.String:
            given = given.str.strip_chars()
            given = given.set(given == "", None)
        elif not (given.dtype.is_numeric() or given.dtype == pl.Null):
            raise DataError(
                f"{self.source}: column {name} holds {given.dtype}; numbers were expected"
            )
        numbers = given.cast(pl.Float64, strict=False)
        text = (numbers.is_null() & given.is_not_null()).to_numpy()
        return numbers.fill_null(np.nan).to_numpy(), text

    def _fault(self, row: int, column: str, *, is_text: bool) -> str:
        cell = self.frame[column][row]
        given = f"the cell is empty; {column} needs a number"
        if cell is not None and str(cell).strip():
            expected = "a number" if is_text else "a finite number"
            given = f"{str(cell).strip()!r} given, {expected} expected"
        leave = "" if is_text else ", or choose on-failure nan to leave such rows empty"
        return f"{self.place(row)}, column {column}: {given}; correct the cell{leave}"


def typed(frame: pl.DataFrame) -> pl.DataFrame:
    """Return the frame with each column of text that holds numbers only made numeric."""
    columns = [_number_column(column) for column in frame.get_columns()]
    return pl.DataFrame(columns)


def _number_column(column: pl.Series) -> pl.Series:
    if column.dtype != pl.String or column.null_count() == len(column):
        return column
    text = column.str.strip_chars()
    for kind in (pl.Int64, pl.Float64):
        numbers = text.cast(kind, strict=False)
        if numbers.null_count() == column.null_count():
            return numbers
    return column
