"""A peer that is called from Python, one state at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from peers.closure import Array, Closure

__all__ = ["Calls"]


@dataclass(frozen=True)
class Calls:
    """The two CasADi functions of a closure around an engine's call, all on memory that stays.

    CasADi's buffers write straight into the engine's coordinates and read its joint forces.

    Parameters
    ----------
    closure : Closure
        The machine's closure.
    coordinates : tuple of array
        Where the engine reads its q, v and a.
    tau : array, shape (16,)
        Where it leaves the joint forces.
    inverse : callable
        The engine's inverse dynamics on this memory.
    unbounded : bool
        Whether q holds cosines and sines of angles.
    """

    closure: Closure
    coordinates: tuple[Array, Array, Array]
    tau: Array
    inverse: Callable[[], object]
    unbounded: bool

    def _call(self) -> Callable[[Array, Array, Array], Array]:
        """Return the function of one state; what it returns is overwritten by the next call."""
        before, follow = self.closure.joints(self.unbounded).buffer()
        after, project = self.closure.forces().buffer()
        rows, found = np.empty(28), np.empty(4)
        x, dx, ddx = np.empty(4), np.empty(4), np.empty(4)
        for i, value in enumerate((x, dx, ddx)):
            before.set_arg(i, value.data)
        for i, value in enumerate((*self.coordinates, rows)):
            before.set_res(i, value.data)
        after.set_arg(0, self.tau.data)
        after.set_arg(1, rows.data)
        after.set_res(0, found.data)
        inverse = self.inverse
        buffers = before, after  # their eval functions do not keep them alive

        def call(
            pose: Array, velocity: Array, acceleration: Array, _kept: object = buffers
        ) -> Array:
            x[:] = pose  # a quarter of what set_arg costs
            dx[:] = velocity
            ddx[:] = acceleration
            follow()
            inverse()
            project()
            return found

        return call

    def forces(self, pose: Array, velocity: Array, acceleration: Array) -> Array:
        """Return the actuator forces (B, 4)."""
        call = self._call()
        states = zip(*_rows(pose, velocity, acceleration), strict=True)
        return np.array([call(*state).copy() for state in states]).reshape(np.shape(pose))

    def seconds(self, pose: Array, velocity: Array, acceleration: Array) -> float:
        """Return the seconds a state that one call for each state of the batch takes."""
        call = self._call()
        poses, velocities, accelerations = _rows(pose, velocity, acceleration)
        begin = perf_counter()
        for x, dx, ddx in zip(poses, velocities, accelerations, strict=True):
            call(x, dx, ddx)
        return (perf_counter() - begin) / len(poses)


def _rows(*states: Array) -> list[list[Array]]:
    return [list(np.ascontiguousarray(state, dtype=float)) for state in states]
