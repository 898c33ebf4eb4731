"""Columns of the data of a picture, one a joint, and the joints' words and units for its labels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError
from pteron.kernels import Array, as_array
from pteron.kernels.named_columns import pick_columns
from pteron.legs.kind import SLIDER, ActuatedJoint
from pteron.manipulator import RobotLike, as_manipulator


def joints_of(robot: RobotLike | None, columns: ArrayLike) -> list[ActuatedJoint]:
    """Return each leg's joint; without a machine, a slider for each column of values (..., n)."""
    if robot is not None:
        return [leg.joint for leg in as_manipulator(robot).legs]
    if np.ndim(columns) == 0:
        raise DataError("one number given, an array (T, n) expected: a column for each leg")
    return [SLIDER] * np.shape(columns)[-1]


def pick_machine_columns(robot: RobotLike | None, table: ArrayLike, what: str) -> ArrayLike:
    """Return the columns of a table that a machine names, such as "forces"; an array unchanged."""
    if robot is None:
        return table
    columns: ArrayLike = pick_columns(table, as_manipulator(robot).column_names[what], what)
    return columns


def rows(
    time: ArrayLike, values: ArrayLike, what: str, columns: int | None = None
) -> tuple[Array, Array]:
    """Return times (T,) and values (T, n) as arrays, checked for their shapes."""
    t, array = as_array(time, "time", ()), as_array(values, what, ())
    expected = "n" if columns is None else columns
    if t.ndim != 1 or not len(t):
        raise DataError(f"time: shape {t.shape} given, (T,) expected, T above 0")
    if array.ndim != 2 or len(array) != len(t) or columns not in (None, array.shape[1]):
        raise DataError(f"{what}: shape {array.shape} given, ({len(t)}, {expected}) expected")
    return t, array
