"""`read_parts`: the rows of a CSV or Parquet file as parts of one class, each number checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, field, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pteron.errors import DataError
from pteron.tables import read_table

_Part = TypeVar("_Part")

POSITIVE, NOT_NEGATIVE = "a number above 0", "0 or more"
"""What is expected of a number, in words."""


def expected_number(expected: str, **default: Any) -> Any:
    """Return a dataclass field of a number with what is expected of it, in words."""
    return field(metadata={"expected": expected}, **default)


def read_parts(path: str | Path, part: type[_Part], joints: Mapping[str, str]) -> tuple[_Part, ...]:
    """Return the parts of a file: a row each, columns named as the fields of the class `part`.

    `joints` has the values that the column "joint" may have, with their meaning. A field with a
    default may have no column, or an empty cell.

    Raises
    ------
    DataError
        If there is no such file, a column or number is missing, or it is not what it must be.
    """
    table, every = read_table(path), [f for f in fields(part) if f.type == "float"]  # type: ignore[arg-type]
    missing = [key for key in ("name", "joint") if key not in table.columns]
    if missing:
        raise DataError(f"{path}: no column {' and '.join(missing)}")
    required = [f.name for f in every if f.default is MISSING]
    optional = [f.name for f in every if f.default is not MISSING and f.name in table.columns]
    numbers = np.hstack([table.numbers(required), table.numbers(optional, "nan")])
    parts = []
    for k, row in enumerate(numbers.tolist()):
        values: dict[str, Any] = {
            name: number
            for name, number in zip(required + optional, row, strict=True)
            if not np.isnan(number)
        }
        joint = table.frame["joint"][k]
        if joint not in joints:
            known = ", ".join(f'"{name}" ({meaning})' for name, meaning in joints.items())
            raise DataError(f"{table.place(k)}: joint: {joint!r} given, one of {known} expected")
        for f in every:
            expected, number = f.metadata["expected"], values.get(f.name, 1.0)
            if number < 0.0 or (number == 0.0 and expected == POSITIVE):
                raise DataError(
                    f"{table.place(k)}: {f.name}: {number:g} given, {expected} expected"
                )
        make: Any = part
        parts.append(make(name=str(table.frame["name"][k]), joint=joint, **values))
    return tuple(parts)
