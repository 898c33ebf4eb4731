"""The legs' rows in one unit: an absolute measure of how well the drives hold the platform.

Row i is the wrench of a unit force (N) of leg i on the platform, with its moment about the middle
of the platform points over a length L, m. The inverse of the least singular value is the largest
ratio of leg forces (root sum of squares) to the load, and of errors of the platform to errors along
the legs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator

_INDEPENDENT = 1e-9
"""Singular values over the largest from which on directions of a motion are independent."""


class UnitRows(NamedTuple):
    """The rows of the legs at poses, in one unit."""

    rows: Array
    """Wrench of each leg's unit force, moments divided by L, (K, n, m); NaN where a leg does not
    reach."""
    sizes: Array
    """Joint rates over the unit rows' rates (K, n): force of the joint = force of the row / size,
    1/m for a crank and 1 for a ram or a slider along its row."""
    length: float
    """L, m: the greatest distance of a platform point from the middle of them all, or from the
    centre that a platform turns about; m/rad where the platform's angle slides its points."""


@dataclass(frozen=True)
class RowFrame:
    """The scaling of a kernel's rows at poses to unit rows.

    Parameters
    ----------
    kernel : {"twist_jacobian", "jacobian"}
        Name of the kernel: rows against a twist, or against the pose's rates where its angle slides
        the platform points, which no twist says.
    length : float
        L, see `UnitRows`.
    motion : array, shape (K, 6, m), or None
        Orthonormal directions of the platform's motion in (v, L omega), for rows against a twist.
    arm : array, shape (K, 3)
        From P to the middle of the platform points, m.
    angular : array of bool, shape (m,)
        Which coordinates are angles.
    """

    kernel: str
    length: float
    motion: Array | None
    arm: Array
    angular: NDArray[np.bool_]

    def normalise(self, rows: Array) -> tuple[Array, Array]:
        """Return Jacobian rows (..., K, n, m) scaled to unit length, and their divisors."""
        if self.motion is None:
            scaled = np.where(self.angular, rows / self.length, rows)
            sizes = np.linalg.norm(scaled[..., ~self.angular], axis=-1)
            with np.errstate(divide="ignore", invalid="ignore"):
                return scaled / sizes[..., None], sizes
        unit, sizes = normalise_rows(rows, self.arm, self.length)
        return unit @ self.motion, sizes


def unit_rows(robot: Manipulator, poses: Array) -> UnitRows:
    """Return the legs' Jacobian rows at poses (K, m), scaled to unit length, with the scales."""
    frame = row_frame(robot, poses)
    rows, sizes = frame.normalise(numeric(robot, frame.kernel)(poses)[0])
    return UnitRows(rows, sizes, frame.length)


def row_frame(robot: Manipulator, poses: Array) -> RowFrame:
    """Return the scaling that makes Jacobian rows at poses (K, m) unit rows."""
    points = np.array([leg.platform_point for leg in robot.legs])
    middle = np.zeros(3) if robot.platform.fixed_point else points.mean(axis=0)
    length = float(np.linalg.norm(points - middle, axis=1).max())
    length = length if length > 0.0 else max(leg.size for leg in robot.legs)
    arm = middle @ np.nan_to_num(robot.platform.placement(poses)[1])
    angular = robot.platform.angular
    if angular.any() and not robot.platform.rotation_axes:
        return RowFrame("jacobian", length, None, arm, angular)
    steps = np.eye(robot.freedom)
    twists = [
        numeric(robot, "twist")(poses, np.broadcast_to(step, poses.shape))[0] for step in steps
    ]
    twist_columns = np.stack(twists, axis=-1)
    twist_columns = np.nan_to_num(twist_columns)
    twist_columns[:, :3] += np.cross(twist_columns[:, 3:], arm[:, :, None], axis=1)
    twist_columns[:, 3:] *= length
    # A step of an angle counts as one of its own length, so that none is lost to rounding.
    twist_columns /= np.maximum(
        np.linalg.norm(twist_columns, axis=1, keepdims=True), np.finfo(float).tiny
    )
    directions = np.linalg.svd(twist_columns, full_matrices=False)[0]
    return RowFrame("twist_jacobian", length, directions, arm, angular)


def normalise_rows(twists: Array, arm: Array, length: float) -> tuple[Array, Array]:
    """Return force rows (K, n, 6) scaled to unit size, moments over `length`, and divisors (K, n).

    The row of a leg that only turns the platform has a unit couple, force times `length`.
    """
    forces, moments = twists[..., :3], twists[..., 3:]
    moments = (moments - np.cross(arm[:, None, :], forces)) / length
    sizes = np.maximum(np.linalg.norm(forces, axis=-1), np.linalg.norm(moments, axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.concatenate([forces, moments], axis=-1) / sizes[..., None], sizes


def least_singular_values(robot: Manipulator, poses: Array) -> Array:
    """Return the least singular value (K,) of the unit Jacobian rows at poses; NaN out of reach."""
    rows = unit_rows(robot, poses).rows
    least = np.full(len(rows), np.nan)
    good = np.isfinite(rows).all(axis=(1, 2))
    least[good] = np.linalg.svd(rows[good], compute_uv=False)[:, -1]
    return least
