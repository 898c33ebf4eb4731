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
from pteron.tables.table import listed

_VALUES = re.compile(r'^"?VarName"? *(?P<separator>[;,\t])', re.MULTILINE)
"""The header of a log of WinCC, which has a row for each value."""

_BLOCKS = re.compile(r"^\d+\.Variable *(?P<separator>[;,\t])", re.MULTILINE)
"""The first line of a variable in a trace of CODESYS 3, whose samples stand below."""

_HEAD = 1 << 12
"""Bytes from which either is recognised."""

_OF_ARCHIVE = "$RT_"
"""Prefix of WinCC's own marks between the values."""

_SECONDS = Decimal("0.0864")
"""Seconds in a millionth of a day, the unit of WinCC's Time_ms."""

_Columns = dict[str, list[tuple[str, str]]]
"""Times and values of each variable, as text with decimal points."""


def side_by_side(file: Path, encoding: str | None, source: str) -> bytes | None:
    """Return a file whose variables stand one below another as plain CSV, with the time in t.

    `encoding` is what was declared. None for any other file.
    """
    with file.open("rb") as opened:
        head = opened.read(_HEAD)
    try:
        known = find_encoding(head, encoding, source)
        start = head.decode(known, errors="ignore").lstrip("\ufeff")
    except (DataError, LookupError):
        return None  # it is refused where it is read
    values, blocks = _VALUES.search(start), _BLOCKS.search(start)
    found = values or blocks
    if found is None:
        return None
    text = file.read_bytes().decode(known).lstrip("\ufeff")[found.start() :]
    rows = [row for row in csv.reader(io.StringIO(text), delimiter=found["separator"]) if row]
    rows = [[cell.strip() for cell in row] for row in rows]
    columns = _of_values(rows, source) if values else _of_blocks(rows)
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


def _of_values(rows: list[list[str]], source: str) -> _Columns:
    names = rows[0]
    needed = ["VarName", "VarValue", "Time_ms"]
    if missing := [name for name in needed if name not in names]:
        raise DataError(
            f"{source}: has a row for each value, but no column {listed(missing)} (found: "
            f"{listed(names)}); export it with {listed(needed)}"
        )
    name, value, time = (names.index(one) for one in needed)
    columns: _Columns = {}
    begin: Decimal | None = None
    for line, row in enumerate(rows[1:], start=2):
        if len(row) < len(names) or row[name].startswith(_OF_ARCHIVE):
            continue
        try:
            stamp = Decimal(row[time].replace(",", "."))
        except InvalidOperation:
            raise DataError(
                f"{source}: line {line}: Time_ms holds {row[time]!r}, a number expected"
            ) from None
        begin = stamp if begin is None else begin
        seconds = format(((stamp - begin) * _SECONDS).normalize(), "f")
        columns.setdefault(row[name], []).append((seconds, row[value].replace(",", ".")))
    return columns


def _of_blocks(rows: list[list[str]]) -> _Columns:
    columns: _Columns = {}
    for row in rows:
        if _BLOCKS.match(f"{row[0]};"):
            samples = columns.setdefault(row[1], [])
        elif len(row) > 2:
            samples.append((row[1].replace(",", "."), row[2].replace(",", ".")))
    return columns
