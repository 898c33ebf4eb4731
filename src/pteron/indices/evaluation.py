"""Evaluation of one performance index, such as the condition number, at any number of poses."""

from __future__ import annotations

from pteron.indices.index import expect_index
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import RobotLike, as_manipulator
from pteron.shapes import Numbers, OnFailure, PoseLike


def evaluate(
    robot: RobotLike, name: str, poses: PoseLike, *, on_failure: OnFailure = "nan"
) -> Numbers:
    """Return an index of performance at poses; `INDICES` says what each one means.

    All poses go through one compiled kernel: a map of eight million poses takes about a second.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    name : str
        Name of the index, one of `indices_of(robot)`.
    poses : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"nan", "raise"}
        Whether a pose that fails gives NaN, or raises. The joints' limits do not count.

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
        Under ``on_failure="raise"``, if a leg does not reach a pose.
    SingularPose
        Under ``on_failure="raise"``, if a leg is stretched or folded (type I) or, where the index
        needs J^-1, the actuators do not hold the platform (type II).

    Examples
    --------
    >>> from pteron.indices import evaluate
    >>> evaluate("quadrupteron", "condition", [[0.0, 0.0, 0.0, 0.0], [0.9, 0.0, 0.0, 0.0]]).round(3)
    array([2.414,   nan])
    """
    robot = as_manipulator(robot)
    expect_index(robot, name)
    return evaluate_kernel(robot, name, on_failure, poses)
