"""Forces at the same measured joints of a machine a little different: its lengths, gravity, joints.

Only the trial of faults uses it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pteron.equations.machine import numbers
from pteron.identification.signals import States
from pteron.kernels import Array
from pteron.kernels.targets import compile
from pteron.manipulator import Manipulator


def lengths_of(robot: Manipulator) -> list[tuple[int, int]]:
    """Return leg, from 0, and place in the vector of `numbers`, of each number that is in m."""
    found, place = [], 0
    for i, leg in enumerate(robot.legs):
        for quantity in leg.quantities:
            size = len(quantity.value)
            if quantity.role in ("point", "length"):
                found += [(i, place + k) for k in range(size)]
            place += size
        found += [(i, place + k) for k in range(3)]  # the platform point; then the fixed offset
        place += 6
    return found


class Moved:
    """The forces of rigid bodies (R, n) at states, and how they change with the machine.

    Another geometry puts the platform elsewhere, as the joints are what was measured.

    Parameters
    ----------
    robot : Manipulator
        The machine as it is drawn.
    parameters : array, shape (N,)
        Its inertial parameters.
    states : States
        R states.
    """

    def __init__(self, robot: Manipulator, parameters: Array, states: States) -> None:
        self._robot, self._parameters, self._states = robot, parameters, states
        self._geometry = np.array(numbers(robot))
        self._step, self._motion, self._dynamics = (
            compile(robot, what, "vm", grade="general")
            for what in ("newton_step", "platform_motion", "inverse_dynamics")
        )
        self._forces = self._at(self._geometry)

    def lengths(self, step: float) -> Array:
        """Return how forces change with each of `lengths_of`, differenced over `step` m."""
        unit = np.eye(len(self._geometry))
        return self._along(unit[[place for _, place in lengths_of(self._robot)]], step)

    def tilt(self, step: float) -> Array:
        """Return how forces change as gravity tilts two ways, differenced over `step` rad."""
        g = np.array(self._robot.gravity)
        size = float(np.linalg.norm(g))
        ways = np.zeros((2, len(self._geometry)))
        if size > 0.0:
            ways[:, -3:] = size * np.linalg.svd(g[None, :])[2][1:]
        return self._along(ways, step)

    def give(self, motion: Sequence[Array], step: float) -> Array:
        """Return how forces change as each joint is behind what was measured by some `motion`.

        Its coordinates, rates and accelerations are (R, n); forces are differenced over `step` of
        the joint's own range.
        """
        columns = []
        for i, size in enumerate(step * np.ptp(self._states.joints, axis=0)):
            part = np.zeros(motion[0].shape[1])
            part[i] = -size / max(float(np.abs(motion[0][:, i]).max()), np.finfo(float).tiny)
            behind = self._at(self._geometry, *(part * one for one in motion))
            columns.append((behind - self._forces) / -part[i])
        return np.stack(columns, axis=-1)

    def _along(self, ways: Array, step: float) -> Array:
        columns = [(self._at(self._geometry + step * way) - self._forces) / step for way in ways]
        return np.stack(columns, axis=-1)

    def _at(self, geometry: Array, *added: Array) -> Array:
        """Return the forces by another geometry, and with some motion added to the joints'."""
        s = self._states
        q, dq, ddq = added or (0.0, 0.0, 0.0)
        # One step of Newton's: its error is of second order in a change that is small.
        pose, _ = self._step(s.joints + q, s.pose, geometry=geometry)
        velocity, acceleration = self._motion(
            pose, s.joint_rates + dq, s.joint_accelerations + ddq, geometry=geometry
        )
        found = self._dynamics(
            pose, velocity, acceleration, geometry=geometry, parameters=self._parameters
        )
        return np.asarray(found)
