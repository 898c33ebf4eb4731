"""Redundant machines: internal forces due to errors of joint zeros, and the loss of one drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kinematics import jacobian
from pteron.kinematics.evaluate import finite_pose
from pteron.kinematics.unit_rows import unit_rows
from pteron.manipulator import RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import PoseLike

ZERO_ERROR = 1e-4
"""Error of a joint's zero, m along the leg, whose internal forces are stated."""

ASSUMED_STIFFNESS = 1e6
"""Stiffness of a drive whose file has none, N/m along its leg: that of an ordinary belt or gear."""


@dataclass(frozen=True, eq=False, repr=False)
class Redundancy(Result):
    """Internal forces of a redundant machine due to an error of one zero, and loss of a drive.

    Attributes
    ----------
    stiffness : array, shape (n,)
        Stiffness of each drive at its joint, N/m or N m/rad: that of its elastic transmission,
        or `ASSUMED_STIFFNESS`.
    assumed : bool
        Whether the stiffness of any drive is `ASSUMED_STIFFNESS`.
    internal_force : array, shape (n, n)
        Force of each drive (column), N or N m, due to an error of `ZERO_ERROR` in one joint's zero
        (row), the motors being held.
    least_singular_value : array, shape (n,)
        Least singular value of the unit rows of the other legs, where one drive is lost: a load
        takes forces along the legs up to its inverse times as great.
    """

    ROWS = "stiffness internal_force:1 least_singular_value"

    stiffness: Array
    assumed: bool
    internal_force: Array
    least_singular_value: Array


def redundancy(robot: RobotLike, pose: PoseLike) -> Redundancy:
    """Return internal forces of wrong zeros, and how well all drives but one hold the platform.

    Parameters
    ----------
    robot : Manipulator, name or path
        A machine with more legs than coordinates.
    pose : array, shape (m,)
        The pose, m and rad.

    Returns
    -------
    Redundancy

    Raises
    ------
    ModelError
        If the machine has as many legs as coordinates.
    UnreachablePose, SingularPose
        If there are no such forces.

    Examples
    --------
    >>> from pteron.workspace import redundancy
    >>> found = redundancy("delta-redundant", [0.0, 0.0, -0.6])
    >>> found.internal_force[0].round(2)
    array([ 7.5, -7.5,  7.5, -7.5])
    """
    robot = as_manipulator(robot)
    if not robot.redundancy:
        raise ModelError(
            f"{robot.name} has as many legs as freedoms: its drives cannot fight each other, and "
            "none can be lost"
        )
    place = finite_pose(robot, pose, "pose")
    rows = jacobian(robot, place)
    levers = np.array([leg.lever for leg in robot.legs])
    springs = [None if leg.drive is None else leg.drive.elastic for leg in robot.legs]
    stiffness = np.array(
        [
            ASSUMED_STIFFNESS * lever**2 if spring is None else spring.stiffness
            for spring, lever in zip(springs, levers, strict=True)
        ]
    )
    # The platform gives way until its forces cancel: F = K e - K J (J^T K J)^-1 J^T K e.
    pulled = stiffness[:, None] * rows
    shared = np.diag(stiffness) - pulled @ np.linalg.solve(rows.T @ pulled, pulled.T)
    unit = unit_rows(robot, place[None]).rows[0]
    least = [
        np.linalg.svd(np.delete(unit, i, axis=0), compute_uv=False)[-1] for i in range(len(unit))
    ]
    forces = shared.T * (ZERO_ERROR / levers)[:, None]
    return Redundancy(stiffness, None in springs, forces, np.array(least))
