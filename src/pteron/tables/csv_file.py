"""CSV files: a block at a time by Polars, or by record where it must be said what is wrong."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import Literal

import polars as pl

from pteron.errors import DataError, shown
from pteron.tables.table import Table, listed

BLOCK = 16 << 20
"""Bytes read at a time: large enough for Polars to be fast, small beside any memory."""
_HEAD = 1 << 20
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}


@dataclass(frozen=True)
class Dialect:
    """How a CSV file is written.

    Parameters
    ----------
    separator : str
        The character between cells.
    decimal : {".", ","}
        The decimal sign.
    encoding : str
        A text encoding that Python knows.
    header_lines : int, optional
        Lines above the data, of which the last names the columns. By default the first line that is
        not blank names them.
    """

    separator: Literal[",", ";", "\t", "|", " "] = ","
    decimal: Literal[".", ","] = "."
    encoding: str = "utf-8"
    header_lines: int | None = None

    def __post_init__(self) -> None:
        if self.decimal == self.separator:
            raise DataError('decimal: "," cannot be the separator too')
        if self.header_lines is not None and self.header_lines < 1:
            raise DataError(f"header_lines: {self.header_lines} given, at least 1 expected")
        try:
            "".encode(self.encoding)
        except (LookupError, ValueError):
            raise DataError(
                f"encoding: {shown(self.encoding)} is no text encoding that Python knows"
            ) from None


class CsvFile:
    """A CSV file that is open for reading; each pass over its tables reads it anew.

    Parameters
    ----------
    data : path or bytes
        A regular file, or what was in one.
    source : str
        What messages call it.
    dialect : Dialect, optional
        How it is written; messages then advise to declare another in the TOML file beside it.
    block : int
        Bytes read at a time.

    Attributes
    ----------
    columns : tuple of str
        Names of the columns, stripped of blanks.
    rows_estimate : int or None
        About how many rows it has.
    hint : str
        What may be amiss with the header where a column is missing.

    Raises
    ------
    DataError
        If it is empty, not text, or has a column name twice.
    """

    def __init__(
        self,
        data: Path | bytes,
        source: str,
        dialect: Dialect | None = None,
        *,
        block: int = BLOCK,
    ) -> None:
        self.source, self._data, self._block = source, data, block
        self._dialect, self._describable = dialect or Dialect(), dialect is not None
        head = next(self._text(_HEAD), b"")
        self.columns, self._start, self._first_line = self._header(head)
        header, sample = head[: self._start], head[self._start :]
        rows = sample.count(b"\n")
        size = len(data) if isinstance(data, bytes) else data.stat().st_size
        self.rows_estimate = round((size - self._start) * rows / len(sample)) if rows else None
        other = self._other_dialect(header.decode(), sample.partition(b"\n")[0])
        self.hint = other or "the first line must name the columns"
        self._mend = other or "mend the row"

    def tables(self, columns: Sequence[str] | None = None) -> Iterator[Table]:
        """Yield the cells as text, a block of rows at a time; blank lines are skipped.

        Parameters
        ----------
        columns : sequence of str, optional
            Those to be read, by default all.

        Raises
        ------
        DataError
            If a row is ragged, or if the file is not text; the message names the row and the line.
        """
        names = [name for name in self.columns if columns is None or name in columns]
        row, line, rest = 0, self._first_line, b""
        for chunk, following in pairwise(chain(self._text(self._block, self._start), [None])):
            assert chunk is not None
            whole = rest + chunk
            cut = len(whole) if following is None else _end_of_records(whole)
            if not cut and len(whole) > self._block + _HEAD:  # a quote that is never closed
                cut = len(whole)
            block, rest = whole[:cut], whole[cut:]
            frame = self._at_once(block, names)
            if frame is None:
                frame = self._by_record(block, row, line).select(names)
            if len(frame):
                line_of = partial(self._line_of, block, line)
                yield Table(self.source, frame, self.hint, row, line_of, self._dialect.decimal)
            row += len(frame)
            line += block.count(b"\n")

    def _text(self, size: int, start: int = 0) -> Iterator[bytes]:
        """Yield the text from `start` on, in UTF-8 and with the line ends of Unix, in pieces."""
        decoder = codecs.getincrementaldecoder(self._dialect.encoding)()
        decode = io.IncrementalNewlineDecoder(decoder, translate=True).decode
        data, mark = self._data, "\ufeff"
        with io.BytesIO(data) if isinstance(data, bytes) else data.open("rb") as file:
            for chunk, following in pairwise(chain(iter(partial(file.read, size), b""), [b""])):
                try:
                    text = decode(chunk, not following)
                except UnicodeError:
                    raise self._not_text() from None
                whole, mark = text.removeprefix(mark).encode(), ""
                yield whole[start:]
                start = max(start - len(whole), 0)

    def _header(self, head: bytes) -> tuple[tuple[str, ...], int, int]:
        """Return the columns' names, where the rows begin, and on which line."""
        lines = io.BytesIO(head).readlines()
        above = self._dialect.header_lines or 1
        records = csv.reader(
            map(bytes.decode, lines[above - 1 :]), delimiter=self._dialect.separator, strict=True
        )
        try:
            names = next((tuple(c.strip() for c in cells) for cells in records if _any(cells)), ())
        except csv.Error as error:
            raise DataError(
                f"{self.source}: its header is not CSV ({error}); check its quotes and line ends"
            ) from None
        if not names:
            which = "first line" if above == 1 else f"line {above}"
            raise DataError(f"{self.source}: is empty; its {which} must name the columns")
        twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
        if twice is not None:
            raise DataError(
                f"{self.source}: two columns are called {shown(twice)}; rename or remove one"
            )
        read = above - 1 + records.line_num
        return names, sum(map(len, lines[:read])), read + 1

    def _other_dialect(self, header: str, row: bytes) -> str | None:
        """Say in which dialect the file seems to be written, if not in the one it is read in."""
        separator = self._dialect.separator
        other = next((s for s in _SEPARATORS if s != separator and s in header), None)
        if len(self.columns) > 1 or other is None:
            return None
        comma = other != "," and re.search(rb"\d,\d", row) is not None
        found = _SEPARATORS[other] + ", with decimal commas" * comma
        declare = ""
        if self._describable:
            declaration = f'separator = "{other}"'.replace("\t", "\\t") + ', decimal = ","' * comma
            declare = f", or declare it in a TOML file beside it: [csv] {declaration}"
        return (
            f"its cells look separated by {found}; separate the cells with commas and decimals "
            f"with points{declare}"
        )

    def _at_once(self, block: bytes, names: Sequence[str]) -> pl.DataFrame | None:
        """Return the cells as Polars reads them, or None where it might read them otherwise.

        Polars fills short rows and takes blank lines for rows, which separators that are not there
        tell; and it is lenient with quotes.
        """
        separator, last = self._dialect.separator, len(self.columns) - 1
        if not last or b'"' in block:
            return None
        wanted = [self.columns.index(name) for name in names]
        schema = {str(j): pl.String for j in range(last + 1)}
        try:
            frame = pl.read_csv(
                block, has_header=False, schema=schema, columns=wanted, separator=separator
            )
        except pl.exceptions.PolarsError:
            return None
        if block.count(separator.encode()) != frame.height * last:
            return None
        return frame.rename({str(j): self.columns[j] for j in wanted})

    def _by_record(self, block: bytes, row: int, line: int) -> pl.DataFrame:
        names, rows = self.columns, list[list[str | None]]()
        try:
            for begins, cells in self._records(block, line):
                if len(cells) != len(names):
                    raise DataError(
                        f"{self.source}: row {row + len(rows) + 1} (line {begins}) has "
                        f"{len(cells)} cells, but the header names {len(names)} columns "
                        f"({listed(names)}); {self._mend}"
                    )
                rows.append([cell or None for cell in cells])
        except csv.Error as error:
            raise DataError(
                f"{self.source}: behind row {row + len(rows)} is not CSV ({error}); check its "
                "quotes"
            ) from None
        return pl.DataFrame(rows, schema=dict.fromkeys(names, pl.String), orient="row")

    def _records(self, block: bytes, line: int) -> Iterator[tuple[int, list[str]]]:
        """Yield the records that are not blank, each with the line it begins on."""
        lines = map(bytes.decode, io.BytesIO(block))
        reader = csv.reader(lines, delimiter=self._dialect.separator, strict=True)
        begins = line
        for cells in reader:
            if _any(cells):
                yield begins, cells
            begins = line + reader.line_num

    def _line_of(self, block: bytes, line: int, index: int) -> int:
        return next(islice(self._records(block, line), index, None))[0]

    def _not_text(self) -> DataError:
        declare = "; or declare its encoding in a TOML file beside it: [csv] encoding = ..."
        return DataError(
            f"{self.source}: not {self._dialect.encoding.upper()} text; save it as CSV in UTF-8"
            f"{declare if self._describable else ''}"
        )


def _any(cells: Sequence[str]) -> bool:
    """Say whether a record is more than a blank line."""
    return len(cells) > 1 or bool(cells and cells[0].strip())


def _end_of_records(block: bytes) -> int:
    """Return how much of a block is whole records: up to its last line end outside quotes."""
    cut = block.rfind(b"\n") + 1
    while cut and block.count(b'"', 0, cut) % 2:
        cut = block.rfind(b"\n", 0, block.rfind(b'"', 0, cut)) + 1
    return cut
