"""Places between a lattice's points where a condition fails though it holds at all the points.

A leg whose links are about equally long cannot fold onto its guide: a thin tube in the workspace,
which may pass between the points of a lattice. About each of a condition's least values on the
lattice, steps along its slope look for a zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pteron.kernels import Array

_STEPS = 6
"""Steps towards a zero."""

_BEYOND, _FURTHER = 1.3, 0.1
"""A step goes further than to the zero of the tangent, by this factor and by this share of a cell:
a condition may be curved about its least value, and failing places may be on the rim of a shape."""

_DEPTH = 1e-5
"""A condition that fails by less is left to the proof."""

_MOST = 60
"""Points examined for each condition, the lowest first: along a limit at the lattice's rim many
are lower than those next to a tube."""


def failing_places(
    slopes: Callable[[Array], tuple[Array, ...]], axes: Sequence[Array], rows: Array
) -> Array:
    """Return positions (H, k) between lattice points where a condition's row is below 0.

    `slopes` takes positions (N, k) and returns rows (N, R) and their slopes (N, R, k); `axes` are
    the lattice's coordinates, evenly spaced, and `rows` (n1, ..., nk, R) the conditions at its
    points.
    """
    count = len(axes)
    margins = np.nan_to_num(rows, nan=-1.0)
    # Each point and its neighbours, also across corners, row by row.
    lowest = (margins == _neighbourhood_extremes(margins, np.minimum, count)) & (margins >= -_DEPTH)
    # A row that rises by less to the neighbours than to zero has none between them.
    near = margins < _neighbourhood_extremes(margins, np.maximum, count) - margins
    minima = np.argwhere(lowest & near)
    if not len(minima):
        return np.empty((0, count))
    minima = minima[np.argsort(margins[tuple(minima.T)], kind="stable")]
    minima = np.concatenate([minima[minima[:, count] == r][:_MOST] for r in range(rows.shape[-1])])
    indices, row, order = minima[:, :count], minima[:, count], np.arange(len(minima))
    low, high = np.array([(a[0], a[-1]) for a in axes]).T
    cell = np.array([a[1] - a[0] for a in axes])
    places = low + cell * indices
    least, most = np.maximum(low, places - cell), np.minimum(high, places + cell)
    failing = np.zeros(len(places), dtype=bool)
    for _ in range(_STEPS):
        row_values, slope = (part[order, row] for part in slopes(places))
        failing |= ~(row_values >= -_DEPTH)
        # Steps end at the box's faces.
        outward = ((places <= least) & (slope > 0.0)) | ((places >= most) & (slope < 0.0))
        slope = np.where(outward, 0.0, slope)
        steep = np.linalg.norm(slope, axis=-1, keepdims=True)
        moving = (steep > 0.0) & ~failing[:, None]
        if not moving.any():
            break
        steep = np.where(moving, steep, 1.0)
        step = (_BEYOND * row_values[:, None] / steep + _FURTHER * cell.min()) * slope / steep
        places = np.clip(places - np.where(moving, step, 0.0), least, most)
    return np.asarray(places[failing])


def _neighbourhood_extremes(array: Array, extreme: np.ufunc, count: int) -> Array:
    """Return the least or greatest of each point and its neighbours, along `count` axes."""
    for axis in range(count):
        source = np.moveaxis(array, axis, 0)
        extremes = array.copy()
        target = np.moveaxis(extremes, axis, 0)
        extreme(target[1:], source[:-1], out=target[1:])
        extreme(target[:-1], source[1:], out=target[:-1])
        array = extremes
    return array
