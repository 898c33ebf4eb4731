"""The simplest of the poses whose margins nearly equal the best: the home pose."""

from __future__ import annotations

from itertools import product

import numpy as np

from pteron.bodies.vectors import rotation_matrices
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics
from pteron.kinematics.sampling import search_ball
from pteron.manipulator import Manipulator
from pteron.tolerances import ROUNDING
from pteron.workspace.home_search import (
    FIRST_STEPS,
    distinct_poses,
    home_margins,
    longest_leg,
    pose_steps,
    refine_poses,
    tilting_angles,
)

_LEVELLED = 4
"""Best poses, made level, that a local search improves."""

_ROUND = (0.1, 0.05, 0.01, 0.005, 0.001, 0.0001)
"""Round numbers that the pose is rounded to, coarsest first: shares of the power of ten that the
longest leg does not exceed."""

_DEGREES = (30.0, 15.0, 5.0, 1.0)
"""Round numbers that angles are rounded to, coarsest first, degrees."""

_WORTH = 0.99
"""Share of the best margin from which on a simpler pose is preferred."""

ON_AXIS = 0.1
"""Share of the best margin from which on a pose on the axis of a machine's symmetry is
preferred."""

_LEVEL = 0.75
"""Share of the best margin from which on a level pose of a platform that tilts is preferred."""

_MIDDLE = 0.9
"""Least share of the best margin in the middle between equals: from there all ways are open."""


def simplest_pose(robot: Manipulator, refined: Array, nearby: Array) -> Array:
    """Return the simplest pose (m,) with nearly the best margin, of optima and poses nearby."""
    margins = home_margins(robot, refined)
    most = float(margins.max())
    level = _best_level_poses(robot, refined)
    worth = home_margins(robot, level)
    if worth.max(initial=0.0) >= _LEVEL * most:
        refined, nearby = level, nearby * ~robot.platform.angular
        margins, most = worth, float(worth.max())
    # Zero says where the joints are meant to be, where nothing else tells.
    equals = refined[margins >= _WORTH * most]
    best = _least_travel(robot, equals)
    middle = distinct_poses(equals, pose_steps(robot, *FIRST_STEPS)).mean(axis=0)
    if home_margins(robot, middle) >= _MIDDLE * most:
        best = middle
    on_axis = _move_onto_axis(robot, np.concatenate([refined, nearby]))
    worth = home_margins(robot, on_axis)
    if worth.max(initial=0.0) >= ON_AXIS * most:
        best = _least_travel(robot, on_axis[worth >= _WORTH * worth.max()])
    least = _WORTH * float(home_margins(robot, best))
    for k in range(robot.freedom if tilting_angles(robot).any() else 0):
        middle = np.where(np.arange(robot.freedom) == k, 0.0, best)
        best = middle if home_margins(robot, middle) >= least else best
    decade = 10.0 ** np.ceil(np.log10(longest_leg(robot)))
    for share, degrees in product(_ROUND, _DEGREES):
        step = np.where(robot.platform.angular, np.radians(degrees), share * decade)
        rounded: Array = np.round(best / step) * step + 0.0  # -0.0 becomes 0.0
        if home_margins(robot, rounded) >= least:
            return rounded
    return best


def _least_travel(robot: Manipulator, poses: Array) -> Array:
    """Return the pose whose joints are nearest to zero."""
    travel = np.abs(inverse_kinematics(robot, poses)).max(axis=-1)
    nearest: Array = poses[travel.argmin()]
    return nearest


def _best_level_poses(robot: Manipulator, poses: Array) -> Array:
    """Return locally best poses with all angles 0; none if the platform does not tilt."""
    tilting = tilting_angles(robot)
    if not tilting.any():
        return poses[:0]
    level = poses * ~tilting
    if not tilting.all():
        order = np.argsort(-home_margins(robot, level), kind="stable")
        level = refine_poses(robot, level[order[:_LEVELLED]], ~tilting)
    return level


def _move_onto_axis(robot: Manipulator, poses: Array) -> Array:
    """Return poses (K, m) moved onto the axis of the machine's symmetry; none if it has none.

    A symmetry is a turn about the platform's axis after which each leg stands where another stood:
    the margins are the same then.
    """
    center, _ = search_ball(robot)
    directions, axis = robot.platform.directions, np.array(robot.platform.axis)
    lengths, count, tilting = len(center), len(robot.legs), tilting_angles(robot)
    if poses[:, tilting].any():
        return poses[:0]  # the turn would turn their angles too
    offsets, direction = poses[:, :lengths] - center, directions @ axis
    # Legs of a hexapod may stand in pairs, or in two halves.
    folds = [count, *(k for k in (3, 2) if k < count)] if tilting.any() else [count]
    for fold in folds:
        turn = rotation_matrices(2.0 * np.pi / fold * axis)
        images = poses.copy()
        images[:, :lengths] = center + offsets @ (directions @ turn @ directions.T).T
        if np.allclose(
            home_margins(robot, images), home_margins(robot, poses), rtol=0.0, atol=ROUNDING
        ):
            images[:, :lengths] = center + np.outer(offsets @ direction, direction)
            return images
    return poses[:0]
