"""Least values of measures along a path, between samples too, and the first place below a bound."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pteron.kernels import Array
from pteron.kernels.bisection import bisect_condition

_VALLEYS = 3
"""Number of a measure's lowest local minima that are refined."""

_FINER = 33
"""Points of a round of the refinement."""

_ZOOMS = 4
"""Rounds of the refinement: each narrows the interval 16 times."""

_HALVINGS = 50
"""Bisections for the first place below a bound."""


def least_along(
    measure: Callable[[Array], Array], marks: Array, enough: float
) -> tuple[Array, Array]:
    """Return place and value of the minimum of each column of measure(marks) (K, c), (c,) each.

    The lowest valleys among the marks are sampled finer and finer if the measure may be below
    `enough` there, assuming that between two marks it changes by at most twice as much as between
    others.
    """
    samples = measure(marks)
    places, least = marks[samples.argmin(axis=0)], samples.min(axis=0)
    for j in range(samples.shape[1]):
        column = samples[:, j]
        if not np.isfinite(column).all() or least[j] - enough > 2.0 * np.abs(np.diff(column)).max():
            continue
        padded = np.concatenate([[np.inf], column, [np.inf]])
        valleys = np.flatnonzero((column <= padded[:-2]) & (column <= padded[2:]))
        for k in valleys[np.argsort(column[valleys])][:_VALLEYS]:
            low, high = marks[max(k - 1, 0)], marks[min(k + 1, len(marks) - 1)]
            for _ in range(_ZOOMS):
                fine = np.linspace(low, high, _FINER)
                refined = measure(fine)[:, j]
                best = int(refined.argmin())
                low, high = fine[max(best - 1, 0)], fine[min(best + 1, _FINER - 1)]
            if refined[best] < least[j]:
                places[j], least[j] = fine[best], refined[best]
    return places, least


def first_below(
    measure: Callable[[Array], Array], marks: Array, least: float
) -> tuple[float, int, float] | None:
    """Return place, column and value where a measure (K, c) first falls below `least`, or None."""
    places, lowest = least_along(measure, marks, least)
    columns = np.flatnonzero(lowest < least)
    if not len(columns):
        return None
    all_marks = np.sort(np.concatenate([marks, places[columns]]))
    below = measure(all_marks) < least
    k = int(below.any(axis=1).argmax())
    i = int(below[k].argmax())
    low, high = all_marks[max(k - 1, 0)], all_marks[k]
    if k:
        _, high = bisect_condition(
            lambda at: measure(at[None])[0, i] >= least, low, high, _HALVINGS
        )
    return float(high), i, float(measure(np.array([high]))[0, i])
