"""`Table`: rows with named columns, of a file or a data frame, and each row's place in the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import ArrayLike, NDArray

from pteron.errors import DataError, shorten
from pteron.renamed import former_attribute
from pteron.shapes import OnFailure

_ROWS_AT_A_TIME = 10_000
"""Rows converted to numbers at a time."""


@dataclass(frozen=True)
class Table:
    """Rows with named columns, and their places in a source.

    Parameters
    ----------
    source : str
        Its name in messages: the path of the file.
    frame : polars.DataFrame
        The cells; those of a CSV file are text.
    hint : str
        The advice where a column is missing.
    first_row : int
        Index from 0 of the first row in its file.
    line_of : callable, optional
        Returns the line of a text file, from 1, on which a row begins.
    decimal : {".", ","}
        The decimal sign of cells that are text.
    """

    source: str
    frame: pl.DataFrame
    hint: str = "add what is missing"
    first_row: int = 0
    line_of: Callable[[int], int] | None = None
    decimal: str = "."

    def __len__(self) -> int:
        return self.frame.height

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the table's columns, in order."""
        return tuple(self.frame.columns)

    def place(self, index: int) -> str:
        """Return as text where a row is: file, row number from 1 and, in a CSV file, line."""
        return f"{self.source}: {self.place_in_file(index)}"

    def place_in_file(self, index: int) -> str:
        """Return as text where a row is in its file: row number and, in a CSV file, line."""
        row = f"row {self.first_row + index + 1}"
        return row if self.line_of is None else f"{row} (line {self.line_of(index)})"

    def numbers(self, columns: Sequence[str], on_failure: OnFailure | None = None) -> NDArray[Any]:
        """Return the named columns as an array of floats (rows, columns).

        Parameters
        ----------
        columns : sequence of str
            Their names.
        on_failure : {"raise", "nan"}, optional
            Whether a cell that is empty or not finite raises, or becomes NaN; where the user has no
            such choice, it raises. Text always raises.

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
        array = np.empty((len(self), len(columns)))
        for j, name in enumerate(columns):
            array[:, j] = self._cells(name)[1].fill_null(np.nan).to_numpy()
        missing = ~np.isfinite(array)
        if missing.any():
            text = np.zeros(array.shape, dtype=bool)
            for j, name in enumerate(columns):
                cells, cell_numbers = self._cells(name)
                text[:, j] = (cell_numbers.is_null() & cells.is_not_null()).to_numpy()
            bad = text if on_failure == "nan" else missing
            if bad.any():
                row, j = (int(i) for i in np.argwhere(bad)[0])
                is_text = bool(text[row, j])
                choice = on_failure is not None and not is_text
                fault = self._fault(row, columns[j], is_text=is_text, choice=choice)
                raise DataError(fault, subject=self.source)
            array[missing] = np.nan
        return array

    def with_columns(self, results: Mapping[str, ArrayLike]) -> Table:
        """Return the table with columns appended, or replaced where the name exists.

        NaN becomes an empty cell.
        """
        added = [
            pl.Series(name, np.asarray(cells), nan_to_null=True) for name, cells in results.items()
        ]
        others = self.frame.drop(*results, strict=False)
        return replace(self, frame=others.hstack(added))

    def empty(self, column: str) -> int:
        """Return the number of empty cells in a column."""
        return self.frame[column].null_count()

    def rows(self, columns: Sequence[str], most: int) -> Iterator[tuple[Any, ...]]:
        """Return an iterator over the first `most` rows of the named columns."""
        return self.frame.select(columns).head(most).iter_rows()

    def json(self) -> str:
        """Return the rows as a JSON list of objects; non-finite numbers are null."""
        for name, kind in self.frame.schema.items():
            # Polars would panic, which nobody can catch quietly.
            if any(word in str(kind) for word in ("Binary", "Object")):
                raise self._unfit("JSON", f"column {name} holds {kind}")
        return parse_numeric_columns(self.frame).write_json()

    def text(self) -> Iterator[str]:
        """Yield the table as CSV text in pieces, the header first."""
        for start in range(0, len(self), _ROWS_AT_A_TIME):
            part = self.frame.slice(start, _ROWS_AT_A_TIME)
            try:
                yield part.write_csv(include_header=start == 0)
            except pl.exceptions.PolarsError as error:
                raise self._unfit("CSV", str(error).splitlines()[0]) from None

    def _unfit(self, kind: str, reason: str) -> DataError:
        """Return the error that the table cannot be written as this kind of file, and why."""
        return DataError(f"{self.source}: cannot be written as {kind} ({reason}); drop the column")

    def _require(self, columns: Sequence[str]) -> None:
        """Raise a `DataError` that names the missing columns, if any of `columns` is missing."""
        missing = [name for name in columns if name not in self.columns]
        if not missing:
            return
        noun = "column" if len(missing) == 1 else "columns"
        raise DataError(
            f"{self.source}: no {noun} {', '.join(missing)} (found: {join_names(self.columns)}; "
            f"needed: {', '.join(columns)}); {self.hint}"
        )

    def _cells(self, name: str) -> tuple[pl.Series, pl.Series]:
        """Return a column's cells (null if empty), and the cells as numbers (null if text)."""
        cells = self.frame[name]
        if cells.dtype == pl.String:
            cells = cells.str.strip_chars()
            cells = cells.set(cells == "", None)
        elif not (cells.dtype.is_numeric() or cells.dtype == pl.Null):
            raise DataError(
                f"{self.source}: column {shorten(name, bare=True)} holds {cells.dtype}; numbers "
                "were expected"
            )
        signs = cells
        if cells.dtype == pl.String and self.decimal == ",":
            # A point is no decimal sign there: what was meant by 1.500 cannot be known.
            signs = cells.str.replace_all(".", "?", literal=True)
            signs = signs.str.replace_all(",", ".", literal=True)
        return cells, signs.cast(pl.Float64, strict=False)

    def _fault(self, row: int, column: str, *, is_text: bool, choice: bool) -> str:
        """Return a message on a cell that is empty or no finite number, with its place."""
        cell = self.frame[column][row]
        name = shorten(column, bare=True)
        fault = f"the cell is empty; {name} needs a number"
        if cell is not None and str(cell).strip():
            expected = "a number" if is_text else "a finite number"
            comma = " with a decimal comma" if is_text and self.decimal == "," else ""
            fault = f"{shorten(str(cell).strip())} given, {expected}{comma} expected"
        leave = ", or leave such rows empty with --on-failure nan" if choice else ""
        return f"{self.place_in_file(row)}, column {name}: {fault}; correct the cell{leave}"

    extended = former_attribute("extended", "with_columns")


def join_names(names: Sequence[str]) -> str:
    """Return names as a list in a text, shortened if there are many or long ones."""
    some = ", ".join(shorten(name, bare=True) for name in names[:20])
    return some + (", ..." if len(names) > 20 else "")


def parse_numeric_columns(frame: pl.DataFrame) -> pl.DataFrame:
    """Return the frame with text columns converted to numbers where all cells are numbers."""
    columns = [_number_column(column) for column in frame.get_columns()]
    return pl.DataFrame(columns)


def _number_column(column: pl.Series) -> pl.Series:
    """Return a text column as integers or floats if all its cells are numbers, else unchanged."""
    if column.dtype != pl.String or column.null_count() == len(column):
        return column
    text = column.str.strip_chars()
    for kind in (pl.Int64, pl.Float64):
        numbers = text.cast(kind, strict=False)
        if numbers.null_count() == column.null_count():
            return numbers
    return column
