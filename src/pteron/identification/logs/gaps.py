"""Gaps in a log's time: samples that are missing, told from stamps that are only uneven."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_WIDE = 1.5
"""Usual steps in a step of time, beyond which a sample may be missing."""

_SURELY = 2.5
"""Beyond which one is, however uneven the stamps are."""

_AROUND = 16
"""Rows on each side whose usual place tells the two apart."""

_LATER = 0.5
"""Usual steps by which all that follows a gap is later, at least."""


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
    found = np.diff(time) > _WIDE * step
    late = time / step - np.arange(len(time))
    for i in np.flatnonzero(found & (np.diff(time) <= _SURELY * step)):
        before = float(np.median(late[max(i + 1 - _AROUND, 0) : i + 1]))
        after = float(np.median(late[i + 1 : i + 1 + _AROUND]))
        found[i] = after - before > _LATER
    return found


def are_apart(before: NDArray[np.float64], after: NDArray[np.float64], step: float) -> bool:
    """Say whether samples are missing between times and those that follow."""
    near = before[-_AROUND:]
    return bool(gaps(np.concatenate([near, after[:_AROUND]]), step)[len(near) - 1])
