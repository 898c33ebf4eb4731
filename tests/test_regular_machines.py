"""Base parameters of machines of any proportions: none is refused that its own determinant allows.

The machines are drawn without a look at any measure: directions, points, lengths, elbows, gravity.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mechanisms import NIGHTLY, inertia, rod_inertia, scaled, unit

import pteron

METHODS = ("exact", "svd", "qr")


def drawn(kind, seed):
    """Return a machine of random proportions around the pose zero, which its legs reach."""
    rng = np.random.default_rng([seed, *kind.encode()])
    axis = unit(rng)
    x_axis = unit(rng, axis)
    frame = np.column_stack([x_axis, np.cross(axis, x_axis), axis])
    leg, count, motion = KINDS[kind]
    legs = []
    for _ in range(count):
        s0 = rng.uniform(-0.1, 0.1, 3)
        legs.append(leg(rng, frame @ s0, s0))
    platform = pteron.platforms.Platform(motion, inertia(rng, 0.1), axis, x_axis)
    gravity = 9.81 * (unit(rng) if rng.random() < 0.8 else np.array(legs[0].direction))
    return pteron.Manipulator(f"{kind} {seed}", platform, tuple(legs), gravity)


def slider_leg(rng, c, s0):
    d = unit(rng)
    e = d if rng.random() < 0.5 else unit(rng)
    if abs(e @ d) < 0.1:
        e = d
    lu, ll = rng.uniform(0.05, 0.4, 2)
    reach = abs(lu - ll) + rng.uniform(0.1, 0.9) * (lu + ll - abs(lu - ll))
    return pteron.legs.PRRR(
        guide_point=c - reach * unit(rng, d) + rng.uniform(-0.3, 0.3) * e,
        direction=d,
        platform_point=s0,
        upper_length=lu,
        lower_length=ll,
        slider_mass=rng.uniform(0.3, 0.8),
        upper=inertia(rng, lu),
        lower=inertia(rng, ll),
        slider_direction=e,
        elbow=int(rng.choice([1, -1])),
    )


def crank_leg(rng, c, s0):
    d = unit(rng)
    lu, ll = rng.uniform(0.05, 0.4, 2)
    return pteron.legs.RSS(
        guide_point=c - lu * unit(rng, d) - ll * unit(rng),
        direction=d,
        zero_direction=unit(rng, d),
        platform_point=s0,
        upper_length=lu,
        lower_length=ll,
        upper=inertia(rng, lu),
        lower=rod_inertia(rng, ll),
        elbow=int(rng.choice([1, -1])),
    )


KINDS = {
    "quadrupteron": (slider_leg, 4, "3T1R"),
    "tripteron": (slider_leg, 3, "3T"),
    "delta": (crank_leg, 3, "3T"),
}
