"""`pteron catalog`, `new` and `check`: the machines that come with Pteron, and the user's own."""

from __future__ import annotations

import math
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from typer import Exit

from pteron.cli.arguments import elbows_text, load_robot, split_numbers
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import complain, plain, show, table, warn, write
from pteron.errors import ModelError, OutputError, PteronError
from pteron.json_values import json_fields

if TYPE_CHECKING:
    from rich.table import Table

    from pteron.legs import LegKind
    from pteron.manipulator import Manipulator

_LIMITS = "LOW:HIGH expected, such as -0.3:0.3"
"""The form of `--limits`."""

_FAULTY = 2
"""Exit code for a faulty file."""


def catalog() -> CommandResult:
    """List the machines that come with Pteron.

    Examples
    --------
    pteron catalog --json
    """
    from pteron.cli.kept_machines import kept_machine
    from pteron.manipulator.files import descriptions

    machines = [
        {**_machine(robot), "legs": len(robot.legs), "description": text}
        for robot, text in ((kept_machine(name)[0], text) for name, text in descriptions().items())
    ]
    keys = ("name", "motion", "types", "description")
    cells = ((machine[key] for key in keys) for machine in machines)
    rows = (tuple(c if isinstance(c, str) else " ".join(c) for c in row) for row in cells)
    machine_table = table("name", "motion", "legs", "machine", rows=rows, names=("name",))
    return CommandResult(machines, [machine_table])


def new(
    kind: str | None = None,
    *,
    base_radius: float | None = None,
    platform_radius: float | None = None,
    crank: float | None = None,
    rod: float | None = None,
    limits: str | None = None,
    mass_from: list[str] | None = None,
    platform_mass: float | None = None,
    out: str | None = None,
    overwrite: bool = False,
) -> CommandResult:
    """Write a file for a machine of your own, which says what every key is.

    It is a machine like KIND, to put your numbers into; without KIND the kinds are listed. The
    dimensions that are given hold for all legs, and the file says what follows from them.

    Arguments
    ---------
    KIND: A machine of the catalog, or a TOML file.

    Options
    -------
    --base-radius: Greatest distance of a guide point from the machine's axis, m.
    --platform-radius: Greatest distance of a platform point from the platform's axis, m.
    --crank: Length of the cranks or upper links, m.
    --rod: Length of the rods or lower links, m.
    --limits LOW:HIGH: Of the joints, m or rad; of rams their length.
    --mass-from STOCK: Masses and inertias of links as cut from aluminium-tube:30x2 or steel-rod:8,
        mm; again, with upper= or lower= before it, for one of the two.
    --platform-mass: Of the platform with its bars, kg; its inertia is in proportion.
    --out FILE: Write it to this TOML file.
    --overwrite: Replace the file if it is there.

    Examples
    --------
    pteron new
    pteron new delta --out robot.toml
    pteron new delta --base-radius 0.2 --crank 0.25 --rod 0.55 --mass-from aluminium-tube:30x2
    """
    if kind is None:
        return catalog()
    from pteron.atomic import write_text
    from pteron.manipulator import load
    from pteron.manipulator.commented_file import commented_text, kept_numbers_sentence

    dimensions = {
        "base_radius": base_radius,
        "platform_radius": platform_radius,
        "crank": crank,
        "rod": rod,
        "limits": None if limits is None else split_numbers("--limits", limits, ":", 2, _LIMITS),
        "stock": _stocks(mass_from),
        "platform_mass": platform_mass,
    }
    dimensions = {key: size for key, size in dimensions.items() if size not in (None, {})}
    if out is not None and Path(out).exists() and not overwrite:
        raise OutputError(f"{out}: is there already; name another file, or say --overwrite")
    text = commented_text(kind, dimensions)
    if out is not None:
        write_text(out, text)
    record = {"kind": kind, "file": out, "text": text}
    if out is None:
        return CommandResult(record, partial(write, text))
    written = f"Written: {plain(out)}. Put in your numbers, then: pteron check {plain(out)}"
    return CommandResult(
        record, [written, *map(plain, kept_numbers_sentence(load(kind), dimensions))]
    )


def _stocks(texts: list[str] | None) -> dict[str, str]:
    """Return the stock of the links by key; a stock without a key is for "upper" and "lower"."""
    stocks: dict[str, str] = {}
    for text in texts or ():
        key, _, stock = text.rpartition("=")
        stocks |= {key: stock} if key else dict.fromkeys(("upper", "lower"), stock)
    return stocks


def _machine(robot: Manipulator) -> dict[str, Any]:
    """Return a machine's name, motion, coordinates, leg types and working mode as JSON data."""
    return {
        "name": robot.name,
        "motion": robot.platform.motion,
        "coordinates": list(robot.coordinates),
        "types": list(dict.fromkeys(leg.type for leg in robot.legs)),
        "working_mode": elbows_text(robot),
    }


