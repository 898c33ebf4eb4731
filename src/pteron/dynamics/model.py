"""The terms of the equation of motion M x'' + C x' + g = J^T F at given poses, and the energies."""

from __future__ import annotations

from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import RobotLike
from pteron.shapes import Matrices, Numbers, OnFailure, PerCoordinate, PoseLike


def mass_matrix(robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise") -> Matrices:
    """Return the mass matrix M of M x'' + h = J^T F, in platform coordinates.

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
    array, shape (..., m, m)
        Symmetric and positive definite; kg, kg m and kg m^2.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).

    Examples
    --------
    >>> import numpy as np, pteron
    >>> M = pteron.mass_matrix(pteron.load("tripteron"), [0.0, 0.0, 0.0])
    >>> np.allclose(M, M.T), np.linalg.eigvalsh(M).min() > 0
    (True, np.True_)
    """
    return evaluate_kernel(robot, "mass_matrix", on_failure, pose)


def coriolis_matrix(
    robot: RobotLike, pose: PoseLike, velocity: PoseLike, *, on_failure: OnFailure = "raise"
) -> Matrices:
    """Return C of M x'' + C x' + g = J^T F, from Christoffel's symbols of M.

    With this C, dM/dt - 2 C is skew-symmetric.

    Parameters
    ----------
    robot : Manipulator, name or path
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
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    return evaluate_kernel(robot, "coriolis_matrix", on_failure, pose, velocity)


def bias_forces(
    robot: RobotLike, pose: PoseLike, velocity: PoseLike, *, on_failure: OnFailure = "raise"
) -> PerCoordinate:
    """Return h = C x' + g of M x'' + h = J^T F: Coriolis, centrifugal and gravity forces.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose, velocity : array, shape (..., m)
        The platform's state; m, rad and s.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., m)
        N and, where it turns, N m.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    return evaluate_kernel(robot, "bias_forces", on_failure, pose, velocity)


def gravity_forces(
    robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> PerCoordinate:
    """Return g of M x'' + C x' + g = J^T F: the gradient of the potential energy.

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
    array, shape (..., m)
        N and, where it turns, N m.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    return evaluate_kernel(robot, "gravity_forces", on_failure, pose)


def kinetic_energy(
    robot: RobotLike, pose: PoseLike, velocity: PoseLike, *, on_failure: OnFailure = "raise"
) -> Numbers:
    """Return the kinetic energy T = x'^T M x' / 2.

    Parameters
    ----------
    robot : Manipulator, name or path
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
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    return evaluate_kernel(robot, "kinetic_energy", on_failure, pose, velocity)


def potential_energy(
    robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> Numbers:
    """Return the potential energy of gravity, zero with every mass at the base frame's origin.

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
    array, shape (...)
        J.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If the two ends of a leg coincide, so that its elbow is undetermined.
    """
    return evaluate_kernel(robot, "potential_energy", on_failure, pose)
