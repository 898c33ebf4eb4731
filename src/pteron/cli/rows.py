"""The rows a subcommand works on, from the command line or a table, and the work in chunks."""

from __future__ import annotations

import re
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import Failure
from pteron.cli.progress import progress_bar
from pteron.errors import DataError, PteronError, SingularPose, UnreachablePose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pteron.tables import Table

__all__ = ["Rows", "rows_of_table", "single_row"]

CHUNK = 50_000
"""Rows served at once: enough to be fast, few enough to show how far the work is."""
LONG = 200_000
"""More rows than that are worth a progress bar."""


@dataclass(frozen=True)
class Rows:
    """A table, or the one row that was typed.

    Parameters
    ----------
    table : Table
        The rows.
    single : bool
        Whether it was typed, so that no message speaks of rows.
    """

    table: Table
    single: bool = False

    def served(
        self,
        serve: Callable[[NDArray[Any]], NDArray[Any]],
        columns: Sequence[str],
        on_failure: Failure,
    ) -> NDArray[Any]:
        """Return what `serve` makes of the numbers in `columns`, chunk by chunk.

        Raises
        ------
        PteronError
            For the first row that fails; the message names it.
        """
        import numpy as np

        values = self.table.numbers(columns, on_failure.value)
        if len(values) <= LONG:
            return np.concatenate(list(self._chunks(serve, values)))
        parts = []
        with progress_bar(self.table.source, len(values)) as advance:
            for part in self._chunks(serve, values):
                parts.append(part)
                advance(len(part))
        return np.concatenate(parts)

    def _chunks(
        self, serve: Callable[[NDArray[Any]], NDArray[Any]], values: NDArray[Any]
    ) -> Iterator[NDArray[Any]]:
        for start in range(0, len(values), CHUNK):
            try:
                yield serve(values[start : start + CHUNK])
            except (UnreachablePose, SingularPose) as error:
                raise self._placed(error, start) from None

    def _placed(self, error: UnreachablePose | SingularPose, start: int) -> PteronError:
        """Return the error with the row of the table for the element of the chunk."""
        element = re.match(r"(\w+)\[[\d, ]+\]: ", str(error))
        if not (element and error.index):
            return PteronError(str(error))
        text = re.sub(r" \(\d+ such poses in the batch\)$", "", str(error)[element.end() :])
        if self.single:
            return PteronError(f"{element[1]}: {text}")
        place = self.table.place(start + error.index[0])
        return PteronError(f"{place}: {text}, or leave such rows empty with --on-failure nan")


def single_row(columns: Sequence[str], values: Sequence[float]) -> Rows:
    """Return the row that was typed."""
    import polars as pl

    from pteron.tables import Table

    cells = {name: [value] for name, value in zip(columns, values, strict=True)}
    return Rows(Table("the command line", pl.DataFrame(cells)), single=True)


def rows_of_table(file: str | None, typed: bool, what: str, names: Sequence[str]) -> Rows | None:
    """Return the rows of a table's file, or None if the numbers were typed instead.

    Raises
    ------
    DataError
        If there are both or neither, or if the file cannot be read.
    """
    if typed and file is not None:
        raise DataError(f"{what} and --table given; give one of them")
    if typed:
        return None
    if file is None:
        raise DataError(f"no {what} given; give {' '.join(names)}, or --table FILE")
    from pteron.tables import read_table

    if hasattr(signal, "siginterrupt"):
        # Polars, once imported, lets a read of standard input go on through Ctrl-C.
        signal.siginterrupt(signal.SIGINT, True)
    return Rows(read_table(file))
