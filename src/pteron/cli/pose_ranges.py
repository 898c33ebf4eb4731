"""Reading of fixed values and ranges of pose coordinates, typed such as z=0,phi=-1:1."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator
    from pteron.workspace import Box


def pose_ranges(
    text: str | None, option: str
) -> tuple[dict[str, float], dict[str, tuple[float, ...]]]:
    """Return the constant coordinates in an option's text, and the ranges of the others.

    Examples
    --------
    >>> pose_ranges("z=0,phi=-1:1", "--slice")
    ({'z': 0.0}, {'phi': (-1.0, 1.0)})
    """
    constants: dict[str, float] = {}
    ranges: dict[str, tuple[float, ...]] = {}
    for part in text.replace(" ", "").split(",") if text is not None else []:
        name, equals, limits = part.partition("=")
        numbers = limits.split(":")
        try:
            span = tuple(float(number) for number in numbers)
        except ValueError:
            span = ()
        if not name or not equals or not 1 <= len(span) <= 3:
            raise DataError(
                f"{option}: {part!r} given; NAME=VALUE or NAME=LEAST:GREATEST[:COUNT] expected, in "
                "m and rad without the unit, such as z=0,phi=0"
            )
        if name in constants or name in ranges:
            raise DataError(f"{option}: {name} given twice")
        if len(span) == 1:
            constants[name] = span[0]
        else:
            ranges[name] = span
    return constants, ranges


def pose_spans(
    robot: Manipulator, text: str, option: str, use: str
) -> dict[str, tuple[float, ...]]:
    """Return the least and the greatest value of each coordinate that an option's text names.

    `use` is what a message adds about them.
    """
    from pteron.maps.grid import expect_coordinates

    constants, ranges = pose_ranges(text, option)
    expect_coordinates(robot, constants, ranges)
    if any(len(span) > 2 for span in ranges.values()):
        raise DataError(f"{option}: NAME=LEAST:GREATEST expected{use}")
    return ranges | {name: (constant, constant) for name, constant in constants.items()}


def box_of(spans: Iterable[tuple[float, ...]]) -> Box:
    """Return the box of poses between the least and the greatest value of each coordinate."""
    from pteron.workspace import Box

    return Box(*zip(*spans, strict=True))


def pose_text(name: str, coordinate: float) -> str:
    """Return a coordinate's value with its name and unit."""
    return f"{name} = {coordinate + 0.0:.4g} {_unit(name)}"


def span_text(name: str, low: float, high: float) -> str:
    """Return a coordinate's range with its name and unit."""
    return f"{name} {low:.4g} to {high:.4g} {_unit(name)}"


def _unit(name: str) -> str:
    """Return the unit of a pose coordinate."""
    from pteron.platforms.coordinates import coordinate

    return coordinate(name).unit
