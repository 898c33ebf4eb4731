"""Short texts of powers of ten, and of several whole numbers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

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


def runs_text(numbers: Sequence[int]) -> str:
    """Return ascending whole numbers as text, three and more neighbours as "1 to 3".

    Examples
    --------
    >>> runs_text([1, 2, 3, 4, 5, 6]), runs_text([1, 2, 5]), runs_text([1, 3, 4, 5])
    ('1 to 6', '1, 2, 5', '1, 3 to 5')
    """
    parts: list[str] = []
    for _, pairs in groupby(enumerate(numbers), lambda pair: pair[1] - pair[0]):
        run = [str(number) for _, number in pairs]
        parts += [f"{run[0]} to {run[-1]}"] if len(run) > 2 else run
    return ", ".join(parts)
