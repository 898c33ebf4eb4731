"""The Jacobian at a pose and its condition number, for reports and the viewer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluated
from pteron.kinematics.inverse import jacobian
from pteron.manipulator import Manipulator


@dataclass(frozen=True)
class JacobianAtPose:
    """The Jacobian (n, m) at a pose, Eq. (10), and its condition number.

    The number is that of J with a crank's row times its length and the angle's column divided by
    `radius`, so that no unit is mixed with another. The joint of a leg that follows the angle, such
    as a shaft, is measured as that angle times the same radius: its gear does not count. The radius
    is the root mean square distance of the platform points, as far as they turn, from the
    platform's axis through P; None where the platform does not turn, or none of them does: then
    nothing but such a leg moves with the angle.
    """

    matrix: Array
    radius: float | None
    condition: float


def jacobian_at(robot: Manipulator, pose: Array) -> JacobianAtPose:
    """Return the Jacobian at a pose (m,), and its condition number."""
    matrix = jacobian(robot, pose)
    found: tuple[Array, Array] = evaluated(robot, "homogeneous_jacobian", "raise", pose)
    plain, length = found
    turning = robot.platform.angles and any(
        any(leg.platform_point[:2]) and leg.reach_bound is not None for leg in robot.legs
    )
    radius = float(length) if turning else None
    return JacobianAtPose(matrix, radius, float(np.linalg.cond(plain)))
