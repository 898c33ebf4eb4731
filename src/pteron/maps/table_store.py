"""A folder of Parquet files, one for each chunk of a sweep, as readers of data sets expect it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pteron.atomic import make_folder, write_text
from pteron.errors import DataError, OutputError
from pteron.maps.plan import expect_same
from pteron.tables import write_table

if TYPE_CHECKING:
    import polars as pl

_PLAN = "plan.json"
_ENDING = ".parquet"


class TableStore:
    """Results of a sweep as tables: each chunk gives the rows of one Parquet file.

    Parameters
    ----------
    folder : str or Path
        It is made if it is missing. Where it holds results of the same plan they are kept, and the
        sweep goes on with what is left.
    plan : mapping
        What makes the results what they are, as JSON has them: the robot's file as text, the seed,
        Pteron's version.

    Raises
    ------
    OutputError
        If the folder holds another plan's results or anything else, or cannot be written.
    """

    def __init__(self, folder: str | Path, plan: Mapping[str, Any]) -> None:
        self.folder = make_folder(folder)
        file = self.folder / _PLAN
        wanted = json.loads(json.dumps(plan))
        if file.exists():
            try:
                found = json.loads(file.read_text(encoding="utf-8"))
            except (OSError, ValueError):
                raise OutputError(f"{file}: cannot be read; remove {self.folder}") from None
            expect_same(self.folder, found, wanted)
        elif any(self.folder.iterdir()):
            raise OutputError(
                f"{self.folder}: holds other files; name a folder that is empty or not there yet"
            )
        else:
            write_text(file, json.dumps(wanted, indent=1) + "\n")

    def finished(self) -> frozenset[int]:
        """Return the numbers of the chunks that are written."""
        return frozenset(int(path.stem) for path in self.folder.glob(f"[0-9]*{_ENDING}"))

    def write(self, number: int, result: pl.DataFrame) -> None:
        """Write a chunk's rows, through a temporary file and a rename."""
        write_table(result, self.folder / f"{number:08d}{_ENDING}")

    def scan(self) -> pl.LazyFrame:
        """Return all rows that are written, in the plan's order, read only as far as asked for.

        Raises
        ------
        DataError
            If no chunk is finished.
        """
        import polars as pl

        files = sorted(self.folder.glob(f"[0-9]*{_ENDING}"))
        if not files:
            raise DataError(f"{self.folder}: no chunk is finished yet")
        return pl.scan_parquet(files, glob=False)
