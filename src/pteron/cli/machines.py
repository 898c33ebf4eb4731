"""`pteron catalog` and `check`: the machines that come with Pteron, and the user's own."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

from typer import Exit

from pteron.cli.arguments import elbows_text, load_robot
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import complain, plain, show, table, warn
from pteron.errors import ModelError, PteronError
from pteron.json_values import json_fields
from pteron.short_numbers import runs_text

if TYPE_CHECKING:
    from rich.table import Table

    from pteron.legs import LegKind
    from pteron.manipulator import Manipulator

_FAULTY = 2
"""Exit code for a faulty file."""

_JOINTS = {"P": "prismatic", "R": "revolute", "S": "spherical", "U": "universal"}
"""The joints that the letters of a leg's type stand for."""


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
    legs = [leg for name in descriptions() for leg in kept_machine(name)[0].legs]
    lines = (
        "Motion: degrees of freedom of the platform, such as 3T1R: 3 translations, 1 rotation.",
        _legs_text(legs),
        "Next: pteron view NAME, or pteron new NAME --out robot.toml for a machine of your own.",
    )
    return CommandResult(machines, [machine_table, *lines])


def _legs_text(legs: Sequence[LegKind]) -> str:
    """Return sentences on the letters of the legs' types, and which of their joints is actuated."""
    # The S of SRRR is no joint: its axes meet in a point.
    spherical = dict.fromkeys(leg.type for leg in legs if leg.platform_center is not None)
    joint_types = [leg.type[leg.type in spherical :] for leg in legs]
    letters = [letter for letter in _JOINTS if any(letter in name for name in joint_types)]
    joints = ", ".join(f"{letter} {_JOINTS[letter]}" for letter in letters)
    actuated: dict[str, list[str]] = {}
    for leg in legs:
        types = actuated.setdefault("P" if leg.joint.unit == "m" else "first R", [])
        types += [leg.type] * (leg.type not in types)
    texts = (f"the {joint} of {', '.join(types)}" for joint, types in actuated.items())
    text = f"Joints from base to platform: {joints}; actuated: {'; '.join(texts)}."
    return " ".join([text, *(f"{kind}: spherical, all axes meet." for kind in spherical)])


def _machine(robot: Manipulator) -> dict[str, Any]:
    """Return a machine's name, motion, coordinates, leg types and working mode as JSON data."""
    return {
        "name": robot.name,
        "motion": robot.platform.motion,
        "coordinates": list(robot.coordinates),
        "types": list(dict.fromkeys(leg.type for leg in robot.legs)),
        "working_mode": elbows_text(robot),
    }


def check(file: str, *, elbows: str | None = None, all_: bool = False) -> CommandResult:
    """Check a machine's file and describe the machine.

    The check fails, with exit code 2, if the file is not valid (all faults are reported), if the
    machine is singular at every pose within the rounding of the file, or if no pose is in reach of
    all legs. Otherwise the exit code is 0, and what is possible but unlikely is a warning, such as
    a length in millimetres, a centre of mass beyond its link, or legs that look swapped.

    The output shows the legs, the home pose, how well the drives hold the platform there, beside
    the thresholds (docs/verdicts.md explains them), and where the platform is in each working mode:
    above the base, below or inside. Of more than eight modes it shows the file's, its opposite, and
    those with all elbow signs equal. Equal legs share a row.

    Arguments
    ---------
    FILE: A machine's TOML file.

    Options
    -------
    --all: Show a row for every leg and joint, even if all are equal.

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
        with spinner(f"Examining {robot.name}"):
            findings = _findings(robot)
        warn(findings["doubts"][len(unlikely) :], f"{file}: ")
    except PteronError as error:
        raise ModelError(error.message, subject=file) from None
    place = plain(file)
    further = f"Next: pteron cycle {place}, pteron size {place}, pteron report {place} --out DIR"
    return CommandResult(findings, partial(_show, robot, findings, further, each=all_))


def _findings(robot: Manipulator) -> dict[str, Any]:
    """Return the results of a machine's examination as JSON data: home, reach, modes, warnings."""
    import numpy as np

    from pteron.kinematics import inverse_kinematics, singular_orientations
    from pteron.manipulator.template import template_sentence
    from pteron.workspace import home_poses, limited_joints, pose_margins
    from pteron.workspace.examination import examine
    from pteron.workspace.redundancy import redundancy

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
        **({"redundancy": redundancy(robot, home).as_dict()} if robot.redundancy else {}),
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
        "template": template_sentence(robot),
        "doubts": list(examination.warnings),
    }


