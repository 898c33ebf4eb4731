"""The reduced model: the regressor whose product with base parameters is the actuator forces."""

from __future__ import annotations

from pteron.errors import ModelError
from pteron.kernels import OTHER_LAYOUT, same_layout
from pteron.kinematics.evaluate import evaluated
from pteron.manipulator import RobotLike, as_manipulator
from pteron.reduction.result import BaseParameters
from pteron.shapes import OnFailure, PoseLike, Regressors


def base_regressor(
    robot: RobotLike,
    base: BaseParameters,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike,
    *,
    on_failure: OnFailure = "raise",
) -> Regressors:
    """Return the reduced dynamic matrix: base_regressor @ base.values(robot) = inverse_dynamics.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    base : BaseParameters
        Its base parameters, from `base_parameters`.
    pose, velocity, acceleration : array, shape (..., m)
        The platform's motion; m, rad and s. Leading axes broadcast.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., n, rank)
        N or N m per unit of each base parameter.

    Raises
    ------
    ModelError
        If `base` belongs to a machine of another layout, or with other gravity.
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("quadrupteron")
    >>> base = pteron.base_parameters(robot)
    >>> state = [0.01, 0.02, 0.03, 0.1], [0.1, 0.0, 0.2, 1.0], [1.0, 2.0, 0.0, 3.0]
    >>> forces = pteron.base_regressor(robot, base, *state) @ base.values(robot)
    >>> np.allclose(forces, pteron.inverse_dynamics(robot, *state))
    True
    """
    robot = as_manipulator(robot)
    if base.robot is not robot and not same_layout(base.robot, robot):
        raise ModelError(OTHER_LAYOUT.format(base.robot.name, robot.name))
    motion = pose, velocity, acceleration
    matrices: Regressors = evaluated(robot, "base_regressor", on_failure, *motion, base=base)
    return matrices
