"""What is possible but unlikely in a leg: most often a wrong unit or sign."""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot, sqrt
from typing import Any

from pteron.legs.kind import LegKind

_LARGE = 10.0
"""Length, m, beyond which millimetres are likelier."""

_ROUNDING = 1e-9


def leg_doubts(leg: LegKind) -> Iterator[str]:
    """Yield what a person should look at again, one line each."""
    for q in leg.quantities:
        if q.role == "length" and q.value[0] > _LARGE:
            yield f"{q.name}: {q.value[0]:g} m: are these mm?"
    for key in ("guide_point", "platform_point"):
        if hypot(*getattr(leg, key)) > _LARGE:
            yield f"{key}: {list(getattr(leg, key))} m: are these mm?"
    for letter, (key, low, high, ends) in leg.extents.items():
        body: Any = leg.bodies[letter]
        x, length = body.center_of_mass[0], high - low
        if not low - _ROUNDING * length <= x <= high + _ROUNDING * length:
            turned = f"; is it {-x:g}?" if low <= -x <= high else ""
            yield (
                f"{key}: center_of_mass: x = {x:g} m is not between {ends}: {low:g} to {high:g} m "
                f"is usual{turned}"
            )
        for text in spread(body, length, along=False):
            yield f"{key}: {text}"


def spread(body: Any, size: float, along: bool = True) -> Iterator[str]:
    """Yield what lies farther from a body's reference point than a body of a size has it."""
    center = body.center_of_mass
    off = hypot(*center) if along else hypot(*center[1:])
    if off > size:
        yield f"center_of_mass: {off:g} m {'away' if along else 'beside it'}: are these mm?"
    if sqrt(body.inertia / body.mass) > 3.0 * size:
        yield (
            f"inertia: {body.inertia:g} kg m^2 with {body.mass:g} kg is mass "
            f"{sqrt(body.inertia / body.mass):g} m away: is it in kg m^2?"
        )
