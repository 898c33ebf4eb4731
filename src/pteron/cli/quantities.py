"""Numbers with units in options of the command line: 250mm, 10deg, 0.7:1.0."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pteron.errors import DataError

_UNITS = {
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254},
    "rad": {"rad": 1.0, "deg": math.pi / 180.0},
    "kg": {"kg": 1.0, "g": 1e-3},
    "": {},
    "kg m^2": {},
}
"""Units that may follow a number, by the unit that a number alone has."""

_MOST_ANGLE = 4.0 * math.pi
"""Greatest angle, rad, that counts as one in radians: two turns."""

_LONG = 10.0
"""Length, m, beyond which a number without a unit is likelier in millimetres."""

_RANGE = "LOW:HIGH expected, such as -0.3:0.3"
"""The form of a range."""


def quantity_range(option: str, text: str, unit: str) -> tuple[float, float]:
    """Return the two numbers of LOW:HIGH, each with a unit or without."""
    low, colon, high = text.partition(":")
    if not colon or ":" in high:
        raise DataError(f"{option}: {text!r} given, {_RANGE}")
    # A unit behind the second number alone is that of both.
    if _is_plain(low) and not _is_plain(high):
        low += high.strip().lstrip("+-0123456789.eE ")
    first, second = (quantity(option, part, unit, signed=True) for part in (low, high))
    assert first is not None
    assert second is not None
    return first, second


def _is_plain(text: str) -> bool:
    """Return whether a text is a number without a unit."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def required_quantity(option: str, text: str, unit: str) -> float:
    """Return the number of an option's text; angles may be negative."""
    number = quantity(option, text, unit, signed=unit == "rad")
    assert number is not None
    return number


def quantity(option: str, text: str | None, unit: str, *, signed: bool = False) -> float | None:
    """Return the number of an option in SI units, from a number with a unit or without; or None.

    Raises
    ------
    DataError
        If it is no number, its unit is another one, or it is not above 0 where it must be.
    """
    if text is None:
        return None
    units = _UNITS[unit]
    words = text.strip()
    named = next((u for u in sorted(units, key=len, reverse=True) if words.endswith(u)), "")
    try:
        number = float(f"{float(words.removesuffix(named)) * units.get(named, 1.0):.12g}")
    except ValueError:
        number = math.nan
    if unit == "rad" and abs(number) > _MOST_ANGLE:
        raise DataError(f"{option}: {text!r} is {number:g} rad; degrees are {words}deg")
    if not math.isfinite(number) or (number <= 0.0 and not signed):
        behind = ", ".join(u for u in units if u != unit)
        others = f" (or {behind} behind it)" if behind else ""
        above = "" if signed else " above 0"
        of_unit = f" in {unit}" if unit else ""
        raise DataError(f"{option}: {text!r} given, a number{above}{of_unit}{others} expected")
    return number


def length_doubts(options: Mapping[str, str | None], long: float = _LONG) -> list[str]:
    """Return a line for each option with a length, without a unit, that is likely in millimetres.

    A text may hold two lengths with a colon between them, or a mass, @ and three lengths.
    """
    lines = []
    for option, text in options.items():
        mass, at, place = (text or "").rpartition("@")
        parts = place.split("," if at else ":")
        if not text or not all(map(_is_plain, parts)):
            continue
        most = max(abs(float(part)) for part in parts)
        if most > long:
            lengths = [f"{float(part) / 1e3:g}" if at else f"{part.strip()}mm" for part in parts]
            meant = mass + at + ("," if at else ":").join(lengths)
            lines.append(f"{option} {text} is {most:g} m: if these are millimetres, write {meant}")
    return lines
