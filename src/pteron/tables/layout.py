"""The layout of a CSV file, found from its beginning: dialect, names, and where its rows begin.

A part that the file leaves ambiguous is refused, with the lines that declare it; only the encoding
of a file that is not UTF-8 is guessed.
"""

from __future__ import annotations

import codecs
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from pteron.errors import DataError, shorten
from pteron.tables.cells import Cut, Record, best_cut, single_blanks
from pteron.tables.dialect import SEPARATORS, Dialect, declaration
from pteron.tables.table import join_names

_LINES = 1000
"""Number of lines of a file from which its layout is found."""

_WITH_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
"""A number with a decimal comma."""

_OF_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
"""A number with a comma that would be another number if the comma separated thousands."""

_ONE_UNIT = r"(?:[mkunµ]?(?:s|m|rad|deg|N|A|V|W|g|Hz)|sec|°C?|%|1|-)(?:\^?-?\d|[²³])?"
"""Pattern of a unit, with a power or without."""

_UNIT = re.compile(
    rf"(?P<open>[\[(])?{_ONE_UNIT}(?:[ ·*/]?{_ONE_UNIT})*(?(open)[\])])|\[.{{0,9}}\]"
)
"""A cell in a line of units below the names."""

_KEYS = {"SymbolName", "SymbolComment", "SampleTime[ms]", "Data-Type", "Unit", "NetID"}
"""First cells of the lines above the data in an export of TwinCAT Scope, beside Name."""
_TICKS = 10**15
"""Time stamps above this are ticks of 100 ns, not ms: no export lasts that long."""


@dataclass(frozen=True)
class Layout:
    """The layout of a CSV file.

    Attributes
    ----------
    dialect : Dialect
        Separator, decimal sign, encoding and number of lines above the data; none is None.
    names, units : tuple of str
        Names and units of the columns; a repeated name has a number at its end, and a unit is empty
        where the file has no line of units.
    repeated : dict
        The numbered names of repeated columns, with their names in the file.
    start : int
        Number of bytes, as UTF-8, before the first row.
    first_line : int
        Number of the first row's line, from 1.
    found : tuple of str
        Differences from a plain CSV file that were not declared, in words.
    """

    dialect: Dialect
    names: tuple[str, ...]
    units: tuple[str, ...]
    repeated: dict[str, str]
    start: int
    first_line: int
    found: tuple[str, ...]


def find_encoding(head: bytes, declared: str | None, source: str) -> str:
    """Return a text's encoding: as declared, by its byte order mark, UTF-8, or else cp1252."""
    if declared is not None:
        return declared
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    if b"\0" not in head:
        for encoding in ("utf-8", "cp1252"):
            try:
                codecs.getincrementaldecoder(encoding)().decode(head)
            except UnicodeError:
                continue
            return encoding
    raise DataError(
        f"{source}: not UTF-8 text; save it as CSV in UTF-8, or say what it is in a TOML file "
        "beside it, such as" + declaration("csv", encoding="utf-16-le")
    )


def find_layout(head: bytes, declared: Dialect, encoding: str, source: str) -> Layout:
    """Return the layout of a CSV file: dialect, names, units and where its rows begin.

    `head` is the beginning of the file's text, in UTF-8; `declared` has the parts of the dialect
    that are declared.
    """
    lines = io.BytesIO(head).readlines()
    text = [line.decode() for line in lines[:_LINES]]
    rows = best_cut(text, declared)
    if rows is None or not rows.records:
        raise DataError(f"{source}: is empty; its first line must name the columns")
    if declared.decimal is None:
        _check_commas(rows, source)
    first = _first_row(rows, declared.header_lines)
    above = [record for record in rows.records if record.line < first]
    names, units, unit_line = _names(rows, above, declared.header_lines, source)
    known = replace(
        declared,
        separator=rows.separator,
        decimal=rows.decimal,
        encoding=encoding,
        header_lines=first,
    )
    named, repeated = _number_repeated(names)
    differences = []
    if declared.separator is None and rows.separator != ",":
        differences.append(f"cells separated by {SEPARATORS[rows.separator]}")
    if declared.decimal is None and rows.decimal == ",":
        differences.append("decimal comma")
    if declared.encoding is None and encoding != "utf-8":
        guessed = " (guessed: it is not UTF-8)" if encoding == "cp1252" else ""
        differences.append(f"encoding {encoding}{guessed}")
    if declared.header_lines is None and first > 1 + above[0].line:
        differences.append(f"{first} header lines")
    if unit_line:
        differences.append("units in a line of their own")
    header = b"".join(lines[:first])
    start = len(single_blanks(header) if rows.separator == " " else header)
    return Layout(known, named, units, repeated, start, first + 1, tuple(differences))


