"""`write_identification`: the report's page, `identification.json` and the model file, written."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pteron.atomic import make_folder, write_text
from pteron.identification import Identification
from pteron.json_values import json_ready
from pteron.manipulator.saving import text_of
from pteron.report.identification.contents import short_sources, shortened
from pteron.report.write import checked_apart, checked_folder, commented

_SAFE = re.compile(r"[^\w.-]+")
"""Characters that names of files do without."""


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
    target = checked_folder(folder)
    model = _model_text(result)
    data = json.dumps(numbers(result), indent=1, allow_nan=False) + "\n"
    html = page(result, None if model is None else path.name)
    make_folder(target)
    if model is not None:
        write_text(path, model)
    return Written(
        numbers=write_text(target / "identification.json", data),
        page=write_text(target / "identification.html", html),
        model=None if model is None else path,
    )


def model_path(folder: str | Path, name: str, sources: Iterable[str | Path] = ()) -> Path:
    """Return the path of the model file: no file that is read, and no description of a log."""
    stem = _SAFE.sub("_", name).strip("._") or "robot"
    path = Path(folder) / f"{stem[:100]}.toml"
    return checked_apart(path, sources)


def _model_text(result: Identification) -> str | None:
    """Return the model file of an identification; None where there are no real bodies."""
    if result.machine is None:
        return None
    return commented(_header(result)) + text_of(result.machine)


def _header(result: Identification) -> list[str]:
    consistency = result.consistency
    assert consistency is not None
    names = short_sources(result)
    fitted = list(dict.fromkeys(names[p.source] for p in result.fitted))
    held = list(dict.fromkeys(names[p.source] for p in result.held_out))
    repeats = "" if set(held) - set(fitted) else " (their last part)"
    distance = (
        "exactly"
        if consistency.feasible
        else f"as nearly as real bodies can, {consistency.distance:.2g} standard deviations away"
    )
    plain = "near uniform rods and a uniform disc."
    return [
        f"{result.robot.name}, identified from {', '.join(fitted)}; "
        f"judged on {', '.join(held)}{repeats}.",
        f"Verdict: {result.verdict.grade}.",
        *shortened(result.verdict.reasons, names),
        f"Bodies that have the identified base parameters {distance}.",
        "What the forces do not show of them is "
        + ("as near as can be to the CAD model." if consistency.nearest_to == "CAD" else plain),
        "Friction and offsets are those of the fit, in each leg's drive.",
    ]


def numbers(result: Identification) -> dict[str, Any]:
    """Return the numbers of an identification as JSON has them, null where one is not finite."""
    return {key: json_ready(value) for key, value in result.as_dict().items()}
