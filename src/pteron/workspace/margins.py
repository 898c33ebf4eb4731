"""Margins of poses to singularities and joint limits, and how each joint uses its range."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect
from pteron.kernels import Array, numeric
from pteron.kinematics import inverse_kinematics
from pteron.kinematics.limits import limited_joints
from pteron.kinematics.sampling import finite_sizes, joint_limits
from pteron.kinematics.singularities import best_holding
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.shapes import Numbers, PerJoint, PoseLike
from pteron.tolerances import ROUNDING


@dataclass(frozen=True, eq=False, repr=False)
class PoseMargins(Result):
    """Margins of poses to singularities and joint limits; each is 1 at best and 0 there.

    Attributes
    ----------
    type_i : array, shape (..., n)
        The type-I measure of each leg: 0 where it is stretched or folded. Out of reach it is
        negative: the missing metres over the leg's size.
    type_ii : array, shape (...)
        The size of the type-II measure over the best that the machine's geometry allows, limits or
        not: 0 where the actuators do not hold the platform. If the legs' couples vary with the
        pose (U-P-U), at most the constraint measure: 0 where the platform is free to turn.
    joints : array, shape (..., n)
        The least over each leg's joints, passive ones too, of the distance from the nearer limit
        over half the range; negative beyond it, and 1 for a leg without limits.
    constraint : array, shape (...)
        The size of the constraint measure over the best that the geometry allows: 0 where the legs
        let the platform turn. It is 1 for legs whose couples do not turn with the pose.
    least : array, shape (...)
        The least of them all, which is what `home_pose` makes as large as it can.
    """

    ROWS = "least type_ii constraint type_i:1 joints:1"

    type_i: PerJoint
    type_ii: Numbers
    joints: PerJoint
    constraint: Numbers
    least: Numbers

    clearances = former_attribute("clearances", "joints")
    smallest = former_attribute("smallest", "least")


def pose_margins(robot: RobotLike, pose: PoseLike) -> PoseMargins:
    """Return the margins of poses, in reach or not.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.

    Returns
    -------
    PoseMargins

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import pose_margins
    >>> pose_margins(pteron.load("quadrupteron"), [0.0, 0.0, 0.0, 0.0]).type_i.round(3)
    array([1.   , 1.   , 0.991, 1.   ])
    """
    robot = as_manipulator(robot)
    return margins_from(partial(numeric, robot), margin_scales(robot), pose)


class MarginScales(NamedTuple):
    """Divisors that turn measures into margins: leg sizes (n,), m, and joint limits (n,).

    `holding` (k,) are the best values of the type-II measure and, of k = 2, the constraint measure.
    """

    sizes: Array
    low: Array
    high: Array
    half_range: Array
    holding: Array


@lru_cache(maxsize=64)
def margin_scales(robot: Manipulator) -> MarginScales:
    """Return a machine's `MarginScales`."""
    low, high = joint_limits(robot)
    half_range = np.where(np.isinf(low), 1.0, (high - low) / 2.0)
    # A shaft without lengths reaches everywhere.
    sizes = np.array([leg.size or 1.0 for leg in robot.legs])
    return MarginScales(sizes, low, high, half_range, best_holding(robot))


def margins_from(
    kernel_of: Callable[[str], Any], scales: MarginScales, pose: PoseLike
) -> PoseMargins:
    """Return the margins of poses from kernels by name, on arrays of any library like NumPy."""
    reach, measure, _, _ = kernel_of("reach")(pose)
    type_i = np.where(reach < 0.0, reach / scales.sizes, np.nan_to_num(measure))
    type_ii, *couples = (
        np.minimum(finite_sizes(kernel_of(name)(pose)[0]) / best, 1.0)
        for name, best in zip(("type_ii", "constraint"), scales.holding, strict=False)
    )
    constraint = couples[0] if couples else np.ones_like(type_ii)
    joints = kernel_of("joint_coordinates")(pose)[0]
    distances = np.minimum(joints - scales.low, scales.high - joints)
    shares = np.where(np.isinf(distances), 1.0, distances / scales.half_range)
    shares = np.where(np.isnan(shares), np.minimum(type_i, 0.0), shares)
    shares = np.fmin(shares, kernel_of("passive_room")(pose)[0])
    held = np.minimum(type_ii, constraint)
    least = np.minimum(np.minimum(type_i, shares).min(axis=-1), held)
    return PoseMargins(type_i, type_ii, shares, constraint, least)


