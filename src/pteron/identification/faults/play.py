"""Play in a drive with one encoder: residuals that are large where its load changes direction.

While a load passes through zero, gear and joint leave each other and meet again with a knock: the
motor is without its load, then gets all of it at once. No column of the regressor has that: when
the teeth meet hangs on the play itself. But it lies around the load's changes of direction, and
nowhere else, where all that is smooth (elasticity, a delay, wrong masses) spreads over the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.kernels import Array

_LENGTH = 1.0
"""Length of a window, over the period of the highest frequency that the forces are seen at."""

_TIMES = 2.5
"""Ratio of the residuals at load reversals to those elsewhere from which there is play. What
follows the load's rate, as all that is smooth does at most, makes a ratio of 1.6."""

_CHANCE = 1e-4
"""Chance that windows of all joints are so much larger by luck, below which it counts."""

_FEWEST = 4
"""Least number of windows of a joint, with changes of direction and without."""


class PlayRecord(NamedTuple):
    """Load, residual and motion of each joint in a part of a log, (T, n), at even times."""

    time: Array
    load: Array
    """The force that its transmission passes on, by the fit."""
    residual: Array
    moving: NDArray[np.bool_]
    """Samples at which the joint moves: where it reverses, dry friction alone makes residuals."""


class BacklashSignature(NamedTuple):
    """The signature of backlash: how much larger residuals are where loads reverse."""

    tested: NDArray[np.bool_]
    """(n,); False where the load changes direction too seldom to tell."""
    times: Array
    """(n,); NaN where too little is seen, or nothing."""
    chance: float
    power: Array
    """Mean square (n,) that this adds to the residuals, over all samples."""


def backlash_signature(records: Sequence[PlayRecord], band: float) -> BacklashSignature:
    """Return the signature of backlash in joints' drives, and the joints with enough data.

    Windows' mean squares are ranked (Mann and Whitney's test, over all joints, each in units of its
    usual one), and medians compared, so that single outliers, or a few of these changes that
    fall together with something else, say nothing. `band` is the highest frequency that forces are
    seen at, Hz.
    """
    count = records[0].load.shape[1]
    times, power = np.full(count, np.nan), np.zeros(count)
    every: tuple[list[Array], list[Array]] = ([], [])
    for joint in range(count):
        near, far, share = _windows(records, band, joint)
        if min(len(near), len(far)) < _FEWEST:
            continue
        usual = max(float(np.median(far)), np.finfo(float).tiny)
        times[joint] = np.sqrt(np.median(near) / usual)
        power[joint] = max(float(np.mean(near)) - usual, 0.0) * share
        every[0].append(near / usual)
        every[1].append(far / usual)
    tested, shows, chance = ~np.isnan(times), times >= _TIMES, 1.0
    if shows.any():
        both = (np.concatenate(part) for part in every)
        chance = float(scipy.stats.mannwhitneyu(*both, alternative="greater").pvalue)
    shows &= chance <= _CHANCE
    times, power = np.where(shows, times, np.nan), np.where(shows, power, 0.0)
    return BacklashSignature(tested, times, chance, power)


def _windows(records: Sequence[PlayRecord], band: float, joint: int) -> tuple[Array, Array, float]:
    """Return mean squares of windows at load reversals and elsewhere, and the former's share.

    A joint moves all through a window.
    """
    near, far = [], []
    covered, samples = 0, 0
    for record in records:
        if len(record.time) < 2:  # a stretch between lost samples
            continue
        length = max(int(_LENGTH / band / float(np.median(np.diff(record.time)))), 2)
        square, moving = record.residual[:, joint] ** 2, record.moving[:, joint]
        turned = np.flatnonzero(np.diff(np.sign(record.load[:, joint])) != 0) + 1
        free, last = moving.copy(), -length
        for at in turned.tolist():
            # The load is not known so well that it could not change a little before.
            free[max(at - length // 2, 0) : at + 2 * length] = False
            if at >= last + length and at + length <= len(square):
                if moving[at : at + length].all():
                    near.append(float(square[at : at + length].mean()))
                    covered += length
                last = at
        for at in range(0, len(square) - length, length):
            if free[at : at + length].all():
                far.append(float(square[at : at + length].mean()))
        samples += len(square)
    return np.array(near), np.array(far), covered / max(samples, 1)
