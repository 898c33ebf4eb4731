"""`pteron size`: what a cycle asks of each drive, and which motors serve."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import rich.table
from typer import Exit

from pteron.cli.arguments import Elbows, Json, Robot, load_robot, option
from pteron.cli.destination import Destination
from pteron.cli.motion_argument import CYCLE, STANDARD, cycle_of, loaded
from pteron.cli.terminal import note, plain, show, spinner, table

if TYPE_CHECKING:
    import polars as pl

    from pteron.motion import Fit, Sizing

_OVERLOADED = 1
_BEST = 3
"""Motors a joint that a person is shown."""


def size(
    robot: Robot,
    cycle: Annotated[str, CYCLE] = STANDARD,
    payload: Annotated[float, option("payload", "At the tool's centre point, kg.")] = 0.0,
    duration: Annotated[
        float | None,
        option("duration", "Of the standard cycle, s.", show_default="10 m/s^2 at the tool"),
    ] = None,
    dwell: Annotated[float, option("dwell", "Rest after each cycle, s.")] = 0.0,
    motors: Annotated[
        str | None,
        option("motors", "Choose from the motors in this CSV or TOML file.", "FILE"),
    ] = None,
    margin: Annotated[
        float, option("margin", "What a motor must be able to do, over what the cycle asks.")
    ] = 1.0,
    out: Annotated[
        str | None,
        option("out", "Write tables, numbers and pictures to a folder, or one table.", "DIR|FILE"),
    ] = None,
    elbows: Elbows = None,
    json: Json = False,
) -> None:
    """Size the motors: peak and RMS force, speed, power and energy of each drive over a cycle.

    Forces are those of the drives: the bodies with the payload, friction and the rotors, as the
    machine's file has them. Where a cycle is more than a drive's limits there, a warning says which
    leg and by how much.

    A list of motors has the columns name, rotor_inertia (kg m^2), rated_torque and peak_torque
    (N m), max_speed (rad/s). For each joint it is told which serve, the smallest first, from what
    ratio to what ratio, and which ratio is best: least RMS torque.

    A folder gets sizing.csv, sizing.json, power.svg, force-speed.svg and motors.csv. The exit code
    is 1 if the drives cannot do the cycle, or no motor of the list serves a joint.
    """
    machine = load_robot(robot, elbows)
    from pteron.motion import choose, read_motors
    from pteron.motion import size as sized

    chosen = () if motors is None else read_motors(motors)
    destination = Destination(out, "sizing")
    destination.check()
    for motor in chosen:
        for text in motor.doubts:
            note(f"Warning: {text}")
    carrying = loaded(machine, payload)
    with spinner(f"Sizing the drives of {machine.name}"):
        motion = cycle_of(machine, cycle, duration)
        found = sized(carrying, motion, dwell=dwell)
        fits = choose(found, chosen, margin=margin)
    for text in found.overloads:
        note(f"Warning: {text}")
    unserved = _unserved(found, fits)
    for text in unserved:
        note(f"Warning: {text}")
    data = _data(found, fits, cycle, payload)
    # A list of motors is what its choice is asked for.
    rows = _fits_table(found, fits) if fits and out is None else found.table()
    destination.deliver(
        rows,
        data,
        lambda: _more(found, fits),
        lambda: _show(found, fits, cycle, payload),
        as_json=json,
    )
    if found.overloads or unserved:
        raise Exit(_OVERLOADED)


def _unserved(found: Sizing, fits: tuple[Fit, ...]) -> list[str]:
    """Return for which joints no motor of the list serves, and what the best of them lacks."""
    lines = []
    for leg in range(1, found.robot.freedom + 1):
        own = [fit for fit in fits if fit.leg == leg]
        if own and not own[0].fits:
            best = own[0]
            lines.append(
                f"leg {leg}: no motor of the list serves; {best.motor.name} comes nearest, with "
                f"{best.margin:.0%} of the {best.scarcest} it needs"
            )
    return lines


def _data(found: Sizing, fits: tuple[Fit, ...], cycle: str, payload: float) -> dict[str, Any]:
    total = found.power.sum(axis=1)
    return {
        "robot": found.robot.name,
        "cycle": cycle,
        "payload": payload,
        "duration": found.duration,
        "dwell": found.dwell,
        "drives": found.table().to_dicts(),
        "all": {
            "peak_power": float(total.max(initial=0.0)),
            "peak_braking": float((-total).max(initial=0.0)),
            "energy": found.net_energy,
            "mean_power": found.net_energy / found.duration,
        },
        "overloads": list(found.overloads),
        "motors": _fits_table(found, fits).to_dicts() if fits else [],
    }


def _fits_table(found: Sizing, fits: tuple[Fit, ...]) -> pl.DataFrame:
    """Return how each motor suits each joint, a row each."""
    import polars as pl

    rows = [
        {
            "leg": fit.leg,
            "motor": fit.motor.name,
            "serves": fit.fits,
            "ratio": fit.ratio,
            "ratio_unit": f"rad/{found.robot.legs[fit.leg - 1].joint.unit}",
            "least_ratio": fit.span.least if fit.fits else None,
            "greatest_ratio": fit.span.greatest if fit.fits else None,
            "rated_margin": fit.rated_margin,
            "peak_margin": fit.peak_margin,
            "speed_margin": fit.speed_margin,
            "inertia_ratio": fit.inertia_ratio,
        }
        for fit in fits
    ]
    return pl.DataFrame(rows, infer_schema_length=None)


def _more(found: Sizing, fits: tuple[Fit, ...]) -> dict[str, str]:
    """Return what a folder has beside the table and the figures."""
    from pteron.plots import svg_file
    from pteron.report.drive_figures import force_speed, power

    texts = {
        "power.svg": svg_file(power(found)),
        "force-speed.svg": svg_file(force_speed(found)),
    }
    return texts | ({"motors.csv": _fits_table(found, fits).write_csv()} if fits else {})


def _show(found: Sizing, fits: tuple[Fit, ...], cycle: str, payload: float) -> None:
    """Print for a person: loads, power, motors, and the choice."""
    carried = f" with {payload:g} kg" if payload else ""
    rest = f", {found.dwell:g} s of it at rest" if found.dwell else ""
    total = found.power.sum(axis=1)
    show(
        f"[bold]{plain(found.robot.name)}[/bold]{carried}, cycle {plain(cycle)}: "
        f"{found.duration:.4g} s{rest}",
        _loads(found),
        _powers(found),
        *_rotors(found),
        f"All drives: {found.net_energy:.4g} J a cycle, "
        f"{found.net_energy / found.duration:.4g} W in the mean, "
        f"{total.max():.4g} W at most",
        *_choice(found, fits),
    )


def _loads(found: Sizing) -> rich.table.Table:
    names = ("peak force", "RMS force", "peak speed", "RMS speed")
    made = table("leg", *names, numbers=("leg", *names))
    columns = found.peak_forces, found.rms_forces, found.peak_speeds, found.rms_speeds
    for i, leg in enumerate(found.robot.legs):
        units = [leg.joint.force_unit] * 2 + [f"{leg.joint.unit}/s"] * 2
        cells = (f"{v[i]:.4g} {unit}" for v, unit in zip(columns, units, strict=True))
        made.add_row(str(i + 1), *cells)
    return made


def _powers(found: Sizing) -> rich.table.Table:
    names = ("peak (W)", "mean (W)", "brakes (W)", "gives (J)", "takes back (J)")
    made = table("leg", *names, numbers=("leg", *names))
    columns = (
        *(found.peak_power, found.mean_power, found.peak_braking),
        *(found.given_energy, found.braked_energy),
    )
    for i in range(found.robot.freedom):
        made.add_row(str(i + 1), *(f"{values[i]:.4g}" for values in columns))
    return made


def _rotors(found: Sizing) -> list[rich.table.Table]:
    """Return what the motors of the machine's file have to do, where it says enough."""
    if not any(drive.ratio or drive.rotor_inertia for drive in found.drives):
        return []
    names = ("load", "rotor", "load/rotor", "ratio", "best ratio", "RMS at motor")
    made = table(
        "leg", *names, numbers=("leg", *names), caption="Inertia at the joint, the load's greatest."
    )
    cells = found.table().to_dicts()
    for leg, row in zip(found.robot.legs, cells, strict=True):
        unit = "kg" if leg.joint.unit == "m" else "kg m^2"
        made.add_row(
            str(row["leg"]),
            *(
                "-" if row[key] is None else f"{row[key]:.3g}{own}"
                for key, own in (
                    ("greatest_load_inertia", f" {unit}"),
                    ("rotor_inertia", f" {unit}"),
                    ("inertia_ratio", ""),
                    ("ratio", ""),
                    ("best_ratio", f" rad/{leg.joint.unit}"),
                    ("rms_motor_torque", " N m"),
                )
            ),
        )
    return [made]


def _choice(found: Sizing, fits: tuple[Fit, ...]) -> list[rich.table.Table]:
    """Return the best motors of the list for each joint."""
    if not fits:
        return []
    names = ("ratio", "from", "to", "rated", "peak", "speed")
    made = table(
        *("leg", "motor", *names),
        numbers=("leg", *names),
        caption="Ratios that serve, the best first; then margins at it: rated, peak torque, speed.",
    )
    for i in range(found.robot.freedom):
        own = [fit for fit in fits if fit.leg == i + 1][:_BEST]
        for fit in own:
            span = fit.span if fit.fits else None
            made.add_row(
                str(fit.leg) if fit is own[0] else "",
                plain(fit.motor.name),
                f"{fit.ratio:.4g} rad/{found.robot.legs[i].joint.unit}",
                *(("none", "") if span is None else (f"{end:.4g}" for end in span)),
                *(f"{v:.2f}" for v in (fit.rated_margin, fit.peak_margin, fit.speed_margin)),
            )
    return [made]
