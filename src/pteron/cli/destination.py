"""The destination of a command's result: `--out` (a folder or one file), and what is printed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pteron.cli.result import CommandResult

if TYPE_CHECKING:
    import polars as pl

_TABLES = (".csv", ".parquet")
"""Endings of tables."""


@dataclass(frozen=True)
class Destination:
    """The value of `--out`: a folder for all files, one .csv or .parquet file, or nothing.

    Attributes
    ----------
    out : str or None
        As it was given.
    name : str
        Name of the files NAME.csv and NAME.json in a folder.
    """

    out: str | None
    name: str

    @property
    def is_table(self) -> bool:
        """Whether it is the file of a table."""
        return self.out is not None and Path(self.out).suffix.lower() in _TABLES

    def check(self) -> None:
        """Raise, before the work begins, if the files cannot be written."""
        if self.is_table:
            from pteron.tables import check_output

            check_output(str(self.out))
        elif self.out is not None:
            from pteron.report.write import checked_folder

            checked_folder(self.out)

    def deliver(
        self,
        table: pl.DataFrame,
        record: dict[str, Any],
        further_files: Callable[[], dict[str, str]],
        person: Callable[[], None],
        code: int = 0,
    ) -> CommandResult:
        """Write the files if requested, and return the command's result.

        `record` are the figures, `more` makes the other files of a folder, by name, and `person`
        prints what a person reads.
        """
        files: list[Path] = []
        if self.is_table:
            from pteron.tables import write_table

            files = [write_table(table, str(self.out))]
        elif self.out is not None:
            from pteron.atomic import write_texts
            from pteron.json_values import json_text

            printed = {"csv": table.write_csv(), "json": json_text(record)}
            texts = {f"{self.name}.{format_}": text for format_, text in printed.items()}
            files = write_texts(self.out, texts | further_files())
        written = {"files": [str(file) for file in files]} if files else {}
        return CommandResult(record | written, person, files, code)