def _leg(leg: LegKind) -> dict[str, Any]:
    """Return a leg's type, joint, lengths, limits, units and drive as JSON data."""
    return {
        "type": leg.type,
        "joint": leg.joint.noun,
        **json_fields(axis=leg.joint_axis),
        "lengths": {q.name: q.value[0] for q in leg.quantities if q.role == "length"},
        "arcs": {name: getattr(leg, name) for name, key in leg.keys.items() if key.role == "angle"},
        **json_fields(**{"elbow": leg.elbow, **leg.signs}, limits=leg.limits),
        **json_fields(unit=leg.joint.unit, force_unit=leg.joint.force_unit),
        **json_fields(drive=leg.drive, reading=leg.reading),
    }


def _show(robot: Manipulator, findings: dict[str, Any], further: str, *, each: bool) -> None:
    """Print the results of a machine's examination: verdict, tables, sentences, what is next.

    Equal legs share a row unless `each` has one.
    """
    from pteron.manipulator.crank_direction import crank_direction_text

    joints = dict.fromkeys(leg.joint for leg in robot.legs)
    counts = re.findall(r"(\d)([TR])", robot.platform.motion)
    nouns = {"T": "translation", "R": "rotation"}
    bends = any(len(leg.sign_choices()) > 1 for leg in robot.legs)
    elbows = f", elbow signs {elbows_text(robot)} (side to which each leg bends)" * bends
    freedoms = " and ".join(f"{n} {nouns[letter]}{'s' * (n != '1')}" for n, letter in counts)
    show(
        f"[bold]{plain(robot.name)}[/bold]: {_verdict(findings)}",
        f"Platform: {robot.platform.motion} ({freedoms}), pose {' '.join(robot.coordinates)}. "
        f"{len(robot.legs)} legs{elbows}.",
        _legs_table(findings["legs"], each=each),
        _legs_text(robot.legs),
        *(f"Coordinate of a {joint.noun}: {joint.zero}." for joint in joints if joint.zero),
        *([f"Cranks at 0: {zero}."] if (zero := crank_direction_text(robot)) else []),
        *_drives(robot, each=each),
        *_pose_lines(robot, findings),
        _home_table(robot, findings),
        *_redundancy(robot, findings),
        *_modes(findings["working_modes"]),
        *_passive(findings["limited_joints"], each=each),
        *([f"Note: {plain(text)}"] if (text := findings["template"]) else []),
        *(
            f"The platform can move with its rams locked {text}"
            for text in findings["self_motions"]
        ),
        further,
    )


def _verdict(findings: dict[str, Any]) -> str:
    """Return whether the machine can work, and what to do."""
    if not (doubts := len(findings["doubts"])):
        return "[green]the file is valid; this machine can work.[/green]"
    warnings = "the warning" if doubts == 1 else f"the {doubts} warnings"
    return f"[yellow]the file is valid; this machine can work. Check {warnings} above.[/yellow]"


def _legs_table(legs: list[dict[str, Any]], *, each: bool) -> Table:
    """Return a table of the legs: type, axis of the actuated joint, lengths, limits, coordinate."""
    rows: dict[tuple[str, ...], list[tuple[int, float]]] = {}
    for i, leg in enumerate(legs, start=1):
        row = (
            *(leg["type"], _vector(leg["axis"], 2) if leg["axis"] else "along the leg"),
            ", ".join(f"{length:g}" for length in leg["lengths"].values())
            or ", ".join(f"{math.degrees(arc):.4g} deg" for arc in leg["arcs"].values())
            or "-",
            "{:.4g} to {:.4g} {}".format(*leg["limits"], leg["unit"]) if leg["limits"] else "none",
            leg["unit"],
        )
        rows.setdefault((*row, str(i)) if each else row, []).append((i, leg["at_home"]))
    cells = (
        (
            runs_text([i for i, _ in members]),
            *row[:4],
            _range([at_home for _, at_home in members], row[4]),
        )
        for row, members in rows.items()
    )
    headings = ("leg", "joints", "actuated axis", "links (m)", "joint limits", "at home")
    return table(*headings, rows=cells, numbers=("leg",))


