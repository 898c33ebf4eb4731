"""A peer that is called from Python, one state at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from peers.closure import Array

__all__ = ["Call", "Calls"]

Call = Callable[[Array, Array, Array], Array]
"""From pose, velocity and acceleration of one state to its forces, (m,) to (n,)."""


@dataclass(frozen=True)
class Calls:
    """A peer that computes one state a call.

    Parameters
    ----------
    call : callable
        The whole job for one state.
    """

    call: Call

    def forces(self, pose: Array, velocity: Array, acceleration: Array) -> Array:
        """Return the actuator forces (B, n)."""
        states = zip(*_rows(pose, velocity, acceleration), strict=True)
        return np.array([self.call(*state) for state in states]).reshape(np.shape(pose))

    def seconds(self, pose: Array, velocity: Array, acceleration: Array) -> float:
        """Return the seconds a state that one call for each state of the batch takes."""
        call = self.call
        poses, velocities, accelerations = _rows(pose, velocity, acceleration)
        begin = perf_counter()
        for x, dx, ddx in zip(poses, velocities, accelerations, strict=True):
            call(x, dx, ddx)
        return (perf_counter() - begin) / len(poses)


def _rows(*states: Array) -> list[list[Array]]:
    return [list(np.ascontiguousarray(state, dtype=float)) for state in states]
