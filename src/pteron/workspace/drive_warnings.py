"""Warnings about drives: unlikely values, most often in a wrong unit, and too weak or heavy motors.

`drive_warnings` looks at a drive by itself, `load_warnings` at all drives holding the machine.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pteron.dynamics import drive_forces, mass_matrix
from pteron.kernels import Array
from pteron.kinematics import jacobian
from pteron.legs import LegKind
from pteron.manipulator import Manipulator

_SLOW = 5.0
"""Motor radians per metre below which a slider's ratio is unlikely: belts have 20 and more, screws
hundreds."""

_SMOOTH = 0.1
"""Greatest usual `rest_speed`, the speed within which dry friction changes its sign smoothly, as a
share of the drive's greatest speed."""

_PEAK = 20.0
"""Greatest ratio of a drive's peak to its rated force, or the inverse: servo drives have 2 to 5."""

_HEAVY = 100.0
"""Greatest ratio of a rotor's inertia to the mass at its joint: matched, they are equal."""


def drive_warnings(leg: LegKind) -> Iterator[str]:
    """Yield warnings about a leg's drive by itself, one line each."""
    drive = leg.drive
    if drive is None:
        return
    unit, slides = leg.joint.force_unit, leg.joint.unit == "m"
    rate = f"{leg.joint.unit}/s"
    if slides and drive.rotor_inertia > 0.0 and abs(drive.gear) < _SLOW:
        left_out = " (left out)" if drive.ratio is None else ""
        yield (
            f"drive: rotor_inertia with a ratio of {drive.gear:g} motor radians per metre"
            f"{left_out}: belts have some tens, screws hundreds"
        )
    dry = drive.coulomb + (drive.stribeck.force if drive.stribeck else 0.0)
    rated, most = drive.rated_force, drive.max_force
    if most is not None and dry > most:
        yield (
            f"drive: dry friction of {dry:g} {unit} is more than max_force, {most:g} {unit}: it "
            "could not move"
        )
    if rated is not None and dry > rated:
        yield (
            f"drive: dry friction of {dry:g} {unit} is more than rated_torque gives at the joint, "
            f"{rated:.3g} {unit}: are ratio and rated_torque at the motor, in rad/{leg.joint.unit} "
            "and N m?"
        )
    if rated is not None and most is not None and not 1.0 / _PEAK <= most / rated <= _PEAK:
        yield (
            f"drive: max_force is {most / rated:.2g} times what rated_torque gives at the joint, "
            f"{rated:.3g} {unit}: is the ratio in rad/{leg.joint.unit}?"
        )
    fastest = drive.max_speed
    if fastest is not None and drive.rest_speed > _SMOOTH * fastest:
        yield (
            f"drive: rest_speed of {drive.rest_speed:g} {rate} smooths dry friction over much of "
            f"the speeds up to max_speed, {fastest:g} {rate}"
        )
    if fastest is not None and drive.stribeck and drive.stribeck.speed > fastest:
        yield (
            f"drive: stribeck.speed of {drive.stribeck.speed:g} {rate} is beyond max_speed, "
            f"{fastest:g} {rate}"
        )


def load_warnings(robot: Manipulator, pose: Array) -> tuple[str, ...]:
    """Return warnings about the drives under their load in a pose (m,), at rest."""
    rest = np.zeros(robot.freedom)
    holding = np.abs(drive_forces(robot, pose, rest, rest))
    inverse = np.linalg.inv(jacobian(robot, pose))
    moved = np.diag(inverse.T @ mass_matrix(robot, pose) @ inverse)
    found = []
    for i, leg in enumerate(robot.legs):
        if (drive := leg.drive) is None:
            continue
        unit, inertia = leg.joint.force_unit, "kg" if leg.joint.unit == "m" else "kg m^2"
        rated = drive.rated_force
        for name, limit in (("max_force", drive.max_force), ("rated_torque's force", rated)):
            if limit is not None and holding[i] > limit:
                found.append(
                    f"leg {i + 1}: drive: to hold the home pose takes {holding[i]:.3g} {unit}, "
                    f"more than {name}, {limit:.3g} {unit}"
                )
                break
        if drive.inertia > _HEAVY * moved[i]:
            found.append(
                f"leg {i + 1}: drive: the rotor is {drive.inertia:.3g} {inertia} at the joint, "
                f"{drive.inertia / moved[i]:.2g} times what the joint moves: is rotor_inertia in "
                "kg m^2?"
            )
    return tuple(found)
