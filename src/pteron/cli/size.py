"""`pteron size`: the load of each drive over a cycle, and a choice of motors."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import STANDARD, Machine
from pteron.cli.destination import Destination
from pteron.cli.motion_argument import Carried, cycle_of
from pteron.cli.motion_table import force_word
from pteron.cli.motor_tables import common_rows, common_table, fits_frame, motors_table
from pteron.cli.pose_ranges import box_of, pose_spans
from pteron.cli.progress import spinner
from pteron.cli.result import Result
from pteron.cli.terminal import plain, show, table, warn
from pteron.errors import UnlikelyValue

if TYPE_CHECKING:
    import rich.table

    from pteron.manipulator import Manipulator
    from pteron.motion import CommonFit, Fit, Motion, Sizing
    from pteron.workspace import Box

_OVERLOADED = 1
"""Exit code where a drive is overloaded."""

_NAMED = {"peak_force": "peak {}", "rms_force": "RMS {}", "peak_speed": "speed"}
"""Quantities whose worst places are told."""

_ROUNDING = 1e-9
"""Share of a margin by which it may be missed."""


def size(
    machine: Machine,
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
) -> Result:
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
    such = ", such as x=-0.1:0.1,y=-0.1:0.1"
    spans = {} if where in places else pose_spans(machine, where, "--within", such)
    carrying = carried.on(machine)
    with spinner(f"Sizing the drives of {machine.name}"):
        motions = [cycle_of(carrying, one, duration) for one in cycles]
        region = _box(machine, spans, motions) if spans else places[where]
        how: dict[str, Any] = {"dwell": dwell or [0.0], "friction": friction}
        found = sized(carrying, motions, places=region, **how)
        fits = choose(found, chosen, margin=margin)
        common = choose_common(found, chosen, margin=margin)
    lacking = [*_weak(found, margin), *_unserved(found, fits, margin)]
    warn(lacking)
    asked = _Asked(" and ".join(cycles), carried, where, margin)
    # A list of motors is what its choice is asked for.
    return destination.deliver(
        fits_frame(machine, fits) if fits and out is None else found.table(),
        _data(found, fits, asked) | {"common_motors": common_rows(machine, common)},
        partial(_more, found, fits),
        partial(_show, found, fits, common, asked),
        _OVERLOADED if lacking else 0,
    )


@dataclass(frozen=True)
class _Asked:
    """The request, in the words of the options."""

    cycle: str
    carried: Carried
    within: str
    margin: float


def _box(
    machine: Manipulator, spans: dict[str, tuple[float, ...]], motions: Sequence[Motion]
) -> Box:
    """Return a box of poses, with room for a cycle at every turn along what has no span."""
    import numpy as np

    from pteron.workspace import Box

    low, high = Box.around(np.vstack([motion.pose for motion in motions])).box
    half, lengths = (high - low) / 2.0, ~machine.platform.angular
    half[lengths] = np.linalg.norm(half[lengths])
    middle = (low + high) / 2.0
    taken = zip(machine.coordinates, middle - half, middle + half, strict=True)
    return box_of([spans.get(name, (float(a), float(b))) for name, a, b in taken])


def _weak(found: Sizing, margin: float) -> list[str]:
    """Return what the drives of the machine's file have too little of, a line each."""
    beyond = [
        f"leg {one.leg}: not enough: {one.limit} allow {one.most:.4g} {one.unit}, {one.margin:.3g} "
        f"times the {one.needed:.4g} {one.unit} that the cycle takes{found.where(one)}, and a "
        f"margin of {margin:g} is asked for"
        for one in found.margins
        if 1.0 <= one.margin < margin * (1.0 - _ROUNDING)
    ]
    return [*found.overloads, *beyond]


def _unserved(found: Sizing, fits: tuple[Fit, ...], margin: float) -> list[str]:
    """Return the joints for which no motor of the list is enough, and what the best one lacks."""
    lines = []
    for leg in range(1, found.robot.joint_count + 1):
        own = [fit for fit in fits if fit.leg == leg]
        if own and not own[0].fits:
            best = own[0]
            lines.append(
                f"leg {leg}: not enough: no motor of the list serves; {best.motor.name}, the "
                f"nearest, has {best.margin:.3g} times the {best.scarcest} that the cycle takes, "
                f"and {margin:g} times is asked for"
            )
    return lines


def _data(found: Sizing, fits: tuple[Fit, ...], asked: _Asked) -> dict[str, Any]:
    total = found.power.sum(axis=-1)
    return {
        "robot": found.robot.name,
        "cycle": asked.cycle,
        "within": asked.within,
        "margin": asked.margin,
        **asdict(asked.carried),
        "duration": found.duration,
        "dwell": found.dwell,
        "drives": found.table().to_dicts(),
        "all": {
            "peak_power": float(total.max(initial=0.0)),
            "peak_braking": float((-total).max(initial=0.0)),
            "energy": found.net_energy,
            "mean_power": found.net_energy / found.duration,
        },
        "places": len(found.places) or 1,
        "worst": _worst(found),
        "assumed_friction": found.assumed_friction.tolist(),
        "margins": [one._asdict() | {"margin": one.margin} for one in found.margins],
        "overloads": list(found.overloads),
        "motors": fits_frame(found.robot, fits).to_dicts() if fits else [],
    }


