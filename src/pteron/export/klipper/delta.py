"""Sections of Klipper's kinematics `delta`, as its delta.py and chelper/kin_delta.c compute it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from pteron.export.klipper.bed import bed, told_bed, tool_of
from pteron.export.klipper.centers import SAME, Center, common, degrees, end_stop
from pteron.export.klipper.sections import (
    PINS,
    SPEEDS,
    ConfigSection,
    differs,
    mm,
    number,
    reading_comment,
    rotation_distance,
    signed,
)
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.manipulator import Manipulator


def delta(robot: Manipulator, centers: Sequence[Center]) -> Iterator[ConfigSection]:
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
    ends = [
        _ends(robot.legs[center.leg].limits, center.at[2], rise, math.sqrt(arm**2 - radius**2))
        for center, rise, arm in zip(centers, rises, arms, strict=True)
    ]
    level, comments = _bed(robot, radius, arms, ends)
    yield ConfigSection(
        "printer",
        (
            ("kinematics", "delta"),
            *SPEEDS,
            ("delta_radius", mm(radius)),
            ("minimum_z_position", None),
            ("print_radius", None),
        ),
        comments,
    )
    for name, center, rise, arm, angle, pair in zip(
        "abc", centers, rises, arms, angles, ends, strict=True
    ):
        leg = robot.legs[center.leg]
        joint = f"{leg.joint.coordinate}{center.leg + 1}"
        top = None if pair is None else mm(pair[1] - level)
        yield ConfigSection(
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
                f"{signed(1000.0 * (center.at[2] - level))} mm.",
                *end_stop(top, "carriage"),
                *reading_comment(robot, center.leg, "rotation_distance"),
            ),
        )


def _ends(
    limits: tuple[float, float] | None, foot: float, rise: float, below: float
) -> tuple[float, float] | None:
    """Return P's z on the axis with a carriage as low, and as high, as its limits let it."""
    if limits is None:
        return None
    low, high = sorted(foot + rise * limit - below for limit in limits)
    return low, high


def _bed(
    robot: Manipulator,
    radius: float,
    arms: Sequence[float],
    ends: Sequence[tuple[float, float] | None],
) -> tuple[float, tuple[str, ...]]:
    """Return P's z at Klipper's bed, and what is said of it."""
    most = min(radius, min(arms) - radius)
    known = [pair for pair in ends if pair is not None]
    if not known:  # the builder's end stops are anywhere
        level = -float(tool_of(robot)[2])
        return level, told_bed(robot, level, most, most)
    level, good = bed(robot, most, max(low for low, _ in known), min(high for _, high in known))
    return level, told_bed(robot, level, good, most)


def _longer(robot: Manipulator, arms: Sequence[float], radius: float) -> None:
    """Refuse rods that are not longer than the radius, as delta.py does."""
    for i, arm in enumerate(arms, start=1):
        if arm <= radius:
            told = f"its rod of {1000.0 * arm:.6g} mm is shorter than the radius, {mm(radius)} mm"
            raise differs(robot, i, told, "delta")
