"""Where the joints of a machine are, for pictures of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.conventions import BatchOfVectors, PoseLike
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics, link_vectors
from pteron.manipulator import Manipulator

__all__ = ["JointPoints", "joint_points"]


@dataclass(frozen=True)
class JointPoints:
    """The points of a machine in poses, in the base frame, m.

    Attributes
    ----------
    sliders : array, shape (..., n, 3)
        R1, on the slider.
    elbows : array, shape (..., n, 3)
        R2.
    platform_points : array, shape (..., n, 3)
        R3, where the leg carries the platform.
    reference : array, shape (..., 3)
        P.
    axes : array, shape (..., 3, 3)
        The platform frame's x, y and z, one a row.
    coordinates : array, shape (..., n)
        The slider coordinates.
    """

    sliders: BatchOfVectors
    elbows: BatchOfVectors
    platform_points: BatchOfVectors
    reference: Array
    axes: Array
    coordinates: Array


def joint_points(robot: Manipulator, pose: PoseLike) -> JointPoints:
    """Return where the joints are: R1 = r + rho e, R2 = R1 + l_u, R3 = R2 + l_l, Eqs. (3) to (7).

    Parameters
    ----------
    robot : Manipulator
        The machine; its elbows choose the branch.
    pose : array, shape (..., m)
        The poses, m and rad.

    Returns
    -------
    JointPoints

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import joint_points
    >>> points = joint_points(pteron.load("tripteron"), [0.0, 0.0, 0.0])
    >>> points.platform_points.round(6) + 0.0
    array([[0.  , 0.05, 0.  ],
           [0.  , 0.  , 0.05],
           [0.05, 0.  , 0.  ]])
    """
    given = np.asarray(pose, dtype=float)
    rho = inverse_kinematics(robot, given)
    l_u, l_l = link_vectors(robot, given)
    guides = np.array([leg.guide_point for leg in robot.legs])
    directions = np.array([leg.e for leg in robot.legs])
    sliders = guides + rho[..., None] * directions
    elbows = sliders + l_u
    x, y, z = (np.array(axis) for axis in robot.platform.frame)
    angle = (given[..., 3] if robot.platform.turns else np.zeros(given.shape[:-1]))[..., None]
    axes = np.stack(
        [
            np.cos(angle) * x + np.sin(angle) * y,
            np.cos(angle) * y - np.sin(angle) * x,
            np.broadcast_to(z, (*angle.shape[:-1], 3)),
        ],
        axis=-2,
    )
    return JointPoints(sliders, elbows, elbows + l_l, given[..., :3], axes, rho)
