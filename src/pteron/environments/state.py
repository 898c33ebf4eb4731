"""The state of one or many machines in a Gymnasium environment: pose, velocity, target, clock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array

Bools = NDArray[np.bool_]
"""An array of truth values."""


@dataclass(frozen=True)
class EpisodeState:
    """Pose, velocity and target (..., m) of machines, and the time of their episodes (...), s."""

    pose: Array
    velocity: Array
    target: Array
    clock: Array

    def put(self, chosen: Bools, others: EpisodeState) -> EpisodeState:
        """Return these states with `others` in place of the chosen ones, a mask (B,)."""
        found = self.pose.copy(), self.velocity.copy(), self.target.copy(), self.clock.copy()
        new = others.pose, others.velocity, others.target, others.clock
        for into, values in zip(found, new, strict=True):
            into[chosen] = values
        return EpisodeState(*found)

    def row(self, i: int) -> EpisodeState:
        """Return the state of one machine."""
        return EpisodeState(self.pose[i], self.velocity[i], self.target[i], self.clock[i])
