"""The check of a machine's name, which every message, file and format must be able to hold."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator

LONGEST_NAME = 200
"""Characters; a file's name has at most 255 bytes, and adds to the machine's name."""

_JOINERS = "\u200c\u200d"
"""Invisible characters that spelling needs, in Persian and Hindi."""


def name_faults(name: object) -> Iterator[str]:
    """Yield the faults of a machine's name, as lines of text."""
    if type(name) is not str or not name.strip():
        yield f"name: {name!r} is not a text with at least one letter"
        return
    if len(name) > LONGEST_NAME:
        yield f"name: {len(name)} characters given, at most {LONGEST_NAME} expected"
    invisible = sorted({c for c in name if _is_invisible(c)})
    if invisible:
        codes = ", ".join(f"U+{ord(c):04X}" for c in invisible[:3])
        yield (
            f"name: has control characters ({codes}{', ...' if len(invisible) > 3 else ''}), which "
            "files and messages cannot hold; write it in one line of letters, digits and signs"
        )


def _is_invisible(c: str) -> bool:
    """Return whether a character is a control or format character, or a noncharacter."""
    if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp"):
        return c not in _JOINERS
    return ord(c) & 0xFFFE == 0xFFFE or 0xFDD0 <= ord(c) <= 0xFDEF
