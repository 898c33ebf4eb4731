"""The records of a CSV file: read at once by Polars, or one by one where it must be said which."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence

import polars as pl

from pteron.errors import DataError

__all__ = ["line_of_row", "read_cells"]


def read_cells(data: bytes, source: str) -> pl.DataFrame:
    """Return the cells of a CSV file as text, with the header's names stripped of blanks.

    Parameters
    ----------
    data : bytes
        The file.
    source : str
        What messages call it.

    Returns
    -------
    polars.DataFrame
        At least one row; blank lines are skipped, empty cells are null.

    Raises
    ------
    DataError
        If the file is empty, ragged, not UTF-8 or has a column name twice.
    """
    try:
        names = _header(data, source)
        frame = _read_whole(data, names)
        if frame is None:
            frame = _read_record_by_record(data, names, source)
    except UnicodeDecodeError:
        raise DataError(f"{source}: not UTF-8 text; save it as CSV in UTF-8") from None
    except csv.Error as error:
        raise DataError(f"{source}: not a CSV file ({error}); check its quotes") from None
    if frame.is_empty():
        raise DataError(f"{source}: has no rows below its header; the names are {', '.join(names)}")
    return frame


def line_of_row(data: bytes, index: int) -> int:
    """Return the line, from 1, on which a row begins; rows are counted from 0."""
    return next(line for i, (line, _) in enumerate(_records(data)) if i == index + 1)


def _header(data: bytes, source: str) -> list[str]:
    first = next(_records(data), None)
    if first is None:
        raise DataError(f"{source}: is empty; its first line must name the columns")
    names = [name.strip() for name in first[1]]
    twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
    if twice is not None:
        raise DataError(f"{source}: two columns are called {twice!r}; rename or remove one")
    return names


def _read_whole(data: bytes, names: Sequence[str]) -> pl.DataFrame | None:
    """Return the cells as Polars reads them, or None where it may have mended the file.

    It fills short rows, takes blank lines for rows and does not say where it failed. All but the
    last show in the last column.
    """
    try:
        frame = pl.read_csv(io.BytesIO(data.rstrip(b"\r\n")), infer_schema=False)
    except pl.exceptions.PolarsError:
        return None
    if frame.is_empty() or frame.width != len(names) or frame.to_series(-1).has_nulls():
        return None
    return frame.rename(dict(zip(frame.columns, names, strict=True)))


def _read_record_by_record(data: bytes, names: Sequence[str], source: str) -> pl.DataFrame:
    records = _records(data)
    next(records)
    rows: list[list[str | None]] = []
    for line, cells in records:
        if len(cells) != len(names):
            raise DataError(
                f"{source}: row {len(rows) + 1} (line {line}) has {len(cells)} cells, but the "
                f"header names {len(names)} columns ({', '.join(names)}); mend the row"
            )
        rows.append([cell or None for cell in cells])
    return pl.DataFrame(rows, schema=dict.fromkeys(names, pl.String), orient="row")


def _records(data: bytes) -> Iterator[tuple[int, list[str]]]:
    """Yield the records that are not blank, the header first, each with the line it begins on."""
    text = io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig", newline="")
    reader = csv.reader(text, strict=True)
    line = 1
    for cells in reader:
        if len(cells) > 1 or (cells and cells[0].strip()):
            yield line, cells
        line = reader.line_num + 1
