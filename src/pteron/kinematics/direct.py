"""Direct kinematics: poses from joint coordinates; assembly modes and working modes of poses."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.equations.machine import closure_of
from pteron.errors import SingularPose, UnreachablePose
from pteron.kernels import Array, numeric
from pteron.kinematics.architecture import expect_regular
from pteron.kinematics.assembly import every_pose, sort_poses, table_poses
from pteron.kinematics.evaluate import (
    evaluate_kernel,
    evaluate_unchecked,
    finite_rows,
    place,
    same_joints,
)
from pteron.kinematics.sampling import draw_poses
from pteron.kinematics.searched_poses import searched_poses
from pteron.kinematics.tilting_assembly import is_searched
from pteron.kinematics.unlikely_values import unlikely_values, warn_of_unlikely
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.manipulator.variants import elbows_of, with_elbows
from pteron.platforms.coordinates import wrap_angle
from pteron.shapes import JointsLike, OnFailure, PerJoint, PoseLike, Poses
from pteron.tolerances import LAST_DIGITS, SAME

_FIT, _FIT_STEPS = 1e-6, 8
"""Share of a leg's length by which a redundant machine's joint may miss a pose; steps of least
squares, which square the error each."""

_CHOICES, _DRAWN = 8, 64
"""Greatest number of choices of legs that are tried; poses at which they are compared."""


def direct_kinematics(
    robot: RobotLike,
    joints: JointsLike,
    *,
    all_branches: bool = False,
    tolerance: float | None = None,
    on_failure: OnFailure = "raise",
) -> Poses:
    """Return every pose with the given joint coordinates: all assembly modes.

    With the joints held, legs keep points of the platform on planes (P-R-R-R), spheres (the ends of
    rods) or circles (planar legs); the poses are where these intersect. They are computed in closed
    form, except for platforms with an angle on legs with rods or planar legs: there phi is a root
    of a polynomial of degree k, refined by Newton's method to about 1e-14. The poses of platforms
    that tilt are the ends of k paths from a machine whose poses are known: each is proved, and none
    is missed except, by rounding, next to a singularity. Where their legs keep points in planes, as
    P-R-R-S and spherical R-R-R legs do, and where their axes do not meet, they are eigenvalues or
    roots. Of P-R-U-R and R-P-U-R legs, and of legs in planes mixed with others, no method finds
    every pose: they are those that Newton's method finds from fixed starts, and others may exist.
    If the poses form a curve (self-motion), an error is raised.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    joints : array, shape (..., n)
        Joint coordinates, m or rad.
    all_branches : bool
        Rods and planar legs close with either side of an elbow. By default only poses of the
        robot's own working mode are returned, those whose inverse kinematics are the joints; True
        returns those of the others as well. Of poses that Newton's method finds k is then as large
        as needed; with more legs than coordinates they are those of the own mode.
    tolerance : float, optional
        With more legs than coordinates: by how much, m, each joint may miss the pose that fits all
        of them best; by default 1e-6 of the leg's length.
    on_failure : {"raise", "nan"}
        What to do with joints that no pose has, or that are not finite: raise, or give NaN. Where
        there is a pose, further modes that are not real are NaN in either case.

    Returns
    -------
    array, shape (..., k, m)
        Legs of kind P-R-R-R alone: k = 2, or 1 where the platform does not turn; each row stands
        for one assembly mode throughout. Any others: in the order of phi, z, y and x, NaN last,
        with k = 2 where the platform has no angle, or where a leg holds it (1 with P-R-R-R legs
        alone); else k = 8 for four legs and 6 for three, but 4 where all but one are P-R-R-R; where
        the platform slides k = 2 for each leg of another kind. Platforms that tilt: k = 40 for six
        legs, 16 for a tripod, 8 about a centre or on six P-R-R-S legs, in the order of the
        coordinates from the last to the first; of a tripod with the yaw on the side that it has
        when level. A row is NaN where the closures have no further real solution, or where a leg
        does not reach the pose that solves them. Angles lie in (-pi, pi] unless a leg holds phi or
        the platform slides; the middle one of roll, pitch and yaw, or of rx, ry and rz, within
        +-pi/2.

    Raises
    ------
    SingularPose
        If the machine is singular at every pose, or a platform that tilts can move with the joints
        held (a self-motion), whatever `on_failure`.
    UnreachablePose
        If joints have no pose, unless `on_failure` is "nan".

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("quadrupteron")
    >>> poses = pteron.direct_kinematics(robot, [0.03, 0.02, 0.01, 0.02])
    >>> np.round(poses, 12) + 0.0
    array([[0.01      , 0.02      , 0.03      , 0.        ],
           [0.01      , 0.02      , 0.03      , 3.14159265]])
    """
    robot = as_manipulator(robot)
    expect_regular(robot)
    joint_array = finite_rows(robot, joints, "joints", on_failure)
    poses = _rows(robot, joint_array, all_branches=all_branches, tolerance=tolerance)
    is_missing = np.isnan(poses).all(axis=(-2, -1))
    if on_failure == "raise" and is_missing.any():
        index = tuple(int(i) for i in np.argwhere(is_missing)[0])
        unlikely = unlikely_values(robot, robot.joint_names, joint_array[index])
        raise UnreachablePose(
            f"{place('joints', index)}: no pose has these joint coordinates "
            f"{'; '.join([str(joint_array[index].tolist()), *unlikely])}",
            leg=0,
            shortfall=float("nan"),
            index=index,
        )
    warn_of_unlikely(robot, robot.joint_names, joint_array)
    return poses


def assembly_mode(
    robot: RobotLike, pose: PoseLike, *, all_branches: bool = False
) -> NDArray[np.int64]:
    """Return a pose's assembly mode: its index among all poses with its joint coordinates.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        Poses, m and rad.
    all_branches : bool
        As for `direct_kinematics`.

    Returns
    -------
    array of int, shape (...,)
        The row of `direct_kinematics`, from 0. Of P-R-R-R legs alone it tells the assembly mode
        throughout; of other machines it counts the modes of these joint coordinates, and may change
        along a motion, which `follow` keeps in its mode.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If the machine is singular at every pose, or the pose is part of a self-motion.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("quadrupteron")
    >>> pteron.kinematics.assembly_mode(robot, [[0.01, 0.02, 0.03, 0.0], [0.01, 0.02, 0.03, np.pi]])
    array([0, 1])
    """
    robot = as_manipulator(robot)
    expect_regular(robot)
    poses = finite_rows(robot, pose, "pose")
    joints: PerJoint = evaluate_kernel(robot, "inverse_kinematics", "raise", poses)
    return nearest(robot, _rows(robot, joints, all_branches=all_branches), poses)


def working_mode(
    robot: RobotLike, pose: PoseLike, joints: JointsLike, *, tolerance: ArrayLike = SAME
) -> NDArray[np.int64]:
    """Return the signs of the legs' branches, 1 or -1, with which a pose has joint coordinates.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        Poses, m and rad.
    joints : array, shape (..., n)
        Their joint coordinates, m or rad.
    tolerance : float or array, shape (n,)
        Greatest difference of joint coordinates that are equal, m or rad.

    Returns
    -------
    array of int, shape (..., k)
        The legs' signs, 1 or -1, with which inverse kinematics of the pose gives the joint
        coordinates: `elbow` of each leg, but `elbow` and `second_elbow` of a P-R-U-R leg, and
        `second_elbow` of an R-P-U-R leg. They are the robot's own where several do, as for P-R-R-R
        legs; 0 where none does, and where the pose is NaN.

    Examples
    --------
    >>> import pteron
    >>> robot = pteron.load("delta")
    >>> joints = pteron.inverse_kinematics(robot, [0.0, 0.0, -0.9])
    >>> poses = pteron.direct_kinematics(robot, joints, all_branches=True)
    >>> pteron.kinematics.working_mode(robot, poses, joints)
    array([[ 1,  1,  1],
           [-1, -1, -1]])
    """
    robot = as_manipulator(robot)
    poses, joint_array = (
        finite_rows(robot, pose, "pose", "nan"),
        finite_rows(robot, joints, "joints", "nan"),
    )
    lead = np.broadcast_shapes(poses.shape[:-1], joint_array.shape[:-1])
    counts = [len(leg.signs) for leg in robot.legs]
    elbows = np.zeros((*lead, sum(counts)), dtype=np.int64)
    # The robot's own branch of each leg comes last.
    choices = [
        sorted(leg.sign_choices(), key=tuple(leg.signs.values()).__eq__) for leg in robot.legs
    ]
    for k in range(-max(map(len, choices)), 0):
        signs = [sign for branches in choices for sign in branches[max(k, -len(branches))]]
        back = evaluate_unchecked(with_elbows(robot, signs), "inverse_kinematics", poses)
        same = same_joints(robot, back, joint_array, tolerance)
        elbows = np.where(np.repeat(same, counts, axis=-1), signs, elbows)
    return elbows


def assembly_modes(
    robot: RobotLike, joints: Array, *, all_branches: bool = False, tolerance: float | None = None
) -> Poses:
    """Return the pose (..., k, m) of joint coordinates (..., n) in each assembly mode; else NaN.

    Poses in closed form are not sorted, unlike those of `direct_kinematics`: along a motion each
    column is one mode, on one side of the singularities. NaN stands for a mode without a pose, or
    with other elbows.
    """
    robot = as_manipulator(robot)
    if robot.redundancy:
        return _fitting_poses(robot, joints, tolerance, all_branches=all_branches)
    closure = closure_of(robot)
    poses: Poses
    if closure.closed_form:
        poses = evaluate_kernel(robot, "direct_kinematics", "nan", joints)
    else:
        poses = every_pose(robot, joints, closure.modes)
    poses[..., robot.wraps] = wrap_angle(poses[..., robot.wraps])
    back: PerJoint = evaluate_kernel(robot, "inverse_kinematics", "nan", poses)
    is_missing = np.isnan(back).any(axis=-1)
    if not closure.keeps_modes and not all_branches:
        is_missing |= ~same_joints(robot, back, joints[..., None, :]).all(axis=-1)
    poses[is_missing] = np.nan
    return poses


def _fitting_poses(
    robot: Manipulator, joints: Array, tolerance: float | None, *, all_branches: bool
) -> Poses:
    """Return the poses (..., k, m) of some legs, one for each coordinate, that the others meet.

    Least squares sharpens them. The legs are those that hold the platform best at home; where these
    give no pose, others are tried.
    """
    levers, sizes = (
        np.array([getattr(leg, name) for leg in robot.legs]) for name in ("lever", "size")
    )
    allowed = (_FIT * sizes if tolerance is None else tolerance) / levers
    poses = np.full((*joints.shape[:-1], closure_of(robot).modes, robot.freedom), np.nan)
    for legs in _best_subsets(robot):
        is_missing = np.isnan(poses).all(axis=(-2, -1))
        if not is_missing.any():
            break
        readings = joints[is_missing]
        part = replace(robot, legs=tuple(robot.legs[i] for i in legs), distribution=None, home=None)
        with suppress(SingularPose):  # these legs leave it a self-motion
            tried = assembly_modes(part, readings[:, list(legs)], all_branches=all_branches)
            rows = np.broadcast_to(readings[:, None], (*tried.shape[:-1], readings.shape[-1]))
            for _ in range(_FIT_STEPS):
                tried, change, _ = numeric(robot, "newton_step")(rows, tried)
            elbows = working_mode(robot, tried, rows, tolerance=allowed)
            misses = (elbows == 0).any(axis=-1) | ~(change < LAST_DIGITS)
            if not all_branches:
                misses |= (elbows != elbows_of(robot)).any(axis=-1)
            tried[misses | _is_repeated(robot, tried)] = np.nan
            poses[is_missing, : tried.shape[1]] = tried[:, : poses.shape[-2]]
    return poses


def _is_repeated(robot: Manipulator, poses: Array) -> NDArray[np.bool_]:
    """Return which poses (B, k, m) equal one before, to which least squares has moved them."""
    size = max(leg.size for leg in robot.legs)
    differences = np.abs(poses[:, :, None] - poses[:, None]).max(axis=-1)
    return np.asarray((np.tril(differences <= _FIT * size, -1)).any(axis=-1))


@lru_cache(maxsize=64)
def _best_subsets(robot: Manipulator) -> tuple[tuple[int, ...], ...]:
    """Return choices of m legs, those first whose forces hold the platform best at many poses."""
    rows = numeric(robot, "jacobian")(draw_poses(robot, _DRAWN, np.random.default_rng(0)))[0]
    choices = list(combinations(range(robot.joint_count), robot.freedom))
    sizes = {legs: float(np.median(np.abs(np.linalg.det(rows[:, list(legs)])))) for legs in choices}
    return tuple(sorted(choices, key=lambda legs: -sizes[legs])[:_CHOICES])


def mode_of(robot: RobotLike, pose: tuple[float, ...]) -> int:
    """Return the assembly mode of a pose: its column in `assembly_modes`."""
    return _mode_of(as_manipulator(robot), pose)


@lru_cache(maxsize=64)
def _mode_of(robot: Manipulator, pose: tuple[float, ...]) -> int:
    """Return the assembly mode of a pose, the column nearest to it in `assembly_modes`, cached."""
    joints: PerJoint = evaluate_kernel(robot, "inverse_kinematics", "raise", np.array(pose))
    return int(nearest(robot, assembly_modes(robot, joints, all_branches=True), np.array(pose)))


def nearest(robot: RobotLike, poses: Array, pose: Array) -> NDArray[np.int64]:
    """Return the index (...) among poses (..., k, m) of that nearest to a pose (..., m)."""
    robot = as_manipulator(robot)
    differences = poses - pose[..., None, :]
    angular = robot.platform.angular
    distance = np.linalg.norm(differences[..., ~angular], axis=-1)
    angles = 0.5 * differences[..., angular]
    distance += np.abs(np.where(robot.wraps[angular], np.sin(angles), angles)).sum(axis=-1)
    return np.asarray(np.nan_to_num(distance, nan=np.inf).argmin(axis=-1))


def _rows(
    robot: Manipulator, joints: Array, *, all_branches: bool, tolerance: float | None = None
) -> Poses:
    """Return poses (..., k, m) of joint coordinates, sorted where modes have no fixed order."""
    if all_branches and not robot.redundancy and is_searched(robot):
        rows = joints.reshape(-1, robot.joint_count)
        which, searched = searched_poses(robot, rows, any_branch=True)
        good = are_poses(robot, searched, rows[which], all_branches=True)
        table = table_poses(searched[good], which[good], closure_of(robot).modes, len(rows))
        return sort_poses(table.reshape(*joints.shape[:-1], *table.shape[1:]))
    poses = assembly_modes(robot, joints, all_branches=all_branches, tolerance=tolerance)
    return poses if closure_of(robot).keeps_modes else sort_poses(poses)


def are_poses(
    robot: Manipulator, poses: Array, joints: Array, *, all_branches: bool = False
) -> NDArray[np.bool_]:
    """Return which poses (..., m) have joint coordinates (..., n), in the robot's working mode.

    With `all_branches` in any: the poses then satisfy the closures, and must be in reach.
    """
    back = evaluate_unchecked(robot, "inverse_kinematics", poses)
    if not all_branches:
        return np.asarray(same_joints(robot, back, joints).all(axis=-1))
    is_elsewhere = (working_mode(robot, poses, joints) != 0).all(axis=-1)
    return np.asarray(np.isfinite(back).all(axis=-1) | is_elsewhere)
