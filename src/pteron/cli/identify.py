"""`pteron identify`: from logs of motions to parameters, a model of real bodies, and a verdict."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from shutil import get_terminal_size
from typing import TYPE_CHECKING, Any, Literal

from pteron.cli.arguments import MachineArgument, load_robot, split_numbers
from pteron.cli.base_parameters import SYMBOLS
from pteron.cli.progress import Times, progress_bar, spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import (
    GRADE_COLORS,
    ascii_number,
    is_terminal,
    note,
    plain,
    show,
    significant,
    table,
)
from pteron.errors import DataError

if TYPE_CHECKING:
    from rich.table import Table

    from pteron.identification import Bounds, Identification, Terms
    from pteron.identification.consistency.bounds import Box
    from pteron.manipulator import Manipulator

_NARROW = 56
"""Columns of a terminal below which tables are shortened: the page has them whole."""

_TERMS = ("coulomb", "viscous", "offset")
"""Terms of the model that `--without` may leave out."""


Estimator = Literal["weighted", "ordinary", "huber", "total", "instrumental", "likelihood"]
"""Names of estimators; like the types below a copy of the library's, which is slow to import."""

Passive = Literal["none", "shared", "each"]
"""Choices for friction in passive joints."""

Derivatives = Literal["periodic", "central", "spline"]
"""Names of differentiators."""


def identify(
    log: list[str],
    *,
    machine: MachineArgument,
    robot: str,
    out: str,
    held_out: list[str] | None = None,
    description: str | None = None,
    without: str | None = None,
    joints: Passive = "none",
    stribeck: str | None = None,
    delay: str | None = None,
    rotors: bool = False,
    payload: bool = False,
    shared: bool = False,
    estimator: Estimator = "weighted",
    derivatives: Derivatives | None = None,
    cutoff: float | None = None,
    band: float | None = None,
    period: float | None = None,
    cad: str = "robot",
    box: list[str] | None = None,
) -> CommandResult:
    """Identify inertia and friction from recorded motions, with a verdict on the result.

    With --payload, the inertia of a payload is identified from a motion recorded with and without
    it: in one log whose column payload is 0, then 1, or in two logs, without.csv and with.csv, each
    with that column, 0 or 1 throughout. It is printed as the call set_payload of exported C.

    The folder gets the report identification.html, identification.json with all numbers, and the
    identified machine with physically consistent bodies as NAME.toml. The exit code is 0 whatever
    the verdict.

    Arguments
    ---------
    LOG...: Recorded motions, .csv or .parquet: t, joints, forces.

    Options
    -------
    --robot ROBOT: The machine as drawn: a machine of the catalog or a TOML file.
    --out DIR: Folder for the results.
    --held-out LOG: Log that validates the model; repeat for several. [default: the last 30 % of
        every log]
    --description TOML: Description of all logs. [default: the one beside each, or logs.toml]

    Model
    -----
    --without TERMS: Terms to leave out of the model: coulomb,viscous,offset.
    --joints: Viscous friction in the passive joints: none, one value for all, or one each.
    --stribeck SPEED,...|auto: Friction that falls with speed, with these Stribeck speeds, m/s or
        rad/s, or identified ones.
    --delay S|auto: Delay of the forces behind the positions, s; 0 assumes none. [default:
        identified, if the forces show one]
    --rotors: Include the inertia of the motors.
    --payload: Identify a payload: logs with and without it, column payload 1 and 0.
    --shared: All legs have the same inertial parameters.

    Processing
    ----------
    --estimator: Estimator that solves the equations.
    --derivatives: Method by which positions are differentiated. [default: chosen by the data]
    --cutoff HZ: Cut-off of the filter on positions. [default: chosen by the data]
    --band HZ: Cut-off of the filter on forces and regressor. [default: chosen by the data]
    --period S: Period of the motion. [default: the description's]

    Bodies
    ------
    --cad WHICH: Choose the bodies as near as possible to those of: robot, none, or a machine's
        file.
    --box BODY=X0,X1,Y0,Y1: Box, m, that contains all mass of the body u1, l3, e, u, ...

    Examples
    --------
    pteron identify log.csv --robot quadrupteron --out identified
    pteron identify a.csv b.csv --held-out c.csv --robot my-robot.toml --out identified
    """
    named = {"robot": "robot", "none": None}
    drawn: Any = named[cad] if cad in named else load_robot(cad)
    with spinner("Opening the logs"):
        from pteron.identification import Processing, identify as identified, open_log
        from pteron.report.identification import model_path, numbers, write_identification
        from pteron.report.write import checked_folder

        falls = _speeds(stribeck)
        terms = _terms(without, joints, rotors=rotors, payload=payload, stribeck=falls)
        bounds = _bounds(box, machine)
        processing = Processing(derivatives, cutoff, band, period, delay=_delay(delay))
        fit, check = (
            [open_log(path, machine, description=description) for path in paths]
            for paths in (log, held_out or [])
        )
    read = [*log, *(held_out or ()), *(path for path in (robot, description) if path)]
    sources = [path for path in read if Path(path).is_file()]
    model_path(out, machine.name, sources)
    folder = checked_folder(out)
    with progress_bar(f"Identifying {machine.name}") as tell:
        times = Times(tell)
        model: dict[str, Any] = {"terms": terms, "shared": shared, "cad": drawn, "bounds": bounds}
        how: dict[str, Any] = {"estimator": estimator, "processing": processing}
        identification = identified(machine, fit, held_out=check, **model, **how, progress=times)
    with spinner("Drawing the report"):
        times.begin("Drawing the report")
        files = write_identification(identification, folder, sources=sources)
    if is_terminal():
        note(times.summary())
    record = {"files": [str(path) for path in files.paths], **numbers(identification)}
    return CommandResult(record, partial(_show, identification), files.paths)


