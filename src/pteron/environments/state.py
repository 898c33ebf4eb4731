"""The state of one or many machines in a Gymnasium environment: pose, velocity, target, clock."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array

Bools = NDArray[np.bool_]
"""An array of truth values."""


@dataclass(frozen=True)
class EpisodeState:
    """Pose, velocity and target (..., m) of machines, and the time of their episodes (...), s.

    `drives` (..., K) is the state of drives that bend or lag, as `pteron.motion.advance` has it.
    """

    pose: Array
    velocity: Array
    drives: Array
    target: Array
    clock: Array

    def put(self, chosen: Bools, others: EpisodeState) -> EpisodeState:
        """Return the states with those in the mask `chosen` (B,) replaced by `others`."""
        columns = [getattr(self, part.name).copy() for part in fields(self)]
        for column, part in zip(columns, fields(others), strict=True):
            column[chosen] = getattr(others, part.name)
        return EpisodeState(*columns)

    def row(self, i: int) -> EpisodeState:
        """Return the state of episode number i."""
        return EpisodeState(*(getattr(self, part.name)[i] for part in fields(self)))
