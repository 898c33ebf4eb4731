"""Bisection: where something that holds at one end of an interval no longer does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def bisected(
    holds: Callable[[Any], Any], low: ArrayLike, high: ArrayLike, halvings: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two places between which something ceases to hold: at the first it does.

    Parameters
    ----------
    holds : callable
        Says at places, of the shape of the ends, whether it holds: for all of them at once, or for
        each, in a shape that broadcasts with theirs.
    low, high : array
        The ends: at `low` it holds, at `high` it does not. Each pair may be any two places, also
        vectors, of which all numbers move as one where `holds` has one answer for them.
    halvings : int
        How often the interval is halved.

    Returns
    -------
    tuple of array
        The last place where it was found to hold, and the nearest known where it does not.

    Examples
    --------
    >>> from pteron.kernels.bisection import bisected
    >>> low, high = bisected(lambda x: x * x < 2.0, 1.0, 2.0, 40)
    >>> print(f"{low:.9f}")
    1.414213562
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        inside = holds(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low, high
