"""From the sliders' motion to the platform's, and to the forces of Pteron's model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import pteron
from plant.model import Array

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
    robot: pteron.Manipulator, sliders: Array, rates: Array, accelerations: Array
) -> State:
    """Return the motion of the platform, from that of the sliders, (T, n) each.

    Of the two poses of a Quadrupteron the one on the home pose's side of the singularity is taken.
    """
    poses = pteron.direct_kinematics(robot, sliders)
    home = pteron.workspace.home_pose(robot)
    if robot.platform.turns:
        turn = np.abs(np.angle(np.exp(1j * (poses[..., 3] - home[3]))))
        nearest = np.nan_to_num(turn, nan=np.inf).argmin(axis=-1)
        pose = np.take_along_axis(poses, nearest[..., None, None], axis=-2)[..., 0, :]
    else:
        pose = poses[..., 0, :]
    jacobian = pteron.jacobian(robot, pose)
    velocity = np.linalg.solve(jacobian, rates[..., None])[..., 0]
    drift = pteron.joint_accelerations(robot, pose, velocity, np.zeros_like(pose))
    acceleration = np.linalg.solve(jacobian, (accelerations - drift.actuated)[..., None])[..., 0]
    return State(pose, velocity, acceleration)
