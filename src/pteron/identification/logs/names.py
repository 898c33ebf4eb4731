"""Words, numbers and units in the names of columns, as Pteron and other programs write them.

Beside Pteron's own ``rho1`` and ``Rho_1 (mm)`` these are names of controllers, ``Axis1.ActPos`` or
``Axis 1 Actual Position [mm]``, and of ROS, ``/joint_states/position[0]`` or ``field.effort0``.
"""

from __future__ import annotations

import re
from typing import NamedTuple

_DIGITS = 9
"""Most digits of the number in a column's name."""

_DRIVE = {"a": "A", "v": "V", "%": "%"}
"""Units of drives, by their spelling in small letters."""

UNITS = {
    "s": {"s": "s", "sec": "s", "ms": "ms", "us": "us", "µs": "us", "ns": "ns", "100 ns": "100 ns"},
    "m": {"m": "m", "mm": "mm", "um": "um", "µm": "um"},
    "rad": {"rad": "rad", "deg": "deg", "°": "deg"},
    "N": {"n": "N"} | _DRIVE,
    "N m": {"nm": "N m", "n m": "N m", "n*m": "N m", "n·m": "N m"} | _DRIVE,
}
"""Spellings of the units, in small letters, by the SI unit of what they measure."""

_POSITION = ("position", "actpos", "actposition", "actualposition", "istposition", "istlage")
"""Words that controllers write for positions."""

RATED = ("acttorque", "actualtorque", "istmoment", "istdrehmoment")
"""Words for torques, which drives write in per cent, per mille or N m: their unit must be said."""

_EFFORT = ("effort", "actcurrent", "actualcurrent", "iststrom", *RATED)
"""Words that controllers write for forces, torques and currents."""

_WORDS: dict[str, tuple[str, ...]] = {
    "t": ("t", "time", "timestamp", "zeit"),
    "rho": ("rho", "q", "s", "joint", *_POSITION),
    "theta": ("theta", "q", "angle", "crank", *_POSITION),
    "force": ("force", "f", "tau", "current", "i", "actforce", "actualforce", *_EFFORT),
    "torque": ("torque", "moment", "tau", "current", "i", *_EFFORT),
}
"""Names of columns, by the documented word; small letters without blanks and lines."""
CURRENTS = ("current", "i", "actcurrent", "actualcurrent", "iststrom")
"""Words that say amperes."""

_SPELLED = "|".join(re.escape(u) for units in UNITS.values() for u in units if len(u) > 1)
_SPELLED += "|(?-i:[smANV%°])"
"""Units without brackets: a last single letter is one only as it is usually written."""

_UNIT = (
    rf"(?P<tail>(?:[ _]*[\[(] *(?P<inside>[^\])\d][^\])]*?) *[\])]"
    rf"|[ _](?P<behind>{_SPELLED})|/(?P<under>{_SPELLED}))?)"
)
"""Pattern of a unit at the end of a name."""

_NUMBERED = re.compile(
    rf"(?P<path>(?:.*?[./])??)[%_]*(?P<word>[a-z][a-z _]*?)"
    rf"(?P<place>[ _]?(?:\[(?P<index>\d+)\]|(?P<number>\d+)))?{_UNIT}",
    re.IGNORECASE,
)
"""Pattern of a name with a number in it."""
_OF_AXIS = re.compile(
    r"(?P<path>.*?)(?:axis|achse|joint|drive|motor|leg|slider|crank)"
    r"(?P<place>[ _]?[\[(]?(?P<index>\d+)[\])]?)[ _./:]+(?:.*[./])?"
    rf"(?P<word>[a-z][a-z _]*?){_UNIT}",
    re.IGNORECASE,
)
"""A numbered axis with a word behind, such as ``MAIN.Axis1.NcToPlc.ActPos``."""

_STAMP = re.compile(r"(?:.*[./])?header[./]stamp(?P<part>[./](?:secs?|nsecs?|nanosec))?")
"""The time of measurement in a message of ROS."""


class NameParts(NamedTuple):
    """The parts of a column's name."""

    word: str
    """In small letters, without blanks and lines."""
    number: int | None
    family: str
    """The name with # in place of its number."""
    unit: str
    """In small letters, empty where there is none."""


def parse_column_name(name: str) -> NameParts | None:
    """Return the parts of a name, or None where it is no word with a number and a unit, or without.

    Examples
    --------
    >>> parse_column_name("Rho_1 (mm)")
    NameParts(word='rho', number=1, family='Rho_# (mm)', unit='mm')
    >>> parse_column_name("/joint_states/position[0]").number
    0
    """
    match = _OF_AXIS.fullmatch(name) or _NUMBERED.fullmatch(name)
    if match is None:
        return None
    word = re.sub("[ _]", "", match["word"].lower())
    word = re.sub("(?<=.)(?:axis|achse)$", "", word)
    parts = match.groupdict()
    number = parts["index"] or parts.get("number")
    if match["path"] and len(word) == 1:
        return None  # MAIN.s1 may be anything
    family = name
    if number is not None:
        start = match.start("index") if parts["index"] else match.start("number")
        family = f"{name[:start]}#{name[start + len(number) :]}"
    if number is not None and len(number) > _DIGITS:
        return None  # no machine has so many joints
    unit = parts["inside"] or parts["behind"] or parts["under"] or ""
    return NameParts(word, None if number is None else int(number), family, unit.lower())


def is_synonym(word: str, stem: str) -> bool:
    """Return whether a word is a synonym of the documented word."""
    return word in _WORDS.get(stem, (stem,))


def parse_unit(text: str, si: str) -> str | None:
    """Return the unit with this spelling for quantities in `si`; None if unknown."""
    return UNITS[si].get(text.strip().lower())


def stamp_columns(names: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Return the columns of the stamps in a ROS message: a single column, or s and ns.

    Examples
    --------
    >>> stamp_columns(("Time", "header.stamp.secs", "header.stamp.nsecs", "position_0"))
    [('header.stamp.secs', 'header.stamp.nsecs')]
    """
    stamps: list[tuple[str, ...]] = []
    for name in names:
        match = _STAMP.fullmatch(name)
        if match is None:
            continue
        part = match["part"] or ""
        if not part:
            stamps.append((name,))
        elif part[1:] in ("sec", "secs"):
            stem = name.removesuffix(part[1:])
            nanoseconds = next(
                (stem + p for p in ("nsecs", "nsec", "nanosec") if stem + p in names), None
            )
            stamps += [(name, nanoseconds)] if nanoseconds else []
    return stamps
