"""Klipper's delta: klippy/kinematics/delta.py and klippy/chelper/kin_delta.c."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from pteron.export.klipper.centers import SAME, Center, common, degrees, end_stop
from pteron.export.klipper.sections import (
    PINS,
    SPEEDS,
    Section,
    differs,
    mm,
    number,
    rotation_distance,
    signed,
)
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.manipulator import Manipulator


def delta(robot: Manipulator, centers: Sequence[Center]) -> Iterator[Section]:
    """Yield the sections of `delta`: stepper = z + sqrt(arm^2 - (x - tower x)^2 - ...)."""
    radii, angles, rises = [], [], []
    for i, center in enumerate(centers, start=1):
        rise = center.along[2]
        if np.abs(center.along[:2]).max() > SAME:
            raise differs(robot, i, "its guide is not vertical, along z", "delta")
        radii.append(float(np.hypot(*center.at[:2])))
        angles.append(degrees(center.at))
        rises.append(float(np.sign(rise)))
    radius = common(robot, radii, "is {:.6g} mm from the z axis", "delta")
    arms = [center.radius for center in centers]
    _longer(robot, arms, radius)
    # Klipper's carriage is above the platform; ours is where inverse kinematics puts it.
    poses = random_poses(robot, 50, seed=1, type_i=0.02, type_ii=0.0, limits=False)
    joints = inverse_kinematics(robot, poses)
    for i, (center, rise) in enumerate(zip(centers, rises, strict=True), start=1):
        height = center.at[2] + rise * joints[:, i - 1]
        if not (height > poses[:, 2]).all():
            told = "its slider is below the platform, and Klipper has it above: turn the model over"
            raise differs(robot, i, told, "delta")
    yield Section(
        "printer",
        (
            ("kinematics", "delta"),
            *SPEEDS,
            ("delta_radius", mm(radius)),
            ("minimum_z_position", None),
            ("print_radius", None),
        ),
        ("Klipper's z is the pose's z, in mm.",),
    )
    for name, center, rise, arm, angle in zip("abc", centers, rises, arms, angles, strict=True):
        leg = robot.legs[center.leg]
        joint = f"{leg.joint.coordinate}{center.leg + 1}"
        top = None
        if leg.limits is not None:
            highest = center.at[2] + rise * leg.limits[1 if rise > 0.0 else 0]
            top = mm(highest - math.sqrt(arm**2 - radius**2))
        yield Section(
            f"stepper_{name}",
            (
                ("angle", number(angle)),
                ("arm_length", mm(arm)),
                ("position_endstop", top),
                ("rotation_distance", rotation_distance(robot, center.leg)),
                ("endstop_pin", None),
                *PINS,
            ),
            (
                f"Its position is {'' if rise > 0.0 else '-'}{joint} in mm "
                f"{signed(1000.0 * center.at[2])} mm.",
                *end_stop(top, "carriage"),
            ),
        )


def _longer(robot: Manipulator, arms: Sequence[float], radius: float) -> None:
    """Refuse rods that are not longer than the radius, as delta.py does."""
    for i, arm in enumerate(arms, start=1):
        if arm <= radius:
            told = f"its rod of {1000.0 * arm:.6g} mm is shorter than the radius, {mm(radius)} mm"
            raise differs(robot, i, told, "delta")
