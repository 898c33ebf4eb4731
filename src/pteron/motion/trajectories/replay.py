"""`replay`: the motion in a table of poses, or of joint coordinates, over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path as File
from typing import Any

import numpy as np
import polars as pl
import scipy  # type: ignore[import-untyped]

from pteron.arguments import expect
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics import follow
from pteron.kinematics.evaluate import evaluate_unchecked, finite_rows
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.manipulator.readings import from_readings
from pteron.motion.motion import Motion
from pteron.motion.trajectories.checks import check_motion
from pteron.shapes import Columns, PoseLike
from pteron.tables import Table, convert_to_si, join_names, read_table

TIME = "t"
"""The column of the time, s."""

_DEGREE = 5
"""Degree of the interpolating spline."""


def replay(
    robot: RobotLike, table: str | File | Table | Columns, *, start: PoseLike | None = None
) -> Motion:
    """Return the motion recorded in a table of poses or joint coordinates over time.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    table : path, Table, DataFrame or mapping
        CSV or Parquet, or a table that is there already, of pandas or polars. Its columns are t (s)
        and the pose's, such as x y z phi, or t and the joints', such as rho1 theta2. With the
        poses' velocities and accelerations (dx ... ddx ...) these count; else they are those of the
        interpolating spline of the fifth degree, for which samples must be smooth.
    start : array, shape (m,), optional
        A pose in the assembly mode of the joints, from which a straight path leads to the table's
        first row; needed where there are joints only.

    Returns
    -------
    Motion
        With the table's own times, which begin at 0.

    Raises
    ------
    DataError
        If a column is missing, a cell is no number, or times do not ascend.
    UnreachablePose, SingularPose
        If the machine cannot do it; see `check_motion`.

    Examples
    --------
    >>> import numpy as np, polars as pl, pteron
    >>> from pteron.motion import replay
    >>> t = np.linspace(0.0, 1.0, 101)
    >>> wave = pl.DataFrame({"t": t, "x": 0.1 * np.sin(t), "y": 0.0 * t, "z": 0.0 * t})
    >>> float(replay("tripteron", wave).velocity[0, 0].round(9))
    0.1
    """
    robot = as_manipulator(robot)
    names = robot.column_names
    poses, joints = names["pose"], names["joints"]
    motion_columns = [*poses, *names["velocity"], *names["acceleration"]]
    rows = rows_of(table, [TIME, *motion_columns, *joints])
    rows = convert_to_si(rows, {**robot.column_units, TIME: "s"})
    has = set(rows.columns)
    m = robot.freedom
    if has.issuperset(motion_columns):
        time, columns = _read_columns(rows, motion_columns)
        columns[:, :m] = _unwrap_angles(robot, columns[:, :m])
        motion = Motion(time, columns[:, :m], columns[:, m : 2 * m], columns[:, 2 * m :])
    elif has.issuperset(joints) and not has.issuperset(poses):
        time, columns = _read_columns(rows, joints)
        motion = _follow_joints(robot, time, columns, start)
    else:
        time, columns = _read_columns(rows, poses)
        columns = _unwrap_angles(robot, columns)
        motion = Motion(time, *_spline(time, columns))
    check_motion(robot, motion, lambda at: _place(rows, motion, at))
    return motion


def _place(rows: Table, motion: Motion, at: float) -> str:
    """Return as text which table row is at or before a time, s."""
    k = int(np.searchsorted(motion.time, at, side="right")) - 1
    return f"{rows.place(max(k, 0))}, at {at:.4g} s"


def rows_of(source: str | File | Table | Columns, useful: Sequence[str]) -> Table:
    """Return `source` as a table: a table as it is, a file read, columns of an object taken."""
    if isinstance(source, Table):
        return source
    if isinstance(source, str | File):
        return read_table(source)
    columns: Any = source
    names = list(columns if isinstance(columns, Mapping) else getattr(columns, "columns", ()))
    try:
        frame = pl.DataFrame({name: np.asarray(columns[name]) for name in useful if name in names})
    except (TypeError, ValueError, pl.exceptions.PolarsError):
        raise DataError("table: columns of numbers expected, as long as each other") from None
    if TIME not in names or not frame.height:
        what = "no rows" if TIME in names else f"no column {TIME}, the time in s"
        raise DataError(f"table: {what}; its columns are {join_names(list(map(str, names)))}")
    return Table("table", frame)


def _read_columns(rows: Table, columns: Sequence[str]) -> tuple[Array, Array]:
    """Return times (T,), s, starting from 0, and the named columns (T, K) of a table."""
    numbers = rows.numbers([TIME, *columns])
    time = numbers[:, 0]
    expect(len(time) >= 2, rows.source, "one row", "at least two")
    not_ascending = np.flatnonzero(np.diff(time) <= 0.0)
    if len(not_ascending):
        k = int(not_ascending[0]) + 1
        raise DataError(
            f"{rows.place(k)}, column {TIME}: {time[k]:g} s after {time[k - 1]:g} s; times must "
            "ascend"
        )
    return time - time[0], numbers[:, 1:]


def _unwrap_angles(robot: Manipulator, poses: Array) -> Array:
    """Return poses (T, m) with angles made continuous where a table has jumps by a turn."""
    return np.where(robot.platform.angular, np.unwrap(poses, axis=0), poses)


def _spline(time: Array, samples: Array) -> tuple[Array, Array, Array]:
    """Return samples (T, K) and two time derivatives of the spline through them."""
    degree = min(_DEGREE, len(time) - 1)
    spline = scipy.interpolate.make_interp_spline(time, samples, k=degree)
    orders = (
        np.asarray(spline.derivative(k)(time)) if k <= degree else 0.0 * samples for k in (1, 2)
    )
    return (samples, *orders)  # type: ignore[return-value]


def _follow_joints(
    robot: Manipulator, time: Array, joints: Array, start: PoseLike | None
) -> Motion:
    """Return the platform's motion for joint coordinates (T, n) at times (T,), from a pose."""
    if start is None:
        raise DataError(
            "start: the table holds joint coordinates, which may have several poses; give one of "
            "their assembly mode"
        )
    cranks = [leg.goes_round for leg in robot.legs]
    joints = from_readings(robot, np.where(cranks, np.unwrap(joints, axis=0), joints))
    _, rates, gains = _spline(time, joints)
    poses = follow(robot, joints, finite_rows(robot, start, "start"))
    return Motion(time, poses, *evaluate_unchecked(robot, "platform_motion", poses, rates, gains))
