"""Configuration sections of Klipper's kinematics `rotary_delta`, see its rotary_delta.py."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from pteron.errors import ModelError
from pteron.export.printers.bed import bed, told_bed
from pteron.export.printers.centers import SAME, Center, common, degrees, end_stop
from pteron.export.printers.sections import (
    INSTEAD,
    PINS,
    SPEEDS,
    ConfigSection,
    differs,
    mm,
    number,
    reading_comment,
    signed,
)
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.legs import Reading
from pteron.manipulator import Manipulator

_TAKER = "Klipper's rotary_delta"


def rotary(robot: Manipulator, centers: Sequence[Center]) -> Iterator[ConfigSection]:
    """Yield the sections of `rotary_delta`: arms that turn in vertical planes through z."""
    radii, heights, angles, lifts, zeros = [], [], [], [], []
    for i, center in enumerate(centers, start=1):
        assert center.across is not None  # it turns
        out = np.array([*center.at[:2], 0.0]) / np.hypot(*center.at[:2])
        axis = np.cross(center.along, center.across)
        axis /= np.linalg.norm(axis)
        if abs(axis[2]) > SAME:
            raise differs(robot, i, "its crank's axis is not horizontal", _TAKER)
        aside = 1000.0 * float(center.at @ axis)
        if abs(aside) > 1000.0 * SAME:
            told = f"its crank's plane passes the z axis at {abs(aside):.6g} mm, not through it"
            raise differs(robot, i, told, _TAKER)
        lifts.append(float(np.sign(np.cross(out, [0.0, 0.0, 1.0]) @ axis)))
        zeros.append(math.atan2(center.along[2], center.along @ out))
        radii.append(float(np.hypot(*center.at[:2])))
        heights.append(float(center.at[2]))
        angles.append(degrees(center.at))
    radius = common(robot, radii, "has its shoulder {:.6g} mm from the z axis", _TAKER)
    height = common(robot, heights, "has its shoulder at z = {:.6g} mm", _TAKER)
    uppers = [float(np.linalg.norm(center.along)) for center in centers]
    arms = [center.radius for center in centers]
    _outside(robot, centers, lifts, zeros, height)
    tops = [
        _rotary_top(robot.legs[k].limits, lift, zero, radius, upper, arm)
        for k, (lift, zero, upper, arm) in enumerate(zip(lifts, zeros, uppers, arms, strict=True))
    ]
    highest = min((top for top in tops if top is not None), default=0.0)
    level, comments = _bed(robot, radius, height, uppers, arms, highest)
    yield ConfigSection(
        "printer",
        (
            ("kinematics", "rotary_delta"),
            *SPEEDS,
            ("shoulder_radius", mm(radius)),
            ("shoulder_height", mm(height - level)),
            ("minimum_z_position", None),
        ),
        (*comments, "For another bed change shoulder_height and the end stops."),
    )
    for k, name in enumerate("abc"):
        leg = robot.legs[k]
        joint = f"{leg.joint.coordinate}{k + 1}"
        top = tops[k]
        end = None if top is None else mm(height + top - level)
        yield ConfigSection(
            f"stepper_{name}",
            (
                ("angle", number(angles[k])),
                ("upper_arm_length", mm(uppers[k])),
                ("lower_arm_length", mm(arms[k])),
                ("position_endstop", end),
                ("gear_ratio", _gear(robot, k)),
                ("endstop_pin", None),
                *PINS,
            ),
            (
                f"Its position is {'' if lifts[k] > 0.0 else '-'}{joint} in rad "
                f"{signed(zeros[k])} rad: 0 where the arm is level, growing as it lifts.",
                *end_stop(end, "arm"),
                *reading_comment(robot, k, "gear_ratio"),
            ),
        )


def _outside(
    robot: Manipulator,
    centers: Sequence[Center],
    lifts: Sequence[float],
    zeros: Sequence[float],
    height: float,
) -> None:
    """Refuse a machine whose elbows are not where kin_rotary_delta.c takes them: outside.

    The platform is below the shoulders; of the two elbows it takes that of the greater angle.
    """
    poses = random_poses(robot, 500, seed=1, type_i=0.05, type_ii=0.0, limits=False)
    poses = poses[poses[:, 2] < height]
    if len(poses) == 0:
        raise ModelError(
            f"{robot.name}: its platform is above the shoulders, and Klipper's rotary_delta has it "
            f"below: turn the model over; or {INSTEAD}"
        )
    joints = inverse_kinematics(robot, poses)
    for i, (center, lift, zero) in enumerate(zip(centers, lifts, zeros, strict=True)):
        out = np.array([*center.at[:2], 0.0]) / np.hypot(*center.at[:2])
        angle = lift * joints[:, i] + zero
        wrist = poses - center.at
        down = np.arctan2(wrist[:, 2], wrist @ out)
        if (np.sin(angle - down) < 0.0).any():
            told = (
                "its elbow is inside while the platform is below, and Klipper has it outside; turn "
                "a model over whose platform is above"
            )
            raise differs(robot, i + 1, told, _TAKER)


def _bed(
    robot: Manipulator,
    radius: float,
    height: float,
    uppers: Sequence[float],
    arms: Sequence[float],
    top: float,
) -> tuple[float, tuple[str, ...]]:
    """Return P's z at Klipper's bed, and what is said of it."""
    lengths = [upper + arm for upper, arm in zip(uppers, arms, strict=True)]
    for i, length in enumerate(lengths, start=1):
        if length <= radius:
            raise differs(robot, i, "its arms do not reach the z axis", _TAKER)
    reach = math.sqrt(min(lengths) ** 2 - radius**2)
    # Klipper lets the tool go so far from the axis, whatever the legs reach.
    most = min(radius + min(uppers), min(arms) - radius)
    level, good = bed(robot, most, height - reach, height + top)
    return level, told_bed(robot, level, good, most)


def _rotary_top(
    limits: tuple[float, float] | None,
    lift: float,
    zero: float,
    radius: float,
    upper: float,
    arm: float,
) -> float | None:
    """Return z over the shoulder, on the axis, where a crank is as high as its limits let it."""
    if limits is None:
        return None
    angle = zero + lift * limits[1 if lift > 0.0 else 0]
    across = radius + upper * math.cos(angle)
    if abs(across) >= arm:
        return None
    return upper * math.sin(angle) - math.sqrt(arm**2 - across**2)


def _gear(robot: Manipulator, leg: int) -> str | None:
    """Return the gear ratio, None where the machine's file does not say."""
    drive = robot.legs[leg].drive
    scale = (robot.legs[leg].reading or Reading()).scale
    return None if drive is None or drive.ratio is None else f"{number(abs(drive.ratio / scale))}:1"
