"""Opening, reading and writing of tables in CSV and Parquet files, by the file's ending."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import polars as pl

from pteron.atomic import checked_file, write_bytes
from pteron.errors import DataError, OutputError, shorten
from pteron.tables.csv_file import CsvFile
from pteron.tables.dialect import PLAIN, Dialect
from pteron.tables.parquet_file import ParquetFile
from pteron.tables.stacked import side_by_side
from pteron.tables.table import Table, join_names, parse_numeric_columns

STANDARD_INPUT = "-"
"""The path that stands for CSV on standard input."""

_OPENED = ("/dev/fd/", "/dev/stdin", "/proc/self/fd/")
"""Where a shell keeps the pipes that it has opened: they have a writer, and so an end."""

_LONGEST_PATH = 1000
"""Characters of a path that a message shows."""


def open_table(
    path: str | Path, *, noun: str = "table", dialect: Dialect | None = None
) -> CsvFile | ParquetFile:
    """Open a CSV or Parquet file whose rows are read a block at a time.

    Parameters
    ----------
    path : str or path
        A regular file; its ending says which it is.
    noun : str
        The word for such files in messages.
    dialect : Dialect, optional
        The form of a CSV file, as far as that is declared; the rest is found. By default it must
        be plain.

    Raises
    ------
    DataError
        If there is no such file, or if it is empty or of another kind.
    """
    source = shorten(str(path), bare=True, longest=_LONGEST_PATH)
    file = Path(path)
    with _name_in_errors(source):
        if file.is_dir():
            raise IsADirectoryError
        if file.suffix.lower() not in ENDINGS:
            raise DataError(f"{source}: {_ending_fault(file, noun)}")
        if file.exists() and not file.is_file():
            raise DataError(
                f"{source}: is no regular file, and a {noun} is read twice; save it as a file"
            )
        if file.suffix.lower() == ".csv":
            encoding = None if dialect is None else dialect.encoding
            plain_csv = None if dialect is None else side_by_side(file, encoding, source)
            if plain_csv is None:
                return CsvFile(file, source, dialect)
            table = CsvFile(plain_csv, source)
            table.found = ("variables one below another",)
            return table
        return ParquetFile(file, source)


def read_table(path: str | Path) -> Table:
    """Return the table in a CSV or Parquet file, or in CSV from standard input (``-``).

    Parameters
    ----------
    path : str or path
        Its ending says which it is. A pipe that the shell has opened, as ``<(...)`` does, is read
        as CSV; a FIFO or a device by its name is refused: reading it may never end.

    Returns
    -------
    Table
        At least one row; blank lines are skipped.

    Raises
    ------
    DataError
        If there is no such file, or if it is empty, ragged or of another kind.
    """
    source = shorten(str(path), bare=True, longest=_LONGEST_PATH)
    special = Path(path)
    file: CsvFile | ParquetFile
    with _name_in_errors(source):
        if str(path) == STANDARD_INPUT:
            source = "standard input"
            if sys.stdin is None:
                raise DataError(f"{source}: is closed; give it a table, or name a file")
            file = CsvFile(sys.stdin.buffer.read(), source)
        elif special.is_fifo() and str(path).startswith(_OPENED):
            file = CsvFile(special.read_bytes(), source)
        elif special.exists() and not special.is_file() and not special.is_dir():
            raise DataError(
                f"{source}: it is a pipe or a device, not a file; pipe its text into - instead"
            )
        else:
            file = open_table(path)
        return whole_table(file)


def whole_table(file: CsvFile | ParquetFile) -> Table:
    """Return all rows of an open file as a single table.

    Raises
    ------
    DataError
        If it has no rows, or is ragged.
    """
    tables = list(file.tables())
    if not tables:
        below = f" below its header; the names are {join_names(file.columns)}"
        raise DataError(f"{file.source}: has no rows{below if isinstance(file, CsvFile) else ''}")
    return _join_tables(tables)


def _join_tables(tables: list[Table]) -> Table:
    """Return the tables of a file joined into one, which knows each row's line."""
    if len(tables) == 1:
        return tables[0]

    def line_of(index: int) -> int:
        """Return the line in the file of the row `index` of the joined table."""
        table = next(table for table in reversed(tables) if table.first_row <= index)
        assert table.line_of is not None
        return table.line_of(index - table.first_row)

    frame = pl.concat([table.frame for table in tables])
    return replace(tables[0], frame=frame, line_of=tables[0].line_of and line_of)


@contextmanager
def _name_in_errors(source: str) -> Iterator[None]:
    """In this context, raise file system errors as a `DataError` that names the source."""
    try:
        yield
    except FileNotFoundError:
        raise DataError(f"{source}: no such file") from None
    except IsADirectoryError:
        raise DataError(f"{source}: is a folder; name a file in it") from None
    except OSError as error:
        raise DataError(f"{source}: cannot be read ({error.strerror or error})") from None


def check_output(path: str | Path, dialect: Dialect | None = None) -> Path:
    """Return `path` after a check that a table can be written there.

    Raises
    ------
    OutputError
        If its ending is unknown, its folder is missing, or it is a folder; if a dialect is given
        for a file that has none.
    """
    file = checked_file(path)
    if file.suffix.lower() not in ENDINGS:
        raise OutputError(f"{path}: {_ending_fault(file, 'table')}")
    if dialect is not None and file.suffix.lower() != ".csv":
        raise OutputError(f"{path}: only a CSV file has a separator and a decimal sign")
    return file


def write_table(frame: pl.DataFrame, path: str | Path, dialect: Dialect | None = None) -> Path:
    """Write a table to a CSV or Parquet file, atomically.

    Parameters
    ----------
    frame : polars.DataFrame
        The table.
    path : str or path
        Its ending says which it is.
    dialect : Dialect, optional
        Separator and decimal sign of a CSV file.

    Raises
    ------
    OutputError
        If it cannot be written, or if a column cannot stand in such a file.
    """
    return write_bytes(path, table_bytes(frame, path, dialect))


def table_bytes(frame: pl.DataFrame, path: str | Path, dialect: Dialect | None = None) -> bytes:
    """Return the bytes of the CSV or Parquet file that `write_table` writes for a table."""
    file = check_output(path, dialect)
    buffer = io.BytesIO()
    try:
        ENDINGS[file.suffix.lower()](frame, buffer, dialect or PLAIN)
    except pl.exceptions.PolarsError as error:
        reason = str(error).splitlines()[0]
        raise OutputError(f"{path}: cannot hold this table ({reason})") from None
    return buffer.getvalue()


ENDINGS: dict[str, Callable[[pl.DataFrame, io.BytesIO, Dialect], None]] = {
    ".csv": lambda frame, buffer, how: frame.write_csv(
        buffer, separator=how.separator or ",", decimal_comma=how.decimal == ","
    ),
    ".parquet": lambda frame, buffer, how: parse_numeric_columns(frame).write_parquet(buffer),
}
"""The endings of the files that hold tables, each with what writes one."""


def _ending_fault(file: Path, noun: str) -> str:
    """Return a message that a file's ending is wrong, with the valid endings."""
    fault = f"unknown ending {shorten(file.suffix)}" if file.suffix else "no ending"
    return f"{fault}; a {noun}'s file ends in {' or '.join(ENDINGS)}"
