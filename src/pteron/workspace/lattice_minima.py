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
"""Points looked at for each condition, the lowest first: along a limit at the lattice's rim many
are lower than those next to a tube."""


def failing_between(
    slopes: Callable[[Array], tuple[Array, ...]], axes: Sequence[Array], rows: Array
) -> Array:
    """Return positions (H, k) between the points of a lattice where a condition's row is below 0.

    `slopes` takes positions (N, k) and returns rows (N, R) and their slopes (N, R, k); `axes` are
    the lattice's coordinates, evenly spaced, and `rows` (n1, ..., nk, R) the conditions at its
    points.
    """
    count = len(axes)
    values = np.nan_to_num(rows, nan=-1.0)
    # Each point and its neighbours, also across corners, row by row.
    lowest = (values == _around(values, np.minimum, count)) & (values >= -_DEPTH)
    # A row that rises by less to the neighbours than to zero has none between them.
    near = values < _around(values, np.maximum, count) - values
    found = np.argwhere(lowest & near)
    if not len(found):
        return np.empty((0, count))
    found = found[np.argsort(values[tuple(found.T)], kind="stable")]
    found = np.concatenate([found[found[:, count] == r][:_MOST] for r in range(rows.shape[-1])])
    at, row, each = found[:, :count], found[:, count], np.arange(len(found))
    low, high = np.array([(a[0], a[-1]) for a in axes]).T
    cell = np.array([a[1] - a[0] for a in axes])
    places = low + cell * at
    least, most = np.maximum(low, places - cell), np.minimum(high, places + cell)
    failing = np.zeros(len(places), dtype=bool)
    for _ in range(_STEPS):
        value, slope = (part[each, row] for part in slopes(places))
        failing |= ~(value >= -_DEPTH)
        # Steps end at the box's faces.
        outward = ((places <= least) & (slope > 0.0)) | ((places >= most) & (slope < 0.0))
        slope = np.where(outward, 0.0, slope)
        steep = np.linalg.norm(slope, axis=-1, keepdims=True)
        moving = (steep > 0.0) & ~failing[:, None]
        if not moving.any():
            break
        steep = np.where(moving, steep, 1.0)
        step = (_BEYOND * value[:, None] / steep + _FURTHER * cell.min()) * slope / steep
        places = np.clip(places - np.where(moving, step, 0.0), least, most)
    return np.asarray(places[failing])


def _around(values: Array, extreme: np.ufunc, count: int) -> Array:
    """Return the least or greatest value of each point and its neighbours along `count` axes."""
    for axis in range(count):
        along = np.moveaxis(values, axis, 0)
        found = values.copy()
        whole = np.moveaxis(found, axis, 0)
        extreme(whole[1:], along[:-1], out=whole[1:])
        extreme(whole[:-1], along[1:], out=whole[:-1])
        values = found
    return values
