"""Conversion to SI units of columns whose names say their unit, such as ``x (mm)``."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace

import polars as pl

from pteron.errors import DataError, shorten
from pteron.tables.table import Table

FACTORS = {
    "m": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "cm": 1e-2},
    "rad": {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0, "mrad": 1e-3},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6},
}
"""Factors from units to SI units, by SI unit."""

_NAMED = re.compile(r"(?P<name>[^\s(\[]+)\s*[\[(]\s*(?P<unit>[^\])]+?)\s*[\])]")


def convert_to_si(table: Table, units: Mapping[str, str]) -> Table:
    """Return the table with columns such as ``x (mm)`` converted to SI units and renamed ``x``.

    Parameters
    ----------
    table : Table
        The table; other columns stay as they are.
    units : mapping
        The SI unit of each column that may be there, such as m, rad/s or N m, by its name.

    Raises
    ------
    DataError
        If a unit is not one of what the column holds, a column is there twice, or a cell that is to
        be converted holds text.
    """
    frame, converted = table.frame, set[str]()
    for column in table.columns:
        match = _NAMED.fullmatch(column)
        if match is None or match["name"] not in units:
            continue
        name = match["name"]
        if name in table.columns or name in converted:
            raise DataError(f"{table.source}: {name} and {column} given; keep one of them")
        factor = _si_factor(match["unit"], units[name])
        if factor is None:
            si, _, per = units[name].partition("/")
            known = ", ".join(f"{unit}/{per}" if per else unit for unit in FACTORS.get(si, (si,)))
            raise DataError(
                f"{table.source}: column {shorten(column, bare=True)}: the unit of {name} is one "
                f"of {known}"
            )
        if factor != 1.0:
            si_values = factor * table.numbers([column], "nan")[:, 0]
            frame = frame.with_columns(pl.Series(column, si_values, nan_to_null=True))
        frame = frame.rename({column: name})
        converted.add(name)
    return replace(table, frame=frame)


def _si_factor(unit: str, si: str) -> float | None:
    """Return the factor from a unit to an SI unit; None if it measures another quantity."""
    (numerator, _, per), (base, _, si_per) = unit.partition("/"), si.partition("/")
    if re.sub("[ ^]", "", per) != re.sub("[ ^]", "", si_per):
        return None
    return FACTORS.get(base, {base: 1.0}).get(numerator.strip())
