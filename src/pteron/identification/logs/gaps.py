"""Gaps of a log: steps between its times in which samples are missing."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

_WIDE = 1.5
"""Length of a time step, in usual steps, beyond which a sample may be missing."""

_SURELY = 2.5
"""Length beyond which a sample is surely missing, however uneven the stamps are."""

_AROUND = 16
"""Rows on each side that tell a missing sample from an uneven stamp in between."""

_LATER = 0.5
"""Usual steps, at least, by which all rows after a missing sample come later."""


def stretches(ends: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first row, and row behind the last, of stretches that end where (T - 1,) is true."""
    return list(pairwise([0, *(np.flatnonzero(ends) + 1).tolist(), len(ends) + 1]))


def gaps(time: NDArray[np.float64], step: float) -> NDArray[np.bool_]:
    """Return which steps (T - 1,) of rising times (T,), s, have samples missing in them.

    A missing sample makes all later ones late by the usual `step`; a stamp that is late by itself
    does not.

    Examples
    --------
    >>> import numpy as np
    >>> even = np.arange(8.0)
    >>> gaps(np.delete(even, 4), 1.0).nonzero()
    (array([3]),)
    >>> gaps(even + [0, 0, 0, -0.3, 0.3, 0, 0, 0], 1.0).any()
    np.False_
    """
    is_gap = np.diff(time) > _WIDE * step
    late = time / step - np.arange(len(time))
    for i in np.flatnonzero(is_gap & (np.diff(time) <= _SURELY * step)):
        lateness_before = float(np.median(late[max(i + 1 - _AROUND, 0) : i + 1]))
        lateness_after = float(np.median(late[i + 1 : i + 1 + _AROUND]))
        is_gap[i] = lateness_after - lateness_before > _LATER
    return is_gap


def are_apart(earlier: NDArray[np.float64], later: NDArray[np.float64], step: float) -> bool:
    """Return whether samples are missing between consecutive times."""
    near = earlier[-_AROUND:]
    return bool(gaps(np.concatenate([near, later[:_AROUND]]), step)[len(near) - 1])
