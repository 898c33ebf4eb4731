"""How much of its range each joint uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics
from pteron.manipulator import Manipulator
from pteron.shapes import PoseLike
from pteron.workspace.reserve import clearances


@dataclass(frozen=True)
class JointRanges:
    """The part of its range that each joint uses.

    Attributes
    ----------
    least, greatest : array, shape (n,)
        Of the joint coordinate, m or rad.
    limits : tuple of ((float, float) or None)
        What the machine allows; None where it does not say.
    within : array of bool, shape (n,)
        Whether the range lies within the limits; True where there are none.
    """

    least: Array
    greatest: Array
    limits: tuple[tuple[float, float] | None, ...]
    within: NDArray[np.bool_]


def joint_ranges(robot: Manipulator, poses: PoseLike) -> JointRanges:
    """Return the least and the greatest joint coordinate over poses.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    poses : array, shape (..., m)
        At least one pose, m and rad.

    Returns
    -------
    JointRanges

    Raises
    ------
    DataError
        If there is no pose.
    UnreachablePose
        If a leg does not reach a pose.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import joint_ranges
    >>> ranges = joint_ranges(pteron.load("tripteron"), [[0.0, 0.1, 0.0], [0.1, 0.0, 0.0]])
    >>> ranges.greatest, bool(ranges.within.all())
    (array([0.1, 0.1, 0. ]), True)
    """
    joints = inverse_kinematics(robot, poses).reshape(-1, robot.freedom)
    if not len(joints):
        raise DataError("poses: none given, at least one expected")
    return JointRanges(
        joints.min(axis=0),
        joints.max(axis=0),
        tuple(leg.limits for leg in robot.legs),
        np.asarray((clearances(robot, joints) >= 0.0).all(axis=0)),
    )
