"""The constraint measure: how well the legs' couples hold the platform's orientation."""

from __future__ import annotations

from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import RobotLike, as_manipulator
from pteron.shapes import Numbers, OnFailure, PoseLike


def constraint_measure(
    robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> Numbers:
    """Return the constraint measure: 0 where the platform is free to turn about a forbidden axis.

    Each leg exerts constraint couples: a P-R-R-R leg perpendicular to its revolute axes, a pair of
    parallel rods about bar x rod. The measure is the volume that the couples span, each of length 1
    or less, divided by the largest possible volume. It depends on the pose for machines with pairs
    of parallel rods; for legs with revolute joints alone it is constant.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Treatment of a pose out of reach.

    Returns
    -------
    array, shape (...)
        In [-1, 1], without unit; NaN where a file does not tell the bars of parallel rods.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.

    References
    ----------
    Zlatanov, Bonev and Gosselin, "Constraint singularities of parallel mechanisms", ICRA 2002.

    Examples
    --------
    >>> import pteron
    >>> float(pteron.kinematics.constraint_measure("tripteron", [0.0, 0.0, 0.0]).round(9))
    1.0
    """
    robot = as_manipulator(robot)
    measures: Array = evaluate_kernel(robot, "constraint", on_failure, pose)
    return measures