def check(file: str, *, elbows: str | None = None) -> CommandResult:
    """Check a machine's file and say what the machine is.

    It fails if the file is not valid, telling all its faults, if the machine is singular at every
    pose, or within what files are rounded to of one that is, or if no pose is in reach of all its
    legs. It says where the platform is in each working mode, above its base, below or inside, which
    is the file's and which is likely meant; of more than eight modes the file's, its opposite, and
    those with all elbows alike. What is possible but unlikely, such as a length in millimetres, a
    centre of mass beyond its link, or legs that look swapped, is told as a warning. How well drives
    hold the platform at home is measured in absolute terms: docs/verdicts.md has the measures and
    their thresholds. The exit code is 2 where it fails, and 0 where not, warnings or none.

    Arguments
    ---------
    FILE: A machine's TOML file.

    Examples
    --------
    pteron check robot.toml
    """
    try:
        robot = load_robot(file, elbows, quiet=True)
    except ModelError as error:
        for fault in error.faults:
            complain(f"{error.subject}: {fault}")
        raise Exit(_FAULTY) from None
    from pteron.manipulator.machine_warnings import machine_warnings

    unlikely = machine_warnings(robot)
    warn(unlikely, f"{file}: ")
    try:
        with spinner(f"Looking where {robot.name} can work"):
            findings = _findings(robot)
        warn(findings["doubts"][len(unlikely) :], f"{file}: ")
    except PteronError as error:
        raise ModelError(error.message, subject=file) from None
    return CommandResult(findings, partial(_show, robot, findings))


def _findings(robot: Manipulator) -> dict[str, Any]:
    """Return the results of a machine's examination as JSON data: home, reach, modes, warnings."""
    import numpy as np

    from pteron.kinematics import inverse_kinematics, singular_orientations
    from pteron.manipulator.template_masses import template_masses
    from pteron.workspace import home_poses, limited_joints, pose_margins
    from pteron.workspace.examination import examine

    # Refuses a singular layout, and one without a common reach with by how much legs miss it
    both = home_poses(robot)
    home = np.array(both.pose)
    examination = examine(robot, home)
    position = home[: len(robot.platform.lengths)]
    return {
        **_machine(robot),
        "gravity": list(robot.gravity),
        "legs": [
            {**_leg(leg), "at_home": float(joint)}
            for leg, joint in zip(robot.legs, inverse_kinematics(robot, home), strict=True)
        ],
        "singular_orientations": singular_orientations(robot, position).tolist(),
        "singular_at_every_position": bool(len(singular_orientations(robot))),
        "tool": list(robot.platform.tool),
        "home_pose": home.tolist(),
        "home_reserve": float(pose_margins(robot, home).least),
        "home_named": both.named,
        "mirror_pose": None if both.mirror is None else list(both.mirror),
        "holding": asdict(examination.holding),
        "working_modes": [
            json_fields(
                elbows=mode.signs,
                place=mode.place,
                depth=mode.depth,
                pose=mode.pose,
                margin=mode.margin,
                named=mode.named,
                likely=mode.likely,
            )
            for mode in examination.modes
        ],
        "limited_joints": [asdict(joint) for joint in limited_joints(robot, home)],
        "holds_orientation": examination.architecture.holds,
        "self_motions": list(examination.architecture.self_motions),
        "template_masses": template_masses(robot),
        "doubts": list(examination.warnings),
    }


def _leg(leg: LegKind) -> dict[str, Any]:
    """Return a leg's type, joint, lengths, limits, units and drive as JSON data."""
    return {
        "type": leg.type,
        "joint": leg.joint.noun,
        **json_fields(axis=leg.joint_axis),
        "lengths": {q.name: q.value[0] for q in leg.quantities if q.role == "length"},
        **json_fields(elbow=leg.elbow, limits=leg.limits),
        **json_fields(unit=leg.joint.unit, force_unit=leg.joint.force_unit),
        **json_fields(drive=leg.drive, reading=leg.reading),
    }