def _worst(found: Sizing) -> list[dict[str, Any]]:
    """Return the worst places of each leg; none where the cycle is done as it stands."""
    rows = []
    for leg in range(found.robot.joint_count) if found.places else ():
        for quantity in _NAMED:
            place = found.places[found.worst(quantity)[leg]]
            rows.append({"leg": leg + 1, "quantity": quantity, **asdict(place)})
    return rows


def _more(found: Sizing, fits: tuple[Fit, ...]) -> dict[str, str]:
    """Return the further files of a folder."""
    from pteron.plots import svg_file
    from pteron.report.drive_figures import force_speed, power

    if found.places:
        found = found.at(int(found.power.sum(axis=-1).max(axis=0).argmax()))
    texts = {"power.svg": svg_file(power(found)), "force-speed.svg": svg_file(force_speed(found))}
    return texts | ({"motors.csv": fits_frame(found.robot, fits).write_csv()} if fits else {})


def _show(
    found: Sizing, fits: tuple[Fit, ...], common: tuple[CommonFit, ...], asked: _Asked
) -> None:
    """Print for a person: loads, power, motors, and the choice."""
    rest = f", {found.dwell:g} s of it at rest" if found.dwell else ""
    places = (
        f"The greatest of {len(found.places)} places and turns of the cycle, within "
        f"{plain(asked.within.replace('workspace', 'the workspace'))}."
    )
    show(
        f"[bold]{plain(found.robot.name)}[/bold]{plain(str(asked.carried))}, "
        f"cycle {plain(asked.cycle)}: "
        f"{found.duration:.4g} s{rest}",
        *([places] if found.places else []),
        _loads(found),
        *_places(found),
        _powers(found),
        *_rotors(found),
        *_energy(found),
        *motors_table(found.robot, fits),
        *common_table(found.robot, common),
        *_verdict(found, fits, asked.margin),
    )


def _energy(found: Sizing) -> list[str]:
    """Return what all drives take, and from where their friction is."""
    total = found.power.sum(axis=-1)
    net = found.net_energy
    given = f"{found.given_energy.sum():.4g} J given and taken back: there is no friction"
    told = [
        f"All drives: {net:.4g} J a cycle{'' if net else f' ({given})'}, "
        f"{net / found.duration:.4g} W in the mean, {total.max():.4g} W at most"
    ]
    if found.assumed_friction.any():
        units = [leg.joint.force_unit for leg in found.robot.legs]
        forces = zip(found.assumed_friction, units, strict=True)
        values = ", ".join(f"{force:.3g} {unit}" if force else "-" for force, unit in forces)
        told.append(
            f"Friction is assumed where the file has none: dry, leg by leg {values}; --friction "
            "SHARE changes it, 0 leaves it out"
        )
    return told


def _verdict(found: Sizing, fits: tuple[Fit, ...], margin: float) -> list[str]:
    """Return whether drives and motors are enough, and the margin that exists."""
    told = []
    if found.margins:
        least = min(found.margins, key=lambda one: one.margin)
        enough = "Enough" if least.margin >= margin * (1.0 - _ROUNDING) else "Not enough"
        told.append(
            f"{enough}: the drives in the file have a margin of {least.margin:.3g}, {margin:g} "
            f"asked; least is leg {least.leg}'s: {least.limit} allow {least.most:.4g} "
            f"{least.unit}, the cycle takes {least.needed:.4g} {least.unit}{found.where(least)}"
        )
    best = [next(f for f in fits if f.leg == leg) for leg in sorted({fit.leg for fit in fits})]
    if best:
        least_fit = min(best, key=lambda fit: (fit.fits, fit.margin))
        enough = "Enough" if all(fit.fits for fit in best) else "Not enough"
        told.append(
            f"{enough}: the first motor listed for each leg has a margin of {least_fit.margin:.3g} "
            f"or more, {margin:g} asked; least is leg {least_fit.leg}'s {least_fit.scarcest} with "
            f"{plain(least_fit.motor.name)}"
        )
    return told


def _places(found: Sizing) -> list[rich.table.Table]:
    """Return where each leg's force and speed are greatest."""
    rows = []
    for one in _worst(found):
        pose = " ".join(f"{round(value, 6) + 0.0:.4g}" for value in one["pose"])
        quantity = _NAMED[one["quantity"]].format(found.robot.legs[one["leg"] - 1].joint.force)
        leg = str(one["leg"]) if one["quantity"] == "peak_force" else ""
        rows.append((leg, quantity, pose, f"{math.degrees(one['turn']) % 360:.4g} deg"))
    platform, coordinates = found.robot.platform, " ".join(found.robot.coordinates)
    units = ", ".join(["m"] * bool(platform.lengths) + ["rad"] * bool(platform.angles))
    names = "leg", "is greatest", f"about {coordinates} ({units})", "turned"
    return [table(*names, rows=rows, numbers=("leg", "turned"))] if rows else []


def _loads(found: Sizing) -> rich.table.Table:
    force = force_word(found.robot)
    names = ("leg", f"peak {force}", f"RMS {force}", "peak speed", "RMS speed")
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
