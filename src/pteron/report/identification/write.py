"""`write_identification`: the page, its numbers and the model file."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from pteron.atomic import write_text
from pteron.identification import Identification
from pteron.report.identification.folder import prepared_folder
from pteron.report.identification.model_file import model_path, model_text
from pteron.report.identification.numbers import numbers

__all__ = ["Written", "write_identification"]


@dataclass(frozen=True)
class Written:
    """The files of an identification; `model` is None where there are no real bodies."""

    page: Path
    numbers: Path
    model: Path | None

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files."""
        return tuple(path for path in (self.page, self.numbers, self.model) if path is not None)


def write_identification(
    result: Identification, folder: str | Path, *, sources: Iterable[str | Path] = ()
) -> Written:
    """Write an identification: a page, `identification.json`, and the machine's model file.

    The page, `identification.html`, needs no other file or network. Each file is written whole or
    not at all.

    Parameters
    ----------
    result : Identification
        What was found.
    folder : str or path
        Where to write; made if it is missing.
    sources : iterable of str or path
        Files that were read, which the model file must not replace.

    Returns
    -------
    Written

    Raises
    ------
    OutputError
        If the folder cannot be written, or a file that was read would be replaced.
    """
    # Matplotlib and Jinja are behind it.
    from pteron.report.identification.page import page

    path = model_path(folder, result.robot.name, sources)
    with prepared_folder(folder) as target:
        model = model_text(result)
        data = json.dumps(numbers(result), indent=1, allow_nan=False) + "\n"
        html = page(result, None if model is None else path.name)
        if model is not None:
            write_text(path, model)
        return Written(
            numbers=write_text(target / "identification.json", data),
            page=write_text(target / "identification.html", html),
            model=None if model is None else path,
        )
