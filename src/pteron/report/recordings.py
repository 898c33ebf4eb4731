"""What is shown of a motion: its samples, and the forces that came with them.

A motion comes from Python, from a simulation, or from a file: a table of poses or of joints, or a
log, whose joints are smoothed as identification does it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pteron.identification.logs import Log, find_description, read_log
from pteron.identification.signals import States, preprocessing_of, samples, spline_motion
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import Motion, Simulation, check_motion, replay
from pteron.tables import Table, read_table
from pteron.workspace import home_pose


@dataclass(frozen=True)
class Recording:
    """A motion with T samples, and the forces of the drives that came with it.

    Attributes
    ----------
    motion : Motion
        What the platform does.
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


Given = Motion | Simulation | Recording | Table | str | Path
"""What a motion is given as."""


def recording(robot: Manipulator, motion: Given) -> Recording:
    """Return a motion as it is to be shown, after a check that the machine can do it.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    motion : Motion, Simulation, Recording, Table, str or path
        A file is a table (CSV or Parquet) of `t` and poses, or of `t` and joints, as `replay` reads
        it; with a TOML file that describes it beside it, or with joints and forces but no rates of
        the pose, it is a log. Joints are followed from the home pose's assembly mode, if the log
        does not tell another.

    Returns
    -------
    Recording

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
    >>> from pteron.report.recordings import recording
    >>> robot = pteron.load("tripteron")
    >>> cycle = pick_and_place(robot, [0.0, 0.0, 0.0], scale=0.5)
    >>> recording(robot, cycle).forces is None
    True
    """
    if isinstance(motion, Recording):
        return motion
    if isinstance(motion, Simulation):
        return Recording(_checked(robot, motion.motion), motion.forces)
    if isinstance(motion, Motion):
        return Recording(_checked(robot, motion))
    if isinstance(motion, Table):
        return of_table(robot, motion)
    if find_description(motion) is None:
        rows = read_table(motion)
        if not (is_measured(robot, rows) and Path(motion).is_file()):
            return of_table(robot, rows)
    return of_log(robot, read_log(motion, robot))


def is_measured(robot: Manipulator, rows: Table) -> bool:
    """Say whether a table has the joints and forces of a log, and no rates of the pose."""
    columns = set(rows.columns)
    rates = {f"d{name}" for name in robot.coordinates}
    return columns.issuperset((*robot.joint_names, *robot.force_names)) and not columns & rates


def of_table(robot: Manipulator, rows: Table) -> Recording:
    """Return the motion of a table, with its forces where it has them all."""
    start = None if set(rows.columns) >= set(robot.coordinates) else home_pose(robot)
    motion = replay(robot, rows, start=start)
    has_forces = set(rows.columns) >= set(robot.force_names)
    forces = rows.numbers(robot.force_names) if has_forces else None
    return Recording(motion, forces, Path(rows.source).name)


def of_log(robot: Manipulator, log: Log) -> Recording:
    """Return the motion of a log's joints, smoothed, with its forces where they are N or N m."""
    # All of it is to be seen, and not the part alone that repeats.
    whole = replace(log, description=replace(log.description, period=None, start=None, end=None))
    how = preprocessing_of(robot, whole)
    if len(log.segments) == 1:
        moves = spline_motion(log.time, log.joints, how.cutoff)
        states = [States.of_joints(robot, moves, log.time, how.start, source=log.source)]
        forces = log.forces
    else:
        # Filters lose what is next to a gap, where a spline would invent a motion.
        parts = list(samples(robot, whole, how))
        states = [part.states for part in parts]
        forces = np.concatenate([part.forces for part in parts])

    def joined(name: str) -> Array:
        return np.concatenate([getattr(one, name) for one in states])

    time = joined("time")
    motion = Motion(time - time[0], joined("pose"), joined("velocity"), joined("acceleration"))
    check_motion(robot, motion)
    # Else they are in a drive's own unit, such as A.
    known = log.description.force_unit == "N"
    return Recording(motion, forces if known else None, Path(log.source).name, log=True)


def _checked(robot: Manipulator, motion: Motion) -> Motion:
    check_motion(robot, motion)
    return motion
