"""`pteron cycle`: a motion of the machine, planned and written as a table, and its peak loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Literal

from pteron.cli.arguments import MachineArgument, about_pivot, check_rate, parsed_list
from pteron.cli.motion_argument import Carried, given_pose, read_motion
from pteron.cli.motion_table import motion_frame, peaks_table, travel_text
from pteron.cli.planned_motions import joint_motion, line_motion, standard_motion
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import note, plain, show
from pteron.errors import DataError
from pteron.json_values import json_fields
from pteron.tolerances import SAME

if TYPE_CHECKING:
    from rich.table import Table

    from pteron.manipulator import Manipulator
    from pteron.motion import Motion, MotionLimits

Kind = Literal["adept", "line", "joints", "replay"]
"""Kinds of motion: pick-and-place, straight line, motion of the joints, or one from a table."""

_KINDS_OF: dict[str, tuple[Kind, ...]] = {
    "to": ("line", "joints"),
    "via": ("line",),
    "from": ("line", "joints", "replay"),
    "corner": ("line",),
    "back": ("line",),
    "around": ("adept",),
    "scale": ("adept",),
    "table": ("replay",),
    "optimal": ("line", "adept"),
    "duration": ("line", "adept"),
    "jerk": ("joints",),
}
"""Kinds of motion that an option belongs to."""

_NOUNS = {
    "adept": "standard pick-and-place cycle",
    "line": "straight lines",
    "joints": "motion straight in the joint coordinates",
    "replay": "motion of the table",
}
"""The kinds of motion in words."""

_DENSE = 10
"""Moments per sample at which a motion's peaks are sought."""


def cycle(
    machine: MachineArgument,
    *,
    kind: Kind | None = None,
    from_: str | None = None,
    to: str | None = None,
    via: str | None = None,
    corner: float = 0.0,
    back: bool = False,
    around: str | None = None,
    scale: float | None = None,
    table: str | None = None,
    duration: float | None = None,
    optimal: bool = False,
    law: Literal["quintic", "seventh"] = "quintic",
    rate: float | None = None,
    speed: str | None = None,
    acceleration: str | None = None,
    force: str | None = None,
    jerk: str | None = None,
    tool_speed: float | None = None,
    tool_acceleration: float | None = None,
    carried: Carried,
    pivot: str | None = None,
    out: str | None = None,
) -> CommandResult:
    """Plan a motion within limits, and compute the speeds and forces that it needs of the drives.

    The motion is the standard pick-and-place cycle (25 mm up, 305 mm across, 25 mm down, and back),
    straight lines to a pose or through the poses of a table, a motion of the joints to a pose with
    limited jerk, or one read from a table. Without --duration it takes the shortest time within the
    limits of the options and of the machine's drives; the whole motion is slowed alike. With
    --optimal it is as fast as the limits allow at every point of the path.

    The file's columns are t x y z phi dx ... ddx ... of the pose, rho1 ... drho1 ... ddrho1 ... of
    the joints (theta1 of cranks), and force1 ... (torque1) of the drives: pteron forces --table
    reads it. --speed, --acceleration, --force and --jerk take one number, or one for each joint.

    Path
    ----
    --kind: Kind of motion: pick-and-place cycle (adept), straight lines of the platform, joints
        moved straight in joint space, or replay of a table. [default: adept, or the kind that --to,
        --via or --table implies]
    --from POSE: Start pose. [default: the home pose]
    --to POSE: End pose; a pose is its numbers, m and rad, or home.
    --via FILE: Table of poses to pass, a .csv or .parquet file.
    --corner: Distance from a corner, m, at which the path is rounded; 0 stops at the corner.
    --back: Return to the start by the same path.
    --around POSE: Centre of the pick-and-place cycle. [default: the home pose]
    --scale: Size of the pick-and-place cycle; 1 is 25 mm x 305 mm. [default: the largest that fits]
    --table FILE: Table of the motion to replay: t and poses, or t and joints.

    Time
    ----
    --duration: Duration of the whole motion, s. [default: the shortest within the limits]
    --optimal: Minimise the time along the path: at each point a limit is reached.
    --law: Time law of a line: polynomial of degree five or seven.
    --rate: Samples per second. [default: 1000, or a multiple where the motion needs them]

    Limits
    ------
    --speed NUMBERS: Joint speed, m/s or rad/s. [default: max_speed of the drives]
    --acceleration NUMBERS: Joint acceleration, m/s^2 or rad/s^2.
    --force NUMBERS: Drive force, N or N m. [default: max_force of the drives]
    --jerk NUMBERS: Joint jerk, m/s^3 or rad/s^3, with --kind joints.
    --tool-speed: Tool speed, m/s.
    --tool-acceleration: Tool acceleration, m/s^2.

    Options
    -------
    --out FILE: Write the samples to a .csv or .parquet file.

    Examples
    --------
    pteron cycle quadrupteron
    pteron cycle my-robot.toml --optimal --force 60 --payload 0.5 --out cycle.csv
    pteron cycle tripteron --to 0.1 0 0.05 --back --acceleration 10 --out line.csv
    pteron cycle delta --via poses.csv --corner 0.02 --duration 2 --out path.csv
    """
    from pteron.manipulator.template import template_sentence
    from pteron.motion import limits_of

    if text := template_sentence(machine):
        note(f"Note: {text}")
    machine = about_pivot(carried.load_machine(machine), pivot)
    if rate is not None:
        check_rate(rate)
    if out is not None:
        from pteron.tables import check_output

        check_output(out)
    joint_limits = {"speed": speed, "acceleration": acceleration, "force": force}
    lists = {name: parsed_list(text, f"--{name}") for name, text in joint_limits.items()}
    limits = limits_of(machine, **lists, tool_speed=tool_speed, tool_acceleration=tool_acceleration)
    way = kind or ("replay" if table else "line" if to or via else "adept")
    options: dict[str, object] = {"to": to, "via": via, "from": from_}
    options |= {"corner": corner, "back": back}
    options |= {"around": around, "scale": scale, "table": table, "optimal": optimal}
    _expect_fitting(way, options | {"duration": duration, "jerk": jerk})
    if way == "replay" and table is None:
        raise DataError("no motion given; give --table FILE")
    with spinner(f"Planning a motion of {machine.name}"):
        step = None if rate is None else 1.0 / rate
        if table is not None:
            start = None if from_ is None else given_pose(machine, from_, "--from")
            motion = read_motion(machine, table, start)
        elif way == "joints":
            motion = joint_motion(machine, from_, to, parsed_list(jerk, "--jerk"), limits, step)
        elif way == "line":
            motion = line_motion(
                machine, from_, to, via, corner, back, limits, duration, optimal, law, step
            )
        else:
            motion = standard_motion(machine, around, scale, limits, duration, optimal, step)
    return _result(machine, way, motion, limits, carried, out)


