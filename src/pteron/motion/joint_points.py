"""Where the joints of a machine are, for pictures of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics
from pteron.kinematics.evaluate import evaluated
from pteron.manipulator import Manipulator
from pteron.shapes import PerJoint, PoseLike


@dataclass(frozen=True)
class JointPoints:
    """The points of a machine in poses, in the base frame, m.

    Attributes
    ----------
    chain : array, shape (..., n, j, 3)
        A point on each joint of each leg, from the base to the platform point; NaN for a joint that
        a leg has not. Of a P-R-R-R leg: r on the guide, R1 on the slider, the elbow R2, then R3.
    platform_points : array, shape (..., n, 3)
        Where the legs carry the platform.
    reference : array, shape (..., 3)
        P.
    axes : array, shape (..., 3, 3)
        The platform frame's x, y and z, one a row.
    coordinates : array, shape (..., n)
        The joint coordinates, m or rad.
    """

    chain: Array
    platform_points: Array
    reference: Array
    axes: Array
    coordinates: PerJoint


def joint_points(robot: Manipulator, pose: PoseLike) -> JointPoints:
    """Return where the joints are.

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
        If a leg does not reach a pose.

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
    coordinates = inverse_kinematics(robot, given)
    chain = evaluated(robot, "joint_points", "raise", given)
    points = evaluated(robot, "platform_points", "raise", given)
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
    return JointPoints(chain, points, given[..., :3], axes, coordinates)
