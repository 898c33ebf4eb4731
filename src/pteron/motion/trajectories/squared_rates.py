"""The largest s'^2 along a path s from rest to rest that keeps limits linear in s'' and s'^2.

Between two nodes s'' is constant, so that x = s'^2 is linear in s, and the limits hold at both ends
of each interval: linear inequalities p x + q y <= r of x at one node and y at the next. A pass
backward finds for each node the largest x from which the path can be gone to its end within the
limits, a pass forward goes as fast as that (Pham and Pham, 2018, IEEE Transactions on Robotics
34(3)). Rest keeps the limits everywhere, so that both passes always succeed. No tolerance compares
x of different nodes: a corner of a micrometre, where x is a millionth of what it is elsewhere, is
solved as well as a long line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pteron.kernels import Array
from pteron.motion.trajectories.limit_rows import LimitRows

_LEAST_MARGIN = 0.1
"""Share of a limit's margin at rest, 1 - c, that is left however much it is tightened."""

_STEPS = 50
"""Most steps of Newton's method at a node, which ends after as many as there are limits at most."""

_FASTEST = 1e12
"""Greatest s'^2, 1/s^2, where no limit bounds it."""


class _Intervals(NamedTuple):
    """Bounds of y at the end of each interval by x at its begin: L <= y <= U, (K - 1, R) each.

    L = `low` + `low_slope` x and U = `high` + `high_slope` x.
    """

    low: Array
    low_slope: Array
    high: Array
    high_slope: Array
    most: Array
    """Greatest x at the nodes (K,)."""


def squared_rates(rows: LimitRows, grid: Array, margin: Array | float = 1.0) -> Array:
    """Return the largest x = s'^2 (K,) at the nodes of s (K,) that keeps limits, from rest to rest.

    Parameters
    ----------
    rows : LimitRows
        The limits at the nodes; `v`, the part of viscous friction, is left out of account.
    grid : array, shape (K,)
        The nodes, ascending.
    margin : array, shape (K, R) or (1,)
        Shares of the limits that are used.
    """
    intervals = _intervals(rows, grid, margin)
    return _go_forward(intervals, _go_backward(intervals))


def _intervals(rows: LimitRows, grid: Array, margin: Array | float) -> _Intervals:
    """Return the bounds of each interval by the limits at both its ends."""
    free = np.maximum(margin - rows.c, _LEAST_MARGIN * np.maximum(1.0 - rows.c, 0.0))
    a = 0.5 * rows.a / np.diff(grid, append=2.0 * grid[-1] - grid[-2])[:, None]
    back = 0.5 * rows.a / np.diff(grid, prepend=2.0 * grid[0] - grid[1])[:, None]
    p = np.hstack([(rows.b - a)[:-1], -back[1:]])
    q = np.hstack([a[:-1], (rows.b + back)[1:]])
    r = np.hstack([free[:-1], free[1:]])
    with np.errstate(divide="ignore", invalid="ignore"):
        bound, slope = r / q, -p / q
        ends = np.where((q == 0.0) & (p > 0.0), r / p, np.inf).min(axis=1, initial=np.inf)
    most = np.minimum(rows.most, _FASTEST)
    most[:-1] = np.minimum(most[:-1], ends)
    most[[0, -1]] = 0.0
    below, above = q < 0.0, q > 0.0
    return _Intervals(
        np.where(below, bound, -np.inf),
        np.where(below, slope, 0.0),
        np.where(above, bound, np.inf),
        np.where(above, slope, 0.0),
        most,
    )


def _go_backward(intervals: _Intervals) -> Array:
    """Return the largest x (K,) at each node from which the end can be reached within limits."""
    largest = intervals.most.copy()
    for i in range(len(largest) - 2, -1, -1):
        low, low_slope = intervals.low[i], intervals.low_slope[i]
        high, high_slope = intervals.high[i], intervals.high_slope[i]
        end, x = largest[i + 1], largest[i]
        # The bounds' gap L - U is convex in x and not above 0 at rest: Newton's method descends to
        # where the two lines meet that are active.
        for _ in range(_STEPS):
            lows, highs = low + low_slope * x, high + high_slope * x
            j, k = lows.argmax(), highs.argmin()
            bottom, rise = (low[j], low_slope[j]) if lows[j] > 0.0 else (0.0, 0.0)
            top, fall = (high[k], high_slope[k]) if highs[k] < end else (end, 0.0)
            if max(lows[j], 0.0) <= min(highs[k], end) or rise <= fall:
                break
            meeting = max((top - bottom) / (rise - fall), 0.0)
            if meeting >= x:  # rounding
                break
            x = meeting
        largest[i] = x
    return largest


def _go_forward(intervals: _Intervals, largest: Array) -> Array:
    """Return x (K,) at the nodes where each step is the largest that the backward pass allows."""
    squares = np.zeros_like(largest)
    for i in range(len(largest) - 1):
        highs = intervals.high[i] + intervals.high_slope[i] * squares[i]
        squares[i + 1] = max(min(float(highs.min(initial=np.inf)), largest[i + 1]), 0.0)
    return squares
