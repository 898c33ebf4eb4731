"""Poses from which the search for a home begins, and on which side of its base a platform is.

First come closed forms: level poses along the platform's axis, and those that Newton's method leads
from there to joints in the middle of their ranges. A grid of level poses and random poses, with a
fixed seed, come last.
"""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array, numeric
from pteron.kinematics.sampling import search_ball, widest_box
from pteron.manipulator import Manipulator

_HEIGHTS = 401
"""Level poses along the platform's axis, through the whole ball that holds the reach: legs whose
cranks have a hundredth of their rods' length reach one or more of them."""

_TURNS = 12
"""Directions that the platform is turned to on that axis, where it turns about it."""

_COARSE = 4
"""Spacing, in steps along the axis, of the poses that all searches but the first take."""

_GRID = {2: 41, 3: 11}
"""Level poses along each length of a grid, by the number of lengths: 1300 to 1700 in all."""

_RANDOM = 2048
"""Random poses, somewhat more than those of the grid."""

_LED = 64
"""Best poses from which Newton's method starts."""

_NEWTON = 25
"""Steps of Newton's method: it doubles the digits with each of the last ones."""

_UPRIGHT = 0.1
"""Height of the platform over its base, as a share of a leg's length, from which it is clearly on
one side."""

_ACROSS = 1e-6
"""Share of gravity, or of the axis, along the platform's motion below which it tells no side."""


def axis_poses(robot: Manipulator) -> Array:
    """Return level poses (K, m) that centre the platform points on the machine's axis.

    The axis is the platform's, through the centre of the ball that holds the reach.
    """
    center, radius = search_ball(robot)
    platform, count = robot.platform, len(center)
    direction = platform.directions @ np.array(platform.axis)
    if not np.linalg.norm(direction) > _ACROSS:
        return np.zeros((1, robot.freedom))
    spin = platform.spin_angle
    angles = np.arange(1 if spin is None else _TURNS) * 2.0 * np.pi / _TURNS
    poses = np.zeros((len(angles), _HEIGHTS, robot.freedom))
    if spin is not None:
        turns = (angles + np.pi) % (2.0 * np.pi) - np.pi
        poses[..., platform.coordinates.index(spin)] = turns[:, None]
    middle = np.mean([leg.platform_point for leg in robot.legs], axis=0)
    offsets = middle @ np.nan_to_num(platform.placement(poses[:, 0])[1])
    heights = radius * np.linspace(-1.0, 1.0, _HEIGHTS)
    poses[..., :count] = (
        center - (offsets @ platform.directions.T)[:, None] + np.outer(heights, direction)
    )
    return np.concatenate([poses[0], *poses[1:, ::_COARSE]])


def grid_poses(robot: Manipulator) -> Array:
    """Return a grid of level poses (K, m) of a platform with two or three lengths, else none."""
    center, radius = search_ball(robot)
    count = len(center)
    if count not in _GRID:
        return np.empty((0, robot.freedom))
    ends = [np.linspace(-radius, radius, _GRID[count])] * count
    grid = center + np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, count)
    return np.hstack([grid, np.zeros((len(grid), robot.freedom - count))])


def random_box_poses(robot: Manipulator) -> Array:
    """Return random poses (K, m) in the box of the reach, not necessarily in reach."""
    low, high = widest_box(robot)
    return np.random.default_rng(0).uniform(low, high, (_RANDOM, robot.freedom))


def mid_range_poses(robot: Manipulator, starts: Array) -> Array:
    """Return poses (K, m) with all joints at mid-range, from several starts.

    A joint without limits has its zero for a middle.
    """
    joints = np.array([np.mean(leg.limits or (0.0, 0.0)) for leg in robot.legs])
    poses = starts[:_LED]
    for _ in range(_NEWTON):
        poses = numeric(robot, "newton_step")(
            np.broadcast_to(joints, (len(poses), len(joints))), poses
        )[0]
    return poses[np.isfinite(poses).all(axis=-1)]


def sides(robot: Manipulator, poses: Array) -> Array:
    """Return on which side of its base the platform is at poses (K, m): 1, -1, or 0 for neither.

    1 is the side along the platform's axis; of a platform that moves across its axis alone, the
    side against gravity. The base is the mean of the guide points, of sliders that of where they
    are. Machines that neither tells have 0.
    """
    platform = robot.platform
    up = np.array(platform.axis)
    if not np.linalg.norm(platform.directions @ up) > _ACROSS:
        down = np.array(robot.gravity)
        gravity_part = (platform.directions @ down) @ platform.directions
        size = np.linalg.norm(gravity_part)
        if not size > _ACROSS * np.linalg.norm(down):
            return np.zeros(len(poses))
        up = -gravity_part / size
    place, axes = platform.placement(poses)
    points = np.mean([leg.platform_point for leg in robot.legs], axis=0) @ axes
    points += place + np.mean([leg.fixed_offset for leg in robot.legs], axis=0)
    joints = np.nan_to_num(numeric(robot, "joint_coordinates")(poses)[0])
    base = np.zeros_like(points)
    for leg, q in zip(robot.legs, joints.T, strict=True):
        base += np.array(leg.guide_point) / len(robot.legs)
        if leg.joint.unit == "m" and leg.joint_axis is not None:
            base += np.outer(q, leg.joint_axis) / len(robot.legs)
    heights = (points - base) @ up
    least = _UPRIGHT * max(leg.size for leg in robot.legs)
    return np.where(np.abs(heights) > least, np.sign(heights), 0.0)
