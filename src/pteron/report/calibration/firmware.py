"""The values that a printer's firmware knows, fitted alone: what its owner looks for first."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pteron.calibration import Calibration, calibrate
from pteron.errors import PteronError
from pteron.export.printers.linear_delta import LinearDelta
from pteron.report.calibration.values import CalibrationRow, value_rows
from pteron.report.typeset import value_with_uncertainty

_FREE = ("radius", "legs[1].angle", "legs[2].angle", "zeros")
"""Values that Klipper, Marlin and RepRapFirmware fit: the third tower's angle is the reference."""

_QUANTILE = 1.96
"""Standard deviations of a 95 % interval."""


@dataclass(frozen=True)
class FirmwareFit:
    """A calibration of the firmware's six values, in its own units, and what shows of its rods."""

    rows: tuple[CalibrationRow, ...]
    sentence: str
    """The error that it leaves, and the one before."""
    result: Calibration

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data: values in mm and degrees, as texts with significant digits."""
        records = [
            {"name": row.name, "drawn": row.drawn, "found": row.found, "unit": row.unit}
            for row in self.rows
        ]
        return {"values": records, "sentence": self.sentence, "grade": self.result.verdict.grade}


def firmware_fit(calibration: Calibration) -> FirmwareFit | None:
    """Return the firmware's values fitted to a calibration's data; None if that is impossible."""
    try:
        drawn = LinearDelta.from_robot(calibration.drawn)
        loose = dict.fromkeys(("radius", "angles", "zeros"), float("inf"))
        fitted = calibrate(calibration.drawn, calibration.measurements, free=_FREE, prior=loose)
        estimated = LinearDelta.from_robot(fitted.robot)
    except PteronError:  # another machine, or too few rows
        return None
    names = [unknown.name for block in fitted.blocks for unknown in block.unknowns]
    deviations = {name: float(np.sqrt(fitted.fit.covariance[k, k])) for k, name in enumerate(names)}
    width = 1e3 * deviations["radius"]
    rows = [_row("delta radius", 1e3 * drawn.radius, 1e3 * estimated.radius, "mm", width)]
    for i in (1, 2):
        key = f"legs[{i}].angle"
        old_angle, new_angle = drawn.angles[i - 1], estimated.angles[i - 1]
        width = float(np.degrees(deviations[key]))
        rows.append(_row(f"angle of tower {i}", old_angle, new_angle, "°", width))
    ends = [(k, drawn.ends, estimated.ends) for k in range(3) if drawn.ends and estimated.ends]
    for k, old, new in ends:
        # A radius that is larger lowers the rods' upper ends too.
        slope = np.zeros(len(names))
        slope[names.index(f"zeros[{k + 1}]")] = 1.0
        below = np.sqrt(drawn.arms[k] ** 2 - drawn.radius**2)
        slope[names.index("radius")] = drawn.radius / below
        width = 1e3 * float(np.sqrt(slope @ fitted.fit.covariance @ slope))
        rows.append(_row(f"end stop of tower {k + 1}", 1e3 * old[k], 1e3 * new[k], "mm", width))
    return FirmwareFit((*rows, *_rods(calibration)), _sentence(fitted), fitted)


def _rods(calibration: Calibration) -> list[CalibrationRow]:
    """Return a row for the rods of each tower: as fitted, or as drawn if the data do not show them.

    They are those of the fit of the full geometry: with the six values alone they would be held.
    """
    kinds = " and ".join(dict.fromkeys(f"{kind}s" for kind in calibration.measurements.kinds))
    rows = []
    lengths = {value.name for value in calibration.values if value.group == "lengths"}
    for row in value_rows(calibration):
        if row.name in lengths:
            tower = row.name.partition("[")[2].partition("]")[0]
            row = replace(row, name=f"rods of tower {tower}")
            if row.origin != "data":
                unseen = f"not shown by {kinds}"
                row = replace(row, found=row.drawn, change="-", half=unseen, origin="tolerance")
            rows.append(row)
    return sorted(rows, key=lambda row: row.name)


def _row(name: str, drawn: float, estimated: float, unit: str, deviation: float) -> CalibrationRow:
    """Return the row of a firmware value: drawn, estimated, their change, and its 95 % interval."""
    half = _QUANTILE * deviation
    change = estimated - drawn
    if unit == "°":
        change = (change + 180.0) % 360.0 - 180.0
    drawn_text, estimated_text, changed = (
        value_with_uncertainty(number, half)[0] for number in (drawn, estimated, change)
    )
    return CalibrationRow(
        name,
        drawn_text,
        estimated_text,
        changed,
        value_with_uncertainty(0.0, half)[1],
        unit,
        "data",
        abs(change),
    )


def _sentence(fitted: Calibration) -> str:
    """Return a sentence on the errors at held-out rows, with and without the firmware's fit."""
    held_out = fitted.held_out
    if held_out is None:
        return "With these six values alone no rows were left for a check."
    parts = [
        f"the {kind} error is {1e3 * after:.3g} mm ({1e3 * held_out.before[kind]:.3g} mm before)"
        for kind, after in held_out.after.items()
        if kind != "angle"
    ]
    return (
        f"With these six values alone, at {held_out.rows} rows held out of the fit, "
        f"{' and '.join(parts)}."
    )
