"""`pteron size`: the load of each drive over a cycle, and a choice of motors."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import STANDARD, MachineArgument, about_pivot
from pteron.cli.destination import Destination
from pteron.cli.motion_argument import Carried, cycle_of, cycle_text
from pteron.cli.motion_table import force_word
from pteron.cli.motor_tables import (
    at_motors,
    common_rows,
    common_table,
    fits_frame,
    motors_table,
)
from pteron.cli.pose_ranges import box_of, pose_spans
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import percent, plain, show, significant, table, warn
from pteron.errors import UnlikelyValue
from pteron.tolerances import ROUNDING

if TYPE_CHECKING:
    import rich.table

    from pteron.manipulator import Manipulator
    from pteron.motion import CommonFit, Motion, MotorFit, Sizing
    from pteron.workspace import Box

_OVERLOADED = 1
"""Exit code where a drive is overloaded."""

_TOO_FAST = 2.0
"""Times a drive's greatest speed at which the output begins with the advice to take a slower cycle:
a slightly stronger drive does not serve then."""

_UNLIKELY_RPM = 10_000.0
"""Speed of a motor, rpm, from which the cycle is doubted where the file has no max_speed: servo
motors reach 3000 to 6000."""

_NAMED = {"peak_force": "peak {}", "rms_force": "RMS {}", "peak_speed": "peak speed"}
"""Quantities whose worst places are shown."""


def size(
    machine: MachineArgument,
    *,
    cycle: list[str] | None = None,
    carried: Carried,
    pivot: str | None = None,
    duration: float | None = None,
    dwell: list[float] | None = None,
    within: str | None = None,
    friction: float = 0.0,
    motors: str | None = None,
    margin: float = 1.0,
    out: str | None = None,
) -> CommandResult:
    """Size the motors: peak and RMS force, speed, power and energy of each drive over a cycle.

    The standard cycle is placed everywhere in the workspace and turned in all directions about the
    vertical, the platform turned with it or not; the largest value of each quantity counts, with
    its place. A motion from a table is taken as it is. Several cycles follow one another, each with
    its dwell.

    Forces are those of the drives: the bodies with the payload, friction, rotors and screws, as in
    the machine's file. With a drive's ratio, torque and speed are given at the motor too, there
    with the losses of the screw. If the drives in the file, or all motors of a list, are too weak,
    a warning says for which leg and by how much, and the exit code is 1.

    A list of motors has the columns name, rotor_inertia (kg m^2), rated_torque and peak_torque
    (N m), max_speed (rad/s). For each joint the output lists the motors that are strong enough, the
    smallest first, with their range of gear ratios and the best one, of least RMS torque; for equal
    legs also the one motor and ratio for all of them.

    A folder gets sizing.csv, sizing.json, power.svg, force-speed.svg and motors.csv; the figures
    are for the place where the most power is needed.

    Options
    -------
    --cycle CYCLE: adept, the standard pick-and-place cycle, or the table of a motion; repeat for
        several. [default: adept]
    --dwell: Time at rest after each cycle, s; repeat for each of several cycles.
    --within REGION: Where the cycle is placed: workspace, here (where it is defined), or a box of
        poses such as x=-0.1:0.1,y=-0.1:0.1; coordinates not named keep the range of the cycle where
        it is defined. [default: workspace; here for a table]
    --friction SHARE: Dry friction to assume for a drive without friction in the file, as a share
        of its largest force, such as 0.1 for gears of an efficiency of 0.9. [default: none]
    --motors FILE: List of motors to choose from, a CSV or TOML file.
    --margin: Required margin: limits of drives and motors over what the cycle needs.
    --out DIR|FILE: Write tables, numbers and figures to a folder, or one table to a file.

    Examples
    --------
    pteron size delta --payload 1.0
    pteron size robot.toml --motors motors.csv --dwell 0.2 --margin 1.3 --out sizing
    pteron size quadrupteron --cycle pick.csv --dwell 0.2 --cycle home.csv --dwell 5
    pteron size delta --within x=-0.1:0.1,y=-0.1:0.1,z=-0.9:-0.8
    """
    from pteron.motion import choose, choose_common, read_motors, size as sized

    with warnings.catch_warnings():  # each motor's are notes below
        warnings.simplefilter("ignore", UnlikelyValue)
        chosen = () if motors is None else read_motors(motors)
    destination = Destination(out, "sizing")
    destination.check()
    warn(text for motor in chosen for text in motor.warnings)
    cycles = cycle or [STANDARD]
    where = within or ("workspace" if cycles == [STANDARD] else "here")
    places: Any = {"workspace": "workspace", "here": None}
    example = ", such as x=-0.1:0.1,y=-0.1:0.1"
    # Poses of regions and tables are those of the pivot.
    spans = {} if where in places else pose_spans(machine, where, "--within", example)
    carrying = about_pivot(carried.load_machine(machine), pivot)
    machine = about_pivot(machine, pivot)
    with spinner(f"Sizing the drives of {machine.name}"):
        motions = [cycle_of(carrying, name, duration) for name in cycles]
        region = _box(machine, spans, motions) if spans else places[where]
        how: dict[str, Any] = {"dwell": dwell or [0.0], "friction": friction}
        sizing = sized(carrying, motions, places=region, **how)
        fits = choose(sizing, chosen, margin=margin)
        common = choose_common(sizing, chosen, margin=margin)
    lacking = [*_weak(sizing, margin), *_unserved_legs(sizing, fits, margin)]
    warn(lacking)
    request = _Request(tuple(cycles), carried, where, margin, friction)
    # A list of motors is what its choice is asked for.
    return destination.deliver(
        fits_frame(machine, fits) if fits and out is None else sizing.table(),
        _data(sizing, fits, request) | {"common_motors": common_rows(machine, common)},
        partial(_further_files, sizing, fits),
        partial(_show, sizing, fits, common, request),
        _OVERLOADED if lacking else 0,
    )


@dataclass(frozen=True)
class _Request:
    """The request, in the words of the options."""

    cycles: tuple[str, ...]
    carried: Carried
    within: str
    margin: float
    friction: float


def _box(
    machine: Manipulator, spans: dict[str, tuple[float, ...]], motions: Sequence[Motion]
) -> Box:
    """Return a box of poses with room for a cycle at every turn; `spans` override its sides."""
    import numpy as np

    from pteron.workspace import Box

    low, high = Box.around(np.vstack([motion.pose for motion in motions])).box
    half, lengths = (high - low) / 2.0, ~machine.platform.angular
    half[lengths] = np.linalg.norm(half[lengths])
    middle = (low + high) / 2.0
    taken = zip(machine.coordinates, middle - half, middle + half, strict=True)
    return box_of([spans.get(name, (float(a), float(b))) for name, a, b in taken])


def _weak(sizing: Sizing, margin: float) -> list[str]:
    """Return a line for each limit that a drive of the file does not meet by the margin."""
    beyond = [
        f"leg {drive.leg}: not enough: {drive.limit} of the file: {drive.most:.4g} {drive.unit} is "
        f"{drive.margin:.3g} times the {drive.needed:.4g} {drive.unit} that the cycle needs"
        f"{sizing.place_text(drive)}; --margin requires {margin:g} times"
        for drive in sizing.margins
        if 1.0 <= drive.margin < margin * (1.0 - ROUNDING)
    ]
    return [*sizing.overloads, *beyond]


def _unserved_legs(sizing: Sizing, fits: tuple[MotorFit, ...], margin: float) -> list[str]:
    """Return a line for each leg that no motor serves: the nearest motor and its shortfall."""
    lines = []
    for leg in range(1, sizing.robot.joint_count + 1):
        leg_fits = [fit for fit in fits if fit.leg == leg]
        if leg_fits and not leg_fits[0].fits:
            best = leg_fits[0]
            lines.append(
                f"leg {leg}: not enough: no motor of the list is strong enough; the nearest, "
                f"{best.motor.name}, has {best.margin:.3g} times the {best.scarcest} that the "
                f"cycle needs; --margin requires {margin:g} times"
            )
    return lines


def _data(sizing: Sizing, fits: tuple[MotorFit, ...], request: _Request) -> dict[str, Any]:
    """Return a sizing as JSON data: loads by drive, totals, margins, overloads and motors."""
    total = sizing.power.sum(axis=-1)
    return {
        "robot": sizing.robot.name,
        "cycle": " and ".join(request.cycles),
        "within": request.within,
        "margin": request.margin,
        **asdict(request.carried),
        "duration": sizing.duration,
        "dwell": sizing.dwell,
        "drives": sizing.table().to_dicts(),
        "all": {
            "peak_power": float(total.max(initial=0.0)),
            "peak_braking": float((-total).max(initial=0.0)),
            "energy": sizing.net_energy,
            "mean_power": sizing.net_energy / sizing.duration,
        },
        "places": len(sizing.places) or 1,
        "worst": _worst(sizing),
        "assumed_friction": sizing.assumed_friction.tolist(),
        "margins": [limit.as_dict() | {"margin": limit.margin} for limit in sizing.margins],
        "overloads": list(sizing.overloads),
        "motors": fits_frame(sizing.robot, fits).to_dicts() if fits else [],
    }


def _worst(sizing: Sizing) -> list[dict[str, Any]]:
    """Return the worst places of each leg; none where the cycle has a fixed place."""
    rows = []
    for leg in range(sizing.robot.joint_count) if sizing.places else ():
        for quantity in _NAMED:
            place = sizing.places[sizing.worst(quantity)[leg]]
            rows.append({"leg": leg + 1, "quantity": quantity, **asdict(place)})
    return rows


def _further_files(sizing: Sizing, fits: tuple[MotorFit, ...]) -> dict[str, str]:
    """Return the further files of a folder."""
    from pteron.plots import svg_file
    from pteron.report.drive_figures import force_speed, power

    if sizing.places:
        sizing = sizing.select_place(int(sizing.power.sum(axis=-1).max(axis=0).argmax()))
    texts = {"power.svg": svg_file(power(sizing)), "force-speed.svg": svg_file(force_speed(sizing))}
    return texts | ({"motors.csv": fits_frame(sizing.robot, fits).write_csv()} if fits else {})


def _show(
    sizing: Sizing, fits: tuple[MotorFit, ...], common: tuple[CommonFit, ...], request: _Request
) -> None:
    """Print tables of loads, power and motors, and the choice."""
    dwell = f", {sizing.dwell:g} s of it at rest" if sizing.dwell else ""
    cycles = " and ".join(map(cycle_text, request.cycles))
    places = (
        f"All values are the largest over {len(sizing.places)} places and orientations of the "
        f"cycle in {plain(request.within.replace('workspace', 'the workspace'))}."
    )
    show(
        f"[bold]{plain(sizing.robot.name)}[/bold]{plain(str(request.carried))}, {plain(cycles)}: "
        f"{sizing.duration:.4g} s{dwell}",
        *_too_fast(sizing, request.cycles),
        *_verdict(sizing, fits, request.margin),
        *([places] if sizing.places else []),
        _loads(sizing),
        *at_motors(sizing),
        *_places(sizing),
        _powers(sizing),
        *_rotors(sizing),
        *_energy(sizing, request.friction),
        *motors_table(sizing.robot, fits),
        *common_table(sizing.robot, common),
    )


def _energy(sizing: Sizing, share: float) -> list[str]:
    """Return lines on the energy of all drives over a cycle, and on friction."""
    from pteron.motion.sizing.friction_sentence import friction_sentence

    total = sizing.power.sum(axis=-1)
    net = sizing.net_energy
    supplied = significant(float(sizing.given_energy.sum()))
    without = "" if net else f" ({supplied} J supplied and braked: there is no friction)"
    mean, peak = significant(net / sizing.duration), significant(float(total.max()))
    lines = [
        f"All drives together: net energy {significant(net)} J per cycle{without}, "
        f"mean net power {mean} W, peak power {peak} W (driving less braking)"
    ]
    if sizing.assumed_friction.any():
        units = [leg.joint.force_unit for leg in sizing.robot.legs]
        forces = zip(sizing.assumed_friction, units, strict=True)
        texts = ", ".join(f"{force:.3g} {unit}" if force else "-" for force, unit in forces)
        lines.append(
            f"Where the file has no friction, dry friction of {percent(share)} of the drive's peak "
            f"is assumed, leg by leg: {texts}"
        )
    else:
        lines.append(friction_sentence(sizing.robot))
    return lines


def _too_fast(sizing: Sizing, cycles: tuple[str, ...]) -> list[str]:
    """Return a line where the standard cycle is far too fast for the drives, else none."""
    if cycles != (STANDARD,):
        return []
    limits = [limit for limit in sizing.margins if limit.quantity == "peak_speed"]
    slowest = min(limits, key=lambda limit: limit.margin, default=None)
    if slowest is not None and slowest.margin * _TOO_FAST < 1.0:
        ratio = 1.0 / slowest.margin
        reason = (
            f"it takes leg {slowest.leg} to {ratio:.3g} times {slowest.limit}, "
            f"{slowest.most:.4g} {slowest.unit}"
        )
    else:
        geared = [bool(drive.ratio) and drive.max_speed is None for drive in sizing.drives]
        rpm = 30.0 / math.pi * sizing.motor_speeds[1] * geared
        ratio = float(rpm.max(initial=0.0)) / _UNLIKELY_RPM
        if ratio < 1.0:
            return []
        reason = (
            f"motors would turn at {rpm.max():.0f} rpm, and the file has no max_speed that limits "
            "them"
        )
    # The cycle keeps its path: speeds are inversely proportional to its duration.
    duration = significant(math.ceil(ratio * (sizing.duration - sizing.dwell)), 2)
    return [
        f"[yellow]The standard cycle is too fast for these drives: {reason}.[/yellow] Forces, "
        f"power and speeds below are of no use; size them for a slower one: --duration {duration}, "
        "or --cycle TABLE for the machine's own motion."
    ]


def _verdict(sizing: Sizing, fits: tuple[MotorFit, ...], margin: float) -> list[str]:
    """Return lines on whether drives and motors suffice, with the actual margin."""
    lines = []
    if sizing.margins:
        least = min(sizing.margins, key=lambda limit: limit.margin)
        enough = "Enough" if least.margin >= margin * (1.0 - ROUNDING) else "Not enough"
        lines.append(
            f"{enough}: the drives in the file have {least.margin:.3g} times what the cycle needs "
            f"({margin:g} required). The tightest limit: {least.limit} of leg {least.leg}, "
            f"{least.most:.4g} {least.unit}; needed: {least.needed:.4g} {least.unit}"
            f"{sizing.place_text(least)}"
        )
    best = [next(f for f in fits if f.leg == leg) for leg in sorted({fit.leg for fit in fits})]
    if best:
        least_fit = min(best, key=lambda fit: (fit.fits, fit.margin))
        enough = "Enough" if all(fit.fits for fit in best) else "Not enough"
        lines.append(
            f"{enough}: the first motor listed for each leg has at least {least_fit.margin:.3g} "
            f"times what the cycle needs ({margin:g} required). The tightest limit: "
            f"{least_fit.scarcest} of {plain(least_fit.motor.name)} at leg {least_fit.leg}"
        )
    if not lines:
        lines.append(
            "The file states no limits of the drives: these are the values that they must reach. "
            "--motors FILE selects motors from a list."
        )
    return lines


def _places(sizing: Sizing) -> list[rich.table.Table]:
    """Return a table of the places where each leg's force and speed are greatest."""
    rows = []
    for worst in _worst(sizing):
        pose = " ".join(f"{round(q, 4) + 0.0:.3g}" for q in worst["pose"])
        quantity = _NAMED[worst["quantity"]].format(sizing.robot.legs[worst["leg"] - 1].joint.force)
        leg = str(worst["leg"]) if worst["quantity"] == "peak_force" else ""
        rows.append((leg, quantity, pose, f"{math.degrees(worst['turn']) % 360:.3g} deg"))
    platform, coordinates = sizing.robot.platform, " ".join(sizing.robot.coordinates)
    units = ", ".join(["m"] * bool(platform.lengths) + ["rad"] * bool(platform.angles))
    names = "leg", "largest", "centre of the cycle", "turned by"
    caption = f"Where each is largest; centre: {coordinates} ({units})."
    return [table(*names, rows=rows, numbers=("leg", names[-1]), caption=caption)] if rows else []


