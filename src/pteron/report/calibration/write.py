"""`write_calibration`: the report's page, `calibration.json` and the machine's file, written."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from pteron.calibration import Calibration
from pteron.json_values import json_ready
from pteron.manipulator.saving import text_of
from pteron.report.calibration.firmware import FirmwareFit
from pteron.report.calibration.values import notes
from pteron.report.write import checked_folder, checked_output, comment_lines
from pteron.report.written import Written as Written, write_found


def write_calibration(
    calibration: Calibration,
    folder: str | Path,
    *,
    sources: Iterable[str | Path] = (),
    anyway: bool = False,
    firmware: FirmwareFit | None = None,
) -> Written:
    """Write a calibration: a page, `calibration.json`, and the calibrated machine, `robot.toml`.

    The page, `calibration.html`, needs no other file or network. All files are written, or none;
    but the machine's is not where the verdict is "not trustworthy".

    Parameters
    ----------
    calibration : Calibration
        The calibration.
    folder : str or path
        Where to write; made if it is missing.
    sources : iterable of str or path
        Files that were read, which the machine's file must not replace.
    anyway : bool
        Whether the machine's file is written even where it is not trustworthy.
    firmware : FirmwareFit, optional
        A printer's own values, `firmware_fit`, which the page then shows first; a machine with
        these alone is written as `firmware.toml`.

    Returns
    -------
    Written

    Raises
    ------
    OutputError
        If the folder cannot be written, or a file that was read would be replaced.
    """
    # This import loads Matplotlib and Jinja, which are slow.
    from pteron.report.calibration.page import page

    target = checked_folder(folder)
    for file in ("calibration.html", "calibration.json", "robot.toml", "firmware.toml"):
        checked_output(target / file, sources)
    models = {}
    if anyway or calibration.verdict.grade != "not trustworthy":
        models["robot.toml"] = comment_lines(_header(calibration)) + text_of(calibration.robot)
        if firmware is not None:
            models["firmware.toml"] = comment_lines(
                [
                    f"{calibration.drawn.name} with the values that a printer's firmware fits, and "
                    "all else as drawn.",
                    firmware.sentence,
                ]
            ) + text_of(firmware.result.robot)
    html = page(calibration, written=bool(models), firmware=firmware)
    files = write_found(target, "calibration", html, numbers(calibration, firmware), models)
    if models:
        return files
    stale = (target / "robot.toml").exists()
    return replace(
        files,
        left_out="robot.toml is not written, as the calibration is not trustworthy"
        + ("; the one in the folder is of an earlier run" if stale else "")
        + " (--anyway writes it).",
    )


def numbers(calibration: Calibration, firmware: FirmwareFit | None = None) -> dict[str, Any]:
    """Return the numbers of a calibration for JSON, null for non-finite ones."""
    contents = calibration.as_dict() | {"notes": list(notes(calibration))}
    if firmware is not None:
        contents["firmware"] = firmware.as_dict()
    ready: dict[str, Any] = json_ready(contents)
    return ready


def _header(calibration: Calibration) -> list[str]:
    """Return the comments at the head of the machine's file: origin, verdict, reasons, notes."""
    rows = len(calibration.measurements)
    return [
        f"{calibration.drawn.name}, calibrated from {rows} rows of measurements.",
        f"Verdict: {calibration.verdict.grade}.",
        *calibration.verdict.reasons,
        *notes(calibration),
    ]
