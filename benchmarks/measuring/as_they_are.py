"""Drives as they are, for a machine whose drives have none of it: play, bending, lag, ripple."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import pteron
from pteron.legs import Drive, Elastic, Wave
from pteron.workspace import home_pose

FREQUENCY = 40.0
"""Of each transmission with the mass that the joint sees at home, its motor held, Hz."""

DAMPING = 0.05
"""Of that, over the critical one."""

PLAY = 1e-5
"""Between the stops, m or rad."""

CURRENT = 1e-3
"""Time constant of the currents, s."""


def as_they_are(robot: pteron.Manipulator) -> pteron.Manipulator:
    """Return the machine with transmissions that bend and have play, lag, ripple and dry friction.

    Friction and limits stay where the drives have them; else dry friction is a tenth of what the
    drive holds at home, and the rotors have a fifth of the mass that their joints see.
    """
    home = home_pose(robot)
    rest = np.zeros_like(home)
    rows = pteron.jacobian(robot, home)
    mass = np.linalg.inv(rows @ np.linalg.solve(pteron.mass_matrix(robot, home), rows.T))
    held = np.abs(pteron.inverse_dynamics(robot, home, rest, rest))
    legs = []
    for i, leg in enumerate(robot.legs):
        drive, seen = leg.drive or Drive(), float(mass[i, i])
        rate = 2.0 * np.pi * FREQUENCY
        bends = Elastic(rate**2 * seen, 2.0 * DAMPING * rate * seen, backlash=PLAY)
        drive = replace(
            drive,
            coulomb=drive.coulomb or 0.1 * float(held[i]),
            rotor_inertia=drive.rotor_inertia or 0.2 * seen,
            elastic=bends,
            current_time=CURRENT,
            ratio=drive.ratio or 1.0,
            ripple=(Wave(6.0, 0.01),),
        )
        legs.append(replace(leg, drive=drive))
    return replace(robot, legs=tuple(legs))