def _loads(sizing: Sizing) -> rich.table.Table:
    """Return a table of each drive's peak and RMS force and speed."""
    force = force_word(sizing.robot)
    names = ("leg", f"peak {force}", f"RMS {force}", "peak speed", "RMS speed")
    columns = sizing.peak_forces, sizing.rms_forces, sizing.peak_speeds, sizing.rms_speeds
    rows = []
    for i, leg in enumerate(sizing.robot.legs):
        units = [leg.joint.force_unit] * 2 + [f"{leg.joint.unit}/s"] * 2
        cells = (f"{significant(v[i])} {unit}" for v, unit in zip(columns, units, strict=True))
        rows.append((str(i + 1), *cells))
    return table(*names, rows=rows, numbers=names)


def _powers(sizing: Sizing) -> rich.table.Table:
    """Return a table of each drive's power (W) and energy (J), motoring and braking."""
    names = (
        *("leg", "peak driving (W)", "mean driving (W)", "peak braking (W)"),
        *("energy supplied (J)", "energy braked (J)"),
    )
    powers = (sizing.peak_power, sizing.mean_power, sizing.peak_braking)
    columns = zip(*powers, sizing.given_energy, sizing.braked_energy, strict=True)
    rows = ((str(i), *map(significant, row)) for i, row in enumerate(columns, start=1))
    return table(*names, rows=rows, numbers=names)


def _rotors(sizing: Sizing) -> list[rich.table.Table]:
    """Return a table of the motors' loads and inertia ratios; none without rotor or ratio."""
    if not any(drive.ratio or drive.rotor_inertia for drive in sizing.drives):
        return []
    names = (
        *("leg", "load inertia", "rotor inertia", "load/rotor", "gear ratio"),
        *("best ratio", "RMS motor torque"),
    )
    rows = []
    for leg, row in zip(sizing.robot.legs, sizing.table().to_dicts(), strict=True):
        inertia = " kg" if leg.joint.unit == "m" else " kg m^2"
        units = {"greatest_load_inertia": inertia, "rotor_inertia": inertia, "inertia_ratio": ""}
        units |= {"ratio": "", "best_ratio": f" rad/{leg.joint.unit}", "rms_motor_torque": " N m"}
        cells = (
            "-" if row[k] is None else f"{significant(row[k])}{unit}" for k, unit in units.items()
        )
        rows.append((str(row["leg"]), *cells))
    caption = "Inertias referred to the joint, the load's at its largest."
    return [table(*names, rows=rows, numbers=names, caption=caption)]
