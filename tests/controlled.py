"""A machine under a law of control: forces held for a period, Runge and Kutta's steps between."""

from dataclasses import dataclass

import numpy as np

import pteron


@dataclass(frozen=True)
class Run:
    """What happened at the samples."""

    errors: np.ndarray
    """(T, m): wanted pose less the machine's."""
    joint_errors: np.ndarray
    memories: np.ndarray
    forces: np.ndarray

    def largest(self, robot, parts=1):
        """Return the largest distance from the path, m, in each of equal parts of the time."""
        lengths = robot.freedom - robot.platform.turns
        distance = np.linalg.norm(self.errors[:, :lengths], axis=-1)
        return np.array([part.max() for part in np.array_split(distance, parts)])


def controlled(plant, law, motion, period, start=None, *, steps=1, grid=None, late=0):
    """Return what a machine does under a law; it begins at the motion's first pose or `start`.

    `grid` is the encoders' resolution, m or rad: rates are then differences of what they show.
    `late` is by how many samples forces come late.
    """
    count = round(motion.duration / period)
    wanted = motion.at(motion.time[0] + period * np.arange(count))
    pose, velocity = (wanted[0][0] if start is None else start), wanted[1][0]
    memory, shown, queue = law.memory(pose, velocity), None, []
    found = [], [], [], []
    for now in zip(*wanted, strict=True):
        joints = pteron.inverse_kinematics(plant, pose)
        rates = pteron.kinematics.joint_rates(plant, pose, velocity).actuated
        if grid is not None:
            joints = grid * np.round(joints / grid)
            rates = (joints - shown) / period if shown is not None else 0.0 * joints
            shown = joints
        forces, memory = law(*now, joints, rates, memory)
        queue.append(forces)
        for kept, value in zip(found, (now[0] - pose, joints, memory, forces), strict=True):
            kept.append(value)
        held = queue[max(len(queue) - 1 - late, 0)]
        for _ in range(steps):
            pose, velocity = _stepped(plant, pose, velocity, held, period / steps)
    errors, joints, memories, forces = (np.array(kept) for kept in found)
    return Run(errors, pteron.inverse_kinematics(plant, wanted[0]) - joints, memories, forces)


def _stepped(robot, x, v, forces, h):
    def slope(x, v):
        return pteron.drive_accelerations(robot, x, v, forces)

    a = slope(x, v)
    b = slope(x + h / 2 * v, v + h / 2 * a)
    c = slope(x + h / 2 * v + h**2 / 4 * a, v + h / 2 * b)
    d = slope(x + h * v + h**2 / 2 * b, v + h * c)
    return x + h * v + h**2 / 6 * (a + b + c), v + h / 6 * (a + 2 * b + 2 * c + d)
