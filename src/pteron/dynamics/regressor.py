"""The dynamics as a form linear in the inertial parameters."""

from __future__ import annotations

from pteron.kinematics.evaluate import evaluated
from pteron.manipulator import Manipulator
from pteron.shapes import OnFailure, PoseLike, Regressors


def regressor(
    robot: Manipulator,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike,
    *,
    on_failure: OnFailure = "raise",
) -> Regressors:
    """Return the dynamic matrix D of Eq. (15): D @ parameters(robot) = inverse_dynamics(...).

    Parameters
    ----------
    robot : Manipulator
        The machine; its inertial parameters play no part.
    pose, velocity, acceleration : array, shape (..., m)
        The platform's motion; m, rad and s. Leading axes broadcast.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., n, N)
        N or N m per unit of each parameter, in the order of `parameter_names`.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("quadrupteron")
    >>> state = [0.01, 0.02, 0.03, 0.1], [0.1, 0.0, 0.2, 1.0], [1.0, 2.0, 0.0, 3.0]
    >>> D = pteron.regressor(robot, *state)
    >>> D.shape, np.allclose(D @ pteron.parameters(robot), pteron.inverse_dynamics(robot, *state))
    ((4, 40), True)
    """
    motion = pose, velocity, acceleration
    matrices: Regressors = evaluated(robot, "regressor", on_failure, *motion)
    return matrices
