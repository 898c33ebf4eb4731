"""Places between a lattice's points where a condition fails that all the points keep.

A leg whose links are about equally long cannot fold onto its guide: a thin tube in the workspace,
through which no point of a lattice need go. About each of a row's least points on the lattice,
steps along the row's slope look for its zero.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter  # type: ignore[import-untyped]

from pteron.design.conditions import Conditions
from pteron.kernels import Array

_STEPS = 6
_OVER = 1.3
_FURTHER = 0.1
"""A step goes so much further than to the zero, as a factor and in cells of the lattice: a row may
be curved about its least value, and a solution may lie on the rim of what fails."""

_DEPTH = 1e-5
"""A row that fails by less is left to the proof."""

_MOST = 60
"""Points that are looked at of each row, the lowest first: along a limit that the lattice ends at,
many are lower than those next to a tube, in an order that is rounding's."""


def holes(
    conditions: Conditions,
    geometry: Array,
    side: float,
    orientation: Array,
    axes: Sequence[Array],
    rows: Array,
) -> Array:
    """Return positions (H, k) between the points of a lattice where a row is below 0.

    Parameters
    ----------
    conditions, geometry, side
        What must hold, of which design, with which sign of the type-II measure.
    orientation : array, shape (m,)
        A pose whose angle is that of all poses.
    axes : sequence of array
        The lattice's coordinates along x, y, ..., evenly spaced.
    rows : array, shape (n1, ..., nk, R)
        The conditions at its points.
    """
    count = len(axes)
    size = (3,) * count + (1,)
    kept = np.nan_to_num(rows, nan=-1.0)
    lowest = kept == minimum_filter(kept, size=size, mode="nearest")
    # A row that rises by less to the neighbours than to zero has none between them.
    near = kept < maximum_filter(kept, size=size, mode="nearest") - kept
    found = np.argwhere(lowest & near & (kept >= -_DEPTH))
    if not len(found):
        return np.empty((0, count))
    found = found[np.argsort(kept[tuple(found.T)], kind="stable")]
    found = np.concatenate([found[found[:, count] == r][:_MOST] for r in range(rows.shape[-1])])
    at, row = found[:, :count], found[:, count]
    low, high = np.array([(a[0], a[-1]) for a in axes]).T
    cell = np.array([a[1] - a[0] for a in axes])
    start = np.stack([a[i] for a, i in zip(axes, at.T, strict=True)], axis=-1)
    least, most = np.maximum(low, start - cell), np.minimum(high, start + cell)
    places = start
    failing = np.zeros(len(places), dtype=bool)
    for _ in range(_STEPS):
        poses = np.tile(orientation, (len(places), 1))
        poses[:, :count] = places
        values, slopes = conditions.pose_slopes(poses, geometry=geometry, side=np.array([side]))
        value = values[np.arange(len(row)), row]
        slope = slopes[np.arange(len(row)), row, :count]
        failing |= ~(value >= -_DEPTH)
        # What leads out of the box is no way.
        outward = ((places <= least) & (slope > 0.0)) | ((places >= most) & (slope < 0.0))
        slope = np.where(outward | ~np.isfinite(slope), 0.0, slope)
        steep = np.linalg.norm(slope, axis=-1, keepdims=True)
        moving = (steep > 0.0) & ~failing[:, None]
        if not moving.any():
            break
        steep = np.where(moving, steep, 1.0)
        way = _OVER * np.nan_to_num(value)[:, None] / steep + _FURTHER * cell.min()
        places = np.clip(np.where(moving, places - way * slope / steep, places), least, most)
    return np.asarray(places[failing])