def _show(robot: Manipulator, findings: dict[str, Any]) -> None:
    """Print the results of a machine's examination: a table of its legs, and sentences."""
    from pteron.manipulator.commented_file import crank_direction_text

    rows = (
        (
            *(str(i), leg["type"], _vector(leg["axis"], 2) if leg["axis"] else "along the leg"),
            ", ".join(f"{length:g}" for length in leg["lengths"].values()) or "-",
            "{:g} to {:g} {}".format(*leg["limits"], leg["unit"]) if leg["limits"] else "none",
            f"{leg['at_home']:.4g} {leg['unit']}",
        )
        for i, leg in enumerate(findings["legs"], start=1)
    )
    headings = ("leg", "type", "joint's axis", "lengths (m)", "limits", "at home")
    angles = ", ".join(f"{math.degrees(angle):.4g}" for angle in findings["singular_orientations"])
    where = "" if findings["singular_at_every_position"] or not angles else " at the home position"
    singular = [f"Singular orientations{where}: {f'{angles} deg' if angles else 'none'}"]
    singular = singular if robot.platform.axis_angle else []
    tool = [f"Tool: {_vector(findings['tool'])} m from P, in the platform frame"]
    tool = tool if any(findings["tool"]) else []
    work = "[green]Fine: the file is valid. This machine can work.[/green]"
    if doubts := len(findings["doubts"]):
        warnings = "the warning" if doubts == 1 else f"the {doubts} warnings"
        work = f"[yellow]This machine can work, if {warnings} above can be left as is.[/yellow]"
    joints = dict.fromkeys(leg.joint for leg in robot.legs)
    show(
        f"[bold]{plain(robot.name)}[/bold]: a {robot.platform.motion} machine with "
        f"{len(robot.legs)} legs, pose {' '.join(robot.coordinates)}, "
        f"working mode {elbows_text(robot)}",
        table(*headings, rows=rows, numbers=("leg",)),
        *(f"A {joint.noun} {joint.zero}." for joint in joints if joint.zero),
        *([f"At 0 cranks point {zero}."] if (zero := crank_direction_text(robot)) else []),
        *_drives(robot),
        *singular,
        *_home_lines(robot, findings),
        *_modes(findings["working_modes"]),
        *_passive(findings["limited_joints"]),
        *tool,
        *([f"Note: {text}"] if (text := findings["template_masses"]) else []),
        *(f"The platform can move with its rams held {text}" for text in findings["self_motions"]),
        work,
    )


def _home_lines(robot: Manipulator, findings: dict[str, Any]) -> list[str]:
    """Return lines on the home pose, its mirror image, and how the drives hold the platform."""
    import numpy as np

    from pteron.workspace.margins import least_margin_text

    margin = least_margin_text(robot, np.array(findings["home_pose"]))
    source = ", from the file" if findings["home_named"] else ""
    lines = [f"Home pose: {_vector(findings['home_pose'])}{source}; least margin {margin}"]
    if findings["mirror_pose"] is not None:
        lines.append(
            f"Its mirror image on the other side of the base: {_vector(findings['mirror_pose'])}; "
            "home is the one along the platform's axis. \\[home] pose in the file names another"
        )
    hold = findings["holding"]
    distance = "none" if hold["distance"] == math.inf else f"{1e3 * hold['distance']:.3g} mm"
    moments = f" (moments over {hold['length']:.3g} m)" if robot.platform.angles else ""
    lines.append(
        f"At home: least singular value {hold['least_singular_value']:.2g} of unit rows{moments}; "
        f"coordinates off by {distance} make it singular"
    )
    if hold["weight"] > 0.0:
        lines.append(
            f"Weight of all bodies: {hold['weight']:.3g} N; a leg holds at most "
            f"{hold['force']:.2g} times as much at home, {hold['force_near']:.2g} about it"
        )
    return lines


def _drives(robot: Manipulator) -> list[Table]:
    """Return a table of the joints' drives; none if the file has none."""
    from pteron.legs.drive_rows import drive_rows

    legs = tuple(f"leg {i}" for i in range(1, robot.joint_count + 1))
    rows = drive_rows(robot.legs)
    cells = ((name, *texts) for name, texts in rows)
    return [table("drive", *legs, rows=cells, numbers=legs)] if rows else []


def _modes(modes: list[dict[str, Any]]) -> list[Table]:
    """Return a table of the working modes: the platform's pose, its least margin, and remarks."""
    rows = []
    for mode in modes:
        said = [*["the file's"] * mode["named"], *["likely"] * mode["likely"]]
        where = ("beyond limits", "-", "-")
        if mode["margin"] > 0.0:
            at = f"({' '.join(f'{coordinate:.3g}' for coordinate in mode['pose'])})"
            where = (f"{mode['place']} the base", at, f"{mode['margin']:.2f}")
        rows.append((mode["elbows"], *where, ", ".join(said)))
    headings = ("elbows", "platform", "pose", "least margin", "which")
    return [table(*headings, rows=rows, numbers=headings[:4])] if rows else []


def _passive(joints: list[dict[str, Any]]) -> list[Table]:
    """Return the passive joints with limits, in the home pose."""
    from pteron.workspace import LimitedJoint

    rows = []
    for joint in (joint for joint in joints if not joint["actuated"]):
        limits = LimitedJoint(**joint).limits_text(lambda coordinate, unit: f"{coordinate:.4g}")
        at, unit = f"{round(joint['value'], 4) + 0.0:g}", joint["unit"]
        rows.append((str(joint["leg"] or ""), joint["noun"], at, f"{limits} {unit}"))
    headings = ("leg", "passive joint", "at home", "limits")
    return [table(*headings, rows=rows, numbers=("leg", "at home"))] if rows else []


def _vector(components: Any, places: int = 4) -> str:
    """Return numbers as text in parentheses, rounded to decimal places."""
    return f"({', '.join(f'{round(component, places) + 0.0:g}' for component in components)})"
