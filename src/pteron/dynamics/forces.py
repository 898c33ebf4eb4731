"""Inverse and forward dynamics: from a motion to actuator forces and back."""

from __future__ import annotations

from pteron.conventions import BatchOfPoses, BatchOfSliders, OnFailure, PoseLike, SliderLike
from pteron.kernels import numeric
from pteron.kinematics.poses import blanked, finite, usable_poses
from pteron.manipulator import Manipulator

__all__ = ["forward_dynamics", "inverse_dynamics"]


def inverse_dynamics(
    robot: Manipulator,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike,
    wrench: PoseLike | None = None,
    *,
    on_failure: OnFailure = "raise",
) -> BatchOfSliders:
    """Return the actuator forces of a motion, by virtual work, Eqs. (13) and (14).

    F_a = - F_p - J^-T (sum J_u^T F_u + sum J_l^T F_l + F_e), without friction.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose, velocity, acceleration : array, shape (..., m)
        The platform's motion; m, rad and s. Leading axes broadcast.
    wrench : array, shape (..., m), optional
        What acts on the platform at P: a force in N and, for 3T1R, a moment about k in N m.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., n)
        Forces on the sliders, N, positive along +e.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the sliders do not hold the platform (type II).

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("quadrupteron")
    >>> rest = np.zeros(4)
    >>> forces = pteron.inverse_dynamics(robot, rest, rest, rest)
    >>> forces.round(3)
    array([31.082, -1.881,  2.566,  0.685])
    """
    poses = usable_poses(robot, pose, bent=True, held=True, on_failure=on_failure)
    rate = finite(robot, velocity, "velocity", on_failure)
    second = finite(robot, acceleration, "acceleration", on_failure)
    if wrench is None:
        return blanked(numeric(robot, "inverse_dynamics")(poses, rate, second), poses, rate, second)
    load = finite(robot, wrench, "wrench", on_failure)
    forces = numeric(robot, "inverse_dynamics_loaded")(poses, rate, second, load)
    return blanked(forces, poses, rate, second, load)


def forward_dynamics(
    robot: Manipulator,
    pose: PoseLike,
    velocity: PoseLike,
    forces: SliderLike,
    wrench: PoseLike | None = None,
    *,
    on_failure: OnFailure = "raise",
) -> BatchOfPoses:
    """Return the platform's acceleration under actuator forces: M x'' = J^T F + wrench - h.

    It needs no J^-1, so that it is defined at type-II singularities too.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose, velocity : array, shape (..., m)
        The platform's state; m, rad and s.
    forces : array, shape (..., n)
        Forces on the sliders, N, positive along +e.
    wrench : array, shape (..., m), optional
        What acts on the platform at P: a force in N and, for 3T1R, a moment about k in N m.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., m)
        m/s^2 and rad/s^2.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("tripteron")
    >>> rest = np.zeros(3)
    >>> holding = pteron.inverse_dynamics(robot, rest, rest, rest)
    >>> np.abs(pteron.forward_dynamics(robot, rest, rest, holding)).max() < 1e-12
    np.True_
    """
    poses = usable_poses(robot, pose, bent=True, on_failure=on_failure)
    rate = finite(robot, velocity, "velocity", on_failure)
    push = finite(robot, forces, "forces", on_failure)
    if wrench is None:
        return blanked(numeric(robot, "forward_dynamics")(poses, rate, push), poses, rate, push)
    load = finite(robot, wrench, "wrench", on_failure)
    acceleration = numeric(robot, "forward_dynamics_loaded")(poses, rate, push, load)
    return blanked(acceleration, poses, rate, push, load)
