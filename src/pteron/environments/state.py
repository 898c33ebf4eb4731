"""The state of one or many machines in a Gymnasium environment: pose, velocity, target, clock."""

from __future__ import annotations

from collections.abc import Sequence
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

    def put(self, rows: NDArray[np.integer], others: EpisodeState) -> EpisodeState:
        """Return the states with those of numbers `rows` (R,) replaced by `others`."""
        columns = [getattr(self, part.name).copy() for part in fields(self)]
        for column, part in zip(columns, fields(others), strict=True):
            column[rows] = getattr(others, part.name)
        return EpisodeState(*columns)

    def row(self, i: int) -> EpisodeState:
        """Return the state of episode number i."""
        return EpisodeState(*(getattr(self, part.name)[i] for part in fields(self)))


class HostGenerators:
    """Random generators of many environments, each with its own sequence."""

    def __init__(self, count: int) -> None:
        self._generators: list[np.random.Generator | None] = [None] * count

    def put(self, rows: Sequence[int], generators: Sequence[np.random.Generator]) -> None:
        """Replace the generators of the rows."""
        for i, generator in zip(rows, generators, strict=True):
            self._generators[i] = generator

    def random(self, rows: NDArray[np.integer], count: int) -> Array:
        """Return the next `count` numbers in [0, 1) of the generators of rows (R,), (R, count)."""
        chosen = [self._generators[i] for i in rows.tolist()]
        return np.stack([rng.random(count) for rng in chosen if rng is not None])
