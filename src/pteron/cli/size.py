"""`pteron size`: the load of each drive over a cycle, and a choice of motors."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import STANDARD, MachineArgument
from pteron.cli.destination import Destination
from pteron.cli.motion_argument import Carried, cycle_of
from pteron.cli.motion_table import force_word
from pteron.cli.motor_tables import common_rows, common_table, fits_frame, motors_table
from pteron.cli.pose_ranges import box_of, pose_spans
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import plain, show, table, warn
from pteron.errors import UnlikelyValue
from pteron.tolerances import ROUNDING

if TYPE_CHECKING:
    import rich.table

    from pteron.manipulator import Manipulator
    from pteron.motion import CommonFit, Motion, MotorFit, Sizing
    from pteron.workspace import Box

_OVERLOADED = 1
"""Exit code where a drive is overloaded."""

_NAMED = {"peak_force": "peak {}", "rms_force": "RMS {}", "peak_speed": "speed"}
"""Quantities whose worst places are told."""


def size(
    machine: MachineArgument,
    *,
    cycle: list[str] | None = None,
    carried: Carried,
    duration: float | None = None,
    dwell: list[float] | None = None,
    within: str | None = None,
    friction: float = 0.1,
    motors: str | None = None,
    margin: float = 1.0,
    out: str | None = None,
) -> CommandResult:
    """Size the motors: peak and RMS force, speed, power and energy of each drive over a cycle.

    The standard cycle is done at all places of the workspace and at all turns about the vertical,
    the platform turned with it or not, and the worst of them counts and is named; a motion from a
    table is done as it stands. Several cycles are done one after the other, each with its rest.

    Forces are those of the drives: the bodies with the payload, friction and the rotors, as the
    machine's file has them. What is not enough is told by leg and amount, of the drives in the file
    as of a list of motors, and the exit code is 1.

    A list of motors has the columns name, rotor_inertia (kg m^2), rated_torque and peak_torque
    (N m), max_speed (rad/s). For each joint it is told which serve, the smallest first, from what
    ratio to what ratio, and which ratio is best: least RMS torque. For legs that are alike the one
    motor and ratio for all of them is told, too.

    A folder gets sizing.csv, sizing.json, power.svg, force-speed.svg and motors.csv; the pictures
    are of the place where the most power is needed.

    Options
    -------
    --cycle CYCLE: adept, the standard pick-and-place cycle, or a table of a motion; again for more.
        [default: adept]
    --dwell: Rest after each cycle, s; again for that after each of several.
    --within REGION: Where the cycle is done: workspace, here (as it stands), or a box of poses such
        as x=-0.1:0.1,y=-0.1:0.1; along what it leaves out the cycle has the room that it takes as
        it stands. [default: workspace; here of a table]
    --friction SHARE: Dry friction of a drive that has none in the file, over its largest force; 0
        leaves it out.
    --motors FILE: Choose from the motors in this CSV or TOML file.
    --margin: What drives and motors must be able to do, over what the cycle asks.
    --out DIR|FILE: Write tables, numbers and pictures to a folder, or one table.

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
    spans = {} if where in places else pose_spans(machine, where, "--within", example)
    carrying = carried.load_machine(machine)
    with spinner(f"Sizing the drives of {machine.name}"):
        motions = [cycle_of(carrying, name, duration) for name in cycles]
        region = _box(machine, spans, motions) if spans else places[where]
        how: dict[str, Any] = {"dwell": dwell or [0.0], "friction": friction}
        sizing = sized(carrying, motions, places=region, **how)
        fits = choose(sizing, chosen, margin=margin)
        common = choose_common(sizing, chosen, margin=margin)
    lacking = [*_weak(sizing, margin), *_unserved_legs(sizing, fits, margin)]
    warn(lacking)
    request = _Asked(" and ".join(cycles), carried, where, margin)
    # A list of motors is what its choice is asked for.
    return destination.deliver(
        fits_frame(machine, fits) if fits and out is None else sizing.table(),
        _data(sizing, fits, request) | {"common_motors": common_rows(machine, common)},
        partial(_further_files, sizing, fits),
        partial(_show, sizing, fits, common, request),
        _OVERLOADED if lacking else 0,
    )


