"""Paths to a machine's geometric numbers, as a search names them: "legs[1,3].guide_point.x"."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches

from pteron.errors import ModelError, shorten
from pteron.legs import LegKind
from pteron.manipulator import Manipulator

_WRITTEN = re.compile(r"(-?)legs(?:\[([\d\s,]*)\])?\.(\w+)(?:\.(\w+))?")
"""Pattern of a path: sign, legs, key, component."""

_GEOMETRIC = ("point", "direction", "length", "number", "angle")
"""Roles of keys that a search may vary."""

_SHAPE = 'a path such as "legs.platform_point" or "legs[1,3].guide_point.x"'
"""Example of a path for messages."""


@dataclass(frozen=True)
class GeometryNumber:
    """One number of one leg.

    Attributes
    ----------
    leg : int
        From 1.
    key : str
        Its key in the robot's file.
    part : int or None
        Index of a vector's component; None for a number.
    sign : int
        1, or -1 where the path has a minus before it.
    role : str
        Role of the key: "point", "direction", "length" or "number".
    """

    leg: int
    key: str
    part: int | None
    sign: int
    role: str

    @property
    def path(self) -> str:
        """The path that names the number in a task's file: "legs[1].key.x"."""
        part = "" if self.part is None else f".{'xyz'[self.part]}"
        return f"legs[{self.leg}].{self.key}{part}"

    def read(self, robot: Manipulator) -> float:
        """Return the value of this geometric number in the machine `robot`."""
        numbers = getattr(robot.legs[self.leg - 1], self.key)
        return float(numbers if self.part is None else numbers[self.part])


def named_numbers(robot: Manipulator, path: str) -> list[GeometryNumber]:
    """Return the geometric numbers of a machine that a path such as "legs[1, 2].key.x" names."""
    match = _WRITTEN.fullmatch(path.strip())
    if match is None:
        raise ModelError(f"{shorten(path)} is not {_SHAPE}")
    minus, numbers, key, part = match.groups()
    legs = range(1, robot.joint_count + 1)
    if numbers is not None:
        try:
            named = [int(word) for word in numbers.split(",") if word.strip()]
        except ValueError:  # blanks within a number, or thousands of digits
            raise ModelError(f"{shorten(path)} is not {_SHAPE}") from None
        if wrong := [shorten(i) for i in named if i not in legs]:
            raise ModelError(
                f"{shorten(path)}: no leg {', '.join(wrong)}; {robot.name} has legs 1 to {legs[-1]}"
            )
        if not named:
            raise ModelError(f"{shorten(path)}: names no leg; write legs[1] or legs")
        legs_named = named
    else:
        legs_named = [i for i in legs if key in geometric_keys(robot.legs[i - 1])]
    sign = -1 if minus else 1
    return [
        place
        for i in legs_named or legs
        for place in _places_in_leg(robot, path, i, key, part, sign)
    ]


def geometric_keys(leg: LegKind) -> list[str]:
    """Return the names of a leg's parameters that hold geometric numbers."""
    return [
        name
        for name, key in leg.every_key().items()
        if key.role in _GEOMETRIC and getattr(leg, name) is not None
    ]


def _places_in_leg(
    robot: Manipulator, path: str, i: int, key: str, part: str | None, sign: int
) -> Iterator[GeometryNumber]:
    """Yield the geometric numbers of leg i that a parsed path names; raise where it has none."""
    leg = robot.legs[i - 1]
    known = geometric_keys(leg)
    if key not in known:
        close = get_close_matches(key, known, n=1)
        guess = f'; did you mean "{close[0]}"?' if close else ""
        raise ModelError(
            f"{shorten(path)}: leg {i}, a {leg.type}, has no number {shorten(key)}; it has "
            f"{', '.join(known)}{guess}"
        )
    role = leg.every_key()[key].role
    scalar = role in ("length", "number", "angle")
    if scalar and part is not None:
        raise ModelError(f"{shorten(path)}: {key} is one number; leave out .{part}")
    if part is not None and part not in ("x", "y", "z"):
        raise ModelError(f"{shorten(path)}: .{part} is none of .x, .y and .z")
    if scalar:
        yield GeometryNumber(i, key, None, sign, role)
    else:
        for k in range(3) if part is None else ["xyz".index(part)]:
            yield GeometryNumber(i, key, k, sign, role)
