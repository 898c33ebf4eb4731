"""The margin that the search for a home pose maximises, and its local search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.kinematics.simplex_ascent import climb
from pteron.manipulator import Manipulator
from pteron.workspace.margins import pose_margins

_CONVERGED, _GAIN = 1e-5, 1e-6
"""Size of a simplex, in units of the longest leg and rad, and difference of its margins, below
which it has converged."""

FIRST_STEPS = (0.05, 0.2)
"""Size of a local search's first simplex: share of the longest leg, and rad."""


def tilting_angles(robot: Manipulator) -> NDArray[np.bool_]:
    """Return which coordinates (m,) are 0 at level poses; none if the platform cannot tilt."""
    return robot.platform.angular & robot.platform.tilts


def distinct_poses(poses: Array, spacing: Array) -> Array:
    """Return poses (K, m) without those near an earlier pose."""
    is_near = np.asarray((np.abs(poses[:, None] - poses) <= spacing).all(axis=-1))
    return poses[[not is_near[i, :i].any() for i in range(len(poses))]]


def home_margins(robot: Manipulator, poses: Array) -> Array:
    """Return the margin (...) of poses that the search maximises; at most 0 if turned back."""
    least = pose_margins(robot, poses).least
    turned_share = np.abs(poses[..., robot.platform.angular]) / np.pi
    worth = np.minimum(least, 1.0 - turned_share.max(axis=-1, initial=0.0))
    return np.asarray(np.where(np.isfinite(worth), worth, -np.inf))


def longest_leg(robot: Manipulator) -> float:
    """Return the length of the longest leg, m, the scale of home's lengths."""
    return max(leg.size for leg in robot.legs) or 1.0


def pose_steps(robot: Manipulator, share: float, radians: float) -> Array:
    """Return a step (m,) of each pose coordinate: a share of the longest leg, m, or radians."""
    return np.where(robot.platform.angular, radians, share * longest_leg(robot))


def refine_poses(
    robot: Manipulator, starts: Array, moved: NDArray[np.bool_] | None = None
) -> Array:
    """Return poses (S, m) with locally best margins, varied in the marked coordinates."""
    movable = np.ones(robot.freedom, dtype=bool) if moved is None else moved
    units = pose_steps(robot, 1.0, 1.0)[movable]

    def poses(scaled: Array) -> Array:
        """Return poses (..., m) from scaled values (..., k) of movable coordinates, others 0."""
        # Simplices (S, ..., k), or points (4, S, k): coordinates that stay are alike, or 0.
        all_coordinates = np.zeros((*scaled.shape[:-1], robot.freedom))
        all_coordinates[..., movable] = scaled * units
        return all_coordinates

    steps = pose_steps(robot, *FIRST_STEPS)[movable] / units
    edges = np.vstack([np.zeros(len(steps)), np.diag(steps)])
    simplices = (starts[:, movable] / units)[:, None, :] + edges
    best, _ = climb(
        lambda scaled: home_margins(robot, poses(scaled)), simplices, size=_CONVERGED, gain=_GAIN
    )
    return poses(best)
