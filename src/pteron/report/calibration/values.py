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


def value_rows(result: Calibration) -> tuple[CalibrationRow, ...]:
    """Return the values of a calibration, the greatest changes first."""
    rows = []
    for value in result.values:
        factor, unit = _UNITS[value.unit]
        half = factor * 0.5 * (value.interval[1] - value.interval[0])
        change = value.found - value.drawn
        drawn, estimated, changed = (
            value_with_uncertainty(factor * number, half)[0]
            for number in (value.drawn, value.found, change)
        )
        size, error = abs(change) / _ORDINARY[value.unit], value_with_uncertainty(0.0, half)[1]
        rows.append(
            CalibrationRow(value.name, drawn, estimated, changed, error, unit, value.origin, size)
        )
    return tuple(sorted(rows, key=lambda row: -row.size))


def next_steps(
    result: Calibration, *, written: bool = True, printer: bool = False
) -> tuple[str, ...]:
    """Return the next steps: the verdict's advice, then commands that use the files."""
    if not written:
        return (
            *result.verdict.next_steps,
            "Mend the cause, measure again and calibrate anew.",
        )
    steps = ["Give robot.toml, beside this page, to every command in place of the drawing."]
    if printer:
        steps.append(
            "pteron export robot.toml --klipper lines writes new lines for printer.cfg; --marlin "
            "and --reprap write M665 and M666."
        )
    steps += [
        "pteron view robot.toml --compare DRAWING --enlarge 50 shows what changed.",
        "Measure once more at other places, and let that judge: --held-out LOG.",
    ]
    return (*steps, *result.verdict.next_steps)


def notes(result: Calibration) -> tuple[str, ...]:
    """Return notes for a user of the calibrated machine: zeros, and bodies' parameters."""
    reading_legs = [str(i) for i, leg in enumerate(result.robot.legs, start=1) if leg.reading]
    sentences = []
    if any(finding.kind == "mistake" for finding in result.findings):
        sentences.append(
            "The calibrated machine belongs to the log with its mistake undone: correct the log, "
            "or the controller that wrote it, before you compute poses from readings."
        )
    if any(value.group in ("zeros", "scales") for value in result.values):
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
