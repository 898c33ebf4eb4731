"""`write_identification`: the report's page, `identification.json` and the model file, written."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pteron.identification import Identification
from pteron.json_values import json_ready
from pteron.manipulator.saving import text_of
from pteron.report.identification.contents import short_sources, shorten_sources
from pteron.report.write import checked_folder, checked_output, comment_lines
from pteron.report.written import Written as Written, write_found

_SAFE = re.compile(r"[^\w.-]+")
"""Characters that are left out of names of files."""


def write_identification(
    identification: Identification, folder: str | Path, *, sources: Iterable[str | Path] = ()
) -> Written:
    """Write an identification: a page, `identification.json`, and the machine's model file.

    The page, `identification.html`, needs no other file or network. All files are written, or none.

    Parameters
    ----------
    identification : Identification
        The identified machine.
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
    # This import loads Matplotlib and Jinja, which are slow.
    from pteron.report.identification.page import page

    path = model_path(folder, identification.robot.name, sources)
    target = checked_folder(folder)
    model = {}
    if identification.machine is not None:
        model[path.name] = comment_lines(_header(identification)) + text_of(identification.machine)
    html = page(identification, path.name if model else None)
    return write_found(target, "identification", html, numbers(identification), model)


def model_path(folder: str | Path, name: str, sources: Iterable[str | Path] = ()) -> Path:
    """Return a path for the model file that replaces no input and no log's description."""
    stem = _SAFE.sub("_", name).strip("._") or "robot"
    path = Path(folder) / f"{stem[:100]}.toml"
    return checked_output(path, sources)


def _header(identification: Identification) -> list[str]:
    """Return the comments at the head of the model file: origin, verdict, and what is uncertain."""
    consistency = identification.consistency
    assert consistency is not None
    names = short_sources(identification)
    fitted = list(dict.fromkeys(names[p.source] for p in identification.fitted))
    held_out = list(dict.fromkeys(names[p.source] for p in identification.held_out))
    repeats = "" if set(held_out) - set(fitted) else " (their last part)"
    distance = (
        "exactly"
        if consistency.feasible
        else f"as nearly as real bodies can, {consistency.distance:.2g} standard deviations away"
    )
    plain = "near uniform rods and a uniform disc."
    return [
        f"{identification.robot.name}, identified from {', '.join(fitted)}; "
        f"judged on {', '.join(held_out)}{repeats}.",
        f"Verdict: {identification.verdict.grade}.",
        *shorten_sources(identification.verdict.reasons, names),
        f"Bodies that have the identified base parameters {distance}.",
        "What the forces do not show of them is "
        + ("as near as can be to the CAD model." if consistency.nearest_to == "CAD" else plain),
        "Friction and offsets are those of the fit, in each leg's drive.",
    ]


def numbers(identification: Identification) -> dict[str, Any]:
    """Return the numbers of an identification for JSON, null for non-finite ones."""
    ready: dict[str, Any] = json_ready(identification.as_dict())
    return ready
