"""Inertia of links whose length changes, in a design search or in a file of other dimensions.

A longer or shorter link keeps its section and is stretched along its own x: mass and the centre's
coordinate along x are proportional to the length, coordinates across x are constant. The moment of
inertia is proportional to the third power of the length, as for a slender rod, except for the part
by the centre's distance across x, which is proportional to the mass. Sliders, platform and drives
are unchanged.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pteron.bodies.inertia import SpatialInertia
from pteron.legs import LegKind


def with_stretched_bodies(unchanged: LegKind, changed: LegKind) -> LegKind:
    """Return `changed` with links' inertia stretched from the lengths in `unchanged`.

    `changed` has the new lengths with the inertia of `unchanged`.
    """
    bodies = dict(changed.bodies)
    for letter, (_, low, high, _) in changed.extents.items():
        _, old_low, old_high, _ = unchanged.extents[letter]
        bodies[letter] = stretch_link(bodies[letter], (high - low) / (old_high - old_low))
    return changed.with_bodies(bodies)


def stretch_link(body: Any, factor: float) -> Any:
    """Return a link's inertia after stretching it along x by a factor, same cross-section.

    Examples
    --------
    >>> from pteron.bodies import RodInertia
    >>> stretch_link(RodInertia.of_body(1.0, [-0.5], 1.0 / 3.0), 2.0).values
    (2.0, -2.0, 2.6666666666666665)
    """
    by_kind = dict(zip(body.kinds, body.values, strict=True))
    if isinstance(body, SpatialInertia):
        return _stretch_solid(body, by_kind, factor)
    offset_inertia = by_kind.get("mgy", 0.0) ** 2 / by_kind["m"]
    stretched_by_kind = {
        "m": by_kind["m"] * factor,
        "mgx": by_kind["mgx"] * factor**2,
        "mgy": by_kind.get("mgy", 0.0) * factor,
        "I": (by_kind["I"] - offset_inertia) * factor**3 + offset_inertia * factor,
    }
    return type(body).of_values([stretched_by_kind[kind] for kind in body.kinds])


def _stretch_solid(
    body: SpatialInertia, by_kind: dict[str, float], factor: float
) -> SpatialInertia:
    """Return the inertia of a body in space after stretching it along x by a factor."""
    stretch = np.diag([factor, 1.0, 1.0, 1.0])
    moments = factor * stretch @ np.array(body.second_moments(by_kind)) @ stretch
    (xx, xy, xz, hx), (_, yy, yz, hy), (_, _, zz, hz), (*_, mass) = moments.tolist()
    tensor = yy + zz, -xy, -xz, xx + zz, -yz, xx + yy
    return SpatialInertia(mass, (hx, hy, hz), tensor)
