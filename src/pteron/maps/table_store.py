"""`TableStore`: a sweep's results as a folder of Parquet files, one a chunk."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pteron.atomic import make_folder, write_bytes, write_text
from pteron.errors import DataError, OutputError
from pteron.maps.plan import expect_same
from pteron.renamed import former_attribute
from pteron.tables import table_bytes

if TYPE_CHECKING:
    import polars as pl

_PLAN = "plan.json"
"""File with the plan of the sweep: the data that its results depend on."""

_ENDING = ".parquet"
"""Ending of the chunks' files."""


class TableStore:
    """Results of a sweep as tables: each chunk gives the rows of one Parquet file.

    A file's name is the chunk's number and a checksum of the plan, the number and the file. A chunk
    whose file is not as it was written counts as not finished, so that it is computed again.

    Parameters
    ----------
    folder : str or Path
        It is made if it is missing. Where it holds results of the same plan they are kept, and the
        sweep goes on with what is left.
    plan : mapping
        All that the results depend on, as JSON has them: the robot's file as text, the seed,
        Pteron's version.

    Raises
    ------
    OutputError
        If the folder holds another plan's results or anything else, or cannot be written.
    """

    def __init__(self, folder: str | Path, plan: Mapping[str, Any]) -> None:
        self.folder = make_folder(folder)
        file = self.folder / _PLAN
        plan_as_json = json.loads(json.dumps(plan))
        self._plan = json.dumps(plan_as_json, sort_keys=True)
        if file.exists():
            try:
                stored = json.loads(file.read_text(encoding="utf-8"))
            except (OSError, ValueError, RecursionError):
                raise OutputError(
                    f"{file}: is damaged; remove {self.folder}, or name another place"
                ) from None
            expect_same(self.folder, stored, plan_as_json)
        elif any(self.folder.iterdir()):
            raise OutputError(
                f"{self.folder}: holds other files; name a folder that is empty or not there yet"
            )
        else:
            write_text(file, json.dumps(plan_as_json, indent=1) + "\n")

    def finished_chunks(self) -> frozenset[int]:
        """Return the numbers of the chunks that are complete."""
        return frozenset(number for number, _ in self._complete_chunks())

    finished = former_attribute("finished", "finished_chunks")

    def write(self, number: int, rows: pl.DataFrame) -> None:
        """Write a chunk's rows, through a temporary file and a rename."""
        contents = table_bytes(rows, self.folder / f"{number}{_ENDING}")
        name = f"{number:08d}-{self._checksum(number, contents)}{_ENDING}"
        write_bytes(self.folder / name, contents)

    def scan(self) -> pl.LazyFrame:
        """Return all rows written, in the plan's order, as a lazy frame.

        Raises
        ------
        DataError
            If no chunk is finished.
        """
        import polars as pl

        files = [file for _, file in sorted(self._complete_chunks())]
        if not files:
            raise DataError(f"{self.folder}: no chunk is finished yet")
        return pl.scan_parquet(files, glob=False)

    def _complete_chunks(self) -> Iterator[tuple[int, Path]]:
        """Yield the number and the file of each complete chunk."""
        seen = set()
        for file in sorted(self.folder.glob(f"[0-9]*{_ENDING}")):
            name = file.name.partition("-")[0]
            if name not in seen and self._is_whole(file):
                seen.add(name)
                yield int(name), file

    def _is_whole(self, file: Path) -> bool:
        """Return whether a chunk's file is complete: its contents have the checksum in its name."""
        number, _, given_sum = file.stem.partition("-")
        try:
            return number.isdecimal() and given_sum == self._checksum(
                int(number), file.read_bytes()
            )
        except OSError:  # gone meanwhile, or it cannot be read
            return False

    def _checksum(self, number: int, contents: bytes) -> str:
        """Return a checksum, hexadecimal digits, of a chunk's contents, its number and the plan."""
        return hashlib.sha256(f"{self._plan} {number} ".encode() + contents).hexdigest()[:16]
