"""Coordinates of all joints of the opened mechanism (a `Tree`, for engines) from platform poses."""

from __future__ import annotations

import numpy as np

from pteron.bodies.vectors import rotation_matrices
from pteron.export.engines.chains import LegStance, leg_stances
from pteron.export.engines.parts import Tree
from pteron.kernels import Array, as_array
from pteron.kinematics import inverse_kinematics
from pteron.platforms.joints import platform_joints
from pteron.shapes import PoseLike

_LONG = 1e-3
"""Least part of a vector across an axis, as a share of its length, to give an angle about it."""


def coordinates(opened: Tree, poses: PoseLike) -> Array:
    """Return the coordinates of the tree's joints with all loops closed.

    Passive joints of legs are found one after the other, by comparison with the home pose: a joint
    that turns from the direction to the next joint, one that slides from the next one's place.

    Parameters
    ----------
    opened : Tree
        The opened mechanism.
    poses : array, shape (..., m)
        m and rad.

    Returns
    -------
    array, shape (..., K)
        In the order of `opened.joints`, m and rad; passive angles are between -pi and pi.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    """
    robot = opened.robot
    rows = as_array(poses, "poses", (robot.freedom,), columns=robot.coordinates)
    flat = rows.reshape(-1, robot.freedom)
    joints = inverse_kinematics(robot, flat)
    by_joint = {joint.name: joint.values for joint in platform_joints(robot.platform, flat)}
    for i, (home, away) in enumerate(
        zip(leg_stances(robot, opened.home), leg_stances(robot, flat), strict=True)
    ):
        for k, angle in zip(home.numbers, _leg(home, away), strict=True):
            driven = k == home.driven
            name = robot.joint_names[i] if driven else f"leg{i + 1}_joint{k}"
            by_joint[name] = joints[:, i] if driven else angle
    p, axes = robot.platform.placement(flat)
    home_p, home_axes = robot.platform.placement(opened.home)
    for body in opened.bodies:
        for joint in body.joints:
            if joint.follows is not None:
                name, ratio = joint.follows
                by_joint[joint.name] = ratio * by_joint[name]
            elif joint.name not in by_joint:  # of a part that slides with a hinge of the platform
                arm = home_axes @ (joint.point - home_p)
                by_joint[joint.name] = (p + np.einsum("kij,i->kj", axes, arm)) @ joint.axis
    columns = np.stack([by_joint[joint.name] for joint in opened.joints], axis=-1)
    return np.asarray(columns.reshape(*rows.shape[:-1], -1))


def _leg(home: LegStance, away: LegStance) -> list[Array]:
    """Return the displacement of each joint of a leg from the home pose, (K,) each."""
    count = len(away.end)
    turn, shift = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
    motions: list[Array] = []
    for k, (is_prismatic, axis, point) in enumerate(
        zip(home.prismatic, home.axes, home.points, strict=True)
    ):
        now = turn @ axis
        if is_prismatic:
            after, where = _next_point(home, k), _next_point(away, k)
            by = np.einsum("ki,ki->k", now, where - turn @ after - shift)
            shift = shift + by[:, None] * now
        else:
            pointer, here = _pointer(home, away, k)
            pointer = turn @ pointer
            normal = np.cross(now, pointer)
            by = np.arctan2(
                np.einsum("ki,ki->k", normal, here),
                np.einsum("ki,ki->k", np.cross(normal, now), here),
            )
            center = turn @ point + shift
            turned = rotation_matrices(by[:, None] * now)
            turn = turned @ turn
            shift = center + np.einsum("kij,kj->ki", turned, shift - center)
        motions.append(by)
    return motions


def _next_point(leg: LegStance, k: int) -> Array:
    """Return the points (K, 3) of the joint after joint `k` of a leg, or of the leg's end."""
    return leg.points[k + 1] if k + 1 < len(leg.points) else leg.end


def _pointer(home: LegStance, away: LegStance, k: int) -> tuple[Array, Array]:
    """Return a vector that a joint turns, at the home pose and away from it."""
    axis, letter = home.axes[k], home.carries[k]
    pairs = []
    if letter in home.along:
        pairs.append((home.along[letter], away.along[letter]))
    if k + 1 < len(home.axes):
        pairs.append((home.axes[k + 1], away.axes[k + 1]))
    pairs += [
        (_next_point(leg, j) - leg.points[k], _next_point(other, j) - other.points[k])
        for leg, other in [(home, away)]
        for j in range(k, len(home.points))
    ]
    for vector, here in pairs:
        if np.linalg.norm(np.cross(axis, vector)) > _LONG * np.linalg.norm(vector) > 0.0:
            return vector, here
    return pairs[0]  # nothing tells: what it carries lies on its axis
