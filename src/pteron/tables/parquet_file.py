"""`ParquetFile`: a Parquet file, read in blocks of rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import ClassVar

import polars as pl

from pteron.errors import DataError
from pteron.tables.table import Table

_ROWS = 262_144
"""Rows of a block."""

_UNREADABLE = (pl.exceptions.PolarsError, pl.exceptions.PanicException)
"""Exceptions of Polars at damaged bytes; a panic is no `Exception`."""


class ParquetFile:
    """A Parquet file, open for reading as a `CsvFile` is; `rows_estimate` is exact.

    Raises
    ------
    DataError
        If it is not a Parquet file.
    """

    hint = "add what is missing"
    units: tuple[str, ...] = ()
    repeated: ClassVar[dict[str, str]] = {}
    found: tuple[str, ...] = ()

    def __init__(self, path: Path, source: str) -> None:
        self.source = source
        self._frame = pl.scan_parquet(path, glob=False)
        try:
            self._kinds = self._frame.collect_schema()
            self.rows_estimate = int(self._frame.select(pl.len()).collect().item())
        except _UNREADABLE:
            raise DataError(
                f"{source}: not a Parquet file; write it again, or give a CSV"
            ) from None
        self.columns = tuple(self._kinds)

    def tables(self, columns: Sequence[str] | None = None) -> Iterator[Table]:
        """Yield the file's rows in order, as tables of a block each.

        Parameters
        ----------
        columns : sequence of str, optional
            Those to be read, truth values as 0 and 1; by default all, as they are.

        Raises
        ------
        DataError
            If a part of the file cannot be read.
        """
        frame = self._frame
        if columns is not None:
            truths = [name for name in columns if self._kinds[name] == pl.Boolean]
            frame = frame.select(*dict.fromkeys(columns)).cast(dict.fromkeys(truths, pl.Float64))
        for start in range(0, self.rows_estimate, _ROWS):
            try:
                part = frame.slice(start, _ROWS).collect()
            except _UNREADABLE as error:
                reason = str(error).splitlines()[0]
                raise DataError(
                    f"{self.source}: cannot be read behind row {start} ({reason}); write it again"
                ) from None
            yield Table(self.source, part, self.hint, start)
