"""Conditional values of a fit: some are fixed, and the others follow by the covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pteron.kernels import Array
from pteron.tolerances import EXACT

_ROUNDS = 5
"""Times, at most, that values below zero are set to zero and the others follow."""


def conditional_shift(covariance: Array, places: Sequence[int], shift: Array) -> Array:
    """Return the most probable shift of all values (p,) if some are shifted by `shift`.

    By a fit's covariance C (p, p) the others move by their regression on those: C_ab C_bb^-1 shift.
    """
    chosen = list(places)
    if not chosen or not np.any(shift):
        return np.zeros(len(covariance))
    size = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    correlation = covariance / np.outer(size, size)
    block = correlation[np.ix_(chosen, chosen)]
    pull = np.linalg.lstsq(block, shift / size[chosen], rcond=EXACT)[0]
    moved = size * (correlation[:, chosen] @ pull)
    moved[chosen] = shift
    return np.asarray(moved)


def conditional_values(
    values: Array, covariance: Array, bodies: Array, positive: Sequence[int]
) -> Array:
    """Return a fit's values (p,) with the first `rank` fixed to those of real `bodies`.

    The others follow by the covariance. Those at `positive` places that would be negative are zero.
    """
    rank = len(bodies)
    fixed, targets = list(range(rank)), bodies.tolist()
    adjusted = values
    for _ in range(_ROUNDS):
        shift = np.array(targets) - values[fixed]
        adjusted = values + conditional_shift(covariance, fixed, shift)
        below = [k for k in positive if adjusted[k] < 0.0 and k not in fixed]
        if not below:
            break
        fixed += below
        targets += [0.0] * len(below)
    return np.asarray(adjusted)
