"""The part of drive forces that the platform of a machine with more legs than coordinates feels.

Drives may push against each other by any amount, which no model of motion tells. So both sides of
F = W beta are mapped to the forces of least norm that act as they do, C^2 J (J^T C^2 J)^-1 J^T F
with the drives' strengths C: the rigid bodies' columns stay as they are, those of friction mix. Of
the n equations of a sample m are independent, `Observations.independent`: squares of residuals are
that share of the noise's, and the covariance is divided by it.
"""

from __future__ import annotations

from pteron.dynamics.joint_space import rate_matrix
from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.manipulator import Manipulator


def felt_part(robot: Manipulator, pose: Array, quantities: Array) -> Array:
    """Return the felt part of forces (R, n), or of their columns (R, n, p), at poses (R, m)."""
    if not robot.redundancy:
        return quantities
    rows: Array = evaluate_unchecked(robot, "jacobian", pose)
    matrices = rate_matrix(rows, robot.drive_strengths).mT @ rows.mT
    if quantities.ndim == pose.ndim:
        return (matrices @ quantities[..., None])[..., 0]
    return matrices @ quantities


def usable_samples(robot: Manipulator, moving: Array) -> Array:
    """Return which equations (R, n) of moving joints (R, n), 1 or 0, are usable.

    A redundant machine's joints are in all equations of a sample, with the signs of their rates.
    """
    return moving.min(axis=1, keepdims=True) + 0.0 * moving if robot.redundancy else moving
