"""Logs into files, with the documented names."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from pteron.identification.logs.log import Log
from pteron.tables import write_table

__all__ = ["write_log"]

_POSE = ("x", "y", "z", "phi")
_STEMS = {"N": "force{}", "A": "current{}"}


def write_log(log: Log, path: str | Path) -> Path:
    """Write a log to a CSV or Parquet file, whole or not at all, at full precision.

    The columns are t (s), rho1.. (m), force1.. (N) or current1.. (A), x y z phi (m, rad) and
    payload; forces in volts or per cent say so in their names. The description is not written:
    it speaks of the columns of the file that the log came from.

    Raises
    ------
    OutputError
        If the file cannot be written; one that was there is left as it was.
    """
    unit = log.description.force_unit
    force = _STEMS.get(unit, f"force{{}} ({unit})")
    columns = {"t": log.time}
    columns |= {f"rho{j + 1}": column for j, column in enumerate(log.sliders.T)}
    columns |= {force.format(j + 1): column for j, column in enumerate(log.forces.T)}
    if log.pose is not None:
        columns |= dict(zip(_POSE[: log.pose.shape[1]], log.pose.T, strict=True))
    if log.payload is not None:
        columns["payload"] = log.payload
    return write_table(pl.DataFrame(columns), path)