def _speeds(text: str | None) -> tuple[float, ...] | Literal["auto"] | None:
    """Return the Stribeck speeds (m/s or rad/s) that a text states, `auto`, or None."""
    if text in (None, "auto"):
        return "auto" if text else None
    each = "a speed in m/s or rad/s expected, or one for each joint, such as 0.02,0.03, or auto"
    return split_numbers("--stribeck", str(text), ",", None, each)


def _delay(text: str | None) -> float | Literal["auto"] | None:
    """Return the delay (s) that a text states, `auto`, or None without text."""
    if text in (None, "auto"):
        return "auto" if text else None
    expected = "seconds expected, such as 0.003, or auto"
    return split_numbers("--delay", str(text), ",", 1, expected)[0]


def _terms(
    without: str | None,
    joints: Passive,
    *,
    rotors: bool,
    payload: bool,
    stribeck: tuple[float, ...] | Literal["auto"] | None,
) -> Terms:
    """Return the model's terms from the options; raise where `--without` has an unknown name."""
    from pteron.identification import Terms

    left_out = [] if without is None else [name.strip() for name in without.split(",")]
    for name in left_out:
        if name not in _TERMS:
            raise DataError(f"--without: {name!r} is not one of {', '.join(_TERMS)}")
    friction = {name: name not in left_out for name in _TERMS}
    return Terms(**friction, passive=joints, payload=payload, rotors=rotors, stribeck=stribeck)


def _bounds(boxes: list[str] | None, machine: Manipulator) -> Bounds | None:
    """Return the boxes as bounds, refused before the work if they do not fit the machine."""
    if not boxes:
        return None
    from pteron.identification import Bounds

    bounds = Bounds(boxes=dict(_box(text) for text in boxes))
    bounds.limits(machine)
    return bounds


def _box(text: str) -> tuple[str, Box]:
    """Return a body and the bounds (m) of its centre of mass, from a text such as `u1=0,1,0,1`."""
    body, _, numbers = text.partition("=")
    try:
        x0, x1, y0, y1 = (float(number) for number in numbers.split(","))
    except ValueError:
        raise DataError(
            f"--box: {text!r} given, a body and four numbers in m expected, such as "
            "u1=-0.02,0.17,-0.03,0.03"
        ) from None
    return body.strip(), ((x0, x1), (y0, y1))