@dataclass(frozen=True)
class _Asked:
    """What was requested, in the words of the options, for the printed result."""

    cycle: str
    carried: Carried
    within: str
    margin: float


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
        f"leg {drive.leg}: not enough: {drive.limit} allow {drive.most:.4g} {drive.unit}, "
        f"{drive.margin:.3g} times the {drive.needed:.4g} {drive.unit} that the cycle takes"
        f"{sizing.place_text(drive)}, and a margin of {margin:g} is asked for"
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
                f"leg {leg}: not enough: no motor of the list serves; {best.motor.name}, the "
                f"nearest, has {best.margin:.3g} times the {best.scarcest} that the cycle takes, "
                f"and {margin:g} times is asked for"
            )
    return lines


def _data(sizing: Sizing, fits: tuple[MotorFit, ...], request: _Asked) -> dict[str, Any]:
    """Return a sizing as JSON data: loads by drive, totals, margins, overloads and motors."""
    total = sizing.power.sum(axis=-1)
    return {
        "robot": sizing.robot.name,
        "cycle": request.cycle,
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
    sizing: Sizing, fits: tuple[MotorFit, ...], common: tuple[CommonFit, ...], request: _Asked
) -> None:
    """Print tables of loads, power and motors, and the choice."""
    dwell = f", {sizing.dwell:g} s of it at rest" if sizing.dwell else ""
    places = (
        f"The greatest of {len(sizing.places)} places and turns of the cycle, within "
        f"{plain(request.within.replace('workspace', 'the workspace'))}."
    )
    show(
        f"[bold]{plain(sizing.robot.name)}[/bold]{plain(str(request.carried))}, "
        f"cycle {plain(request.cycle)}: "
        f"{sizing.duration:.4g} s{dwell}",
        *([places] if sizing.places else []),
        _loads(sizing),
        *_places(sizing),
        _powers(sizing),
        *_rotors(sizing),
        *_energy(sizing),
        *motors_table(sizing.robot, fits),
        *common_table(sizing.robot, common),
        *_verdict(sizing, fits, request.margin),
    )


def _energy(sizing: Sizing) -> list[str]:
    """Return lines on the energy of all drives over a cycle, and on assumed friction."""
    total = sizing.power.sum(axis=-1)
    net = sizing.net_energy
    exchanged = f"{sizing.given_energy.sum():.4g} J given and taken back: there is no friction"
    lines = [
        f"All drives: {net:.4g} J a cycle{'' if net else f' ({exchanged})'}, "
        f"{net / sizing.duration:.4g} W in the mean, {total.max():.4g} W at most"
    ]
    if sizing.assumed_friction.any():
        units = [leg.joint.force_unit for leg in sizing.robot.legs]
        forces = zip(sizing.assumed_friction, units, strict=True)
        texts = ", ".join(f"{force:.3g} {unit}" if force else "-" for force, unit in forces)
        lines.append(
            f"Friction is assumed where the file has none: dry, leg by leg {texts}; --friction "
            "SHARE changes it, 0 leaves it out"
        )
    return lines


def _verdict(sizing: Sizing, fits: tuple[MotorFit, ...], margin: float) -> list[str]:
    """Return lines on whether drives and motors suffice, with the actual margin."""
    lines = []
    if sizing.margins:
        least = min(sizing.margins, key=lambda limit: limit.margin)
        enough = "Enough" if least.margin >= margin * (1.0 - ROUNDING) else "Not enough"
        lines.append(
            f"{enough}: the drives in the file have a margin of {least.margin:.3g}, {margin:g} "
            f"asked; least is leg {least.leg}'s: {least.limit} allow {least.most:.4g} "
            f"{least.unit}, the cycle takes {least.needed:.4g} {least.unit}"
            f"{sizing.place_text(least)}"
        )
    best = [next(f for f in fits if f.leg == leg) for leg in sorted({fit.leg for fit in fits})]
    if best:
        least_fit = min(best, key=lambda fit: (fit.fits, fit.margin))
        enough = "Enough" if all(fit.fits for fit in best) else "Not enough"
        lines.append(
            f"{enough}: the first motor listed for each leg has a margin of {least_fit.margin:.3g} "
            f"or more, {margin:g} asked; least is leg {least_fit.leg}'s {least_fit.scarcest} with "
            f"{plain(least_fit.motor.name)}"
        )
    return lines


