"""Motions to replay in reports and in the viewer, with the forces that came with them.

They come from Python, from a simulation, or from a file: a table of poses or of joints, or a log,
whose joints are smoothed as identification does it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pteron.errors import DataError, shorten, warn_unlikely
from pteron.identification.logs import Description, Log, LogFile, find_description, read_log
from pteron.identification.signals import States, preprocessing_for_log, samples, spline_motion
from pteron.kernels import Array, numeric
from pteron.kinematics.unlikely_values import warn_of_unlikely
from pteron.manipulator import Manipulator
from pteron.manipulator.readings import from_readings, reading_scales
from pteron.motion import Motion, Simulation, check_motion, replay
from pteron.shapes import PoseLike
from pteron.tables import (
    CsvFile,
    Dialect,
    ParquetFile,
    Table,
    convert_to_si,
    open_table,
    read_table,
    whole_table,
)
from pteron.workspace import home_pose

_OTHER = 2e-3
"""Share of a leg's size, or rad, by which joints of a table may be off from its poses: what
calibration corrects on a built machine is less."""

_SLOW = 0.5
"""Time between samples above which a warning is given, s."""


@dataclass(frozen=True)
class Playback:
    """A motion with T samples, and the forces of the drives recorded with it.

    Attributes
    ----------
    motion : Motion
        The platform's motion.
    forces : array, shape (T, n), or None
        N or N m; None where there are none beside the motion.
    source : str
        The name of its file, without the folder; empty where it has none.
    log : bool
        Whether it was measured: poses then follow from smoothed joints.
    """

    motion: Motion
    forces: Array | None = None
    source: str = ""
    log: bool = False
    payload: float | None = None
    """The largest of its column `payload`, kg; None where it has none."""


Given = Motion | Simulation | Playback | Table | Log | str | Path
"""The kinds of motion that `playback` takes."""


def playback(robot: Manipulator, motion: Given, start: PoseLike | None = None) -> Playback:
    """Return a motion, simulation, table, log or file as a `Playback` that the machine can do.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    motion : Motion, Simulation, Playback, Table, Log, str or path
        A file is a table (CSV or Parquet) of `t` and poses, or of `t` and joints, as `replay` reads
        it; with a TOML file that describes it beside it, or with joints and forces but no rates of
        the pose, or other names than these, it is a log.
    start : array, shape (m,), optional
        A pose in the assembly mode of a table's joints, m and rad; by default the home pose.

    Returns
    -------
    Playback

    Raises
    ------
    DataError
        If a file is no table, or a column is missing, or a time does not ascend.
    UnreachablePose, SingularPose
        If the machine cannot do it; the message says where it fails, and which leg.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import pick_and_place
    >>> from pteron.playback import playback
    >>> robot = pteron.load("tripteron")
    >>> cycle = pick_and_place(robot, [0.0, 0.0, 0.0], scale=0.5)
    >>> playback(robot, cycle).forces is None
    True
    """
    if isinstance(motion, Playback):
        return motion
    if isinstance(motion, Simulation):
        return Playback(_check_motion_of(robot, motion.motion), motion.forces)
    if isinstance(motion, Motion):
        return Playback(_check_motion_of(robot, motion))
    if isinstance(motion, str | Path):
        motion = read_motion(robot, motion)
    if isinstance(motion, Log):
        return playback_of_log(robot, motion)
    if not isinstance(motion, Table):
        raise DataError(
            f"motion: {shorten(motion)} given; a Motion, a Simulation, a Table, a Log or a file's "
            "path expected"
        )
    return playback_of_table(robot, motion, start)


def read_motion(robot: Manipulator, path: str | Path) -> Table | Log:
    """Return the table or the log in a file; "-" is a table on standard input."""
    if find_description(path) is not None:
        return read_log(path, robot)
    if not Path(path).is_file():
        return read_table(path)
    plain = open_table(path)
    if is_table(robot, plain.columns):
        return whole_table(plain)
    # Semicolons, decimal commas: a table may be written as logs are.
    dialect_table = open_table(path, dialect=Dialect())
    return (
        whole_table(dialect_table)
        if is_table(robot, dialect_table.columns)
        else read_log(path, robot)
    )


def read_content(robot: Manipulator, data: bytes, source: str) -> Table | Log:
    """Return the table or the log in a file's bytes; `source` is the file's name."""
    if Path(source).suffix.lower() == ".csv":
        plain = CsvFile(data, source)
        if is_table(robot, plain.columns):
            return whole_table(plain)
        dialect_file = CsvFile(data, source, Dialect())
        if is_table(robot, dialect_file.columns):
            return whole_table(dialect_file)
        return LogFile(dialect_file, robot, Description()).read()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "motion.parquet"
        path.write_bytes(data)
        file = ParquetFile(path, source)
        if is_table(robot, file.columns):
            return whole_table(file)
        return LogFile(file, robot, Description()).read()


def is_table(robot: Manipulator, columns: Sequence[str]) -> bool:
    """Return whether columns are those of a motion's table, rather than of a controller's log.

    A log has joints and forces, but no rates of the pose; or all of its columns have other names.
    """
    has = set(columns)
    if has.issuperset((*robot.joint_names, *robot.force_names)):
        return bool(has & {f"d{name}" for name in robot.coordinates})
    if has.intersection((*robot.coordinates, *robot.joint_names)):
        return True
    bare = {name.partition("(")[0].partition("[")[0].strip() for name in columns}
    return bare.issuperset(robot.coordinates) and bare.isdisjoint(robot.joint_names)


def playback_of_table(robot: Manipulator, rows: Table, start: PoseLike | None = None) -> Playback:
    """Return the motion in a table as a `Playback`, with drive forces if all are there."""
    rows = convert_to_si(rows, {**robot.column_units, "t": "s"})
    if start is None and not set(rows.columns) >= set(robot.coordinates):
        start = home_pose(robot)
    motion = replay(robot, rows, start=start)
    _warn_of_other_joints(robot, rows, motion)
    names = [name for name in (*robot.coordinates, *robot.joint_names) if name in rows.columns]
    warn_of_unlikely(robot, names, rows.numbers(names), f"{rows.source}: ")
    if (step := float(np.median(np.diff(motion.time)))) >= _SLOW:
        text = f"{rows.source}: t in steps of {step:g}: are these ms? s are expected"
        warn_unlikely(text)
    has_forces = set(rows.columns) >= set(robot.force_names)
    forces = rows.numbers(robot.force_names) / reading_scales(robot) if has_forces else None
    heaviest = rows.numbers(["payload"]).max() if "payload" in rows.columns else None
    return Playback(motion, forces, Path(rows.source).name, payload=heaviest)


def _warn_of_other_joints(robot: Manipulator, rows: Table, motion: Motion) -> None:
    """Warn if the joints of a table are not those of its poses."""
    if not set(rows.columns) >= {*robot.coordinates, *robot.joint_names}:
        return
    joints = from_readings(robot, rows.numbers(robot.joint_names))
    off = np.abs(numeric(robot, "joint_coordinates")(motion.pose)[0] - joints)
    share = off / [leg.size if leg.joint.unit == "m" else 1.0 for leg in robot.legs]
    if len(share) and (most := float(np.nanmax(share))) > _OTHER:
        k, i = np.unravel_index(np.nanargmax(share), share.shape)
        leg = robot.legs[i]
        warn_unlikely(
            f"{rows.source}: row {k + 1}: {robot.joint_names[i]} is off by {off[k, i]:.3g} "
            f"{leg.joint.unit}, {most:.1%} of the leg, from that of its pose: are they of another "
            "machine, or about another point (--pivot)? The poses count"
        )


def playback_of_log(robot: Manipulator, log: Log) -> Playback:
    """Return the smoothed motion of a log's joints as a `Playback`, with forces if in N or N m."""
    # All of it is to be seen, and not the part alone that repeats.
    whole_log = replace(
        log, description=replace(log.description, period=None, start=None, end=None)
    )
    how = preprocessing_for_log(robot, whole_log)
    if len(log.segments) == 1:
        moves = spline_motion(log.time, log.joints, how.cutoff)
        states = [States.from_joints(robot, moves, log.time, how.start, source=log.source)]
        forces = log.forces
    else:
        # Filters lose what is next to a gap, where a spline would invent a motion.
        parts = list(samples(robot, whole_log, how))
        states = [part.states for part in parts]
        forces = np.concatenate([part.forces for part in parts])

    def join_columns(name: str) -> Array:
        """Return the column `name` of all segments of the log, joined, (T, ...)."""
        return np.concatenate([getattr(state, name) for state in states])

    time = join_columns("time")
    motion = Motion(
        time - time[0], join_columns("pose"), join_columns("velocity"), join_columns("acceleration")
    )
    check_motion(robot, motion)
    # Else they are in a drive's own unit, such as A.
    known = log.description.force_unit == "N"
    return Playback(motion, forces if known else None, Path(log.source).name, log=True)


def _check_motion_of(robot: Manipulator, motion: Motion) -> Motion:
    """Return the motion; raise if the machine cannot do it."""
    check_motion(robot, motion)
    return motion
