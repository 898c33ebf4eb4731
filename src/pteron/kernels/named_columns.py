"""Tables in place of arrays: their columns are selected by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pteron.errors import DataError, shorten

_MANY = 12
"""Columns of a table that a message lists."""


def pick_columns(table: Any, columns: Sequence[str], name: str) -> Any:
    """Return a table's named columns (..., k), in order; an argument without names unchanged.

    Parameters
    ----------
    value : array or table
        A DataFrame of pandas or polars, a `pteron.tables.Table`, a mapping from names to numbers or
        arrays, a row of a DataFrame with its names, a structured array, or a DataArray of xarray
        whose last axis has names. Other columns than those asked for do not matter. A table whose
        columns have no names is an array.
    columns : sequence of str
        The names that are asked for; none where no names are known, and a table is refused.
    name : str
        The value's name in messages.

    Returns
    -------
    array, shape (..., len(columns)), or `value`

    Raises
    ------
    DataError
        If columns are missing, have names of two levels, or one of them has no numbers or another
        length; or for a table where no names are known.
    """
    if _has_labels(table):
        table = _columns_from_labels(table)
    names = column_names(table)
    if not names:
        return table
    if not columns:
        raise DataError(
            f"{name}: a table with names given, an array expected, its columns in order: "
            "table[names].to_numpy()"
        )
    if any(isinstance(column_name, tuple) for column_name in names):
        raise DataError(f"{name}: the table's columns have names of two levels; keep one")
    if missing := [column for column in columns if column not in names]:
        remaining = f" and {len(names) - _MANY} more" if len(names) > _MANY else ""
        listed = ", ".join(shorten(column_name, bare=True) for column_name in names[:_MANY])
        raise DataError(
            f"{name}: no column {', '.join(missing)} in a table of {listed}{remaining}; name its "
            "columns so, in SI units and radians, or give an array"
        )
    if callable(numbers := getattr(table, "numbers", None)):
        return numbers(columns)
    for column in columns:
        if names.count(column) > 1:
            raise DataError(f"{name}, column {column}: stands twice in the table; keep one")
    parts = [_column(table[column], f"{name}, column {column}") for column in columns]
    try:
        return np.stack(np.broadcast_arrays(*parts), axis=-1)
    except ValueError:
        shapes = ", ".join(f"{c} {p.shape}" for c, p in zip(columns, parts, strict=True))
        raise DataError(f"{name}: columns of different lengths: {shapes}") from None


def column_names(table: Any) -> list[str]:
    """Return the names of a table's columns; [] for an argument without named columns."""
    if isinstance(table, np.ndarray):
        return list(table.dtype.names or ())
    if isinstance(table, list | tuple | float | int):
        return []
    if isinstance(table, Mapping):
        raw_names: Any = table.keys()
    else:
        raw_names = getattr(table, "columns", None)
        if raw_names is None and callable(keys := getattr(table, "keys", None)):
            raw_names = keys()  # a row of a DataFrame of pandas
    try:
        names = list(() if raw_names is None or callable(raw_names) else raw_names)
    except TypeError:
        return []
    return names if any(isinstance(column, str | tuple) for column in names) else []


def _has_labels(array: Any) -> bool:
    """Return whether an array is an xarray DataArray whose last axis has text labels."""
    if isinstance(array, np.ndarray) or not getattr(array, "dims", ()):
        return False
    labels = getattr(array, "coords", {}).get(array.dims[-1])
    return labels is not None and all(isinstance(label, str) for label in labels.values.tolist())


def _columns_from_labels(array: Any) -> dict[str, Any]:
    """Return the columns of an xarray DataArray by the labels of its last axis."""
    axis = array.dims[-1]
    return {str(label): array.sel({axis: label}).values for label in array.coords[axis].values}


def _column(raw: Any, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return a column as an array of floats; raise DataError if it is not real numbers."""
    try:
        if (array := np.asarray(raw)).dtype.kind not in "biufO":
            raise TypeError
        return np.asarray(array, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"{name}: not real numbers") from None
