"""The machine that was built, against the one that was drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import pteron
from plant.model import legs_of

__all__ = ["as_built"]


def as_built(robot: pteron.Manipulator, seed: int = 0, spread: float = 0.2) -> pteron.Manipulator:
    """Return the machine with the inertia it really has: that of its drawings, off at random.

    Each body's mass, both coordinates of its centre of mass and its moment of inertia about that
    centre are multiplied by factors of their own, uniform between 1 - spread and 1 + spread.
    """
    rng = np.random.default_rng(seed)

    def built(body: pteron.PlanarInertia) -> pteron.PlanarInertia:
        gx, gy = body.center_of_mass
        about_center = body.inertia - body.mass * (gx**2 + gy**2)
        factors = rng.uniform(1.0 - spread, 1.0 + spread, 4)
        mass, gx, gy, about_center = (factors * (body.mass, gx, gy, about_center)).tolist()
        inertia = about_center + mass * (gx**2 + gy**2)
        return pteron.PlanarInertia.of_body(mass, (gx, gy), inertia)

    legs = tuple(
        replace(
            leg,
            slider_mass=leg.slider_mass * rng.uniform(1.0 - spread, 1.0 + spread),
            upper=built(leg.upper),
            lower=built(leg.lower),
        )
        for leg in legs_of(robot)
    )
    platform = replace(robot.platform, inertia=built(robot.platform.inertia))
    return replace(robot, legs=legs, platform=platform)
