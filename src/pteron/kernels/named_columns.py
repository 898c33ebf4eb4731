"""Tables that are given where an array is expected: their columns are picked by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pteron.errors import DataError, shown

_MANY = 12
"""Columns of a table that a message lists."""


def by_name(value: Any, columns: Sequence[str], name: str) -> Any:
    """Return the columns of a table, in the order asked for; what is no table, unchanged.

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
    if _is_labelled(value):
        value = _by_label(value)
    has = _names(value)
    if not has:
        return value
    if not columns:
        raise DataError(
            f"{name}: a table with names given, an array expected, its columns in order: "
            "table[names].to_numpy()"
        )
    if any(isinstance(one, tuple) for one in has):
        raise DataError(f"{name}: the table's columns have names of two levels; keep one")
    if missing := [column for column in columns if column not in has]:
        more = f" and {len(has) - _MANY} more" if len(has) > _MANY else ""
        listed = ", ".join(shown(one, bare=True) for one in has[:_MANY])
        raise DataError(
            f"{name}: no column {', '.join(missing)} in a table of {listed}{more}; name its "
            "columns so, in SI units and radians, or give an array"
        )
    if callable(numbers := getattr(value, "numbers", None)):
        return numbers(columns)
    for column in columns:
        if has.count(column) > 1:
            raise DataError(f"{name}, column {column}: stands twice in the table; keep one")
    parts = [_column(value[column], f"{name}, column {column}") for column in columns]
    try:
        return np.stack(np.broadcast_arrays(*parts), axis=-1)
    except ValueError:
        shapes = ", ".join(f"{c} {p.shape}" for c, p in zip(columns, parts, strict=True))
        raise DataError(f"{name}: columns of different lengths: {shapes}") from None


def _names(value: Any) -> list[str]:
    """Return the names of a table's columns; none of what is no table, or has no names."""
    if isinstance(value, np.ndarray):
        return list(value.dtype.names or ())
    if isinstance(value, list | tuple | float | int):
        return []
    if isinstance(value, Mapping):
        given: Any = value.keys()
    else:
        given = getattr(value, "columns", None)
        if given is None and callable(keys := getattr(value, "keys", None)):
            given = keys()  # a row of a DataFrame of pandas
    try:
        names = list(() if given is None or callable(given) else given)
    except TypeError:
        return []
    return names if any(isinstance(one, str | tuple) for one in names) else []


def _is_labelled(value: Any) -> bool:
    """Return whether a value is a DataArray of xarray whose last axis has names."""
    if isinstance(value, np.ndarray) or not getattr(value, "dims", ()):
        return False
    labels = getattr(value, "coords", {}).get(value.dims[-1])
    return labels is not None and all(isinstance(one, str) for one in labels.values.tolist())


def _by_label(value: Any) -> dict[str, Any]:
    axis = value.dims[-1]
    return {str(one): value.sel({axis: one}).values for one in value.coords[axis].values}


def _column(value: Any, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    try:
        if (array := np.asarray(value)).dtype.kind not in "biufO":
            raise TypeError
        return np.asarray(array, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"{name}: not real numbers") from None
