"""Rows of a table of poses or joints: their results, computed in chunks, and the table of these."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import Failure, parsed_numbers
from pteron.cli.motion_argument import pose_numbers
from pteron.cli.progress import progress_bar
from pteron.cli.terminal import is_terminal, note, show, show_json, table, write
from pteron.errors import DataError, OutputError, PteronError, SingularPose, UnreachablePose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pteron.cli.typed_row import TypedRow
    from pteron.manipulator import Manipulator
    from pteron.tables import Table

CHUNK = 50_000
"""Rows of a chunk: enough to be fast, few enough for a progress bar."""
LONG = 200_000
"""Rows above which a progress bar is shown."""
SHOWN_ROWS = 40
"""Most rows that a person is shown."""

_DECIMALS = {"m": 6, "rad": 6, "N": 4, "N m": 4}
"""Decimals printed, by unit."""


@dataclass(frozen=True)
class TableRows:
    """A table, or a single typed row, for which messages name no row."""

    table: Table | TypedRow

    @property
    def single(self) -> bool:
        """Whether the row was typed."""
        from pteron.cli.typed_row import TypedRow

        return isinstance(self.table, TypedRow)

    def evaluate(
        self,
        robot: Manipulator,
        serve: Callable[[NDArray[Any]], NDArray[Any]],
        columns: Sequence[str],
        on_failure: Failure,
    ) -> NDArray[Any]:
        """Return the results of `serve` for the numbers (..., K) in `columns`, chunk by chunk."""
        import numpy as np

        from pteron.errors import UnlikelyValue
        from pteron.kinematics.unlikely_values import unlikely_values

        numbers = self.table.numbers(columns, on_failure)
        unlikely = "; ".join(unlikely_values(robot, columns, numbers))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnlikelyValue)  # it is told once, of the whole table
            if len(numbers) <= LONG:
                parts = list(self._chunks(serve, numbers, unlikely))
            else:
                parts = []
                with progress_bar(self.table.source) as tell:
                    for part in self._chunks(serve, numbers, unlikely):
                        parts.append(part)
                        tell(min(len(parts) * CHUNK / len(numbers), 1.0))
        if unlikely:
            note(f"Note: {self.table.source}: {unlikely}")
        return np.concatenate(parts)

    def _chunks(
        self, serve: Callable[[NDArray[Any]], NDArray[Any]], numbers: NDArray[Any], unlikely: str
    ) -> Iterator[NDArray[Any]]:
        """Yield results of `serve` by chunks of rows; an error names the row that fails."""
        for start in range(0, len(numbers), CHUNK):
            try:
                yield serve(numbers[start : start + CHUNK])
            except (UnreachablePose, SingularPose) as error:
                if not error.index:
                    raise
                self._refuse(serve, numbers, start + error.index[0], unlikely)
                raise

    def _refuse(
        self,
        serve: Callable[[NDArray[Any]], NDArray[Any]],
        numbers: NDArray[Any],
        row: int,
        unlikely: str,
    ) -> None:
        """Evaluate the row that fails alone, so that the message names it."""
        try:
            serve(numbers[row])
        except PteronError as error:
            is_millimetres = isinstance(error, UnreachablePose) and error.millimetres
            is_told = is_millimetres or unlikely in str(error)
            doubt = f"; {unlikely}" if unlikely and not is_told else ""
            if self.single:
                raise PteronError(f"{error}{doubt}") from None
            raise PteronError(
                f"{self.table.place(row)}, {error}, or leave such rows empty with --on-failure nan"
                f"{doubt}"
            ) from None


def given_rows(
    robot: Manipulator,
    file: str | None,
    typed: Sequence[str] | None,
    what: str,
    names: Sequence[str],
) -> TableRows:
    """Return the rows of a table's file, or the single typed row, with columns `names`."""
    if not typed:
        return rows_of_table(robot, file, what, names)
    if file is not None:
        raise DataError(f"{what} and --table given; give one of them")
    is_pose = tuple(names) == robot.coordinates
    numbers = pose_numbers(robot, typed, what) if is_pose else parsed_numbers(typed, names, what)
    return single_row(names, numbers)


