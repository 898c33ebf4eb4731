"""The machine that was built, against the one that was drawn."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

import pteron
from pteron.bodies.inertia import PointMass, SpatialInertia

__all__ = ["as_built"]


def as_built(robot: pteron.Manipulator, seed: int = 0, spread: float = 0.2) -> pteron.Manipulator:
    """Return the machine with the inertia it really has: that of its drawings, off at random.

    Each body's mass, the coordinates of its centre of mass and its moment of inertia about that
    centre are multiplied by factors of their own, uniform between 1 - spread and 1 + spread; all
    moments of inertia of a platform that tilts by one, so that it stays a body.
    """
    rng = np.random.default_rng(seed)

    def factor() -> float:
        return float(rng.uniform(1.0 - spread, 1.0 + spread))

    def built(body: Any) -> Any:
        if isinstance(body, PointMass):
            return PointMass(body.mass * factor())
        center = np.array(body.center_of_mass)
        about_center = np.array(body.inertia) - body.mass * _second_moment(body, center)
        mass, center = factor() * body.mass, center * [factor() for _ in center]
        inertia = factor() * about_center + mass * _second_moment(body, center)
        return body.of_body(mass, center.tolist(), inertia.tolist())

    legs = tuple(
        leg.with_bodies({letter: built(body) for letter, body in leg.bodies.items()})
        for leg in robot.legs
    )
    platform = replace(
        robot.platform,
        inertia=built(robot.platform.inertia),
        bars=tuple(replace(bar, mass=bar.mass * factor()) for bar in robot.platform.bars),
        geared=tuple(
            replace(part, inertia=part.inertia * factor()) for part in robot.platform.geared
        ),
    )
    return replace(robot, legs=legs, platform=platform)


def _second_moment(body: Any, center: Any) -> Any:
    """Return the moment of inertia of a unit mass at a centre, or six where the body tilts."""
    if isinstance(body, SpatialInertia):
        return np.array(list(body.shares_of_point(*center).values())[4:])
    return center @ center
