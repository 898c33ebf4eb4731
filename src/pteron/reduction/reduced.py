"""The reduced model: forces from base parameters alone."""

from __future__ import annotations

from pteron.conventions import BatchOfRegressors, OnFailure, PoseLike
from pteron.kernels import numeric
from pteron.kinematics.poses import blanked, finite, usable_poses
from pteron.manipulator import Manipulator
from pteron.reduction.result import BaseParameters

__all__ = ["base_regressor"]


def base_regressor(
    robot: Manipulator,
    base: BaseParameters,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike,
    *,
    on_failure: OnFailure = "raise",
) -> BatchOfRegressors:
    """Return the reduced dynamic matrix: base_regressor @ base.values(robot) = inverse_dynamics.

    Parameters
    ----------
    robot : Manipulator
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
        Newtons per unit of each base parameter.

    Raises
    ------
    ModelError
        If `base` belongs to a machine of another layout, or with other gravity.
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the sliders do not hold the platform (type II).

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
    evaluate = numeric(robot, "base_regressor", base=base)
    poses = usable_poses(robot, pose, bent=True, held=True, on_failure=on_failure)
    rate = finite(robot, velocity, "velocity", on_failure)
    second = finite(robot, acceleration, "acceleration", on_failure)
    matrices: BatchOfRegressors = evaluate(poses, rate, second)
    return blanked(matrices, poses, rate, second)
