"""The numbers of a Parquet file, some rows at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pteron.errors import DataError

__all__ = ["ParquetRows"]

_ROWS = 262_144


class ParquetRows:
    """A Parquet file of numbers; it is read anew in every pass.

    Parameters
    ----------
    path : path
        A regular file.
    source : str
        What messages call it.

    Raises
    ------
    DataError
        If it is not a Parquet file.
    """

    hint = "add what is missing"

    def __init__(self, path: Path, source: str) -> None:
        self._source = source
        self._frame = pl.scan_parquet(path, glob=False)
        try:
            self._kinds = self._frame.collect_schema()
            self.rows_estimate = int(self._frame.select(pl.len()).collect().item())
        except pl.exceptions.PolarsError:
            raise DataError(
                f"{source}: not a Parquet file; write it again, or give a CSV"
            ) from None
        self.columns = tuple(self._kinds)

    def blocks(self, columns: Sequence[int]) -> Iterator[NDArray[np.float64]]:
        """Yield the finite numbers in some columns, shape (rows, len(columns)), in order.

        Raises
        ------
        DataError
            If a column does not hold numbers, or a cell is empty or not finite; the message names
            the row and the column.
        """
        names = [self.columns[j] for j in columns]
        for name in names:
            kind = self._kinds[name]
            if not (kind.is_numeric() or kind == pl.Boolean):
                raise DataError(
                    f"{self._source}: column {name} holds {kind}; numbers were expected; write it "
                    "as floats"
                )
        numbers = self._frame.select(pl.col(name).cast(pl.Float64) for name in names)
        for start in range(0, self.rows_estimate, _ROWS):
            try:
                frame = numbers.slice(start, _ROWS).collect()
            except pl.exceptions.PolarsError as error:
                reason = str(error).splitlines()[0]
                raise DataError(
                    f"{self._source}: cannot be read behind row {start} ({reason}); write it again"
                ) from None
            values = frame.to_numpy()
            bad = ~np.isfinite(values)
            if bad.any():
                i, j = (int(k) for k in np.argwhere(bad)[0])
                given = frame[names[j]][i]
                what = "the cell is empty" if given is None else f"{given!r} given"
                raise DataError(
                    f"{self._source}: row {start + i + 1}, column {names[j]}: {what}; a finite "
                    "number was expected; correct the cell"
                )
            yield values
