"""Values of a configuration of Klipper's kinematics `delta`: see its delta.py and kin_delta.c."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pteron.export.printers.bed import bed_comments
from pteron.export.printers.centers import Center, end_stop
from pteron.export.printers.linear_delta import LinearDelta
from pteron.export.printers.sections import (
    mm,
    number,
    reading_comment,
    rotation_distance,
    signed_number,
)
from pteron.manipulator import Manipulator


def delta(robot: Manipulator, centers: Sequence[Center]) -> dict[str, Any]:
    """Return the template's values for Klipper's `delta`, from the numbers of `LinearDelta`."""
    numbers = LinearDelta.from_centers(robot, centers, "Klipper's delta")
    good = numbers.most if numbers.ends is None else numbers.bed
    steppers = []
    for i, joint in enumerate(robot.joint_names):
        top = None if numbers.ends is None else mm(numbers.ends[i])
        place = (
            f"Its position is {'' if numbers.rises[i] > 0.0 else '-'}{joint} in mm "
            f"{signed_number(1000.0 * numbers.zeros[i])} mm."
        )
        reading = reading_comment(robot, i, "rotation_distance")
        steppers.append(
            {
                "comments": (place, *end_stop(top, "carriage"), *reading),
                "angle": number(numbers.angles[i]),
                "arm": mm(numbers.arms[i]),
                "end": top,
                "turn": rotation_distance(robot, i),
            }
        )
    return {
        "kinematics": "delta",
        "comments": (
            *bed_comments(robot, numbers.level, good, numbers.most),
            *numbers.error_comments,
        ),
        "radius": mm(numbers.radius),
        "steppers": steppers,
    }
