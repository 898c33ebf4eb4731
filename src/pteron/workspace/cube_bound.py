"""`cube_bound`: a proved upper bound on the edge of cubes along the pose's axes in a workspace."""

from __future__ import annotations

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.errors import DataError
from pteron.kernels.bisection import bisect_condition
from pteron.workspace.components import Lattice, lattice
from pteron.workspace.paving import Paving

_HALVINGS = 30
"""Bisections of the edge."""

_WIDER = 1e-9
"""Share added to the bound, far more than rounding."""


def cube_bound(paving: Paving) -> float:
    """Return an upper bound, m, on the edge of axis-parallel cubes in a paved workspace.

    Cubes whose edges are along the pose's coordinates are bounded, as `largest_cube` finds them; in
    a plane, squares. Such a cube of edge a holds, along each axis, at least floor(a / h) - 1 whole
    cells of a lattice of spacing h in a row. None of them is proved outside; so there is no such
    cube where the paving has no such block. Beside the edge of `largest_cube` it says how much more
    there can be.

    A cube that is turned may be larger: by up to sqrt(3), or sqrt(2) in a plane, since the ball in
    it holds a cube along the axes. No cube of any orientation has more than the cube root of
    `paving.outer_volume` for its edge; in a plane, the square root.

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
    widest = float((cells.size * cells.possible.shape).min() + 2.0 * cells.size.max())
    edge = bisect_condition(lambda edge: _has_block(cells, edge), 0.0, widest, _HALVINGS)[1]
    return float(edge) * (1.0 + _WIDER)


def _has_block(cells: Lattice, edge: float) -> bool:
    """Return whether the lattice has a block of possible cells that a cube of an edge needs."""
    counts = np.maximum(np.floor(edge / cells.size).astype(int) - 1, 0)
    if not counts.all():
        return True
    if (counts > cells.possible.shape).any():
        return False
    possible = cells.possible.astype(np.uint8)
    return bool(scipy.ndimage.minimum_filter(possible, counts, mode="constant").any())
