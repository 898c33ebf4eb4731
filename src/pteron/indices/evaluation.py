"""Evaluation of one performance index, such as the condition number, at any number of poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.indices.index import Index, expect_index, function_values
from pteron.kernels import Array, as_array
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.shapes import Numbers, OnFailure, PoseLike


def evaluate(
    robot: RobotLike, name: str | Index, poses: PoseLike, *, on_failure: OnFailure = "raise"
) -> Numbers:
    """Return the values (...) of a performance index at poses (..., m).

    All poses go through one compiled kernel: a map of eight million poses takes about a second.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    name : str or Index
        Name of the index, one of `indices_of(robot)`; or an `Index` of one's own, with a function.
    poses : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN. The joints' limits do not count.

    Returns
    -------
    array, shape (...)
        In the index's unit.

    Raises
    ------
    DataError
        If there is no index of that name.
    ModelError
        If it is about turning or translation, and the platform does not move so.
    UnreachablePose
        If a leg does not reach a pose, unless `on_failure` is "nan".
    SingularPose
        If a leg is stretched or folded (type I) or, where the index needs J^-1, the actuators do
        not hold the platform (type II), unless `on_failure` is "nan".

    Examples
    --------
    >>> from pteron.indices import evaluate
    >>> poses = [[0.0, 0.0, 0.0, 0.0], [0.9, 0.0, 0.0, 0.0]]
    >>> evaluate("quadrupteron", "condition", poses, on_failure="nan").round(3)
    array([2.414,   nan])
    """
    robot = as_manipulator(robot)
    index = expect_index(robot, name)
    if index.function is None:
        return evaluate_kernel(robot, index.name, on_failure, poses)
    joints: Array = evaluate_kernel(robot, "inverse_kinematics", on_failure, poses)
    array = as_array(poses, "pose", (robot.freedom,), columns=robot.coordinates)
    in_reach = np.asarray(~np.isnan(joints).any(axis=-1))
    return values_in_reach(robot, index, array, in_reach)[()]


def values_in_reach(
    robot: Manipulator, index: Index, poses: Array, in_reach: NDArray[np.bool_]
) -> Array:
    """Return an index's values (...) at poses (..., m); NaN at those out of reach."""
    values = np.full(poses.shape[:-1], np.nan)
    if in_reach.any():
        values[in_reach] = function_values(robot, index, poses[in_reach])
    return values
