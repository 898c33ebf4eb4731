"""Logs of WinCC and CODESYS 3, which have variables one below another, put side by side.

Only the opening of a table uses this; the result is a plain CSV file.
"""

from __future__ import annotations

import csv
import io
import re
from decimal import Decimal, InvalidOperation
from pathlib import Path

from pteron.errors import DataError
from pteron.tables.layout import find_encoding
from pteron.tables.table import join_names

_VALUE_HEADER = re.compile(r'^"?VarName"? *(?P<separator>[;,\t])', re.MULTILINE)
"""The header of a log of WinCC, which has a row for each value."""

_BLOCK_HEADER = re.compile(r"^\d+\.Variable *(?P<separator>[;,\t])", re.MULTILINE)
"""The first line of a variable in a trace of CODESYS 3, whose samples stand below."""

_HEAD = 1 << 12
"""Bytes from which either is recognised."""

_ARCHIVE_PREFIX = "$RT_"
"""Prefix of WinCC's own marks between the values."""

_SECONDS = Decimal("0.0864")
"""Seconds in a millionth of a day, the unit of WinCC's Time_ms."""

_Columns = dict[str, list[tuple[str, str]]]
"""Times and values of each variable, as text with decimal points."""


def side_by_side(file: Path, encoding: str | None, source: str) -> bytes | None:
    """Return as plain CSV a log that lists one variable below another; None for other files.

    `encoding` is the declared encoding, if any. The time column is called t.
    """
    with file.open("rb") as opened:
        head = opened.read(_HEAD)
    try:
        known = find_encoding(head, encoding, source)
        start = head.decode(known, errors="ignore").lstrip("\ufeff")
    except (DataError, LookupError):
        return None  # it is refused where it is read
    value_header, block_header = _VALUE_HEADER.search(start), _BLOCK_HEADER.search(start)
    header = value_header or block_header
    if header is None:
        return None
    text = file.read_bytes().decode(known).lstrip("\ufeff")[header.start() :]
    rows = [row for row in csv.reader(io.StringIO(text), delimiter=header["separator"]) if row]
    rows = [[cell.strip() for cell in row] for row in rows]
    columns = _columns_of_values(rows, source) if value_header else _columns_of_blocks(rows)
    (first, reference), *others = columns.items()
    times = [time for time, _ in reference]
    for name, samples in others:
        if [time for time, _ in samples] != times:
            raise DataError(
                f"{source}: its variables stand one below another, and the times of {name} are "
                f"not those of {first}; record all of them with one sample time"
            )
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(["t", *columns])
    writer.writerows(
        [time, *(samples[k][1] for samples in columns.values())] for k, time in enumerate(times)
    )
    return out.getvalue().encode()


def _columns_of_values(rows: list[list[str]], source: str) -> _Columns:
    """Return each variable's (seconds, value) samples in a WinCC log, one value a row."""
    names = rows[0]
    needed = ["VarName", "VarValue", "Time_ms"]
    if missing := [name for name in needed if name not in names]:
        raise DataError(
            f"{source}: has a row for each value, but no column {join_names(missing)} (found: "
            f"{join_names(names)}); export it with {join_names(needed)}"
        )
    name_column, value_column, time_column = (names.index(column) for column in needed)
    columns: _Columns = {}
    begin: Decimal | None = None
    for line, row in enumerate(rows[1:], start=2):
        if len(row) < len(names) or row[name_column].startswith(_ARCHIVE_PREFIX):
            continue
        try:
            stamp = Decimal(row[time_column].replace(",", "."))
        except InvalidOperation:
            raise DataError(
                f"{source}: line {line}: Time_ms holds {row[time_column]!r}, a number expected"
            ) from None
        begin = stamp if begin is None else begin
        seconds = format(((stamp - begin) * _SECONDS).normalize(), "f")
        columns.setdefault(row[name_column], []).append(
            (seconds, row[value_column].replace(",", "."))
        )
    return columns


def _columns_of_blocks(rows: list[list[str]]) -> _Columns:
    """Return each variable's (time, value) samples in a CODESYS log, one block a variable."""
    columns: _Columns = {}
    for row in rows:
        if _BLOCK_HEADER.match(f"{row[0]};"):
            samples = columns.setdefault(row[1], [])
        elif len(row) > 2:
            samples.append((row[1].replace(",", "."), row[2].replace(",", ".")))
    return columns
