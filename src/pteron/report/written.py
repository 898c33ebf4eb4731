"""The files of what logs or measurements tell: a page, numbers, and the machine's file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pteron.atomic import write_texts
from pteron.json_values import json_text


@dataclass(frozen=True)
class Written:
    """The paths of the files written; `model`, the machine's file, may be None."""

    page: Path
    numbers: Path
    model: Path | None
    left_out: str = ""
    """Why a file was not written; "" where all were."""
    others: tuple[Path, ...] = ()
    """Further machines' files."""

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files."""
        first = (self.page, self.numbers, self.model)
        return (*(path for path in first if path is not None), *self.others)


def write_found(
    folder: Path, stem: str, page: str, numbers: dict[str, Any], model: dict[str, str]
) -> Written:
    """Write a page, numbers and perhaps a machine's file: all of them, or none."""
    paths = write_texts(folder, {f"{stem}.html": page, f"{stem}.json": json_text(numbers), **model})
    return Written(paths[0], paths[1], paths[2] if model else None, others=tuple(paths[3:]))
