"""Nelder and Mead's method for many starts at once: one evaluation serves all simplices."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array

_STEPS = 500
"""Most steps of a simplex."""


def climb(
    worth: Callable[[Array], Array],
    simplices: Array,
    *,
    size: float,
    gain: float,
    evaluations: float = math.inf,
) -> tuple[Array, Array]:
    """Return local maxima (S, k) of `worth` near S simplices, and its values there (S,).

    The search from each simplex (S, k + 1, k) ends when it is no larger than `size` and its values
    differ by at most `gain`, or when a serial search would have used `evaluations` evaluations. The
    function need not be smooth; points at which it is -inf are avoided. The method is that of J. A.
    Nelder and R. Mead, A simplex method for function minimization, 1965, with the usual factors 1,
    2, 1/2 and 1/2.
    """
    if not len(simplices):
        return simplices[:, 0], np.empty(0)
    points, heights = simplices, np.asarray(worth(simplices))
    moving = np.arange(len(simplices))
    used = np.full(len(simplices), simplices.shape[1])
    for _ in range(_STEPS):
        order = np.argsort(-heights[moving], axis=1, kind="stable")
        simplex = np.take_along_axis(points[moving], order[..., None], axis=1)
        height = np.take_along_axis(heights[moving], order, axis=1)
        points[moving], heights[moving] = simplex, height
        spread = np.abs(simplex[:, 1:] - simplex[:, :1]).max(axis=(1, 2), initial=0.0)
        flat = height[:, 0] - height[:, -1] <= gain
        going = ~((spread <= size) & flat) & np.isfinite(height[:, 0])
        moving, simplex, height = moving[going], simplex[going], height[going]
        if not len(moving):
            break
        simplex, height, needed = _step_simplices(worth, simplex, height)
        used[moving] += needed
        within = used[moving] <= evaluations
        moving = moving[within]
        points[moving], heights[moving] = simplex[within], height[within]
        moving = moving[used[moving] < evaluations]
    best = np.arange(len(points)), heights.argmax(axis=1)
    return points[best], heights[best]


def _step_simplices(
    worth: Callable[[Array], Array], simplex: Array, height: Array
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return simplices (S, k + 1, k) after one Nelder-Mead step, values, evaluation counts.

    In each simplex the best point is first.
    """
    rows, (_, count, _) = np.arange(len(simplex)), simplex.shape
    middle, last = simplex[:, :-1].mean(axis=1), simplex[:, -1]
    factors = np.array([1.0, 2.0, 0.5, -0.5])[:, None, None]
    candidates = (1.0 + factors) * middle - factors * last
    reflected, expanded, outside, inside = worths = np.asarray(worth(candidates))
    best, second, worst = height[:, 0], height[:, -2], height[:, -1]
    choice = np.where(
        reflected > best,
        np.where(expanded > reflected, 1, 0),
        np.where(reflected > second, 0, np.where(reflected > worst, 2, 3)),
    )
    shrinks = ((choice == 2) & (outside < reflected)) | ((choice == 3) & ~(inside > worst))
    needed = 1 + ((choice > 0) | (reflected > best)) + (count - 1) * shrinks
    simplex, height = simplex.copy(), height.copy()
    simplex[:, -1], height[:, -1] = candidates[choice, rows], worths[choice, rows]
    if shrinks.any():
        small = simplex[shrinks].copy()
        small[:, -1] = last[shrinks]
        small[:, 1:] = small[:, :1] + 0.5 * (small[:, 1:] - small[:, :1])
        simplex[shrinks] = small
        height[shrinks, 1:] = worth(small[:, 1:])
    return simplex, height, needed
