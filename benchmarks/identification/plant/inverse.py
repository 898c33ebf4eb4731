"""The platform's motion from that of the actuated joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import pteron
from plant.model import Array
from pteron.dynamics.joint_space import solve_rates

__all__ = ["State", "platform_state"]


@dataclass(frozen=True)
class State:
    """The platform's motion.

    Attributes
    ----------
    pose, velocity, acceleration : array, shape (T, m)
        m, rad and s.
    """

    pose: Array
    velocity: Array
    acceleration: Array


def platform_state(
    robot: pteron.Manipulator, joints: Array, rates: Array, accelerations: Array
) -> State:
    """Return the motion of the platform, from that of the actuated joints, (T, n) each.

    Of the poses that they have it is followed in the home pose's assembly mode.
    """
    pose = pteron.follow(robot, joints, pteron.workspace.home_pose(robot))
    jacobian = pteron.jacobian(robot, pose)
    velocity = solve_rates(jacobian, rates[..., None])[..., 0]
    drift = pteron.kinematics.joint_accelerations(robot, pose, velocity, np.zeros_like(pose))
    acceleration = solve_rates(jacobian, (accelerations - drift.actuated)[..., None])[..., 0]
    return State(pose, velocity, acceleration)
