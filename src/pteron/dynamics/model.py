"""M x'' + C x' + g = J^T F in numbers, and the energies."""

from __future__ import annotations

from pteron.conventions import BatchOfMatrices, BatchOfNumbers, BatchOfPoses, OnFailure, PoseLike
from pteron.kernels import numeric
from pteron.kinematics.poses import blanked, finite, usable_poses
from pteron.manipulator import Manipulator

__all__ = [
    "bias_forces",
    "coriolis_matrix",
    "gravity_forces",
    "kinetic_energy",
    "mass_matrix",
    "potential_energy",
]


def mass_matrix(
    robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> BatchOfMatrices:
    """Return the mass matrix M of M x'' + h = J^T F, in platform coordinates.

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
    array, shape (..., m, m)
        Symmetric and positive definite; kg, kg m and kg m^2.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).

    Examples
    --------
    >>> import numpy as np, pteron
    >>> M = pteron.mass_matrix(pteron.load("tripteron"), [0.0, 0.0, 0.0])
    >>> np.allclose(M, M.T), np.linalg.eigvalsh(M).min() > 0
    (True, np.True_)
    """
    poses = usable_poses(robot, pose, bent=True, on_failure=on_failure)
    return blanked(numeric(robot, "mass_matrix")(poses), poses)


def coriolis_matrix(
    robot: Manipulator, pose: PoseLike, velocity: PoseLike, *, on_failure: OnFailure = "raise"
) -> BatchOfMatrices:
    """Return C of M x'' + C x' + g = J^T F, from Christoffel's symbols of M.

    With this C, dM/dt - 2 C is skew-symmetric.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose, velocity : array, shape (..., m)
        The platform's state; m, rad and s.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., m, m)

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    poses = usable_poses(robot, pose, bent=True, on_failure=on_failure)
    rate = finite(robot, velocity, "velocity", on_failure)
    return blanked(numeric(robot, "coriolis_matrix")(poses, rate), poses, rate)


def bias_forces(
    robot: Manipulator, pose: PoseLike, velocity: PoseLike, *, on_failure: OnFailure = "raise"
) -> BatchOfPoses:
    """Return h = C x' + g of M x'' + h = J^T F: Coriolis, centrifugal and gravity forces.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose, velocity : array, shape (..., m)
        The platform's state; m, rad and s.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., m)
        N and, for 3T1R, N m.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    poses = usable_poses(robot, pose, bent=True, on_failure=on_failure)
    rate = finite(robot, velocity, "velocity", on_failure)
    return blanked(numeric(robot, "bias_forces")(poses, rate), poses, rate)


def gravity_forces(
    robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> BatchOfPoses:
    """Return g of M x'' + C x' + g = J^T F: the gradient of the potential energy.

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
    array, shape (..., m)
        N and, for 3T1R, N m.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    poses = usable_poses(robot, pose, bent=True, on_failure=on_failure)
    return blanked(numeric(robot, "gravity_forces")(poses), poses)


def kinetic_energy(
    robot: Manipulator, pose: PoseLike, velocity: PoseLike, *, on_failure: OnFailure = "raise"
) -> BatchOfNumbers:
    """Return the kinetic energy T = x'^T M x' / 2.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose, velocity : array, shape (..., m)
        The platform's state; m, rad and s.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (...)
        J.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    poses = usable_poses(robot, pose, bent=True, on_failure=on_failure)
    rate = finite(robot, velocity, "velocity", on_failure)
    return blanked(numeric(robot, "kinetic_energy")(poses, rate), poses, rate)


def potential_energy(
    robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> BatchOfNumbers:
    """Return the potential energy of gravity, zero with every mass at the base frame's origin.

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
    array, shape (...)
        J.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If R1 and R3 of a leg coincide, so that its elbow is undetermined.
    """
    poses = usable_poses(robot, pose, reach=True, on_failure=on_failure)
    return blanked(numeric(robot, "potential_energy")(poses), poses)
