"""`CsvFile`: a CSV file read in blocks by Polars, or record by record to say what is wrong."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import chain, islice, pairwise
from pathlib import Path

import polars as pl

from pteron.errors import DataError, shorten
from pteron.tables.cells import single_blanks
from pteron.tables.dialect import PLAIN, SEPARATORS, Dialect, declaration
from pteron.tables.layout import find_encoding, find_layout
from pteron.tables.table import Table, join_names

BLOCK = 16 << 20
"""Bytes read at a time: large enough for Polars to be fast, small beside any memory."""

_HEAD = 1 << 20
"""Bytes at the beginning of a file from which its layout is found."""

_END = b"\nEOF"
"""A last line that marks the end, as TwinCAT Scope writes it."""

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
"""A number, which is no name of a column."""


class CsvFile:
    """A CSV file that is open for reading; each pass over its tables reads it anew.

    Parameters
    ----------
    data : path or bytes
        A regular file, or what was in one.
    source : str
        Its name in messages.
    dialect : Dialect, optional
        The form it is written in, as far as that is declared in the TOML file beside it; the rest
        is found. By default it must be plain: commas, decimal points, UTF-8, names in the first
        line.
    block : int
        Bytes read at a time.

    Attributes
    ----------
    columns : tuple of str
        Names of the columns, stripped of blanks.
    units : tuple of str
        Their units, empty where no line of the file says them.
    repeated : dict
        Names that the file has more than once, as they are told apart, and as it has them.
    found : tuple of str
        Differences from a plain CSV file that were not declared, in words.
    rows_estimate : int or None
        About how many rows it has.
    hint : str
        The likely fault of the header where a column is missing.

    Raises
    ------
    DataError
        If it is empty, not text, or has a column name twice.
    """

    def __init__(
        self, data: Path | bytes, source: str, dialect: Dialect | None = None, *, block: int = BLOCK
    ) -> None:
        self.source, self._data, self._block = source, data, block
        self._found = dialect is not None
        self._dialect = dialect or PLAIN
        self._encoding = self._dialect.encoding or find_encoding(self._read_head(), None, source)
        self._separator = self._dialect.separator or ","
        head = next(self._text(_HEAD), b"")
        self.units: tuple[str, ...] = ()
        self.repeated: dict[str, str] = {}
        self.found: tuple[str, ...] = ()
        if dialect is None:
            self.columns, self._start, self._first_line = self._header(head)
        else:
            layout = find_layout(head, dialect, self._encoding, source)
            self._dialect = layout.dialect
            self._separator = layout.dialect.separator or ","
            self.columns, self.units = layout.names, layout.units
            self.repeated, self.found = layout.repeated, layout.found
            self._start, self._first_line = layout.start, layout.first_line
            if self._separator == " ":
                head = next(self._text(_HEAD), b"")
        header, sample = head[: self._start], head[self._start :]
        rows = sample.count(b"\n")
        size = len(data) if isinstance(data, bytes) else data.stat().st_size
        self.rows_estimate = round((size - self._start) * rows / len(sample)) if rows else None
        other = self._other_dialect(header.decode(), sample.partition(b"\n")[0])
        self.hint = other or "the first line must name the columns"
        self._mend = other or "mend the row"
        if self._separator == " ":
            self._mend += ", or export with another separator: blanks cannot mark an empty cell"

    def tables(self, columns: Sequence[str] | None = None) -> Iterator[Table]:
        """Yield the file's rows as tables of text cells, a block each; blank lines are skipped.

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
        row, line, carried = 0, self._first_line, b""
        for chunk, following in pairwise(chain(self._text(self._block, self._start), [None])):
            assert chunk is not None
            text = carried + chunk
            if following is None and self._found and text.rstrip().endswith(_END):
                text = text[: text.rindex(_END) + 1]
            end = len(text) if following is None else _end_of_records(text)
            if not end and len(text) > self._block + _HEAD:  # a quote that is never closed
                end = len(text)
            block, carried = text[:end], text[end:]
            frame = self._read_by_polars(block, names)
            if frame is None:
                frame = self._read_by_record(block, row, line).select(names)
            if len(frame):
                line_of = partial(self._line_of, block, line)
                decimal = self._dialect.decimal or "."
                yield Table(self.source, frame, self.hint, row, line_of, decimal)
            row += len(frame)
            line += block.count(b"\n")

    def _read_head(self) -> bytes:
        """Return the bytes at the beginning of the file, from which its layout is detected."""
        if isinstance(self._data, bytes):
            return self._data[:_HEAD]
        with self._data.open("rb") as file:
            return file.read(_HEAD)

    def _text(self, size: int, start: int = 0) -> Iterator[bytes]:
        """Yield the file's text from `start` on, as UTF-8 in pieces with Unix line ends.

        If blanks separate the cells, runs of blanks are made single, and removed at the ends of
        lines.
        """
        decoder = codecs.getincrementaldecoder(self._encoding)()
        decode = io.IncrementalNewlineDecoder(decoder, translate=True).decode
        content, mark, carried = self._data, "\ufeff", b""
        with io.BytesIO(content) if isinstance(content, bytes) else content.open("rb") as file:
            for chunk, following in pairwise(chain(iter(partial(file.read, size), b""), [b""])):
                try:
                    text = decode(chunk, not following)
                except UnicodeError:
                    raise self._not_text() from None
                piece, mark = text.removeprefix(mark).encode(), ""
                if self._separator == " ":
                    piece = carried + piece
                    end = len(piece) if not following else piece.rfind(b"\n") + 1
                    piece, carried = single_blanks(piece[:end]), piece[end:]
                yield piece[start:]
                start = max(start - len(piece), 0)

    def _header(self, head: bytes) -> tuple[tuple[str, ...], int, int]:
        """Return the columns' names, the offset at which rows begin, and their line number."""
        lines = io.BytesIO(head).readlines()
        records = csv.reader(map(bytes.decode, lines), strict=True)
        try:
            names = next(
                (tuple(c.strip() for c in cells) for cells in records if _is_not_blank(cells)), ()
            )
        except csv.Error as error:
            raise DataError(
                f"{self.source}: its header is not CSV ({error}); check its quotes and line ends"
            ) from None
        if not names:
            raise DataError(f"{self.source}: is empty; its first line must name the columns")
        twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
        if twice is not None:
            fault = f"two columns are called {shorten(twice)}; rename or remove one"
            if all(_NUMBER.fullmatch(name) for name in names):
                fault = "its first line has numbers; it must name the columns"
            raise DataError(f"{self.source}: {fault}")
        read = records.line_num
        return names, sum(map(len, lines[:read])), read + 1

    def _other_dialect(self, header: str, row: bytes) -> str | None:
        """Return a message on the CSV dialect that a file seems to have; None if it is plain."""
        other = next((s for s in SEPARATORS if s not in ", " and s in header), None)
        if self._found or len(self.columns) > 1 or other is None:
            return None
        comma = re.search(rb"\d,\d", row) is not None
        separators = SEPARATORS[other] + ", with decimal commas" * comma
        return (
            f"its cells look separated by {separators}; separate the cells with commas and "
            "decimals with points"
        )

    def _read_by_polars(self, block: bytes, names: Sequence[str]) -> pl.DataFrame | None:
        """Return a block's cells as read by Polars; None where Polars might misread them.

        Polars pads short rows and reads blank lines as rows, which a count of separators reveals;
        it also tolerates wrong quotes.
        """
        separator, last = self._separator, len(self.columns) - 1
        if not last or b'"' in block:
            return None
        indices = [self.columns.index(name) for name in names]
        schema = {str(j): pl.String for j in range(last + 1)}
        try:
            frame = pl.read_csv(
                block, has_header=False, schema=schema, columns=indices, separator=separator
            )
        except pl.exceptions.PolarsError:
            return None
        if block.count(separator.encode()) != frame.height * last:
            return None
        return frame.rename({str(j): self.columns[j] for j in indices})

    def _read_by_record(self, block: bytes, row: int, line: int) -> pl.DataFrame:
        """Return a block's cells as text, read by `csv`; errors name the row's line."""
        names, rows = self.columns, list[list[str | None]]()
        try:
            for begins, cells in self._records(block, line):
                if len(cells) != len(names):
                    raise DataError(
                        f"{self.source}: row {row + len(rows) + 1} (line {begins}) has "
                        f"{len(cells)} cells, but the header names {len(names)} columns "
                        f"({join_names(names)}); {self._mend}"
                    )
                rows.append([cell or None for cell in cells])
        except csv.Error as error:
            raise DataError(
                f"{self.source}: behind row {row + len(rows)} is not CSV ({error}); check its "
                "quotes"
            ) from None
        return pl.DataFrame(rows, schema=dict.fromkeys(names, pl.String), orient="row")

    def _records(self, block: bytes, line: int) -> Iterator[tuple[int, list[str]]]:
        """Yield the non-blank records of a block, each with the line it begins on."""
        lines = map(bytes.decode, io.BytesIO(block))
        reader = csv.reader(lines, delimiter=self._separator, strict=True)
        begins = line
        for cells in reader:
            if _is_not_blank(cells):
                yield begins, cells
            begins = line + reader.line_num

    def _line_of(self, block: bytes, line: int, index: int) -> int:
        """Return the line of the file on which row `index` of a block begins."""
        try:
            return next(islice(self._records(block, line), index, None))[0]
        except csv.Error:  # a cell longer than `csv` reads, which Polars did: each row is a line
            return line + index

    def _not_text(self) -> DataError:
        """Return the error that the file is not text in its encoding."""
        message = f"{self.source}: not {self._encoding.upper()} text; save it as CSV in UTF-8"
        if self._found:
            message += ", or say what it is in a TOML file beside it, such as"
            message += declaration("csv", encoding="cp1252")
        return DataError(message)


def _is_not_blank(cells: Sequence[str]) -> bool:
    """Return whether a record is more than a blank line."""
    return len(cells) > 1 or bool(cells and cells[0].strip())


def _end_of_records(block: bytes) -> int:
    """Return the length of the complete records in a block: to its last unquoted line end."""
    cut = block.rfind(b"\n") + 1
    while cut and block.count(b'"', 0, cut) % 2:
        cut = block.rfind(b"\n", 0, block.rfind(b'"', 0, cut)) + 1
    return cut
