"""Reading of fixed values and ranges of pose coordinates, typed such as z=0,phi=-1:1."""

from __future__ import annotations

from pteron.errors import DataError


def pose_ranges(
    text: str | None, option: str
) -> tuple[dict[str, float], dict[str, tuple[float, ...]]]:
    """Return the coordinates that an option holds, and the ranges of others.

    Examples
    --------
    >>> pose_ranges("z=0,phi=-1:1", "--slice")
    ({'z': 0.0}, {'phi': (-1.0, 1.0)})
    """
    held: dict[str, float] = {}
    ranges: dict[str, tuple[float, ...]] = {}
    for part in text.replace(" ", "").split(",") if text is not None else []:
        name, equals, values = part.partition("=")
        numbers = values.split(":")
        try:
            given = tuple(float(number) for number in numbers)
        except ValueError:
            given = ()
        if not name or not equals or not 1 <= len(given) <= 3:
            raise DataError(
                f"{option}: {part!r} given; NAME=VALUE or NAME=LEAST:GREATEST[:COUNT] expected, in "
                "m and rad without the unit, such as z=0,phi=0"
            )
        if name in held or name in ranges:
            raise DataError(f"{option}: {name} given twice")
        if len(given) == 1:
            held[name] = given[0]
        else:
            ranges[name] = given
    return held, ranges


def pose_text(name: str, value: float) -> str:
    """Return a coordinate's value with its name and unit."""
    return f"{name} = {value + 0.0:.4g} {_unit(name)}"


def span_text(name: str, low: float, high: float) -> str:
    """Return a coordinate's range with its name and unit."""
    return f"{name} {low:.4g} to {high:.4g} {_unit(name)}"


def _unit(name: str) -> str:
    from pteron.platforms.coordinates import coordinate

    return coordinate(name).unit