def _show(fit: Identification) -> None:
    """Print the verdict, the errors, the values, the findings in the logs, and the files."""
    verdict = fit.verdict
    worst = max(float(prediction.nrms.max()) for prediction in fit.held_out)
    color = GRADE_COLORS[verdict.grade]
    show(
        f"[bold {color}]{plain(fit.robot.name)}: {verdict.grade}[/bold {color}]; error of the "
        f"forces predicted in held-out data: up to {worst:.3g} % (NRMS)",
        _errors(fit),
        *map(plain, verdict.reasons),
        _values(fit),
        f"{SYMBOLS} Fc is dry and Fv viscous friction of a drive.",
        *map(plain, _bodies(fit)),
        *_payload(fit),
        *(f"Next: {plain(step)}" for step in verdict.next_steps),
        *(f"[yellow]Note:[/yellow] {plain(finding.message)}" for finding in fit.findings),
    )


def _errors(fit: Identification) -> Table:
    """Return a table of each actuator's NRMS of prediction (%), its noise, and no friction."""
    columns = ("error (%)", "noise alone (%)", "without friction terms (%)")
    headings = columns[: 2 if _narrow() else 3]
    rows = []
    for prediction in fit.held_out:
        where = f" in {prediction.source}" if len(fit.held_out) > 1 else ""
        errors = prediction.nrms, prediction.floor, prediction.nrms_without_friction
        for i, row in enumerate(zip(*errors[: len(headings)], strict=True), start=1):
            cells = (significant(v) if v >= 0.01 else "< 0.01" for v in row)
            rows.append((plain(f"{i}{where}"), *cells))
    caption = "RMS error of the predicted forces over their standard deviation (NRMS)."
    return table("actuator", *headings, rows=rows, numbers=headings, caption=caption)


def _values(fit: Identification) -> Table:
    """Return a table of base parameters with 95 % half-widths (absolute, and relative in %)."""
    from pteron.report.identification import parameter_rows, value_with_uncertainty

    short = fit.has_understated_errors
    headings = ("value", "+- (95 %, too short)" if short else "+- (95 %)", "+- in %")
    numbers = headings[: 2 if _narrow() else 3]
    columns = ["parameter", *numbers, *(() if _narrow() else ("unit",)), ""]
    caption = "Base parameters are sums, named by their first term; the page has them in full."
    negative = [row.name for row in parameter_rows(fit) if row.unit == "kg" and row.value < 0.0]
    if negative:
        caption += f" A sum that subtracts masses may be negative, such as {negative[0]}."
    if short:
        caption += " Too short: the intervals do not allow for the faults named above."
    if fit.essential.dropped:
        caption += " Weak: not significantly different from 0."
    value_table = table(*columns, numbers=numbers, caption=caption)
    marks = {"essential": "", "dropped": "[yellow]weak[/]", "unseen": "[yellow]unseen[/]"}
    for row in parameter_rows(fit):
        estimate, half = map(ascii_number, value_with_uncertainty(row.value, row.half))
        relative = "> 999" if row.relative >= 9.995 else significant(100.0 * row.relative, 2)
        further_cells = () if _narrow() else (relative, row.unit)
        value_table.add_row(plain(row.name), estimate, half, *further_cells, marks[row.status])
    return value_table


def _payload(fit: Identification) -> list[str]:
    """Return lines with the payload as arguments of a controller and of other commands."""
    from pteron.identification.payload import payload_in

    payload = payload_in(fit)
    if payload is None:
        return []
    if not (payload.real and payload.is_significant):
        return [
            "No real body has this payload, or it does not act on the forces: record longer, or "
            "faster."
        ]
    return [plain(f"The payload: {payload.call(fit.robot)}")]


def _narrow() -> bool:
    """Return whether the terminal has fewer columns than the full tables need."""
    return get_terminal_size().columns < _NARROW


def _bodies(fit: Identification) -> tuple[str, ...]:
    """Return sentences: whether real bodies have these parameters, the CAD model, and notes."""
    consistency = fit.consistency
    if consistency is None:
        return fit.notes
    at_border = ", ".join(consistency.at_border)
    border = f"; at the limit of consistency: {at_border}" if at_border else ""
    lines = [f"Physically consistent: real bodies can have exactly these base parameters{border}."]
    if not consistency.feasible:
        away = f"the nearest are {consistency.distance:.2g} standard deviations away{border}."
        lines = [f"Not physically consistent: no real bodies have these base parameters; {away}"]
    if not consistency.cad_feasible:
        violations = "; ".join(consistency.cad_violations)
        lines.append(f"The CAD model itself is physically inconsistent: {violations}.")
    return (*lines, *fit.notes)
