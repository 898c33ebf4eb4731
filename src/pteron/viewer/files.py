"""A motion from a file that a person gives the viewer: a motion, joints, a simulation or a log."""

from __future__ import annotations

import tempfile
from pathlib import Path, PurePath

import numpy as np

from pteron.errors import DataError, shown
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import Motion, replay
from pteron.motion.trajectories.checks import check_motion
from pteron.tables import ENDINGS, CsvFile, Dialect, ParquetFile, whole_table

_LARGEST = 100 << 20
"""Bytes of a file that is shown; a longer one takes minutes to follow."""


def motion_of_file(robot: Manipulator, name: str, data: bytes, start: Array) -> Motion:
    """Return the motion that a file holds.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    name : str
        The file's name: its ending says whether it is CSV or Parquet.
    data : bytes
        What is in it. A table with t and the pose, or t and the joints, is replayed as
        `pteron.motion.replay` does, as are the tables of `pteron cycle` and `pteron simulate`;
        anything else is read as a log, in whatever dialect, and smoothed.
    start : array, shape (m,)
        A pose in the assembly mode of the joints, m and rad.

    Returns
    -------
    Motion

    Raises
    ------
    DataError
        If it is no such file; the message says where and why.
    UnreachablePose, SingularPose
        If the machine cannot do the motion.
    """
    source = shown(PurePath(name).name, bare=True) or "the file"
    ending = PurePath(name).suffix.lower()
    if ending not in ENDINGS:
        raise DataError(f"{source}: a motion's file ends in {' or '.join(ENDINGS)}")
    if len(data) > _LARGEST:
        size, most = len(data) >> 20, _LARGEST >> 20
        raise DataError(f"{source}: {size} MB given, {most} MB or less expected; cut a part out")
    if not data:
        raise DataError(f"{source}: is empty")
    if ending == ".csv":
        plain = CsvFile(data, source)
        if _is_motion(robot, plain.columns):
            return replay(robot, whole_table(plain), start=start)
        return _motion_of_log(robot, CsvFile(data, source, Dialect()))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"motion{ending}"
        path.write_bytes(data)
        file = ParquetFile(path, source)
        if _is_motion(robot, file.columns):
            return replay(robot, whole_table(file), start=start)
        return _motion_of_log(robot, file)


def _is_motion(robot: Manipulator, columns: tuple[str, ...]) -> bool:
    """Say whether columns are those of a motion as Pteron writes it, rather than of any log."""
    has = set(columns)
    return "t" in has and (has.issuperset(robot.coordinates) or has.issuperset(robot.joint_names))


def _motion_of_log(robot: Manipulator, file: CsvFile | ParquetFile) -> Motion:
    """Return what a log says the platform did, its noise kept out."""
    from pteron.identification.logs import Description
    from pteron.identification.logs.log_file import LogFile
    from pteron.identification.signals import preprocessing_of, samples

    log = LogFile(file, robot, Description()).read()
    found = [block.states for block in samples(robot, log, preprocessing_of(robot, log))]
    parts = ("time", "pose", "velocity", "acceleration")
    motion = Motion(*(np.concatenate([getattr(one, name) for one in found]) for name in parts))
    check_motion(robot, motion)
    return motion
