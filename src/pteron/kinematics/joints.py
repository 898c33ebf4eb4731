"""Screws of all joints, passive ones too, at a pose; joint and link rates of the motion."""

from __future__ import annotations

from dataclasses import dataclass

from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import RobotLike
from pteron.result import Result
from pteron.shapes import OnFailure, PerJoint, PoseLike


def joint_screws(robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise") -> Array:
    """Return the unit screws of every leg's joints about P, Eq. (8).

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
    array, shape (..., n, j, 6)
        Screws (omega, v), from the base to the platform. A P-R-R-R leg has P, R1, R2, R3 and, for
        3T1R, R4; an R-S-S leg R and the two universal joints of its rod. NaN for a joint that a leg
        does not have.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    return evaluate_kernel(robot, "joint_screws", on_failure, pose)


@dataclass(frozen=True, eq=False, repr=False)
class JointMotion(Result):
    """Rates, or accelerations, of every joint.

    Attributes
    ----------
    actuated : array, shape (..., n)
        q', m/s or rad/s (or per s^2).
    upper_links, lower_links : array, shape (..., n)
        theta_u' and theta_l', the absolute rates of the links about d, rad/s (or rad/s^2); NaN for
        a link that does not turn about its leg's d alone.
    passive : array, shape (..., n, j)
        The passive joints from the base to the platform: each body against the one before it in
        the leg; NaN for a joint that a leg does not have. Where d of a P-R-R-R leg is parallel to
        k, R3 and R4 are one joint: its motion is under R3, and R4 is 0.
    """

    ROWS = "actuated:1 upper_links:1 lower_links:1 passive:2"

    actuated: PerJoint
    upper_links: PerJoint
    lower_links: PerJoint
    passive: Array


def joint_rates(
    robot: RobotLike, pose: PoseLike, velocity: PoseLike, *, on_failure: OnFailure = "raise"
) -> JointMotion:
    """Return the rates of all joints, passive ones included.

    For P-R-R-R legs theta_u' = l_l . u' / D and theta_l' = -l_u . u' / D with D = (l_u x l_l) . d.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose, velocity : array, shape (..., m)
        The platform's motion; m, rad and s.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    JointMotion

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).

    Examples
    --------
    >>> import pteron
    >>> robot = pteron.load("quadrupteron")
    >>> pteron.kinematics.joint_rates(robot, [0, 0, 0, 0], [0.1, 0, 0, 0]).actuated
    array([0. , 0. , 0.1, 0. ])
    """
    rates: tuple[Array, ...] = evaluate_kernel(robot, "joint_rates", on_failure, pose, velocity)
    return JointMotion(*rates)


def joint_accelerations(
    robot: RobotLike,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike,
    *,
    on_failure: OnFailure = "raise",
) -> JointMotion:
    """Return the accelerations of all joints, passive ones included.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose, velocity, acceleration : array, shape (..., m)
        The platform's motion; m, rad and s.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    JointMotion

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    motion = pose, velocity, acceleration
    accelerations: tuple[Array, ...] = evaluate_kernel(
        robot, "joint_accelerations", on_failure, *motion
    )
    return JointMotion(*accelerations)
