"""Bisection for the place in an interval where a condition stops holding."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def bisect_condition(
    holds: Callable[[Any], Any], low: ArrayLike, high: ArrayLike, halvings: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return an interval with a condition true at its low and false at its high end, bisected.

    Parameters
    ----------
    holds : callable
        The condition: from places, of the shape of the ends, one truth value for all, or one for
        each in a shape that broadcasts with theirs.
    low, high : array
        The ends: it holds at `low` and not at `high`. They may be vectors, whose numbers move
        together where `holds` returns one value for them.
    halvings : int
        Number of times that the interval is halved.

    Returns
    -------
    tuple of array
        The largest known argument where it holds, and the smallest known one where it does not.

    Examples
    --------
    >>> from pteron.kernels.bisection import bisect_condition
    >>> low, high = bisect_condition(lambda x: x * x < 2.0, 1.0, 2.0, 40)
    >>> print(f"{low:.9f}")
    1.414213562
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        inside = holds(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low, high
