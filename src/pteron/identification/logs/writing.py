"""Logs written to CSV and Parquet files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl

from pteron.identification.logs.log import Log
from pteron.legs import Reading
from pteron.platforms.coordinates import COORDINATES
from pteron.tables import write_table


def write_log(log: Log, path: str | Path) -> Path:
    """Write a log to a CSV or Parquet file, whole or not at all, at full precision.

    The columns are t (s), rho1.. (m), force1.. (N) or current1.. (A), the pose's coordinates (m,
    rad) and payload; at a crank theta (rad) and torque (N m). Joints and forces are as the drives
    count them (`readings`). Forces in volts or per cent say so in their names. The description is
    not written: it speaks of the columns of the file that the log came from.

    Raises
    ------
    OutputError
        If the file cannot be written; one that was there is left as it was.
    """
    unit = log.description.force_unit
    counted = [reading or Reading() for reading in log.readings or [None] * len(log.joint_names)]
    scales = np.array([reading.scale for reading in counted])
    joints = (log.joints - [reading.zero for reading in counted]) / scales
    columns = {"t": log.time} | dict(zip(log.joint_names, joints.T, strict=True))
    for j, name in enumerate(log.force_names):
        stem = f"current{j + 1}" if unit == "A" else name
        columns[stem + (f" ({unit})" if unit in ("V", "%") else "")] = log.forces[:, j] * scales[j]
    if log.pose is not None:
        names = log.coordinates or tuple(COORDINATES)[: log.pose.shape[1]]
        columns |= dict(zip(names, log.pose.T, strict=True))
    if log.payload is not None:
        columns["payload"] = log.payload
    return write_table(pl.DataFrame(columns), path)
