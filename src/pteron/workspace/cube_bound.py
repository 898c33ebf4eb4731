"""`cube_bound`: a proved upper bound on the edge of cubes that fit in the workspace."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.workspace.components import lattice
from pteron.workspace.paving import Paving

_HALVINGS = 30
"""Bisections of the edge."""

_WIDER = 1e-9
"""Share added to the bound, far more than rounding."""


def cube_bound(paving: Paving) -> float:
    """Return an edge that no cube in a paved workspace exceeds, m.

    A cube of edge a holds, along each axis, at least floor(a / h) - 1 whole cells of a lattice of
    spacing h in a row. None of them is proved outside; so there is no such cube where the paving
    has no such block. Beside the edge of `largest_cube` it says how much more there can be.

    Parameters
    ----------
    paving : Paving
        The workspace at one orientation, all of it.

    Returns
    -------
    float
        0 where nothing is in reach.

    Raises
    ------
    DataError
        If an angle varies.

    Examples
    --------
    >>> from pteron.workspace import cube_bound, paving
    >>> round(cube_bound(paving("tripteron-router", [0.1, 0.1, 0.1], tolerance=0.1)), 2)
    0.21
    """
    if turning := [axis for axis in paving.axes if axis in paving.robot.platform.angles]:
        raise DataError(f"paving: {turning[0]} varies; a cube is sought at one orientation")
    if not len(paving.inner) + len(paving.boundary):
        return 0.0
    cells = lattice(paving)
    filled = np.pad(cells.possible, 1).astype(np.int64)
    for axis in range(filled.ndim):
        filled = filled.cumsum(axis=axis)
    low, high = 0.0, float((cells.size * cells.possible.shape).min() + 2.0 * cells.size.max())
    for _ in range(_HALVINGS):
        edge = 0.5 * (low + high)
        low, high = (edge, high) if _has_block(filled, edge, cells.size) else (low, edge)
    return high * (1.0 + _WIDER)


def _has_block(filled: NDArray[np.int64], edge: float, size: Array) -> bool:
    """Return whether some block as a cube of this edge must hold is filled, by summed cells."""
    counts = np.maximum(np.floor(edge / size).astype(int) - 1, 0)
    if not counts.all():
        return True
    if (counts > np.array(filled.shape) - 2).any():
        return False
    for axis, count in enumerate(counts):
        length = filled.shape[axis]
        after, before = (np.arange(start, length - count + start) for start in (count, 0))
        filled = filled.take(after, axis=axis) - filled.take(before, axis=axis)
    return bool((filled == counts.prod()).any())
