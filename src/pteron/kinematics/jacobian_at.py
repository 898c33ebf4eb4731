"""The Jacobian at a pose and its condition number, for reports and the viewer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.kinematics.inverse import jacobian
from pteron.manipulator import Manipulator


@dataclass(frozen=True)
class JacobianAtPose:
    """The Jacobian (n, m) at a pose, Eq. (10), and its condition number.

    The condition number is that of J with each crank's row multiplied by the crank's length and the
    angle's column divided by `radius`, m, so that all entries have one unit. The joint of a leg
    that follows the angle, such as a shaft, counts as that angle times `radius`, without its gear.
    The radius is the root mean square distance of the platform points that turn from the platform's
    axis through P; None where the platform does not turn, or no point does.
    """

    matrix: Array
    radius: float | None
    condition: float


def jacobian_at(robot: Manipulator, pose: Array) -> JacobianAtPose:
    """Return the Jacobian at a pose (m,) with its characteristic length and condition number."""
    matrix = jacobian(robot, pose)
    homogeneous: tuple[Array, Array] = evaluate_kernel(robot, "homogeneous_jacobian", "raise", pose)
    plain, length = homogeneous
    turning = robot.platform.angles and any(
        any(leg.platform_point[:2]) and leg.reach_bound is not None for leg in robot.legs
    )
    radius = float(length) if turning else None
    return JacobianAtPose(matrix, radius, float(np.linalg.cond(plain)))
