"""Poses to joint coordinates and back, and the Jacobians."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pteron.equations.machine import closure_of
from pteron.errors import UnreachablePose
from pteron.kernels import Array
from pteron.kinematics.assembly import every_pose, in_order, within_a_turn
from pteron.kinematics.evaluate import checked, evaluated, place
from pteron.kinematics.singularities import is_singular_everywhere, singular_everywhere
from pteron.manipulator import Manipulator
from pteron.shapes import JointsLike, Matrices, OnFailure, PerJoint, PoseLike, Poses, Vectors

_SAME_JOINT = 1e-6
"""m or rad within which a pose gives the joints back: far above rounding, even near a singularity,
where the other branch, which it is to tell apart, is no other."""


def inverse_kinematics(
    robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> PerJoint:
    """Return the joint coordinates of poses, Eq. (4): rho of a slider, theta of a crank.

    A crank's angle is the one nearest to the middle of its limits, or in (-pi, pi]. The limits
    themselves are not applied.

    Parameters
    ----------
    robot : Manipulator
        The machine; its elbows choose the branch.
    pose : array, shape (..., m)
        (x, y, z, phi), or (x, y, z) for 3T; m and rad.
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
    return evaluated(robot, "inverse_kinematics", on_failure, pose)


def link_vectors(
    robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> tuple[Vectors, Vectors]:
    """Return the vectors of the upper links or cranks, and of the lower links or rods.

    For P-R-R-R legs these are Eqs. (6) and (7).

    Parameters
    ----------
    robot : Manipulator
        The machine; its elbows choose the branch.
    pose : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    l_u, l_l : array, shape (..., n, 3)
        Towards the platform, in the base frame, m; NaN for a link that a leg has not.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If the two ends of a leg coincide, so that its elbow is undetermined.
    """
    return evaluated(robot, "link_vectors", on_failure, pose)


def jacobian(robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise") -> Matrices:
    """Return the input-output Jacobian J, with joint rates = J @ velocity, Eq. (10).

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
    array, shape (..., n, m)
        Row i is [dq/dc | dq/dphi] d(c, phi)/dx; for a P-R-R-R leg [ d^T | (d x k) . s ] / (d . e),
        which does not involve the links and is also given where they do not reach.

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
    return evaluated(robot, "jacobian", on_failure, pose)


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
    return evaluated(robot, "link_jacobians", on_failure, pose)


def direct_kinematics(
    robot: Manipulator,
    joints: JointsLike,
    *,
    all_branches: bool = False,
    on_failure: OnFailure = "nan",
) -> Poses:
    """Return every pose with the given joint coordinates: all assembly modes, in closed form.

    P-R-R-R legs close linearly in (p, cos phi, sin phi), so that a Quadrupteron has at most two
    poses and a Tripteron one; each column stands for one assembly mode throughout. Rods keep their
    ends on spheres: a Delta has at most two poses, in the order of z, y and x.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    joints : array, shape (..., n)
        Joint coordinates, m or rad.
    all_branches : bool
        Rods close with either side of an elbow. By default only poses of the robot's own working
        mode are returned; True returns those of the others as well.
    on_failure : {"nan", "raise"}
        A mode that is not real is NaN: that is an answer, not a failure, hence the default. With
        "raise", joints that no pose has raise.

    Returns
    -------
    array, shape (..., k, m)
        k = 2, or 1 for P-R-R-R legs under a 3T platform. A row is NaN where the closures have no
        real solution, or where a leg does not reach the pose that solves them. phi lies in
        (-pi, pi].

    Raises
    ------
    SingularPose
        If the machine is singular at every pose.
    UnreachablePose
        With ``on_failure="raise"``, if joints have no pose.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("quadrupteron")
    >>> poses = pteron.direct_kinematics(robot, [0.03, 0.02, 0.01, 0.02])
    >>> np.round(poses, 12) + 0.0
    array([[0.01      , 0.02      , 0.03      , 0.        ],
           [0.01      , 0.02      , 0.03      , 3.14159265]])
    """
    if is_singular_everywhere(robot):
        raise singular_everywhere(robot)
    given = checked(robot, joints, "joints", on_failure)
    poses = assembly_modes(robot, given, all_branches=all_branches)
    if not closure_of(robot).keeps_modes:
        poses = in_order(poses)
    lost = np.isnan(poses).all(axis=(-2, -1))
    if on_failure == "raise" and lost.any():
        index = tuple(int(i) for i in np.argwhere(lost)[0])
        raise UnreachablePose(
            f"{place('joints', index)}: no pose has these joint coordinates "
            f"{given[index].tolist()}",
            leg=0,
            shortfall=float("nan"),
            index=index,
        )
    return poses


def assembly_modes(robot: Manipulator, joints: Array, *, all_branches: bool = False) -> Poses:
    """Return the pose (..., k, m) of joint coordinates (..., n) in each assembly mode.

    Where the poses have a closed form they are not sorted, unlike those of `direct_kinematics`:
    along a motion each column is one mode, a side of the singularities. NaN where a mode has no
    pose, or one of other elbows.
    """
    closure = closure_of(robot)
    poses: Poses
    if closure.closed_form:
        poses = evaluated(robot, "direct_kinematics", "nan", joints)
    else:
        poses = every_pose(robot, joints, closure.modes)
    if robot.platform.turns and not any(leg.follows_angle for leg in robot.legs):
        poses[..., -1] = within_a_turn(poses[..., -1])
    back: PerJoint = evaluated(robot, "inverse_kinematics", "nan", poses)
    lost = np.isnan(back).any(axis=-1)
    if not closure.keeps_modes and not all_branches:
        lost |= ~_same_joints(robot, back, joints[..., None, :]).all(axis=-1)
    poses[lost] = np.nan
    return poses


def _same_joints(robot: Manipulator, one: Array, other: Array) -> NDArray[np.bool_]:
    """Return where joint coordinates (..., n) are the same, whole turns of cranks left out."""
    apart = np.abs(one - other)
    cranks = np.array([leg.joint.unit == "rad" for leg in robot.legs])
    turn = 2.0 * np.pi
    apart = np.where(cranks, np.abs((apart + np.pi) % turn - np.pi), apart)
    return np.asarray(apart <= _SAME_JOINT)


@lru_cache(maxsize=64)
def mode_of(robot: Manipulator, pose: tuple[float, ...]) -> int:
    """Return the column of `assembly_modes` that a pose is in."""
    joints: PerJoint = evaluated(robot, "inverse_kinematics", "raise", np.array(pose))
    poses = assembly_modes(robot, joints, all_branches=True)
    lengths = len(robot.platform.directions)
    apart = np.linalg.norm(poses[:, :lengths] - pose[:lengths], axis=-1)
    if robot.platform.turns:
        apart += np.abs(np.sin(0.5 * (poses[:, -1] - pose[-1])))
    return int(np.nanargmin(apart))
