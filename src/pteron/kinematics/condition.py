"""How evenly the joints move the platform at a pose: the Jacobian and its condition number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.kernels import Array
from pteron.kinematics.position import jacobian
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
    """Return the Jacobian at a pose (m,), and its condition number.

    Raises
    ------
    UnreachablePose
        If a leg does not reach the pose.
    SingularPose
        If a leg is stretched or folded (type I).
    """
    matrix = jacobian(robot, pose)
    held = [leg.platform_point[:2] for leg in robot.legs if not leg.follows_angle]
    radius = float(np.sqrt((np.array(held) ** 2).sum(axis=-1).mean()))
    unit = radius or 1.0
    levers = [
        unit / abs(row[-1]) if leg.follows_angle else leg.lever
        for leg, row in zip(robot.legs, matrix, strict=True)
    ]
    columns = [unit if name == "phi" else 1.0 for name in robot.coordinates]
    condition = float(np.linalg.cond(matrix * np.array(levers)[:, None] / columns))
    return JacobianAtPose(matrix, radius or None if robot.platform.turns else None, condition)