def _places(sizing: Sizing) -> list[rich.table.Table]:
    """Return a table of the places where each leg's force and speed are greatest."""
    rows = []
    for worst in _worst(sizing):
        pose = " ".join(f"{round(coordinate, 6) + 0.0:.4g}" for coordinate in worst["pose"])
        quantity = _NAMED[worst["quantity"]].format(sizing.robot.legs[worst["leg"] - 1].joint.force)
        leg = str(worst["leg"]) if worst["quantity"] == "peak_force" else ""
        rows.append((leg, quantity, pose, f"{math.degrees(worst['turn']) % 360:.4g} deg"))
    platform, coordinates = sizing.robot.platform, " ".join(sizing.robot.coordinates)
    units = ", ".join(["m"] * bool(platform.lengths) + ["rad"] * bool(platform.angles))
    names = "leg", "is greatest", f"about {coordinates} ({units})", "turned"
    return [table(*names, rows=rows, numbers=("leg", "turned"))] if rows else []


def _loads(sizing: Sizing) -> rich.table.Table:
    """Return a table of each drive's peak and RMS force and speed."""
    force = force_word(sizing.robot)
    names = ("leg", f"peak {force}", f"RMS {force}", "peak speed", "RMS speed")
    columns = sizing.peak_forces, sizing.rms_forces, sizing.peak_speeds, sizing.rms_speeds
    rows = []
    for i, leg in enumerate(sizing.robot.legs):
        units = [leg.joint.force_unit] * 2 + [f"{leg.joint.unit}/s"] * 2
        cells = (f"{v[i]:.4g} {unit}" for v, unit in zip(columns, units, strict=True))
        rows.append((str(i + 1), *cells))
    return table(*names, rows=rows, numbers=names)


def _powers(sizing: Sizing) -> rich.table.Table:
    """Return a table of each drive's power (W) and energy (J), motoring and braking."""
    names = ("leg", "peak (W)", "mean (W)", "brakes (W)", "gives (J)", "takes back (J)")
    powers = (sizing.peak_power, sizing.mean_power, sizing.peak_braking)
    columns = zip(*powers, sizing.given_energy, sizing.braked_energy, strict=True)
    rows = ((str(i), *(f"{v:.4g}" for v in row)) for i, row in enumerate(columns, start=1))
    return table(*names, rows=rows, numbers=names)


def _rotors(sizing: Sizing) -> list[rich.table.Table]:
    """Return a table of the motors' loads and inertia ratios; none without rotor or ratio."""
    if not any(drive.ratio or drive.rotor_inertia for drive in sizing.drives):
        return []
    names = ("leg", "load", "rotor", "load/rotor", "ratio", "best ratio", "RMS at motor")
    rows = []
    for leg, row in zip(sizing.robot.legs, sizing.table().to_dicts(), strict=True):
        inertia = " kg" if leg.joint.unit == "m" else " kg m^2"
        units = {"greatest_load_inertia": inertia, "rotor_inertia": inertia, "inertia_ratio": ""}
        units |= {"ratio": "", "best_ratio": f" rad/{leg.joint.unit}", "rms_motor_torque": " N m"}
        cells = ("-" if row[k] is None else f"{row[k]:.3g}{unit}" for k, unit in units.items())
        rows.append((str(row["leg"]), *cells))
    caption = "Inertia at the joint, the load's greatest."
    return [table(*names, rows=rows, numbers=names, caption=caption)]
