"""Inertia of links whose length changes, in a design search or in a file of other dimensions.

A longer or shorter link keeps its section and is stretched along its own x: mass and the centre's
coordinate along x are proportional to the length, coordinates across x are constant. The moment of
inertia is proportional to the third power of the length, as for a slender rod, except for the part
by the centre's distance across x, which is proportional to the mass. Sliders, platform and drives
are unchanged.
"""

from __future__ import annotations

from typing import Any

from pteron.legs import LegKind


def with_stretched_bodies(before: LegKind, after: LegKind) -> LegKind:
    """Return a leg with the inertia that its links have at their new lengths.

    `after` has the new lengths, and still the inertia of `before`.
    """
    bodies = dict(after.bodies)
    for letter, (_, low, high, _) in after.extents.items():
        _, old_low, old_high, _ = before.extents[letter]
        bodies[letter] = stretched(bodies[letter], (high - low) / (old_high - old_low))
    return after.with_bodies(bodies)


def stretched(body: Any, factor: float) -> Any:
    """Return the inertia of a link stretched along x by a factor, with the same section.

    Examples
    --------
    >>> from pteron.bodies import RodInertia
    >>> stretched(RodInertia.of_body(1.0, [-0.5], 1.0 / 3.0), 2.0).values
    (2.0, -2.0, 2.6666666666666665)
    """
    values = dict(zip(body.kinds, body.values, strict=True))
    across = values.get("mgy", 0.0) ** 2 / values["m"]
    drawn = {
        "m": values["m"] * factor,
        "mgx": values["mgx"] * factor**2,
        "mgy": values.get("mgy", 0.0) * factor,
        "I": (values["I"] - across) * factor**3 + across * factor,
    }
    return type(body).of_values([drawn[kind] for kind in body.kinds])
