"""Least singularity measures of random poses, relative to those that a machine's poses have.

The measures are absolute, 1 at best, and many sound machines come nowhere near 1: the type-II
measure of a Quadrupteron may be 0.02 at its best pose. A floor that is the same for all machines
refuses such a machine; these follow from the distribution of its own measures over poses in reach.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pteron.kernels import Array, numeric
from pteron.kinematics.sampling import holding_sizes, sample_poses
from pteron.manipulator import Manipulator
from pteron.tolerances import ROUNDING

_SAMPLE = 100
"""Poses in reach whose measures are taken: a tenth of them is 10, whose own deviation is 3."""

_USUAL = 0.1
"""Least measure of poses that count as away from singularities, where a machine has such poses."""

_SHARE = 0.1
"""Least share of poses in reach with the usual measure, so that it serves: drawing ten poses for
one that is wanted is cheap. Of the catalog it is 0.25 and more."""


class Floors(NamedTuple):
    """Least measures of a pose."""

    type_i: float
    type_ii: float


def usual_floors(
    robot: Manipulator, type_i: float | None, type_ii: float | None, limits: bool
) -> Floors:
    """Return type-I and type-II thresholds for poses far from singular; None means default.

    The default is 0.1 if at least a tenth of the machine's poses exceed it, else their median.
    """
    if type_i is not None and type_ii is not None:
        return Floors(type_i, type_ii)
    type_i_measures, type_ii_measures = _measures(robot, type_i or 0.0, limits)
    least = _usual(type_i_measures) if type_i is None else type_i
    return Floors(
        least, _usual(type_ii_measures[type_i_measures >= least]) if type_ii is None else type_ii
    )


def median_floors(robot: Manipulator, limits: bool = True) -> Floors:
    """Return the median type-I measure of poses, and the median type-II measure above it.

    So a quarter of the poses in reach exceed both, for any machine.
    """
    type_i_measures, type_ii_measures = _measures(robot, 0.0, limits)
    least = _median(type_i_measures)
    return Floors(least, _median(type_ii_measures[type_i_measures >= least]))


@lru_cache(maxsize=64)
def _measures(robot: Manipulator, type_i: float, limits: bool) -> tuple[Array, Array]:
    """Return the least type-I measure over legs (K,) and the least holding measure (K,)."""
    poses = sample_poses(robot, _SAMPLE, np.random.default_rng(0), type_i, limits=limits)
    type_i_measures = numeric(robot, "reach")(poses)[1].min(axis=-1)
    return type_i_measures, holding_sizes(robot, poses).min(axis=-1)


def _usual(measures: Array) -> float:
    """Return the default threshold, 0.1, if enough measures (K,) exceed it, else their median."""
    enough = int((measures >= _USUAL).sum()) >= _SHARE * len(measures)
    return _USUAL if enough else _median(measures)


def _median(measures: Array) -> float:
    """Return the median of the measures above 0 (K,); 0 if there are none."""
    measures = measures[measures > 0.0]
    return float(np.median(measures)) * (1.0 - ROUNDING) if len(measures) else 0.0
