"""Rows of a calibration's report: values as designed and as found, their intervals, and notes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.calibration import Calibration
from pteron.calibration.result import Origin
from pteron.report.typeset import value_with_uncertainty

_UNITS = {"m": (1e3, "mm"), "rad": (float(np.degrees(1.0)), "°"), "": (1e2, "%")}

_ORDINARY = {"m": 1e-3, "rad": 0.0035, "": 1e-3}
"""Sizes by which changes in m, rad and of scales are compared."""


@dataclass(frozen=True)
class CalibrationRow:
    """One value in mm, degrees or percent: as texts with as many digits as its interval has."""

    name: str
    drawn: str
    found: str
    change: str
    half: str
    unit: str
    origin: Origin
    size: float
    """The size of the change beside an ordinary tolerance."""


def value_rows(calibration: Calibration) -> tuple[CalibrationRow, ...]:
    """Return the values of a calibration, the greatest changes first."""
    rows = []
    for known in calibration.values:
        factor, unit = _UNITS[known.unit]
        half = factor * 0.5 * (known.interval[1] - known.interval[0])
        change = known.found - known.drawn
        drawn, estimated, changed = (
            value_with_uncertainty(factor * number, half)[0]
            for number in (known.drawn, known.found, change)
        )
        size, error = abs(change) / _ORDINARY[known.unit], value_with_uncertainty(0.0, half)[1]
        rows.append(
            CalibrationRow(known.name, drawn, estimated, changed, error, unit, known.origin, size)
        )
    return tuple(sorted(rows, key=lambda row: -row.size))


def next_steps(
    calibration: Calibration, *, written: bool = True, printer: bool = False
) -> tuple[str, ...]:
    """Return the next steps: the verdict's advice, then commands that use the files."""
    if not written:
        return (
            *calibration.verdict.next_steps,
            "Mend the cause, measure again and calibrate anew.",
        )
    steps = ["Give robot.toml, beside this page, to every command in place of the drawing."]
    if printer:
        steps.append(
            "pteron export firmware.toml --klipper lines writes lines for printer.cfg; --marlin "
            "and --reprap write M665 and M666. robot.toml has the full geometry, which firmware "
            "cannot hold."
        )
    steps += [
        "pteron view robot.toml --compare DRAWING --enlarge 50 shows what changed.",
        "Measure once more at other places, and let that judge: --held-out LOG.",
    ]
    return (*steps, *calibration.verdict.next_steps)


def notes(calibration: Calibration) -> tuple[str, ...]:
    """Return notes for a user of the calibrated machine: zeros, and bodies' parameters."""
    reading_legs = [str(i) for i, leg in enumerate(calibration.robot.legs, start=1) if leg.reading]
    sentences = []
    if any(finding.kind == "mistake" for finding in calibration.findings):
        sentences.append(
            "The calibrated machine belongs to the log with its mistake undone: correct the log, "
            "or the controller that wrote it, before you compute poses from readings."
        )
    if any(known.group in ("zeros", "scales") for known in calibration.values):
        sentences.append(
            f"Zeros and scales of joints {', '.join(reading_legs)} are in robot.toml as reading of "
            "the legs: joint coordinate = zero + scale x reading."
            if reading_legs
            else "The geometry contains the joints' zeros: joint coordinates equal readings."
        )
    sentences.append(
        "Masses, centres of mass, moments of inertia and friction are unchanged: if they were "
        "identified with the drawn geometry, identify them again with this one."
    )
    return tuple(sentences)
