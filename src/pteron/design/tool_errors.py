"""Position error of the tool, as the parts of drives and of all else.

The parts are computed once for a machine; from them follows the error with any drives.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pteron.design.requirement_tables import AccuracyTable
from pteron.design.worst_cases import worst_position_errors
from pteron.indices import (
    Tolerances,
    pose_error,
)
from pteron.kernels import Array
from pteron.manipulator import Manipulator


def tolerances(accuracy: AccuracyTable, joints: float | Sequence[float]) -> Tolerances:
    """Return `Tolerances` of the parts in `accuracy`, with these joint errors, m or rad."""
    return Tolerances(joints, 0.0, accuracy.point, accuracy.length, accuracy.angle)


def joint_errors(accuracy: AccuracyTable, ratios: Array, backlash: Array) -> Array:
    """Return joint errors, m or rad: half an encoder count plus half the backlash.

    `ratios` are motor radians per joint unit, `backlash` is at the joint, m or rad.
    """
    return np.asarray(
        np.pi / accuracy.counts_per_turn / ratios + 0.5 * accuracy.backlash * backlash
    )


def unit_errors(accuracy: AccuracyTable, robot: Manipulator, poses: Array) -> tuple[Array, Array]:
    """Return tool errors (N,) at poses: per unit of joint error, and those of the parts, m."""
    joints = greatest_errors(accuracy, robot, poses, Tolerances(joints=1.0))
    if not accuracy.has_part_errors:
        return joints, np.zeros_like(joints)
    return joints, greatest_errors(accuracy, robot, poses, tolerances(accuracy, 0.0))


def greatest_errors(
    accuracy: AccuracyTable, robot: Manipulator, poses: Array, errors: Tolerances
) -> Array:
    """Return the tool's error at poses, (N,), m: worst case or standard deviation.

    `accuracy.counted` selects which.
    """
    if accuracy.counted == "worst":
        return worst_position_errors(robot, poses, errors)
    return np.asarray(pose_error(robot, poses, errors).position)


def errors_with(
    accuracy: AccuracyTable, units: tuple[Array, Array], ratios: Array, backlash: Array
) -> Array:
    """Return the tool's greatest error, m, for each of O choices of drives: (O,).

    `units` are errors as `unit_errors` returns them.
    """
    joint = joint_errors(accuracy, ratios, backlash)[:, None] * units[0]
    total = joint + units[1] if accuracy.counted == "worst" else np.hypot(joint, units[1])
    return np.asarray(total.max(axis=1))