def _range(coordinates: Sequence[float], unit: str) -> str:
    """Return the range of the coordinates of equal joints as text, one number if all are equal."""
    rounded = (round(coordinate, 4) + 0.0 for coordinate in (min(coordinates), max(coordinates)))
    return f"{' to '.join(dict.fromkeys(f'{coordinate:g}' for coordinate in rounded))} {unit}"


def _pose_lines(robot: Manipulator, findings: dict[str, Any]) -> list[str]:
    """Return lines on singular orientations, the tool, and the home pose and its mirror image."""
    lines = []
    if robot.platform.axis_angle:
        angles = ", ".join(f"{math.degrees(a):.4g}" for a in findings["singular_orientations"])
        everywhere = findings["singular_at_every_position"]
        where = "" if everywhere or not angles else " at the home position"
        reason = " (type II: the drives cannot hold the platform there)" if angles else ""
        angles = f"phi = {angles} deg" if angles else "none"
        lines.append(f"Singular orientations{where}: {angles}{reason}")
    if any(findings["tool"]):
        lines.append(f"Tool: {_vector(findings['tool'])} m from P, in the platform frame")
    source = ", from the file" if findings["home_named"] else ""
    units = " and ".join(dict.fromkeys(robot.units))
    lines.append(f"Home pose: {_vector(findings['home_pose'])} {units}{source}")
    if findings["mirror_pose"] is not None:
        lines.append(
            f"Its mirror image on the other side of the base: {_vector(findings['mirror_pose'])}; "
            "home is the one along the platform's axis. \\[home] pose in the file chooses another"
        )
    return lines


def _home_table(robot: Manipulator, findings: dict[str, Any]) -> Table:
    """Return a table of the measures at the home pose beside their thresholds."""
    import numpy as np

    from pteron.thresholds import (
        HOLDING_FORCE,
        HOLDING_FORCE_NEAR,
        INACCURATE,
        LEAST_SINGULAR_VALUE,
    )
    from pteron.workspace.margins import least_margin_text

    hold = findings["holding"]
    moments = f" (moments / {hold['length']:.3g} m)" if robot.platform.angles else ""
    distance = "none" if hold["distance"] == math.inf else f"{1e3 * hold['distance']:.3g} mm"
    least = 1.0 / hold["least_singular_value"] if hold["least_singular_value"] else math.inf
    margin, cause = least_margin_text(robot, np.array(findings["home_pose"]))
    rows = [
        (f"smallest margin: to {cause}", margin, "above 0 %"),
        (
            f"largest leg force over load{moments}",
            *(f"{least:.2g}", f"at most {1.0 / LEAST_SINGULAR_VALUE:g}"),
        ),
        (
            "geometric error that makes it singular",
            *(distance, f"above {1e3 * INACCURATE * hold['rounding']:.2g} mm"),
        ),
    ]
    if hold["weight"] > 0.0:
        weight = f"largest leg force over weight of bodies ({hold['weight']:.3g} N)"
        rows += [
            (weight, f"{hold['force']:.2g}", f"at most {HOLDING_FORCE:g}"),
            (
                "the same, at poses near home",
                f"{hold['force_near']:.2g}",
                f"at most {HOLDING_FORCE_NEAR:g}",
            ),
        ]
    return table("at the home pose", "value", "good if", rows=rows, numbers=("value", "good if"))