def least_margin_text(robot: Manipulator, pose: Array) -> tuple[str, str]:
    """Return the least margin of a pose (m,) in percent, and what it is the distance to."""
    margins = pose_margins(robot, pose)
    least = float(margins.least)
    if float(margins.type_ii) <= least:
        cause = "a type-II singularity, where the drives cannot hold the platform (100 % is best)"
    elif float(margins.constraint) <= least:
        cause = "a constraint singularity, where the platform can turn (100 % is best)"
    elif float(margins.type_i.min()) <= least:
        cause = f"leg {_first_least(margins.type_i)} stretched or folded (100 % is best)"
    else:
        leg = _first_least(margins.joints)
        joints = [at for at in limited_joints(robot, pose) if at.leg in (0, leg)]
        nearest = min(joints, key=lambda at: at.margin)
        limit = f"a joint limit of leg {leg}" if nearest.leg else f"a limit of {nearest.noun}"
        cause = f"{limit} (100 % is mid-range)"
    return f"{100.0 * least:.0f} %", cause


def _first_least(margins: Array) -> int:
    """Return the first leg, from 1, whose value (n,) is least up to rounding."""
    return int((margins <= margins.min() + ROUNDING).argmax()) + 1


def joint_distances(robot: Manipulator, joints: Array) -> Array:
    """Return the distance (..., n) of joints from their nearer limit, negative beyond, or inf."""
    low, high = joint_limits(robot)
    return np.asarray(np.minimum(joints - low, high - joints))


def distance_to_limits(robot: Manipulator, poses: Array) -> Array:
    """Return the distance (..., n), m, to each leg's nearest actuated or passive joint limit.

    Very far without limits, and out of reach, where a joint may have no coordinate; so is a joint
    within its limits that turns with the platform alone, since no translation leads out of them.
    """
    distances = joint_distances(robot, numeric(robot, "joint_coordinates")(poses)[0])
    levers, turned = _levers(robot)
    free = np.isnan(distances) | (turned & (distances >= 0.0))
    passive: Array = numeric(robot, "passive_room")(poses)[1]
    return np.asarray(np.fmin(np.where(free, np.inf, distances * levers), passive))


@lru_cache(maxsize=64)
def _levers(robot: Manipulator) -> tuple[Array, NDArray[np.bool_]]:
    """Return each joint's lever, m, and whether only the platform's angle turns it."""
    levers = np.array([leg.lever for leg in robot.legs])
    return levers, np.array([leg.reach_bound is None for leg in robot.legs])


@dataclass(frozen=True, eq=False, repr=False)
class JointRanges(Result):
    """The part of its range that each joint uses.

    Attributes
    ----------
    least, greatest : array, shape (n,)
        Ends of the joint coordinate's range, m or rad.
    limits : tuple of ((float, float) or None)
        The machine's limits; None where it has none.
    within : array of bool, shape (n,)
        Whether the range lies within the limits; True where there are none.
    """

    ROWS = "least greatest within"

    least: Array
    greatest: Array
    limits: tuple[tuple[float, float] | None, ...]
    within: NDArray[np.bool_]


def joint_ranges(robot: RobotLike, poses: PoseLike) -> JointRanges:
    """Return the least and the greatest joint coordinate over poses.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    poses : array, shape (..., m)
        At least one pose, m and rad.

    Returns
    -------
    JointRanges

    Raises
    ------
    DataError
        If there is no pose.
    UnreachablePose
        If a leg does not reach a pose.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import joint_ranges
    >>> ranges = joint_ranges(pteron.load("tripteron"), [[0.0, 0.1, 0.0], [0.1, 0.0, 0.0]])
    >>> ranges.greatest, bool(ranges.within.all())
    (array([0.1, 0.1, 0. ]), True)
    """
    robot = as_manipulator(robot)
    joints = inverse_kinematics(robot, poses).reshape(-1, robot.joint_count)
    expect(len(joints), "poses", "none", "at least one")
    return JointRanges(
        joints.min(axis=0),
        joints.max(axis=0),
        tuple(leg.limits for leg in robot.legs),
        np.asarray((joint_distances(robot, joints) >= 0.0).all(axis=0)),
    )