def _expect_fitting(way: str, options: Mapping[str, object]) -> None:
    """Raise DataError on options of another kind of motion, or two that set its duration."""
    if options["optimal"] and options["duration"] is not None:
        raise DataError("--duration and --optimal given; give one of them")
    for name, option in options.items():
        if option not in (None, False, 0.0) and way not in _KINDS_OF[name]:
            raise DataError(
                f"--{name}: has no use in a motion of kind {way}; leave it out, or give --kind "
                f"{' or '.join(_KINDS_OF[name])}"
            )


def _result(
    machine: Manipulator,
    way: str,
    motion: Motion,
    limits: MotionLimits,
    carried: Carried,
    out: str | None,
) -> CommandResult:
    """Write the motion's table if a file is named, and return its summary with the peak loads."""
    import numpy as np

    from pteron.motion import peaks
    from pteron.motion.sizing.friction_sentence import friction_sentence

    count = _DENSE * (len(motion.time) - 1) + 1
    fine = np.linspace(float(motion.time[0]), float(motion.time[-1]), count)
    largest = peaks(machine, *motion.at(fine), limits)
    for peak in largest:
        if peak.share > 1.0 + SAME:  # of a motion that came in a table
            note(f"Note: {peak.phrase()}")
    if out is not None:
        from pteron.tables import write_table

        write_table(motion_frame(machine, motion), out)
    bound = getattr(motion, "polynomial", None)
    record = {
        "robot": machine.name,
        "kind": way,
        **asdict(carried),
        "duration": motion.duration,
        "samples": len(motion.time),
        "start": motion.pose[0].tolist(),
        "end": motion.pose[-1].tolist(),
        "quintic_duration": bound,
        "scale": getattr(motion, "scale", None),
        "peaks": [
            json_fields(
                quantity=p.name, leg=p.leg, size=p.size, unit=p.unit, limit=p.limit, share=p.share
            )
            | {"leg": p.leg or None}
            for p in largest
        ],
        "file": out,
    }
    text = (
        f"[bold]{plain(machine.name)}[/bold]{plain(str(carried))}, {_NOUNS[way]}: "
        f"{motion.duration:.4g} s ({len(motion.time)} samples)"
    )
    if bound is not None:
        text += f"; a polynomial of degree 5 along the same path takes {bound:.4g} s"
    friction = friction_sentence(machine)
    text += f". Travel: {travel_text(machine, motion)}."
    return CommandResult(
        record | {"friction": friction},
        partial(_show, [text, peaks_table(largest), friction], out),
        [out] if out else [],
    )


def _show(lines: list[str | Table], out: str | None) -> None:
    """Print the lines and tables, and a hint to `--out` where no file was written."""
    show(*lines)
    if out is None:
        note("Note: no file is written; --out FILE.csv saves the motion")
