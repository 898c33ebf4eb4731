"""Inverse and forward dynamics, with drives or without, and the regressor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pteron.dynamics.distribution import forces_within_limits
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import RobotLike, as_manipulator
from pteron.manipulator.distribution import Distribution
from pteron.shapes import JointsLike, OnFailure, PerCoordinate, PerJoint, PoseLike, Regressors


def inverse_dynamics(
    robot: RobotLike,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike,
    wrench: PoseLike | None = None,
    *,
    distribution: Distribution | None = None,
    on_failure: OnFailure = "raise",
) -> PerJoint:
    """Return the actuator forces (..., n) of a motion, without friction, by virtual work, Eq. (13).

    F_a = - F_p - J^-T (sum J_u^T F_u + sum J_l^T F_l + F_e), without friction.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose, velocity, acceleration : array, shape (..., m)
        The platform's motion; m, rad and s. Leading axes broadcast.
    wrench : array, shape (..., m), optional
        Wrench on the platform at P: a force in N and, where it turns, a moment about k in N m; of a
        platform that tilts a force and a moment in the base frame, (..., 6).
    distribution : Distribution, optional
        With more legs than coordinates: how forces are shared, in place of the machine's own.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., n)
        N at a slider, N m at a crank; positive along +q.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).
    DataError
        If a distribution's limits admit no forces.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("quadrupteron")
    >>> rest = np.zeros(4)
    >>> forces = pteron.inverse_dynamics(robot, rest, rest, rest)
    >>> forces.round(3)
    array([31.082, -1.881,  2.566,  0.685])
    """
    inputs = [pose, velocity, acceleration, *([] if wrench is None else [wrench])]
    robot = _replace_distribution(robot, distribution)
    forces: PerJoint = evaluate_kernel(
        _remove_limits(robot), "inverse_dynamics", on_failure, *inputs, wrench=wrench is not None
    )
    return _apply_limits(robot, pose, forces, lambda: np.zeros(forces.shape[-1]), on_failure)


def _replace_distribution(robot: RobotLike, distribution: Distribution | None) -> RobotLike:
    """Return the machine with another distribution of forces; as it is for None."""
    if distribution is None:
        return robot
    return replace(as_manipulator(robot), distribution=distribution)


def _remove_limits(robot: RobotLike) -> RobotLike:
    """Return the machine whose forces are shared without limits."""
    shares = as_manipulator(robot).distribution
    if shares is None or not shares.limits:
        return robot
    return replace(as_manipulator(robot), distribution=replace(shares, limits=False))


def _apply_limits(
    robot: RobotLike,
    pose: PoseLike,
    forces: PerJoint,
    drive_loads: Callable[[], PerJoint],
    on_failure: OnFailure,
) -> PerJoint:
    """Return forces within the limits of the machine's distribution, if it has them.

    `drive_loads` returns the part of the forces that the drives need for themselves.
    """
    machine = as_manipulator(robot)
    if machine.greatest_forces is None:
        return forces
    return forces_within_limits(machine, pose, forces, drive_loads(), on_failure)


def forward_dynamics(
    robot: RobotLike,
    pose: PoseLike,
    velocity: PoseLike,
    forces: JointsLike,
    wrench: PoseLike | None = None,
    *,
    on_failure: OnFailure = "raise",
) -> PerCoordinate:
    """Return the platform's acceleration (..., m) under actuator forces, without friction.

    M x'' = J^T F + wrench - h. It needs no J^-1, so that it is defined at type-II singularities
    too.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose, velocity : array, shape (..., m)
        The platform's state; m, rad and s.
    forces : array, shape (..., n)
        N at a slider, N m at a crank; positive along +q.
    wrench : array, shape (..., m), optional
        Wrench on the platform at P: a force in N and, where it turns, a moment about k in N m; of a
        platform that tilts a force and a moment in the base frame, (..., 6).
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., m)
        m/s^2 and rad/s^2.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
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
    inputs = [pose, velocity, forces, *([] if wrench is None else [wrench])]
    return evaluate_kernel(
        robot, "forward_dynamics", on_failure, *inputs, wrench=wrench is not None
    )


