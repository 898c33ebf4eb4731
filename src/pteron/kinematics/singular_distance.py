"""The distance of a machine's coordinates to those that make a pose, or every pose, singular.

To first order the least singular value of the unit rows (`unit_rows`) changes by u^T dA v, with u
and v its vectors. The least change, the same for every coordinate of a point and every length, that
takes it to 0 is its value over the sum of those sizes. A layout that is singular everywhere within
a tolerance has no pose that is farther than that.
"""

from __future__ import annotations

import numpy as np

from pteron.equations.variations import Variation, variations, varied_numbers
from pteron.kernels import Array, general_program
from pteron.kinematics.unit_rows import row_frame, unit_rows
from pteron.manipulator import Manipulator

_STEP = 1e-6
"""Step of a difference quotient over the length L: its error is the square, 1e-12, and rounding
1e-16 over the step, 1e-10."""


def coordinate_distances(robot: Manipulator, poses: Array) -> Array:
    """Return the least change of points and lengths, m, that makes each pose singular (K,).

    The distance is to first order, at a fixed pose; NaN out of reach.
    """
    unit = unit_rows(robot, poses)
    distances = np.full(len(poses), np.nan)
    good = np.isfinite(unit.rows).all(axis=(1, 2))
    if not good.any():
        return distances
    u, sigmas, v = np.linalg.svd(unit.rows[good])
    slopes = _slopes(robot, poses[good])
    changes = np.einsum("kn,bknm,km->bk", u[:, :, -1], slopes, v[:, -1])
    total = np.abs(changes).sum(axis=0)
    with np.errstate(divide="ignore"):
        distances[good] = sigmas[:, -1] / total
    return distances


def _slopes(robot: Manipulator, poses: Array) -> Array:
    """Return derivatives (B, K, n, m) of normalised Jacobian rows by points and lengths, 1/m."""
    changes = [v for v in variations(robot) if v.group in ("points", "lengths")]
    frame = row_frame(robot, poses)
    step = _STEP * frame.length
    amounts = step * np.concatenate([np.eye(len(changes)), -np.eye(len(changes))])
    rows = _rows_of(robot, frame.kernel, changes, amounts, poses)
    unit = np.stack([frame.normalise(machine_rows)[0] for machine_rows in rows])
    ahead, behind = np.split(np.nan_to_num(unit), 2)
    return np.asarray((ahead - behind) / (2.0 * step))


def _rows_of(
    robot: Manipulator, kernel: str, changes: list[Variation], amounts: Array, poses: Array
) -> Array:
    """Return the Jacobian rows (B, K, n, 6 or m) of B changed machines at poses (K, m).

    `kernel` is the one that a `RowFrame` names, and `amounts` (B, len(changes)), m, are the changes
    of each machine.
    """
    geometry = varied_numbers(robot, changes, amounts)
    function = general_program(robot, kernel).function
    several = np.repeat(geometry, len(poses), axis=0).T
    rows = np.array(function(several, np.tile(poses, (len(geometry), 1)).T))
    return rows.reshape(-1, len(geometry), len(poses), robot.joint_count).transpose(1, 2, 3, 0)
