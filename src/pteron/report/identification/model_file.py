"""The file of the machine with its identified bodies."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable
from pathlib import Path

from pteron.errors import OutputError
from pteron.identification import Identification
from pteron.manipulator import save
from pteron.report.identification.names import short_sources, shortened

__all__ = ["model_path", "model_text"]

_SAFE = re.compile(r"[^\w.-]+")


def model_path(folder: str | Path, name: str, sources: Iterable[str | Path] = ()) -> Path:
    """Return where the model file of a machine goes.

    Parameters
    ----------
    folder : str or path
        The folder of the results.
    name : str
        The machine's name.
    sources : iterable of str or path
        Files that were read, which it must not replace.

    Raises
    ------
    OutputError
        If it would replace one of those, or be taken for the description of a log.
    """
    stem = _SAFE.sub("_", name).strip("._") or "robot"
    path = Path(folder) / f"{stem[:100]}.toml"
    for source in map(Path, sources):
        if source.resolve() == path.resolve():
            raise OutputError(f"{path}: would replace a file that is read; give another folder")
        if source.with_suffix(".toml").resolve() == path.resolve():
            raise OutputError(
                f"{path}: would be taken for the description of {source.name}; give another folder"
            )
    return path


def model_text(result: Identification) -> str | None:
    """Return the model file of an identification; None where there are no real bodies."""
    if result.consistency is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        plain = save(result.consistency.robot, Path(folder) / "robot.toml").read_text("utf-8")
    return "".join(f"# {_line(text)}\n" for text in _header(result)) + "#\n" + plain


def _header(result: Identification) -> list[str]:
    consistency = result.consistency
    assert consistency is not None
    predictions = (*result.fitted, *result.held_out)
    names = short_sources(prediction.source for prediction in predictions)
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
        *(shortened(reason, names) for reason in result.verdict.reasons),
        f"Bodies that have the identified base parameters {distance}.",
        "What the forces do not show of them is "
        + ("as near as can be to the CAD model." if consistency.nearest_to == "CAD" else plain),
        "Friction and offsets are no part of a machine's file: identification.json has them.",
    ]


def _line(text: str) -> str:
    """Return text as a comment may hold it: TOML forbids control characters there."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
