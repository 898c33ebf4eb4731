"""Tables in CSV and Parquet files: read with care, written whole or not at all."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path

import polars as pl

from pteron.atomic import write_bytes
from pteron.errors import DataError, OutputError
from pteron.tables.csv_text import read_cells
from pteron.tables.table import Table, typed

__all__ = ["ENDINGS", "STANDARD_INPUT", "check_output", "read_table", "write_table"]

STANDARD_INPUT = "-"
"""The path that stands for CSV on standard input."""


def read_table(path: str | Path) -> Table:
    """Read a table from a CSV or Parquet file, or as CSV from standard input (``-``).

    Parameters
    ----------
    path : str or path
        Its ending says which it is; what is no regular file, such as a pipe, is read as CSV.

    Returns
    -------
    Table
        At least one row; blank lines are skipped.

    Raises
    ------
    DataError
        If there is no such file, or if it is empty, ragged or of another kind.
    """
    source = str(path)
    try:
        if source == STANDARD_INPUT:
            if sys.stdin is None:
                raise DataError("standard input: is closed; give it a table, or name a file")
            return _from_csv(sys.stdin.buffer.read(), "standard input")
        file = Path(path)
        special = file.is_fifo() or file.is_char_device()
        ending = ".csv" if special else file.suffix.lower()
        if file.is_dir():
            raise IsADirectoryError
        if ending not in ENDINGS:
            raise DataError(f"{source}: {_unknown(file)}")
        data = file.read_bytes()
    except FileNotFoundError:
        raise DataError(f"{source}: no such file") from None
    except IsADirectoryError:
        raise DataError(f"{source}: is a folder; name a file in it") from None
    except OSError as error:
        raise DataError(f"{source}: cannot be read ({error.strerror or error})") from None
    return (_from_csv if ending == ".csv" else _from_parquet)(data, source)


def check_output(path: str | Path) -> Path:
    """Return `path` after a check, before the work begins, that a table can be written there.

    Raises
    ------
    OutputError
        If its ending is unknown, its folder is missing, or it is a folder.
    """
    file = Path(path)
    if file.is_dir():
        raise OutputError(f"{path}: is a folder; name a file in it")
    if file.suffix.lower() not in ENDINGS:
        raise OutputError(f"{path}: {_unknown(file)}")
    if not file.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {file.parent}; make it first")
    return file


def write_table(frame: pl.DataFrame, path: str | Path) -> Path:
    """Write a table to a CSV or Parquet file, whole or not at all.

    Raises
    ------
    OutputError
        If it cannot be written, or if a column cannot stand in such a file.
    """
    file = check_output(path)
    buffer = io.BytesIO()
    try:
        ENDINGS[file.suffix.lower()](frame, buffer)
    except pl.exceptions.PolarsError as error:
        reason = str(error).splitlines()[0]
        raise OutputError(f"{path}: cannot hold this table ({reason})") from None
    return write_bytes(file, buffer.getvalue())


def _write_csv(frame: pl.DataFrame, buffer: io.BytesIO) -> None:
    frame.write_csv(buffer)


def _write_parquet(frame: pl.DataFrame, buffer: io.BytesIO) -> None:
    typed(frame).write_parquet(buffer)


ENDINGS: dict[str, Callable[[pl.DataFrame, io.BytesIO], None]] = {
    ".csv": _write_csv,
    ".parquet": _write_parquet,
}
"""The endings of the files that hold tables, each with what writes one."""


def _unknown(file: Path) -> str:
    given = f"unknown ending {file.suffix!r}" if file.suffix else "no ending"
    return f"{given}; a table's file ends in {' or '.join(ENDINGS)}"


def _from_parquet(data: bytes, source: str) -> Table:
    try:
        frame = pl.read_parquet(io.BytesIO(data))
    except pl.exceptions.PolarsError:
        raise DataError(f"{source}: not a Parquet file; write it again, or give a CSV") from None
    if frame.is_empty():
        raise DataError(f"{source}: has no rows")
    return Table(source, frame)


def _from_csv(data: bytes, source: str) -> Table:
    return Table(source, read_cells(data, source), data)
