"""The names of columns taken apart: a word, perhaps a number, perhaps a unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["ANGLES", "FORCES", "LENGTHS", "TIMES", "Name", "split", "unit_in"]

TIMES = {"s": "s", "sec": "s", "ms": "ms", "us": "us", "µs": "us"}
LENGTHS = {"m": "m", "mm": "mm", "um": "um", "µm": "um"}
ANGLES = {"rad": "rad", "deg": "deg", "°": "deg"}
FORCES = {"n": "N", "a": "A", "v": "V", "%": "%"}
"""Spellings of the units, in small letters."""

_NAME = re.compile(
    r"(?P<stem>(?P<word>[a-z]+)[ _]?)(?P<number>[1-9]\d*)?"
    r"(?P<tail>(?:[ _]*[\[(] *(?P<inside>[^\])]+?) *[\])]|[ _](?P<behind>[^\d\W]+|[%°]))?)",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Name:
    """A column's name such as ``Rho_1 (mm)``.

    Parameters
    ----------
    word : str
        In small letters.
    number : int or None
        From 1.
    stem, tail : str
        What stands before and behind the number, as it is spelled.
    """

    word: str
    number: int | None
    stem: str
    tail: str


def split(name: str, units: Mapping[str, str]) -> Name | None:
    """Return the parts of a name, or None if it has others or ends in no unit that is known."""
    match = _NAME.fullmatch(name)
    if match is None or (match["tail"] and unit_in(name, units) is None):
        return None
    number = None if match["number"] is None else int(match["number"])
    return Name(match["word"].lower(), number, match["stem"], match["tail"])


def unit_in(name: str, units: Mapping[str, str]) -> str | None:
    """Return the unit that a name ends in, or None."""
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    return units.get((match["inside"] or match["behind"] or "").lower())
