"""Warnings about the drives of a machine that holds a pose: too weak, or heavy rotors."""

from __future__ import annotations

import numpy as np

from pteron.dynamics import drive_forces, mass_matrix
from pteron.dynamics.joint_space import moved_inertias
from pteron.kernels import Array
from pteron.kinematics import jacobian
from pteron.manipulator import Manipulator

_HEAVY = 100.0
"""Greatest ratio of a rotor's inertia to the mass at its joint: matched, they are equal."""


def load_warnings(robot: Manipulator, pose: Array) -> tuple[str, ...]:
    """Return warnings about the drives under their load in a pose (m,), at rest."""
    if not any(leg.drive for leg in robot.legs):
        return ()
    zero_rates = np.zeros(robot.freedom)
    holding = np.abs(drive_forces(robot, pose, zero_rates, zero_rates))
    moved_masses = moved_inertias(jacobian(robot, pose), mass_matrix(robot, pose))
    warnings = []
    for i, leg in enumerate(robot.legs):
        if (drive := leg.drive) is None:
            continue
        unit, inertia = leg.joint.force_unit, "kg" if leg.joint.unit == "m" else "kg m^2"
        rated = drive.rated_force
        for name, limit in (("max_force", drive.max_force), ("rated_torque's force", rated)):
            if limit is not None and holding[i] > limit:
                warnings.append(
                    f"leg {i + 1}: drive: to hold the home pose takes {holding[i]:.3g} {unit}, "
                    f"more than {name}, {limit:.3g} {unit}"
                )
                break
        if drive.inertia > _HEAVY * moved_masses[i]:
            warnings.append(
                f"leg {i + 1}: drive: the rotor is {drive.inertia:.3g} {inertia} at the joint, "
                f"{drive.inertia / moved_masses[i]:.2g} times what the joint moves: is "
                "rotor_inertia in kg m^2?"
            )
    return tuple(warnings)
