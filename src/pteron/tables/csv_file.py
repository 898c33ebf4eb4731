"""CSV files: in blocks by Polars, or record by record where it must be said what is wrong."""

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

import polars as pl

from pteron.errors import DataError, shown
from pteron.tables.table import Table, listed

BLOCK = 16 << 20
"""Bytes read at a time: large enough for Polars to be fast, small beside any memory."""
_HEAD = 1 << 20
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
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

    separator: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    header_lines: int | None = None


class CsvFile:
    """A CSV file that is open for reading; each pass over its tables reads it anew.

    Parameters
    ----------
    data : path or bytes
        A regular file, or what was in one.
    source : str
        What messages call it.
    dialect : Dialect
        How it is written.
    describable : bool
        Whether a TOML file beside it may declare its dialect, so that messages advise it.
    block : int
        Bytes read at a time.

    Attributes
    ----------
    source : str
        As given.
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
        describable: bool = False,
        block: int = BLOCK,
    ) -> None:
        self._data = data
        self.source = source
        self._dialect = dialect or Dialect()
        self._describable = describable
        self._block = block
        self._old_line_ends = False
        head = next(self._text(_HEAD), b"")
        # Old spreadsheets end lines with CR alone.
        self._old_line_ends = b"\n" not in head and b"\r" in head
        if self._old_line_ends:
            head = head.replace(b"\r", b"\n")
        self.columns, self._start, self._first_line = self._header(head)
        sample = head[self._start :]
        rows = sample.count(b"\n")
        size = len(data) if isinstance(data, bytes) else data.stat().st_size
        self.rows_estimate = round((size - self._start) * rows / len(sample)) if rows else None
        other_dialect = self._other_dialect(head[: self._start].decode(), sample)
        self.hint = other_dialect or "the first line must name the columns"
        self._mend = other_dialect or "mend the row"

    def tables(self, numbers: Sequence[str] | None = None) -> Iterator[Table]:
        """Yield the rows in order, a block of them at a time; blank lines are skipped.

        Parameters
        ----------
        numbers : sequence of str, optional
            The columns to be read, for their numbers. By default all are read, as text.

        Raises
        ------
        DataError
            If a row is ragged, or if the file is not text; the message names the row and the line.
        """
        row, line, rest = 0, self._first_line, b""
        for chunk, following in pairwise(chain(self._body(), [None])):
            assert chunk is not None
            whole = rest + chunk
            cut = len(whole) if following is None else _end_of_records(whole)
            if not cut and len(whole) > 2 * self._block:  # a quote that is never closed
                cut = len(whole)
            block, rest = whole[:cut], whole[cut:]
            table = self._table(block, numbers, row, line)
            if len(table):
                yield table
            row, line = row + len(table), line + block.count(b"\n")

    def _text(self, size: int) -> Iterator[bytes]:
        """Yield the file's text in UTF-8, so many bytes of the file at a time."""
        encoding = codecs.lookup(self._dialect.encoding).name
        decode = None if encoding == "utf-8" else codecs.getincrementaldecoder(encoding)().decode
        mark = _BYTE_ORDER_MARK
        with (
            io.BytesIO(self._data)
            if isinstance(self._data, bytes)
            else self._data.open("rb") as file
        ):
            while chunk := file.read(size):
                if decode is not None:
                    try:
                        chunk = decode(chunk).encode()
                    except UnicodeError:
                        raise self._not_text("") from None
                chunk, mark = chunk.removeprefix(mark), b""
                yield chunk.replace(b"\r", b"\n") if self._old_line_ends else chunk

    def _body(self) -> Iterator[bytes]:
        skipped = self._start
        for chunk in self._text(self._block):
            yield chunk[skipped:]
            skipped = max(skipped - len(chunk), 0)

    def _header(self, head: bytes) -> tuple[tuple[str, ...], int, int]:
        """Return the columns' names, where the rows begin, and on which line."""
        start, lines = 0, 0
        above = self._dialect.header_lines

        def read() -> Iterator[bytes]:
            nonlocal start, lines
            for line in io.BytesIO(head):
                start, lines = start + len(line), lines + 1
                yield line

        def decoded() -> Iterator[str]:
            for line in islice(read(), above and above - 1, above):
                if b"\r" in line.rstrip(b"\r\n"):
                    raise DataError(
                        f"{self.source}: line {lines} has a carriage return in its midst; end all "
                        "lines in the same way"
                    )
                yield line.decode("utf-8")

        try:
            records = csv.reader(decoded(), delimiter=self._dialect.separator, strict=True)
            names = next((tuple(c.strip() for c in cells) for cells in records if _any(cells)), ())
        except UnicodeDecodeError:
            raise self._not_text("") from None
        except csv.Error as error:
            raise DataError(
                f"{self.source}: not a CSV file ({error}); check the quotes of its header"
            ) from None
        if not names:
            which = "first line" if above is None else f"line {above}"
            raise DataError(f"{self.source}: is empty; its {which} must name the columns")
        twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
        if twice is not None:
            raise DataError(
                f"{self.source}: two columns are called {shown(twice)}; rename or remove one"
            )
        return names, start, lines + 1

    def _other_dialect(self, header: str, rows: bytes) -> str | None:
        """Say in which dialect the file seems to be written, if not in the one it is read in."""
        separator = self._dialect.separator
        other = next((s for s in _SEPARATORS if s != separator and s in header), None)
        if len(self.columns) > 1 or other is None:
            return None
        comma = other != "," and re.search(rb"\d,\d", rows.partition(b"\n")[0]) is not None
        advice = "separate the cells with commas and decimals with points"
        if self._describable:
            decimal = ', decimal = ","' if comma else ""
            sign = other.replace("\t", "\\t")
            advice += (
                f', or declare it in a TOML file beside it: [csv] separator = "{sign}"{decimal}'
            )
        with_commas = ", with decimal commas" if comma else ""
        return f"its cells look separated by {_SEPARATORS[other]}{with_commas}; {advice}"

    def _table(self, block: bytes, numbers: Sequence[str] | None, row: int, line: int) -> Table:
        names = self.columns if numbers is None else sorted(set(numbers), key=self.columns.index)
        frame = None
        decimal = self._dialect.decimal
        if numbers is not None and (decimal == "." or b"." not in block):
            frame = self._at_once(block, names, pl.Float64)
            if frame is not None and not all(column.is_finite().all() for column in frame):
                frame = None
        if frame is None:
            frame = self._at_once(block, names, pl.String)
        if frame is None:
            frame = self._by_record(block, row, line).select(names)
        line_of = partial(self._line_of, block, line)
        return Table(self.source, frame, self.hint, row, line_of, decimal)

    def _at_once(
        self, block: bytes, names: Sequence[str], kind: type[pl.DataType]
    ) -> pl.DataFrame | None:
        """Return the cells as Polars reads them, or None where a row may be at fault.

        Polars fills short rows and takes blank lines for rows. Both leave the last cell empty, and
        separators that are not there.
        """
        if block.count(b"\r") != block.count(b"\r\n"):
            return None
        separator, last = self._dialect.separator, len(self.columns) - 1
        wanted = [self.columns.index(name) for name in names]
        quoted = b'"' in block
        try:
            frame = pl.read_csv(
                block,
                has_header=False,
                schema={str(j): kind if j in wanted else pl.String for j in range(last + 1)},
                columns=None if quoted or not last else wanted,
                separator=separator,
                decimal_comma=kind == pl.Float64 and self._dialect.decimal == ",",
            )
        except pl.exceptions.PolarsError:
            return None
        if quoted or not last:
            whole = not frame[str(last)].has_nulls()
        else:
            whole = block.count(separator.encode()) == frame.height * last
        return (
            frame.select(pl.col(str(j)).alias(self.columns[j]) for j in wanted) if whole else None
        )

    def _by_record(self, block: bytes, row: int, line: int) -> pl.DataFrame:
        names, rows = self.columns, list[list[str | None]]()
        begins = line
        try:
            for begins, cells in self._records(block, line):
                if len(cells) != len(names):
                    raise DataError(
                        f"{self.source}: row {row + len(rows) + 1} (line {begins}) has "
                        f"{len(cells)} cells, but the header names {len(names)} columns "
                        f"({listed(names)}); {self._mend}"
                    )
                rows.append([cell or None for cell in cells])
        except UnicodeDecodeError:
            raise self._not_text(f" behind row {row}" if row else "") from None
        except csv.Error as error:
            behind = f" (line {begins})" if rows else ""
            raise DataError(
                f"{self.source}: behind row {row + len(rows)}{behind} is not CSV ({error}); check "
                "its quotes"
            ) from None
        return pl.DataFrame(rows, schema=dict.fromkeys(names, pl.String), orient="row")

    def _records(self, block: bytes, line: int) -> Iterator[tuple[int, list[str]]]:
        """Yield the records that are not blank, each with the line it begins on."""
        text = io.TextIOWrapper(io.BytesIO(block), encoding="utf-8", newline="")
        reader = csv.reader(text, delimiter=self._dialect.separator, strict=True)
        begins = line
        for cells in reader:
            if _any(cells):
                yield begins, cells
            begins = line + reader.line_num

    def _line_of(self, block: bytes, line: int, index: int) -> int:
        return next(islice(self._records(block, line), index, None))[0]

    def _not_text(self, where: str) -> DataError:
        encoding = self._dialect.encoding
        name = "UTF-8" if encoding == "utf-8" else encoding
        declare = "; or declare its encoding in a TOML file beside it: [csv] encoding = ..."
        return DataError(
            f"{self.source}: not {name} text{where}; save it as CSV in UTF-8"
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
