"""Machines whose drives differ from leg to leg."""

from __future__ import annotations

from dataclasses import replace

import pteron


def driven(robot, **more):
    """Return the machine with different drives on its legs."""
    legs = []
    for i, leg in enumerate(robot.legs):
        slides = leg.joint.unit == "m"
        drive = pteron.legs.Drive(
            coulomb=(2.0 + i) * (1.0 if slides else 0.1),
            viscous=(10.0 - i) * (1.0 if slides else 0.01),
            offset=0.3 * i,
            rotor_inertia=3e-5,
            ratio=(-1.0) ** i * (200.0 if slides else 20.0),
            rest_speed=0.05,
            **more,
        )
        legs.append(replace(leg, drive=drive))
    return replace(robot, legs=tuple(legs))
