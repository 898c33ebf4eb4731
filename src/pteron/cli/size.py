"""`pteron size`: the load of each drive over a cycle, and a choice of motors."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import rich.table
from typer import Exit

from pteron.cli.arguments import STANDARD, load_robot
from pteron.cli.destination import Destination
from pteron.cli.motion_argument import cycle_of, loaded
from pteron.cli.progress import spinner
from pteron.cli.terminal import note, plain, show, table
from pteron.errors import UnlikelyValue
from pteron.json_values import picked

if TYPE_CHECKING:
    import polars as pl

    from pteron.motion import Fit, Sizing

_OVERLOADED = 1
"""Exit code where a drive is overloaded."""

_BEST = 3
"""Motors shown for each joint, the best ones."""


def size(
    robot: str,
    *,
    cycle: str = STANDARD,
    payload: float = 0.0,
    duration: float | None = None,
    dwell: float = 0.0,
    motors: str | None = None,
    margin: float = 1.0,
    out: str | None = None,
    elbows: str | None = None,
    json: bool = False,
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

    Options
    -------
    --dwell: Rest after each cycle, s.
    --motors FILE: Choose from the motors in this CSV or TOML file.
    --margin: What a motor must be able to do, over what the cycle asks.
    --out DIR|FILE: Write tables, numbers and pictures to a folder, or one table.

    Examples
    --------
    pteron size delta --payload 1.0
    pteron size robot.toml --motors motors.csv --dwell 0.2 --out sizing
    pteron size quadrupteron --cycle motion.csv --out sizing.csv
    """
    machine = load_robot(robot, elbows)
    from pteron.motion import choose, read_motors, size as sized

    with warnings.catch_warnings():  # each motor's are notes below
        warnings.simplefilter("ignore", UnlikelyValue)
        chosen = () if motors is None else read_motors(motors)
    destination = Destination(out, "sizing")
    destination.check()
    for motor in chosen:
        for text in motor.warnings:
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
    """Return the joints that no motor of the list serves, and what the best of them lacks."""
    lines = []
    for leg in range(1, found.robot.joint_count + 1):
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
            **picked(fit, "rated_margin peak_margin speed_margin inertia_ratio"),
        }
        for fit in fits
    ]
    return pl.DataFrame(rows, infer_schema_length=None)


def _more(found: Sizing, fits: tuple[Fit, ...]) -> dict[str, str]:
    """Return the further files of a folder."""
    from pteron.plots import svg_file
    from pteron.report.drive_figures import force_speed, power

    texts = {"power.svg": svg_file(power(found)), "force-speed.svg": svg_file(force_speed(found))}
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
    names = ("leg", "peak force", "RMS force", "peak speed", "RMS speed")
    columns = found.peak_forces, found.rms_forces, found.peak_speeds, found.rms_speeds
    rows = []
    for i, leg in enumerate(found.robot.legs):
        units = [leg.joint.force_unit] * 2 + [f"{leg.joint.unit}/s"] * 2
        cells = (f"{v[i]:.4g} {unit}" for v, unit in zip(columns, units, strict=True))
        rows.append((str(i + 1), *cells))
    return table(*names, rows=rows, numbers=names)


def _powers(found: Sizing) -> rich.table.Table:
    names = ("leg", "peak (W)", "mean (W)", "brakes (W)", "gives (J)", "takes back (J)")
    powers = (found.peak_power, found.mean_power, found.peak_braking)
    columns = zip(*powers, found.given_energy, found.braked_energy, strict=True)
    rows = ((str(i), *(f"{v:.4g}" for v in values)) for i, values in enumerate(columns, start=1))
    return table(*names, rows=rows, numbers=names)


def _rotors(found: Sizing) -> list[rich.table.Table]:
    """Return the loads of the motors of the machine's file, where it says enough."""
    if not any(drive.ratio or drive.rotor_inertia for drive in found.drives):
        return []
    names = ("leg", "load", "rotor", "load/rotor", "ratio", "best ratio", "RMS at motor")
    rows = []
    for leg, row in zip(found.robot.legs, found.table().to_dicts(), strict=True):
        inertia = " kg" if leg.joint.unit == "m" else " kg m^2"
        units = {"greatest_load_inertia": inertia, "rotor_inertia": inertia, "inertia_ratio": ""}
        units |= {"ratio": "", "best_ratio": f" rad/{leg.joint.unit}", "rms_motor_torque": " N m"}
        cells = ("-" if row[k] is None else f"{row[k]:.3g}{unit}" for k, unit in units.items())
        rows.append((str(row["leg"]), *cells))
    caption = "Inertia at the joint, the load's greatest."
    return [table(*names, rows=rows, numbers=names, caption=caption)]


def _choice(found: Sizing, fits: tuple[Fit, ...]) -> list[rich.table.Table]:
    if not fits:
        return []
    rows = []
    for i, leg in enumerate(found.robot.legs, start=1):
        own = [fit for fit in fits if fit.leg == i][:_BEST]
        for fit in own:
            ratio = f"{fit.ratio:.4g} rad/{leg.joint.unit}"
            span = [f"{end:.4g}" for end in fit.span] if fit.fits else ["none", ""]
            margins = (f"{v:.2f}" for v in (fit.rated_margin, fit.peak_margin, fit.speed_margin))
            first = str(i) if fit is own[0] else ""
            rows.append((first, plain(fit.motor.name), ratio, *span, *margins))
    names = ("ratio", "from", "to", "rated", "peak", "speed")
    caption = "Ratios that serve, the best first; then margins at it: rated, peak torque, speed."
    return [table("leg", "motor", *names, rows=rows, numbers=("leg", *names), caption=caption)]