def _redundancy(robot: Manipulator, findings: dict[str, Any]) -> list[Any]:
    """Return a table of internal forces and lost drives, and a sentence; [] for n = m."""
    import numpy as np

    from pteron.thresholds import LEAST_SINGULAR_VALUE
    from pteron.workspace.redundancy import ASSUMED_STIFFNESS, ZERO_ERROR

    if (analysis := findings.get("redundancy")) is None:
        return []
    greatest = np.abs(analysis["internal_force"]).max(axis=1)
    rows = []
    for i, (leg, force, least) in enumerate(
        zip(robot.legs, greatest, analysis["least_singular_value"], strict=True), start=1
    ):
        ratio = f"{1.0 / least:.2g}" if least > 0.0 else "-"
        is_held = "held" if least >= LEAST_SINGULAR_VALUE else "not held"
        rows.append((str(i), f"{force:.3g} {leg.joint.force_unit}", is_held, ratio))
    error = f"{1e3 * ZERO_ERROR:g} mm"
    stiffness = (
        f" Drives without elastic.stiffness are taken as {1e-6 * ASSUMED_STIFFNESS:g} N/um along "
        "their leg."
        if analysis["assumed"]
        else ""
    )
    headings = ("leg", "internal force", "without its drive", "leg force over load then")
    return [
        table(*headings, rows=rows, numbers=headings[:2] + headings[3:]),
        f"{robot.joint_count} drives for {robot.freedom} freedoms fight under position control. "
        f"Internal force: the greatest of any drive where this leg's zero is wrong by {error} "
        f"along the leg.{stiffness}",
    ]


def _drives(robot: Manipulator, *, each: bool) -> list[Table]:
    """Return a table of the joints' drives, equal ones in one column; none if the file has none."""
    from pteron.legs.drive_rows import drive_rows

    if not (rows := drive_rows(robot.legs)):
        return []
    columns: dict[tuple[str, ...], list[int]] = {}
    for i, texts in enumerate(zip(*(texts for _, texts in rows), strict=True), start=1):
        columns.setdefault((*texts, str(i)) if each else texts, []).append(i)
    headings = [f"leg{'s' * (len(legs) > 1)} {runs_text(legs)}" for legs in columns.values()]
    cells = ((name, *(texts[k] for texts in columns)) for k, (name, _) in enumerate(rows))
    return [table("drive", *headings, rows=cells, numbers=tuple(headings))]


def _modes(modes: list[dict[str, Any]]) -> list[Table]:
    """Return a table of the working modes: the platform's pose, its least margin, and remarks."""
    rows = []
    for mode in modes:
        remarks = [*["in the file"] * mode["named"], *["likely meant"] * mode["likely"]]
        where = ("beyond limits", "-", "-")
        if mode["margin"] > 0.0:
            at = f"({' '.join(f'{q:.3g}' for q in mode['pose'])})"
            where = (f"{mode['place']} the base", at, f"{100.0 * mode['margin']:.0f} %")
        rows.append((mode["elbows"], *where, ", ".join(remarks)))
    headings = ("elbow signs", "platform", "at its best pose", "margin", "working mode")
    return [table(*headings, rows=rows, numbers=headings[:4])] if rows else []


def _passive(joints: list[dict[str, Any]], *, each: bool) -> list[Table]:
    """Return a table of the passive joints with limits at home, equal joints in one row."""
    from pteron.workspace import LimitedJoint

    rows: dict[tuple[str, ...], list[tuple[int, float]]] = {}
    for joint in (joint for joint in joints if not joint["actuated"]):
        limits = LimitedJoint(**joint).limits_text(lambda coordinate, unit: f"{coordinate:.4g}")
        row = (joint["noun"], joint["unit"], f"{limits} {joint['unit']}")
        members = rows.setdefault((*row, str(joint["leg"])) if each else row, [])
        members.append((joint["leg"] or 0, joint["value"]))
    cells = (
        (
            runs_text([leg for leg, _ in members if leg]),
            row[0],
            _range([coordinate for _, coordinate in members], row[1]),
            row[2],
        )
        for row, members in rows.items()
    )
    headings = ("legs", "passive joint", "at home", "limits")
    return [table(*headings, rows=cells, numbers=("at home",))] if rows else []


def _vector(components: Any, places: int = 4) -> str:
    """Return numbers as text in parentheses, rounded to decimal places."""
    return f"({', '.join(f'{round(component, places) + 0.0:g}' for component in components)})"
