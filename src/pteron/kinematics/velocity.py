"""Jacobians, joint screws, and the rates and accelerations of every joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import overload

import numpy as np

from pteron.conventions import BatchOfMatrices, BatchOfSliders, OnFailure, PoseLike
from pteron.kernels import Array, numeric
from pteron.kinematics.poses import blanked, finite, usable_poses
from pteron.manipulator import Manipulator
from pteron.manipulator.vectors import dot, parallel

__all__ = ["JointMotion", "jacobian", "joint_rates", "joint_screws", "link_jacobians"]


def jacobian(
    robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> BatchOfMatrices:
    """Return the input-output Jacobian J, with slider velocities = J @ velocity, Eq. (10).

    J does not involve the links, so that it is also given where they do not reach.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose that is not finite raises, or gives NaN.

    Returns
    -------
    array, shape (..., n, m)
        Row i is [ d^T | (d x k) . s ] / (d . e): without unit, the last column in m/rad.

    Examples
    --------
    >>> import pteron
    >>> pteron.jacobian(pteron.load("tripteron"), [0.0, 0.0, 0.0])
    array([[1., 0., 0.],
           [0., 1., 0.],
           [0., 0., 1.]])
    """
    poses = usable_poses(robot, pose, on_failure=on_failure)
    matrices: BatchOfMatrices = numeric(robot, "jacobian")(poses)
    return blanked(matrices, poses)


def link_jacobians(
    robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> tuple[Array, Array]:
    """Return the link Jacobians J_u and J_l, Eqs. (11) and (12).

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    upper, lower : array, shape (..., n, 6, m)
        Rows v, then omega: the velocity of the link's reference point (upper: on R1, lower: on R3,
        the platform's end) and its angular velocity, per unit of the platform's velocity.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    poses = usable_poses(robot, pose, bent=True, on_failure=on_failure)
    upper, lower = numeric(robot, "link_jacobians")(poses)
    return blanked(upper, poses), blanked(lower, poses)


def joint_screws(robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise") -> Array:
    """Return the unit screws of every leg's joints about P, Eq. (8).

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., n, j, 6)
        Screws (omega, v) of P, R1, R2, R3 and, for 3T1R, R4 (j = 5, or 4 for 3T).

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    """
    poses = usable_poses(robot, pose, bent=True, on_failure=on_failure)
    screws: Array = numeric(robot, "joint_screws")(poses)
    return blanked(screws, poses)


@dataclass(frozen=True)
class JointMotion:
    """Rates, or accelerations, of every joint.

    Attributes
    ----------
    sliders : array, shape (..., n)
        rho', m/s (or m/s^2).
    upper_links, lower_links : array, shape (..., n)
        theta_u' and theta_l', the absolute rates of the links about d, rad/s (or rad/s^2).
    revolute : array, shape (..., n, j)
        The joints R1, R2, R3 and, for 3T1R, R4: each body against the one before it in the leg.
        Where d is parallel to k, R3 and R4 are one joint: its motion is under R3, and R4 is 0.
    """

    sliders: BatchOfSliders
    upper_links: BatchOfSliders
    lower_links: BatchOfSliders
    revolute: Array


@overload
def joint_rates(
    robot: Manipulator,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: None = None,
    *,
    on_failure: OnFailure = "raise",
) -> JointMotion: ...


@overload
def joint_rates(
    robot: Manipulator,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike,
    *,
    on_failure: OnFailure = "raise",
) -> tuple[JointMotion, JointMotion]: ...


def joint_rates(
    robot: Manipulator,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike | None = None,
    *,
    on_failure: OnFailure = "raise",
) -> JointMotion | tuple[JointMotion, JointMotion]:
    """Return the rates of all joints, passive ones included, and their accelerations.

    theta_u' = l_l . u' / D and theta_l' = -l_u . u' / D with D = (l_u x l_l) . d.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose, velocity : array, shape (..., m)
        The platform's motion; m, rad and s.
    acceleration : array, shape (..., m), optional
        Its acceleration; with it the joints' accelerations are returned too.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    JointMotion or (JointMotion, JointMotion)
        The rates; the rates and the accelerations where an acceleration is given.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).

    Examples
    --------
    >>> import pteron
    >>> robot = pteron.load("quadrupteron")
    >>> rates = pteron.joint_rates(robot, [0, 0, 0, 0], [0.1, 0, 0, 0])
    >>> rates.sliders
    array([0. , 0. , 0.1, 0. ])
    """
    poses = usable_poses(robot, pose, bent=True, on_failure=on_failure)
    rate = finite(robot, velocity, "velocity", on_failure)
    first = blanked(numeric(robot, "joint_rates")(poses, rate), poses, rate)
    rates = _joint_motion(robot, first, rate)
    if acceleration is None:
        return rates
    second = finite(robot, acceleration, "acceleration", on_failure)
    kernel = numeric(robot, "joint_accelerations")
    accelerations = blanked(kernel(poses, rate, second), poses, rate, second)
    return rates, _joint_motion(robot, accelerations, second)


def _joint_motion(robot: Manipulator, motion: Array, platform: Array) -> JointMotion:
    slider, upper, lower = np.moveaxis(motion, -1, 0)
    joints = [upper, lower - upper, -lower]
    if robot.platform.turns:
        turn = np.broadcast_to(platform[..., 3:4], lower.shape)
        axes = [leg.direction for leg in robot.legs]
        merged = np.array([parallel(d, robot.platform.axis) for d in axes])
        sense = np.array([round(dot(d, robot.platform.axis)) for d in axes])
        joints[2] = np.where(merged, sense * turn - lower, -lower)
        joints.append(np.where(merged, 0.0 * lower, turn + 0.0 * lower))
    return JointMotion(slider, upper, lower, np.stack(joints, axis=-1))
