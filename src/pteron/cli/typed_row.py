"""`TypedRow`: numbers typed on the command line, with their results, printed as a `Table` is.

It takes the place of `pteron.tables.Table`, which loads Polars: that takes longer than the whole
calculation for one pose.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import polars as pl

Cell = float | int | None


@dataclass(frozen=True)
class TypedRow:
    """Columns of finite numbers by name, all of one length; None is an empty cell."""

    cells: Mapping[str, Sequence[Cell]]
    source: str = "the command line"

    def __len__(self) -> int:
        return len(next(iter(self.cells.values())))

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, in order."""
        return tuple(self.cells)

    @property
    def frame(self) -> pl.DataFrame:
        """The cells as a Polars data frame, to be written to a file."""
        import polars as pl

        return pl.DataFrame(dict(self.cells))

    def place(self, index: int) -> str:
        """Return the place of a row, from 0, for messages."""
        return f"{self.source}: row {index + 1}"

    def numbers(self, columns: Sequence[str], on_failure: str | None = None) -> NDArray[Any]:
        """Return columns as an array of floats (rows, columns); typed numbers are finite."""
        return np.array([self.cells[name] for name in columns], dtype=float).T

    def with_columns(self, results: Mapping[str, ArrayLike]) -> TypedRow:
        """Return the rows with columns of results added, as `Table.extended` does."""
        added = {name: _column(column) for name, column in results.items()}
        return replace(self, cells=self._drop_columns(results) | added)

    def repeat_modes(self, modes: Sequence[int | None], replaced: Collection[str]) -> TypedRow:
        """Return the row once for each mode, with a first column `row` and a last one `mode`.

        Columns that are `replaced` are left out.
        """
        columns = self._drop_columns({"row", "mode", *replaced})
        count = len(modes)
        cells = {name: [*column] * count for name, column in columns.items()}
        return replace(self, cells={"row": [1] * count, **cells, "mode": modes})

    def empty(self, column: str) -> int:
        """Return the number of empty cells of a column."""
        return sum(cell is None for cell in self.cells[column])

    def rows(self, columns: Sequence[str], most: int) -> Iterator[tuple[Cell, ...]]:
        """Return the first rows of some columns, `most` of them."""
        return islice(zip(*(self.cells[name] for name in columns), strict=True), most)

    def json(self) -> str:
        """Return the rows as a JSON list of objects."""
        lines = (
            ",".join(
                f'"{name}":{_text(cell) or "null"}'
                for name, cell in zip(self.cells, row, strict=True)
            )
            for row in zip(*self.cells.values(), strict=True)
        )
        return f"[{','.join(f'{{{line}}}' for line in lines)}]"

    def text(self) -> Iterator[str]:
        """Yield the rows as CSV, the header first."""
        yield ",".join(self.cells) + "\n"
        for row in zip(*self.cells.values(), strict=True):
            yield ",".join(map(_text, row)) + "\n"

    def _drop_columns(self, names: Collection[str]) -> dict[str, Sequence[Cell]]:
        """Return the columns except those named."""
        return {name: cells for name, cells in self.cells.items() if name not in names}


def _column(numbers: ArrayLike) -> list[Cell]:
    """Return values as a list of cells, with None for NaN."""
    return [None if number != number else number for number in np.asarray(numbers).tolist()]


def _text(cell: Cell) -> str:
    """Return a number as Polars writes it: Python's digits, 0.00001 for 1e-05, e-6 for e-06."""
    text = "" if cell is None else repr(cell)
    if text.endswith("e-05"):
        sign, digits = text[: -len(text.lstrip("-"))], text[:-4].lstrip("-").replace(".", "")
        return f"{sign}0.0000{digits}"
    return text.replace("e-0", "e-")
