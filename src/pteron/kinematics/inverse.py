"""Inverse kinematics: joint coordinates, link vectors and Jacobians from poses."""

from __future__ import annotations

from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import RobotLike
from pteron.shapes import Matrices, OnFailure, PerJoint, PoseLike, Vectors


def inverse_kinematics(
    robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> PerJoint:
    """Return the joint coordinates of poses, Eq. (4): rho of a slider, theta of a crank.

    A crank's angle is the one nearest to the middle of its limits, or in (-pi, pi]. The limits
    themselves are not applied.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its elbows choose the branch.
    pose : array, shape (..., m)
        The poses, as `robot.coordinates` names their numbers: x, y, z, phi, ...; m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose out of a leg's reach raises, or gives NaN.

    Returns
    -------
    array, shape (..., n)
        m for a slider, rad for a crank.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.

    Examples
    --------
    >>> import pteron
    >>> pteron.inverse_kinematics(pteron.load("quadrupteron"), [0.01, 0.02, 0.03, 0.0])
    array([0.03, 0.02, 0.01, 0.02])
    """
    return evaluate_kernel(robot, "inverse_kinematics", on_failure, pose)


def link_vectors(
    robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> tuple[Vectors, Vectors]:
    """Return the vectors of the upper links or cranks, and of the lower links or rods.

    For P-R-R-R legs these are Eqs. (6) and (7).

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its elbows choose the branch.
    pose : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    l_u, l_l : array, shape (..., n, 3)
        Towards the platform, in the base frame, m; NaN for a link that a leg does not have.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If the two ends of a leg coincide, so that its elbow is undetermined.
    """
    return evaluate_kernel(robot, "link_vectors", on_failure, pose)


def jacobian(robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise") -> Matrices:
    """Return the input-output Jacobian J, with joint rates = J @ velocity, Eq. (10).

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., n, m)
        Row i is that of leg i against (c', omega), times d(c', omega)/dx'; for a P-R-R-R leg
        [ d^T | (d x k) . s ] / (d . e), which does not involve the links and is also given where
        they do not reach.

    Raises
    ------
    UnreachablePose
        If a leg whose row depends on the pose does not reach it.
    SingularPose
        If such a leg is stretched or folded (type I).

    Examples
    --------
    >>> import pteron
    >>> pteron.jacobian(pteron.load("tripteron"), [0.0, 0.0, 0.0])
    array([[1., 0., 0.],
           [0., 1., 0.],
           [0., 0., 1.]])
    """
    return evaluate_kernel(robot, "jacobian", on_failure, pose)


def link_jacobians(
    robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> tuple[Array, Array]:
    """Return the link Jacobians J_u and J_l, Eqs. (11) and (12).

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    upper, lower : array, shape (..., n, 6, m)
        Rows v, then omega: the velocity of the link's reference point (upper: at the base end;
        lower: at the platform's end) and its angular velocity, per unit of the platform's
        velocity. NaN for a link that a leg has not.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    return evaluate_kernel(robot, "link_jacobians", on_failure, pose)
