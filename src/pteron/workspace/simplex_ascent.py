"""Nelder and Mead's method for many starts at once: one evaluation serves all simplices."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pteron.kernels import Array

_STEPS = 500
"""Most steps of a simplex."""

_SIZE = 1e-5
"""Size of a simplex, in units of the variables, below which it has converged, with `_GAIN`."""

_GAIN = 1e-6
"""Difference of its values below which it has."""


def climb(worth: Callable[[Array], Array], starts: Array, steps: Array) -> Array:
    """Return local maxima (S, k) of a function of points (..., k), one from each start (S, k).

    Each first simplex is the start and a step (k,) along each variable. The function need not be
    smooth; where it is -inf no simplex goes. The method is that of J. A. Nelder and R. Mead, A
    simplex method for function minimization, 1965, with the usual factors 1, 2, 1/2 and 1/2.
    """
    if not len(starts):
        return starts
    edges = np.vstack([np.zeros(len(steps)), np.diag(steps)])
    points = starts[:, None, :] + edges
    heights = np.asarray(worth(points))
    moving = np.arange(len(starts))
    for _ in range(_STEPS):
        order = np.argsort(-heights[moving], axis=1, kind="stable")
        simplex = np.take_along_axis(points[moving], order[..., None], axis=1)
        height = np.take_along_axis(heights[moving], order, axis=1)
        points[moving], heights[moving] = simplex, height
        spread = np.abs(simplex[:, 1:] - simplex[:, :1]).max(axis=(1, 2), initial=0.0)
        flat = height[:, 0] - height[:, -1] <= _GAIN
        going = ~((spread <= _SIZE) & flat) & np.isfinite(height[:, 0])
        moving, simplex, height = moving[going], simplex[going], height[going]
        if not len(moving):
            break
        points[moving], heights[moving] = _step_simplices(worth, simplex, height)
    best: Array = points[np.arange(len(points)), heights.argmax(axis=1)]
    return best


def _step_simplices(
    worth: Callable[[Array], Array], simplex: Array, height: Array
) -> tuple[Array, Array]:
    """Return simplices (S, k + 1, k), best point first, after one step, and their values."""
    rows = np.arange(len(simplex))
    middle, last = simplex[:, :-1].mean(axis=1), simplex[:, -1]
    step = middle - last
    candidates = middle + np.array([1.0, 2.0, 0.5, -0.5])[:, None, None] * step
    reflected, expanded, outside, inside = worths = np.asarray(worth(candidates))
    best, second, worst = height[:, 0], height[:, -2], height[:, -1]
    choice = np.where(
        reflected > best,
        np.where(expanded > reflected, 1, 0),
        np.where(reflected > second, 0, np.where(reflected > worst, 2, 3)),
    )
    shrinks = ((choice == 2) & (outside < reflected)) | ((choice == 3) & ~(inside > worst))
    simplex, height = simplex.copy(), height.copy()
    simplex[:, -1], height[:, -1] = candidates[choice, rows], worths[choice, rows]
    if shrinks.any():
        small = simplex[shrinks].copy()
        small[:, -1] = last[shrinks]
        small[:, 1:] = 0.5 * (small[:, 1:] + small[:, :1])
        simplex[shrinks] = small
        height[shrinks, 1:] = worth(small[:, 1:])
    return simplex, height
