"""The reachable pose nearest to a target, found by sliding along the boundary."""

from __future__ import annotations

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator
from pteron.viewer.boundary import farthest_reachable_pose, is_allowed
from pteron.workspace.margins import distance_to_limits

_ROUNDS = 40
"""Most steps along the boundary."""

_STRIDE = 0.15
"""Greatest length of a step, as a share of the longest leg's size."""

_TURN = 0.3
"""Greatest change of an angle in a step, rad."""

_WITHIN = 2e-4
"""Margin that is kept to the end of a leg's reach, as a share of the leg's size."""

_APART = 1e-6
"""Difference of poses for slopes, m or rad."""

_LEAST = 1e-6
"""Length of a step, as a share of the way asked for, that ends the slide."""

_BACK = 3
"""Steps back into what is allowed after a step along a curved boundary."""


def nearest_reachable_pose(
    robot: Manipulator, start: Array, target: Array
) -> tuple[Array, Array | None]:
    """Return the reachable pose near a target (m,), from a start (m,), by sliding.

    It goes straight as far as it can, then along the boundary while it comes nearer: a step is the
    one next to the target that keeps all margins, taken as linear. Angles count with the arm of
    the platform. With the pose comes one beyond it, which is not allowed; None where the target is
    come to.
    """
    pose, beyond = farthest_reachable_pose(robot, start, target)
    if beyond is None:
        return pose, None
    weights = _weights(robot)

    def distance_to_target(there: Array) -> float:
        """Return the weighted distance, m, of a pose (m,) to the target."""
        return float(np.linalg.norm(weights * (target - there)))

    distance = distance_to_target(start)
    radius = max(min(0.25 * distance, _STRIDE * max(leg.size for leg in robot.legs)), 1e-9)
    for _ in range(_ROUNDS):
        step = _step(robot, pose, target - pose, weights)
        length = float(np.linalg.norm(weights * step))
        turn = float(np.abs(step[robot.platform.angular]).max(initial=0.0))
        trial = pose + step * min(1.0, radius / (length or radius), _TURN / (turn or _TURN))
        for _ in range(_BACK):
            if is_allowed(robot, trial):
                break
            trial = trial + _step(robot, trial, np.zeros_like(trial), weights)
        if not is_allowed(robot, trial):
            trial = farthest_reachable_pose(robot, pose, trial)[0]
        if distance_to_target(trial) < distance_to_target(pose) - _LEAST * distance:
            pose = trial
        else:
            radius *= 0.25
            if radius < _LEAST * distance:
                break
    return pose, farthest_reachable_pose(robot, pose, target)[1]


def _weights(robot: Manipulator) -> Array:
    """Return weights (m,) that turn coordinates into lengths: m for each rad, 1 for lengths."""
    arm = max(float(np.linalg.norm(leg.platform_point)) for leg in robot.legs)
    size = max(leg.size for leg in robot.legs)
    return np.where(robot.platform.angular, max(arm, 0.1 * size), 1.0)


def _step(robot: Manipulator, pose: Array, wish: Array, weights: Array) -> Array:
    """Return the step (m,) nearest to a desired one at which linearised margins stay positive.

    Least distance programming by non-negative least squares (Lawson and Hanson, chapter 23).
    """
    sides = np.vstack([np.zeros_like(pose), *(_APART * np.eye(len(pose)))])
    margins = _margins(robot, pose + sides)
    known = np.isfinite(margins).all(axis=0)
    margins = margins[:, known]
    slopes = (margins[1:] - margins[0]).T / _APART / weights
    # With z what the step differs from the wish by: slopes z >= -margin - slopes wish.
    least = -margins[0] - slopes @ (weights * wish)
    if not (least > 0.0).any():
        return wish
    rows = np.vstack([slopes.T, least])
    multipliers, _ = scipy.optimize.nnls(
        rows, np.append(np.zeros(len(pose)), 1.0), maxiter=50 * rows.shape[1]
    )
    residual = rows @ multipliers - np.append(np.zeros(len(pose)), 1.0)
    if abs(residual[-1]) < 1e-12:
        return np.zeros_like(wish)
    return np.asarray(wish - residual[:-1] / residual[-1] / weights)


def _margins(robot: Manipulator, poses: Array) -> Array:
    """Return margins (K, C) to the ends of legs and to limits, m; not negative where allowed."""
    reach = numeric(robot, "reach")(poses)[0]
    sizes = np.array([leg.size for leg in robot.legs])
    return np.hstack([reach - _WITHIN * sizes, distance_to_limits(robot, poses)])
