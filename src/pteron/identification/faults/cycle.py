"""The reference cycle that faults are weighed on: pick-and-place as fast as a log's motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.errors import PteronError
from pteron.identification.signals import States
from pteron.identification.signals.states import FullMotion, home
from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.manipulator import Manipulator
from pteron.motion import Motion, pick_and_place

_SAMPLES = 201
"""Samples of the cycle."""

_MOVES = 0.02
"""Share of a joint's largest rate below which its dry friction is uncertain, so that samples do
not count."""

_LEAST = 0.1
"""Least standard deviation that an actuator's force counts as having, over the largest."""


class Extent(NamedTuple):
    """The mean pose of a motion (m,), and the largest rate and acceleration of each joint (n,)."""

    pose: Array
    rates: Array
    accelerations: Array

    @classmethod
    def from_states(cls, states: list[States]) -> Extent:
        """Return the extent of a motion in blocks."""
        return cls(
            np.mean([s.pose.mean(axis=0) for s in states], axis=0),
            np.max([np.abs(s.joint_rates).max(axis=0) for s in states], axis=0),
            np.max([np.abs(s.joint_accelerations).max(axis=0) for s in states], axis=0),
        )


@dataclass(frozen=True)
class ReferenceCycle:
    """States of a cycle, and a mask (R, n) of the rows in which each joint moves.

    They may be `in_order`, one after the other, or each by itself.
    """

    states: States
    moves: NDArray[np.bool_]
    in_order: bool = True

    @classmethod
    def from_mean_pose(
        cls, robot: Manipulator, extent: Extent, *, size: float = 1.0
    ) -> ReferenceCycle | None:
        """Return the cycle about a motion's mean pose, or home, as fast as the motion itself.

        `size` is over the largest size that fits; None where none does.
        """
        for around in (extent.pose, np.array(home(robot))):
            within = partial(pick_and_place, robot, around, samples=_SAMPLES)
            try:
                slow = within(duration=1.0)
            except PteronError:
                continue
            gone = _complete_motion(robot, slow)
            rate = np.abs(gone.rates).max(axis=0) / extent.rates
            acceleration = np.abs(gone.accelerations).max(axis=0) / extent.accelerations
            duration = float(np.maximum(rate, np.sqrt(acceleration)).max())
            motion = within(scale=size * slow.scale, direction=slow.across, duration=duration)
            gone = _complete_motion(robot, motion)
            rates = np.abs(gone.rates)
            return cls(States.from_motion(motion.time, gone), rates > _MOVES * rates.max(axis=0))
        return None

    @classmethod
    def from_range(cls, robot: Manipulator, states: list[States]) -> ReferenceCycle:
        """Return states of another motion with the range, speeds and accelerations of a log's.

        Each coordinate is that of another sample, and so is its rate. Poses out of the legs' reach
        are left out.
        """
        rng = np.random.default_rng(0)
        motion = []
        for name in ("pose", "velocity", "acceleration"):
            log = np.concatenate([getattr(s, name) for s in states])
            rows = rng.integers(len(log), size=(_SAMPLES, log.shape[1]))
            motion.append(np.take_along_axis(log, rows, axis=0))
        full_motion = FullMotion.from_platform(robot, *motion)
        # A slider's motion is finite out of the legs' reach too; that of the links is not.
        within = np.isfinite(evaluate_unchecked(robot, "regressor", *motion)).all(axis=(1, 2))
        within &= np.isfinite(np.hstack(full_motion)).all(axis=1)
        full_motion = FullMotion(*(np.ascontiguousarray(part[within]) for part in full_motion))
        rates = np.abs(full_motion.rates)
        time = np.arange(len(rates), dtype=float)
        moves = rates > _MOVES * rates.max(axis=0, initial=0.0)
        return cls(States.from_motion(time, full_motion), moves, in_order=False)

    def share(self, error: Array, forces: Array) -> Array:
        """Return an error's RMS (n,) where joints move, percent of the forces' deviation."""
        count = np.maximum(self.moves.sum(axis=0), 1)
        size = np.sqrt((self.moves * error**2).sum(axis=0) / count)
        spread = forces.std(axis=0)
        return np.asarray(100.0 * size / np.maximum(spread, max(_LEAST * spread.max(), 1e-300)))


def _complete_motion(robot: Manipulator, motion: Motion) -> FullMotion:
    """Return a planned motion with its joint coordinates, rates and accelerations."""
    return FullMotion.from_platform(robot, motion.pose, motion.velocity, motion.acceleration)
