"""`pteron calibrate`: from measurements to a machine's geometry, and the poses to measure."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pteron.cli.arguments import MachineArgument
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import GRADE_COLORS, ascii_number, plain, show, table
from pteron.errors import DataError

if TYPE_CHECKING:
    from rich.table import Table

    from pteron.calibration import Calibration, Plan, Setup
    from pteron.manipulator import Manipulator
    from pteron.report.calibration import CalibrationRow, FirmwareFit

_MOST = 12
"""Values that the terminal shows, those that changed most; the page has them all."""

_WEAK = 2
"""Weakly determined combinations that are shown; the page has all of them."""

Measure = Literal["positions", "heights", "poses", "distances"]
"""Quantities that may be measured at planned poses."""


def calibrate(
    log: list[str] | None = None,
    *,
    machine: MachineArgument,
    robot: str,
    out: str,
    held_out: list[str] | None = None,
    free: list[str] | None = None,
    prior: str | None = None,
    plan: int | None = None,
    measure: Measure = "positions",
    plane: str | None = None,
    anyway: bool = False,
) -> CommandResult:
    """Find a machine's true geometry from measurements, and what they leave undetermined.

    The folder gets the report calibration.html, calibration.json with all numbers, and the
    calibrated machine, robot.toml, unless the result is not trustworthy. The exit code is 0
    whatever the verdict.

    With --plan, poses that determine the geometry best are written as a table of joints and poses.

    Arguments
    ---------
    LOG...: Measurements, .csv or .parquet, or a controller's log.

    Options
    -------
    --robot ROBOT: The machine as drawn: a machine of the catalog or a TOML file.
    --out DIR|FILE: Folder for the results; with --plan the file of the table.
    --held-out LOG: Log that validates the result; repeat for several. [default: every fifth row, if
        there are enough]
    --free GROUP: Fit these values alone; repeat for several: zeros, scales, lengths, points,
        directions, tool, radius, angles, or a value by its name in calibration.json.
    --prior TOML: File of tolerances: standard deviations by group or value, m and rad.
    --plan N: Choose this number of poses to measure, instead of reading a LOG.
    --measure: Quantity to be measured at the planned poses.
    --plane z=HEIGHT: Height of the plane that a planned probe touches, m. [default: z=0 if the tool
        reaches down to it, as on a printer's bed; else the bottom of the proved poses]
    --anyway: Write robot.toml even if it is not trustworthy.

    Examples
    --------
    pteron calibrate log.csv --robot robot.toml --out calibrated
    pteron calibrate printer.cfg --robot printer.toml --free radius --free zeros --out calibrated
    pteron calibrate a.csv b.csv --held-out c.csv --robot delta --prior shop.toml --out calibrated
    pteron calibrate --plan 40 --measure heights --robot printer.toml --out plan.csv
    pteron calibrate --plan 40 --measure heights --plane z=0.002 --robot printer.toml --out p.csv
    """
    if (plan is None) == (not log):
        raise DataError("give logs of measurements, or --plan with the number of poses to measure")
    if plane is not None and (plan is None or measure != "heights"):
        raise DataError("--plane goes with --plan and --measure heights")
    if plan is not None:
        tolerances = None if prior is None else _prior(prior)
        return _plan(machine, plan, measure, out, free, tolerances, plane)
    with spinner("Reading the measurements"):
        from pteron.calibration import calibrate as calibrated, read_measurements
        from pteron.report.calibration import firmware_fit, numbers, write_calibration
        from pteron.report.write import checked_folder, checked_output

        read = [*(log or ()), *(held_out or ())]
        given_files = (*read, robot, *([prior] if prior else ()))
        sources = [path for path in given_files if Path(path).is_file()]
        checked_output(checked_folder(out) / "robot.toml", sources)
        tolerances = None if prior is None else _prior(prior)
        measurements = read_measurements(machine, *(log or ()))
        check = read_measurements(machine, *held_out) if held_out else None
    with spinner(f"Calibrating {machine.name} from {len(measurements)} rows"):
        calibration = calibrated(machine, measurements, free=free, prior=tolerances, held_out=check)
    with spinner("Drawing the report"):
        firmware = firmware_fit(calibration)
        files = write_calibration(
            calibration, out, sources=sources, anyway=anyway, firmware=firmware
        )
    record = {"files": [str(path) for path in files.paths], **numbers(calibration, firmware)}
    return CommandResult(record, partial(_show, calibration, firmware, files.left_out), files.paths)


def _prior(path: str) -> dict[str, float]:
    """Return standard deviations (m or rad) by the name of the geometry's value, from a file."""
    from pteron.toml import read_toml

    tolerances: dict[str, float] = {}
    for name, tolerance in read_toml(path, DataError, f"{path}: there is no such file").items():
        if isinstance(tolerance, bool) or not isinstance(tolerance, int | float):
            raise DataError(
                f"{path}: {name} = {tolerance!r}: a standard deviation in m or rad expected; a "
                "value's "
                'name stands in quotes, as in "zeros[2]" = 0.0001'
            )
        tolerances[name] = float(tolerance)
    return tolerances


def _plan(
    machine: Manipulator,
    count: int,
    measure: Measure,
    out: str,
    free: list[str] | None,
    prior: dict[str, float] | None,
    plane: str | None,
) -> CommandResult:
    """Choose the poses to measure, and write the table that the machine runs."""
    from pteron.tables import check_output, write_table

    check_output(out)
    setup = None if plane is None else _level(plane)
    with spinner(f"Choosing {count} poses"):
        import polars as pl

        from pteron.calibration import plan

        poses = plan(machine, count, measure, setup=setup, free=free, prior=prior)
        path = write_table(pl.DataFrame(poses.columns()), out)
    box = {name: list(side) for name, side in zip(("low", "high"), poses.region.box, strict=True)}
    expected = {"before": poses.before, "after": poses.after}
    what, unit = ("tool's position", "mm") if machine.platform.lengths else ("angles", "mrad")
    few = (
        f"From {poses.checked} poses on, some are held out to check the calibration; with fewer, "
        "give a second log (--held-out)."
    )
    lines = [
        f"{plain(machine.name)}: {count} poses at which to measure {measure}{_plane_text(poses)}, "
        f"in a {_region(poses)}; every pose in it is proved to be in reach",
        f"Expected error of the {what} (one standard deviation): up to {1e3 * poses.before:.3g} "
        f"{unit} as drawn, from the tolerances; {1e3 * poses.after:.3g} {unit} once calibrated.",
        *([few] if count < poses.checked else []),
    ]
    return CommandResult({"file": str(path), "expected": expected, "region": box}, lines, [path])


def _level(text: str) -> Setup:
    """Return a setup with the plane of --plane."""
    from pteron.calibration import ReferencePlane, Setup
    from pteron.cli.pose_ranges import pose_ranges

    constants, ranges = pose_ranges(text, "--plane")
    if set(constants) != {"z"} or ranges:
        raise DataError(f"--plane: {text!r} given; z=HEIGHT expected, in m, such as z=0")
    return Setup(planes={"": ReferencePlane(offset=constants["z"])})


def _plane_text(planned: Plan) -> str:
    """Return text that names the plane over which heights are measured."""
    plane = planned.plane
    if plane is None:
        return ""
    known = "" if plane.known else ", which is fitted with the geometry"
    return f" over the plane z = {1e3 * plane.offset + 0.0:.4g} mm{known}"


def _region(planned: Plan) -> str:
    """Return the shape and the size of a plan's region, mm and mrad."""
    from pteron.workspace import Cylinder

    region, machine = planned.region, planned.robot
    sides = [
        f"{name} {1e3 * a + 0.0:.0f} to {1e3 * b + 0.0:.0f} {'mm' if unit == 'm' else 'mrad'}"
        for name, unit, a, b in zip(
            machine.coordinates, machine.units, *region.box.round(9).tolist(), strict=True
        )
    ]
    if isinstance(region, Cylinder):
        x, y = (f"{1e3 * coordinate + 0.0:.4g}" for coordinate in region.center[:2])
        disc = f"disc of radius {1e3 * region.radius:.0f} mm about x {x} mm, y {y} mm"
        return ", ".join([disc, *sides[2:]])
    return f"box, {', '.join(sides)}"


def _show(calibration: Calibration, firmware: FirmwareFit | None, left_out: str) -> None:
    """Print a verdict, what changed, what shows and what does not."""
    from pteron.report.calibration.values import notes

    verdict, shown = calibration.verdict, calibration.observability
    color = GRADE_COLORS[verdict.grade]
    lines: list[str | Table] = [plain(verdict.reasons[0])]
    if firmware:
        lines += [_table(firmware.rows), plain(firmware.sentence)]
    show(
        f"[bold {color}]{plain(calibration.drawn.name)}: {verdict.grade}[/bold {color}], "
        f"{shown.determined_count} of {shown.columns} combinations of errors determined",
        *lines,
        *([] if firmware else [_values(calibration)]),
        *_errors(calibration),
        *map(plain, verdict.reasons[1:]),
        *(_folded(calibration) if firmware else _undetermined(calibration)),
        *map(plain, notes(calibration)),
        *(f"Next: {plain(step)}" for step in verdict.next_steps),
        *([f"[red]{plain(left_out)}[/red]"] if left_out else []),
    )


def _folded(calibration: Calibration) -> list[str]:
    """Return a line on the full geometry, whose values are on the page."""
    return [
        f"The {len(calibration.values)} values of the full geometry, and what the measurements "
        "leave undetermined, are on the page; robot.toml has them, firmware.toml the values above."
    ]


def _undetermined(calibration: Calibration) -> list[str]:
    """Return lines on what the measurements determine weakly or not at all."""
    shown = calibration.observability
    hidden = len(shown.weak) - _WEAK
    return [
        *(f"Not determined, kept as drawn: {plain(line)}" for line in shown.unseen),
        *(f"[yellow]Weakly determined:[/yellow] {plain(line)}" for line in shown.weak[:_WEAK]),
        *([f"{hidden} more weakly determined combinations are on the page."] if hidden > 0 else []),
    ]


def _values(calibration: Calibration) -> Table:
    """Return the table of the values that changed most, with a caption that counts the others."""
    from pteron.report.calibration import value_rows

    rows = value_rows(calibration)
    omitted = len(rows) - _MOST
    return _table(
        rows[:_MOST],
        f"{omitted} more, which changed less, are on the page. Determined by: measurements (data), "
        "tolerances of the drawing, or both."
        if omitted > 0
        else None,
    )


def _table(rows: Sequence[CalibrationRow], caption: str | None = None) -> Table:
    """Return a table of fitted values: drawn, change, 95 % half-width, unit and origin."""
    numbers = ("drawn", "change", "+- (95 %)")
    return table(
        *("value", *numbers, "unit", "determined by"),
        rows=[
            (
                plain(row.name),
                *(ascii_number(text) for text in (row.drawn, row.change, row.half)),
                "deg" if row.unit == "°" else row.unit,
                row.origin,
            )
            for row in rows
        ],
        numbers=numbers,
        names=("value",),
        caption=caption,
    )


def _errors(calibration: Calibration) -> list[Table]:
    """Return a table of errors (mm, mrad) of rows outside the fit, before and after; else none."""
    held_out = calibration.held_out
    if held_out is None:
        return []
    from pteron.calibration.measurements import error_unit
    from pteron.report.typeset import significant

    numbers = ("before", "after", "expected")
    rows = []
    for kind in held_out.after:
        errors = (held_out.before[kind], held_out.after[kind], held_out.expected[kind])
        texts = (ascii_number(significant(1e3 * error)) for error in errors)
        rows.append((kind, *texts, error_unit(kind)))
    caption = f"At {held_out.rows} rows held out of the fit; expected from noise and intervals."
    return [table("error", *numbers, "unit", rows=rows, numbers=numbers, caption=caption)]
