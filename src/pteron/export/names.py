"""A machine's name as an identifier and as a file's stem: letters, digits and one separator."""

from __future__ import annotations

import hashlib
import re
import unicodedata

from pteron.manipulator import Manipulator

_PLAIN = re.compile(r"[A-Za-z0-9]+([ _-][A-Za-z0-9]+)*")
"""Names that lose nothing but their capitals and the kind of their separators."""

_LONGEST = 100
"""Longest stem: with what is added it fits file systems, and FMI's 200 for identifiers."""

_DIGITS = 6
"""Digits of the checksum of a name that is cut or changed."""

_TAKEN = {"all", "clean", "depend", "help", "install", "package", "test"} | {
    *("con", "prn", "aux", "nul"),
    *(f"{port}{i}" for port in ("com", "lpt") for i in range(1, 10)),
}
"""Targets that CMake keeps for itself, and names of devices, which are no files on Windows."""


def prefix_of(robot: Manipulator) -> str:
    """Return the machine's name as an identifier of C and the stem of files."""
    name = safe_name(robot.name, "_")
    return name if name and not name[0].isdigit() else f"robot_{name}".rstrip("_")


def identifier(robot: Manipulator) -> str:
    """Return a machine's name as an identifier in XML and the stem of XML files."""
    return safe_name(robot.name, "-") or "robot"


def safe_name(name: str, separator: str) -> str:
    """Return a name in small ASCII letters, digits and a separator; empty if it has none.

    A name that is long, or loses more than its capitals and which separator it has, gets a
    checksum: two that differ stay apart.
    """
    letters = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
    identifier = re.sub(r"[^a-z0-9]+", separator, letters).strip(separator)
    if identifier in _TAKEN:
        identifier = f"robot{separator}{identifier}"
    plain = _PLAIN.fullmatch(name) is not None
    return (
        identifier
        if plain and len(identifier) <= _LONGEST
        else add_checksum(identifier, name, _LONGEST, separator)
    )


def add_checksum(stem: str, name: str, longest: int, separator: str = "_") -> str:
    """Return a stem with a name's checksum, cut to a length."""
    digest = hashlib.sha256(name.encode()).hexdigest()[:_DIGITS]
    shortened = stem[: longest - _DIGITS - 1].rstrip(separator) or "robot"
    return f"{shortened}{separator}{digest}"
