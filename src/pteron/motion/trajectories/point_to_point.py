"""`point_to_point`: the tool along a straight line, from rest in one pose to rest in another."""

from __future__ import annotations

import numpy as np

from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.trajectories.limits import MotionLimits
from pteron.motion.trajectories.path import line_path
from pteron.motion.trajectories.time_law import polynomial_motion
from pteron.motion.trajectories.time_polynomials import PolynomialLaw
from pteron.shapes import PoseLike


def point_to_point(
    robot: RobotLike,
    start: PoseLike,
    end: PoseLike,
    *,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    law: PolynomialLaw = "quintic",
    step: float | None = None,
) -> Motion:
    """Return the straight motion of the tool from rest in one pose to rest in another.

    The tool's centre point moves on a straight line, and the pose's angles change in proportion.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    start, end : array, shape (m,)
        m and rad.
    duration, limits, law, step
        As of `along`: a duration, or the shortest that keeps the limits.

    Returns
    -------
    Motion

    Raises
    ------
    UnreachablePose, SingularPose, DataError, ModelError
        As `along`.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import point_to_point
    >>> robot = pteron.load("delta")
    >>> motion = point_to_point(robot, [0.0, 0.0, -0.9], [0.1, 0.0, -0.8], duration=0.5)
    >>> motion.at(0.25)[0]
    array([ 0.05,  0.  , -0.85])
    """
    robot = as_manipulator(robot)
    ends = np.stack([finite_pose(robot, start, "start"), finite_pose(robot, end, "end")])
    path = line_path(robot, ends)
    return polynomial_motion(robot, path, duration=duration, limits=limits, law=law, step=step)
