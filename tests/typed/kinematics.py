"""Poses, joints and the Jacobian of a Delta, and the distance to its singular poses."""

import numpy as np
from numpy.typing import NDArray

import pteron


def worst_condition(robot: pteron.Manipulator, count: int) -> float:
    """Return the greatest condition number of the Jacobian over random poses."""
    poses: NDArray[np.float64] = pteron.random_poses(robot, count, seed=1)
    jacobians = pteron.jacobian(robot, poses)
    return float(np.linalg.cond(jacobians).max())


delta = pteron.load("delta")
joints = pteron.inverse_kinematics(delta, [0.05, -0.1, -0.95])
modes = pteron.direct_kinematics(delta, joints)
distance = np.nanmin(np.linalg.norm(modes - [0.05, -0.1, -0.95], axis=-1))
names: tuple[str, ...] = delta.joint_names
print(names, round(float(distance), 9), worst_condition(delta, 50) > 1.0)
