"""A controller of the joints: feedforward, and feedback of position and rate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import pteron
from plant.friction import Friction
from plant.inverse import platform_state
from plant.model import Array
from plant.reference import Reference
from pteron.dynamics.joint_space import moved_inertias

__all__ = ["BANDWIDTH", "Controller", "FeedForward"]

FeedForward = Callable[[Array, Array, Array], Array]
"""From joint coordinates, rates and accelerations (T, n) to the actuators' forces (T, n)."""

BANDWIDTH = 100.0
"""rad/s; the controller's two poles are there."""

_REVERSAL = 1e-4
"""Reference speed where the compensation of Coulomb's friction changes sign, m/s or rad/s."""


class Controller:
    """The controller: a command that depends on time, tabulated, less gains times the joints."""

    def __init__(
        self,
        robot: pteron.Manipulator,
        drawn: pteron.Manipulator,
        reference: Reference,
        friction: Friction,
        compensation: float,
        start: float,
        duration: float,
        spacing: float,
        bandwidth: float,
        feed_forward: FeedForward | None,
    ) -> None:
        self.start, self.spacing = start, spacing
        instants = np.arange(round((duration - start) / spacing) + 50, dtype=np.float64)
        time = start + spacing * instants
        joints, rates, accelerations = reference(time)
        home: Array = pteron.workspace.home_pose(robot)
        masses = moved_inertias(pteron.jacobian(robot, home), pteron.mass_matrix(drawn, home))
        self.position_gain = masses * bandwidth**2
        self.rate_gain = 2.0 * masses * bandwidth
        if feed_forward is None:
            state = platform_state(robot, joints, rates, accelerations)
            needed = pteron.inverse_dynamics(drawn, state.pose, state.velocity, state.acceleration)
            braking = friction.dry(rates) * np.tanh(rates / _REVERSAL)
            braking += np.array(friction.viscous) * rates + np.array(friction.offset)
            needed = needed + compensation * braking
        else:
            needed = feed_forward(joints, rates, accelerations)
        self.command = needed + self.position_gain * joints + self.rate_gain * rates

    def forces(self, time: float, joints: Array, rates: Array) -> Array:
        """Return the actuator forces (n,); between the table's instants the command is linear."""
        place = (time - self.start) / self.spacing
        k = int(place)
        share = place - k
        command = (1.0 - share) * self.command[k] + share * self.command[k + 1]
        forces: Array = command - self.position_gain * joints - self.rate_gain * rates
        return forces