def _check_commas(rows: Cut, source: str) -> None:
    """Raise if commas in numbers may be either decimal commas or thousands separators."""
    if rows.decimal != ",":
        return
    cells = [cell for record in rows.records if rows.is_row(record) for cell in record.cells]
    commas = [cell for cell in cells if _WITH_COMMA.fullmatch(cell)]
    if commas and all(map(_OF_THOUSANDS.fullmatch, commas)):
        raise DataError(
            f"{source}: {shorten(commas[0])} may have a decimal comma or a mark of thousands; "
            "export it without marks of thousands, or if these are decimal commas, say so in a "
            "TOML file beside it:" + declaration("csv", decimal=",")
        )


def _first_row(rows: Cut, header_lines: int | None) -> int:
    """Return the line number, from 0, of the first row of data."""
    if header_lines is not None:
        below = [record for record in rows.records if record.line >= header_lines]
        return below[0].after if below and _are_units(below[0]) else header_lines
    index = next((i for i, record in enumerate(rows.records) if rows.is_row(record)), None)
    if index is None:
        return rows.records[0].after
    while index and rows.may_be_row(rows.records[index - 1]):
        if rows.records[index].line > rows.records[index - 1].after:
            break
        index -= 1
    return rows.records[index].line


def _names(
    rows: Cut, above: Sequence[Record], header_lines: int | None, source: str
) -> tuple[tuple[str, ...], tuple[str, ...], bool]:
    """Return the columns' names and units, and whether units are on a line of their own."""
    width = rows.width
    # Rows may end in a separator where the line of names does not.
    fitting = [record for record in above if len(record.cells) in (width, width - 1)]
    full = [record for record in fitting if 2 * sum(map(bool, record.cells)) > width]
    fitting = full or fitting[-1:]
    if not rows.columns:
        fitting = list(above)
    keyed = [record for record in fitting if record.cells[0] in _KEYS]
    titles = [record for record in fitting if record.cells[0] == "Name" and keyed]
    if titles:
        return *_scope_names(rows, titles[-1], keyed), False
    units = [record for record in fitting[1:] if _are_units(record)][-1:]
    if header_lines is not None and units and units[0].line < header_lines - 1:
        units = []
    named = [record for record in fitting if not units or record.line < units[0].line]
    if not named:
        raise _nameless(rows, above, source)
    cells = named[-1].cells
    of_units = [cell.strip("[]() ") for cell in units[0].cells] if units else []
    fill = ("",) * width
    return (*cells, *fill)[: max(width, len(cells))], (*of_units, *fill)[:width], bool(units)


def _are_units(record: Record) -> bool:
    """Return whether a record has units only: two or more cells that are not empty."""
    cells = [cell for cell in record.cells if cell]
    return len(cells) > 1 and all(map(_UNIT.fullmatch, cells))


def _scope_names(
    rows: Cut, title: Record, keyed: Sequence[Record]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the columns' names and units in a TwinCAT Scope export.

    Times are in milliseconds from the start, or full stamps in ticks of 100 ns; a unit is written
    like "mm (Length)" or "(None)".
    """
    unit_cells = next(
        (record.cells for record in keyed if record.cells[0] == "Unit"), ("",) * rows.width
    )
    row = next(record.cells for record in rows.records if rows.is_row(record))
    names, units = list(title.cells), [unit.partition("(")[0].strip() for unit in unit_cells]
    for j, name in enumerate(names):
        if name == "Name":
            ticks = float(row[j].replace(",", ".")) > _TICKS
            names[j], units[j] = "Time", "100 ns" if ticks else "ms"
    return tuple(names), tuple(units)


def _nameless(rows: Cut, above: Sequence[Record], source: str) -> DataError:
    """Return the error that no line above the rows names the columns."""
    if not above:
        return DataError(f"{source}: no line names the columns; the first line must name them")
    last = above[-1]
    why = "the names stand in another line, or a separator stands in names or numbers"
    if rows.separator == ",":
        why += " (commas cannot separate cells and be decimal signs too)"
    return DataError(
        f"{source}: line {last.line + 1} has {len(last.cells)} cells ({join_names(last.cells)}), "
        f"but the rows below have {rows.width}, separated by {SEPARATORS[rows.separator]}: {why}; "
        "export it with another separator, or say in a TOML file beside it which line names the "
        "columns:" + declaration("csv", separator=rows.separator, header_lines=last.line + 1)
    )


def _number_repeated(names: Sequence[str]) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return names made distinct by numbers, and a map from numbered to original names."""
    numbered: list[str] = []
    repeated: dict[str, str] = {}
    seen: Counter[str] = Counter()
    for j, name in enumerate(names):
        seen[name] += 1
        label = name or f"column {j + 1}"
        while label in numbered or (label != name and label in names):
            label = f"{name} ({seen[name]})" if label == name else label + "'"
        if name and label != name:
            repeated[label] = name
        numbered.append(label)
    return tuple(numbered), repeated