def drive_forces(
    robot: RobotLike,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike,
    wrench: PoseLike | None = None,
    *,
    smooth: bool = False,
    distribution: Distribution | None = None,
    on_failure: OnFailure = "raise",
) -> PerJoint:
    """Return the drives' forces: `inverse_dynamics` plus friction and the motors' inertia.

    F + ratio^2 rotor_inertia q'' + (coulomb + stribeck exp(-(q'/v_s)^2)) s(q') + viscous q' +
    offset, by each leg's `drive`; a leg without one has neither friction nor a rotor.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose, velocity, acceleration : array, shape (..., m)
        The platform's motion; m, rad and s. Leading axes broadcast.
    wrench : array, shape (..., m), optional
        Wrench on the platform at P: a force in N and, where it turns, a moment about k in N m; of a
        platform that tilts a force and a moment in the base frame, (..., 6).
    smooth : bool
        s is the sign of q', exact where a joint moves, which suits logs; or tanh(q'/rest_speed),
        which suits simulation and controllers (the kernel `feed_forward`).
    distribution : Distribution, optional
        With more legs than coordinates: how forces are shared, in place of the machine's own; its
        limits count friction and the motors' inertia.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., n)
        N at a slider, N m at a crank; positive along +q.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from dataclasses import replace
    >>> robot = pteron.load("tripteron")
    >>> drive = pteron.legs.Drive(coulomb=3.0, viscous=10.0)
    >>> legs = [replace(leg, drive=drive) for leg in robot.legs]
    >>> state = np.zeros(3), [0.1, 0.2, -0.3], np.zeros(3)
    >>> driven = pteron.drive_forces(replace(robot, legs=legs), *state)
    >>> (driven - pteron.inverse_dynamics(robot, *state)).round(9)
    array([ 4.,  5., -6.])
    """
    inputs = [pose, velocity, acceleration, *([] if wrench is None else [wrench])]
    what = "feed_forward" if smooth else "drive_forces"
    robot = _replace_distribution(robot, distribution)
    unlimited, loaded = _remove_limits(robot), wrench is not None
    forces: PerJoint = evaluate_kernel(unlimited, what, on_failure, *inputs, wrench=loaded)

    def drive_loads() -> PerJoint:
        """Return friction and the motors' inertia."""
        rigid: PerJoint = evaluate_kernel(
            unlimited, "inverse_dynamics", "nan", *inputs, wrench=loaded
        )
        return np.asarray(forces - rigid)

    return _apply_limits(robot, pose, forces, drive_loads, on_failure)


def drive_accelerations(
    robot: RobotLike,
    pose: PoseLike,
    velocity: PoseLike,
    forces: JointsLike,
    wrench: PoseLike | None = None,
    *,
    on_failure: OnFailure = "raise",
) -> PerCoordinate:
    """Return the platform's acceleration under drive forces, with friction and motor inertia.

    It is the inverse of `drive_forces` with ``smooth=True``.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose, velocity : array, shape (..., m)
        The platform's state; m, rad and s.
    forces : array, shape (..., n)
        Of the drives, N at a slider, N m at a crank; positive along +q.
    wrench : array, shape (..., m), optional
        Wrench on the platform at P: a force in N and, where it turns, a moment about k in N m; of a
        platform that tilts a force and a moment in the base frame, (..., 6).
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., m)
        m/s^2 and rad/s^2.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I).

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from dataclasses import replace
    >>> robot = pteron.load("tripteron")
    >>> legs = [replace(leg, drive=pteron.legs.Drive(rotor_inertia=2.0)) for leg in robot.legs]
    >>> robot, rest = replace(robot, legs=legs), np.zeros(3)
    >>> forces = pteron.drive_forces(robot, rest, rest, [1.0, 2.0, 3.0], smooth=True)
    >>> pteron.drive_accelerations(robot, rest, rest, forces).round(9)
    array([1., 2., 3.])
    """
    inputs = [pose, velocity, forces, *([] if wrench is None else [wrench])]
    return evaluate_kernel(
        robot, "drive_accelerations", on_failure, *inputs, wrench=wrench is not None
    )


def regressor(
    robot: RobotLike,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike,
    *,
    on_failure: OnFailure = "raise",
) -> Regressors:
    """Return the regressor D of Eq. (15): D @ parameters(robot) = inverse_dynamics(...).

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its inertial parameters play no part.
    pose, velocity, acceleration : array, shape (..., m)
        The platform's motion; m, rad and s. Leading axes broadcast.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., n, N)
        N or N m per unit of each parameter, in the order of `parameter_names`.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("quadrupteron")
    >>> state = [0.01, 0.02, 0.03, 0.1], [0.1, 0.0, 0.2, 1.0], [1.0, 2.0, 0.0, 3.0]
    >>> D = pteron.regressor(robot, *state)
    >>> D.shape, np.allclose(D @ pteron.parameters(robot), pteron.inverse_dynamics(robot, *state))
    ((4, 40), True)
    """
    return evaluate_kernel(robot, "regressor", on_failure, pose, velocity, acceleration)
