"""Values of a configuration of Klipper's kinematics `rotary_delta`, see its rotary_delta.py."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pteron.errors import ModelError
from pteron.export.printers.bed import bed_comments, find_bed
from pteron.export.printers.centers import SAME, Center, bearing, common_value, end_stop
from pteron.export.printers.sections import (
    INSTEAD,
    mm,
    number,
    reading_comment,
    signed_number,
    unfit_error,
)
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.legs import Reading
from pteron.manipulator import Manipulator

_TAKER = "Klipper's rotary_delta"


class _Arm(NamedTuple):
    """A crank as Klipper has it: its shoulder, and its angle, lift q + zero, from the level."""

    number: int
    """The leg's, from 1."""
    limits: tuple[float, float] | None
    shoulder: Array
    outward: Array
    """From the z axis to the shoulder, a unit vector."""
    lift: float
    """1 where the arm lifts as its joint coordinate grows, else -1."""
    zero: float
    upper: float
    lower: float

    @classmethod
    def from_center(cls, robot: Manipulator, center: Center) -> _Arm:
        """Return the arm of a leg whose crank turns in a vertical plane through z."""
        assert center.across is not None  # it turns
        out = np.array([*center.origin[:2], 0.0]) / np.hypot(*center.origin[:2])
        axis = np.cross(center.along, center.across)
        axis /= np.linalg.norm(axis)
        i, aside = center.leg + 1, 1000.0 * float(center.origin @ axis)
        if abs(axis[2]) > SAME:
            raise unfit_error(robot, i, "its crank's axis is not horizontal", _TAKER)
        if abs(aside) > 1000.0 * SAME:
            reason = f"its crank's plane passes the z axis at {abs(aside):.6g} mm, not through it"
            raise unfit_error(robot, i, reason, _TAKER)
        lift = float(np.sign(np.cross(out, [0.0, 0.0, 1.0]) @ axis))
        zero, upper = math.atan2(center.along[2], center.along @ out), np.linalg.norm(center.along)
        limits = robot.legs[center.leg].limits
        return cls(i, limits, center.origin, out, lift, zero, float(upper), center.radius)

    def top(self, radius: float) -> float | None:
        """Return z over the shoulder, on the axis, where its limits let it be highest."""
        if self.limits is None:
            return None
        angle = self.zero + self.lift * self.limits[1 if self.lift > 0.0 else 0]
        distance = radius + self.upper * math.cos(angle)
        if abs(distance) >= self.lower:
            return None
        return self.upper * math.sin(angle) - math.sqrt(self.lower**2 - distance**2)


def rotary(robot: Manipulator, centers: Sequence[Center]) -> dict[str, Any]:
    """Return the template's values for Klipper's `rotary_delta`: arms in planes through z."""
    arms = [_Arm.from_center(robot, center) for center in centers]
    radii = [float(np.hypot(*arm.shoulder[:2])) for arm in arms]
    radius = common_value(robot, radii, "has its shoulder {:.6g} mm from the z axis", _TAKER)
    heights = [float(arm.shoulder[2]) for arm in arms]
    height = common_value(robot, heights, "has its shoulder at z = {:.6g} mm", _TAKER)
    _refuse_elbows_inside(robot, arms, height)
    tops = [arm.top(radius) for arm in arms]
    highest = min((top for top in tops if top is not None), default=0.0)
    level, comments = _bed(robot, arms, radius, height, highest)
    steppers = []
    for k, (arm, top) in enumerate(zip(arms, tops, strict=True)):
        end = None if top is None else mm(height + top - level)
        joint = f"{'' if arm.lift > 0.0 else '-'}{robot.joint_names[k]}"
        place = (
            f"Its position is {joint} in rad {signed_number(arm.zero)} rad: 0 where the arm is "
            "level, growing as it lifts."
        )
        reading = reading_comment(robot, k, "gear_ratio")
        steppers.append(
            {
                "comments": (place, *end_stop(end, "arm"), *reading),
                "angle": number(bearing(arm.shoulder)),
                "upper": mm(arm.upper),
                "lower": mm(arm.lower),
                "end": end,
                "gear": _gear(robot, k),
            }
        )
    return {
        "kinematics": "rotary_delta",
        "comments": (*comments, "For another bed change shoulder_height and the end stops."),
        "radius": mm(radius),
        "height": mm(height - level),
        "steppers": steppers,
    }


def _refuse_elbows_inside(robot: Manipulator, arms: Sequence[_Arm], height: float) -> None:
    """Raise ModelError if elbows are not where kin_rotary_delta.c takes them: outside.

    The platform is below the shoulders; of the two elbows it takes that of the greater angle.
    """
    poses = random_poses(robot, 500, seed=1, type_i=0.05, type_ii=0.0, limits=False)
    poses = poses[poses[:, 2] < height]
    if len(poses) == 0:
        raise ModelError(
            f"{robot.name}: its platform is above the shoulders, and Klipper's rotary_delta has it "
            f"below: turn the model over; or {INSTEAD}"
        )
    for arm, q in zip(arms, inverse_kinematics(robot, poses).T, strict=True):
        wrist = poses - arm.shoulder
        down = np.arctan2(wrist[:, 2], wrist @ arm.outward)
        if (np.sin(arm.lift * q + arm.zero - down) < 0.0).any():
            reason = (
                "its elbow is inside while the platform is below, and Klipper has it outside; turn "
                "a model over whose platform is above"
            )
            raise unfit_error(robot, arm.number, reason, _TAKER)


def _bed(
    robot: Manipulator, arms: Sequence[_Arm], radius: float, height: float, top: float
) -> tuple[float, tuple[str, ...]]:
    """Return P's z at Klipper's bed, m, and comments on it."""
    for arm in arms:
        if arm.upper + arm.lower <= radius:
            raise unfit_error(robot, arm.number, "its arms do not reach the z axis", _TAKER)
    reach = math.sqrt(min(arm.upper + arm.lower for arm in arms) ** 2 - radius**2)
    # Klipper lets the tool go so far from the axis, whatever the legs reach.
    most = min(radius + min(arm.upper for arm in arms), min(arm.lower for arm in arms) - radius)
    level, good = find_bed(robot, most, height - reach, height + top)
    return level, bed_comments(robot, level, good, most)


def _gear(robot: Manipulator, leg: int) -> str | None:
    """Return the gear ratio as text, such as 5:1; None if the machine's file has none."""
    drive = robot.legs[leg].drive
    scale = (robot.legs[leg].reading or Reading()).scale
    return None if drive is None or drive.ratio is None else f"{number(abs(drive.ratio / scale))}:1"
