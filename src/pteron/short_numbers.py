"""Powers of ten as a text writes them."""

from __future__ import annotations

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
"""Raised digits."""


def power_of_ten(power: int) -> str:
    """Return a power of ten as text: "10⁻¹²" for -12.

    Examples
    --------
    >>> power_of_ten(-12)
    '10⁻¹²'
    """
    return f"10{str(power).translate(_RAISED)}"