def single_row(columns: Sequence[str], numbers: Sequence[float]) -> TableRows:
    """Return numbers that were typed on the command line as a table of one row."""
    from pteron.cli.typed_row import TypedRow

    return TableRows(TypedRow({name: [q] for name, q in zip(columns, numbers, strict=True)}))


def rows_of_table(
    robot: Manipulator, file: str | None, what: str, names: Sequence[str]
) -> TableRows:
    """Return the rows of a table's file, in SI units."""
    if file is None:
        raise DataError(f"no {what} given; give {' '.join(names)}, or --table FILE")
    from pteron.tables import convert_to_si, read_table

    if hasattr(signal, "siginterrupt"):
        # Polars, once imported, lets a read of standard input go on through Ctrl-C.
        signal.siginterrupt(signal.SIGINT, True)
    return TableRows(convert_to_si(read_table(file), robot.column_units))


def check_destination(
    out: str | None, source: str | None, table: Table | TypedRow, added: Sequence[str]
) -> None:
    """Raise OutputError, before the work begins, if a file cannot be written or would lose data."""
    # The columns added replace those of the same name, in another file than the table's own.
    replaced = [name for name in added if name in table.columns]
    columns = f"{'column' if len(replaced) == 1 else 'columns'} {', '.join(replaced)}"
    if out is not None:
        from pteron.tables import check_output

        file = check_output(out)
        if replaced and source is not None and file.exists() and file.samefile(source):
            raise OutputError(f"{out}: its own {columns} would be lost; write to another file")
    if replaced:
        note(f"Note: {table.source}: {columns} replaced by the result")


def deliver(
    robot: Manipulator,
    delivered: Table | TypedRow,
    shown: Sequence[str],
    *,
    out: str | None,
    as_json: bool,
    caption: str,
    single: bool = False,
) -> None:
    """Write a result with all its columns to a file or a program, or show some to a person.

    `caption` says what the shown columns are.
    """
    # The last column shown is empty in a row that failed.
    empty = delivered.empty(shown[-1])
    without = f", {empty} of them without a result" if empty else ""
    if out is not None:
        from pteron.tables import write_table

        write_table(delivered.frame, out)
        if as_json:
            show_json({"out": out, "rows": len(delivered), "empty": empty})
        else:
            note(f"Wrote {_count(len(delivered))} to {out}{without}")
    elif as_json:
        text = delivered.json()
        write(text[1:-1] if single else text)
        write("\n")
    elif is_terminal():
        _show(robot, delivered, shown, caption, single=single)
    else:
        for text in delivered.text():
            write(text)
        if empty and not single:
            note(f"Printed {_count(len(delivered))}{without}")


def _show(
    robot: Manipulator,
    delivered: Table | TypedRow,
    shown: Sequence[str],
    caption: str,
    *,
    single: bool,
) -> None:
    """Print the first rows of a result as a table, with units in its headings."""
    known = robot.column_units
    units = [known.get(name, "") for name in shown]
    headings = [f"{n} ({unit})" if unit else n for n, unit in zip(shown, units, strict=True)]
    rows = [
        [str(i), *map(_text, cells, units)]
        for i, cells in enumerate(delivered.rows(shown, SHOWN_ROWS), start=1)
    ]
    show(caption)
    if single or "mode" in shown:
        show(table(*headings, rows=(row[1:] for row in rows), numbers=tuple(headings)))
    else:
        show(table("row", *headings, rows=rows, numbers=("row", *headings)))
    if len(delivered) > SHOWN_ROWS:
        note(f"{SHOWN_ROWS} of {_count(len(delivered))} shown; --out FILE writes them all")


def _text(cell: float | int | None, unit: str) -> str:
    """Return a cell as text: `-` if empty, with the decimals of its unit."""
    if cell is None:
        return "-"
    # Adding zero takes the sign from what was rounded to zero.
    return f"{round(cell, _DECIMALS[unit]) + 0.0:.{_DECIMALS[unit]}f}" if unit else str(cell)


def _count(rows: int) -> str:
    """Return a number of rows with its noun."""
    return f"{rows} {'row' if rows == 1 else 'rows'}"
