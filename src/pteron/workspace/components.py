"""Connected parts of a workspace, and proofs that some of them are apart."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import chain
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.result import Result
from pteron.tolerances import ROUNDING
from pteron.workspace.paving import Paving

_CELLS = 1 << 22
"""Most cells of the lattice in which parts are sought: a paving that needs more gets a coarser
lattice, in which a cell is inside only where boxes fill it."""


@dataclass(frozen=True, eq=False, repr=False)
class Component(Result):
    """A path-connected part of the workspace.

    Attributes
    ----------
    volume : float
        Its volume that is proved inside, in the paving's unit.
    pose : array, shape (m,)
        A pose of it far from its edge: all m coordinates of the machine.
    box : array, shape (2, k)
        The bounding box of its proved part, of the k coordinates that vary in the paving.
    group : int
        Parts of different groups are proved to be apart; of two of one group it is not decided.
    """

    volume: float
    pose: Array
    box: Array
    group: int


@dataclass(frozen=True, eq=False, repr=False)
class Components(Result):
    """The parts of a workspace.

    Attributes
    ----------
    parts : tuple of Component
        The largest first, without those left out as too small.
    groups : int
        At least so many of them are apart, which is proved.
    connected : bool or None
        Of all parts, those left out too: True: there is one. False: at least two are proved to be
        apart. None: not decided.
    share : float
        Share of the volume proved inside that `parts` hold. The rest is in parts left out, or in
        none where the paving's smallest boxes are finer than the lattice in which parts are sought.
    """

    ROWS = "parts"

    parts: tuple[Component, ...] = field(repr=False)
    groups: int
    connected: bool | None
    share: float


def components(paving: Paving, *, smallest: float = 0.0) -> Components:
    """Return the connected parts of a paved workspace.

    Boxes that are proved inside and touch are connected. Where no chain of boxes that are inside or
    undecided leads from one to another there is no path between them.

    Parameters
    ----------
    paving : Paving
        The workspace; over angles too, if it was paved so. An angle and the same one a
        turn on are different.
    smallest : float
        Parts of less volume than this share of the whole are left out of `parts`.

    Returns
    -------
    Components

    Examples
    --------
    >>> from pteron.workspace import components, paving
    >>> components(paving("tripteron", [0.0, 0.0, 0.0], tolerance=0.3)).connected
    True
    """
    if not len(paving.inner):
        return Components((), 0, None, 0.0)
    start, size, inside, possible = lattice(paving)
    neighbours = np.ones((3,) * inside.ndim)
    labels, count = scipy.ndimage.label(inside, neighbours)
    groups, _ = scipy.ndimage.label(possible, neighbours)
    moving = [paving.robot.coordinates.index(axis) for axis in paving.axes]
    depth = scipy.ndimage.distance_transform_cdt(np.pad(inside, 1), metric="chessboard")
    depth = depth[(slice(1, -1),) * inside.ndim]
    cell_volume, inner_volume = float(np.prod(size)), paving.inner_volume
    parts = []
    volumes = np.bincount(labels.ravel(), minlength=count + 1) * cell_volume
    for label, where in enumerate(scipy.ndimage.find_objects(labels), start=1):
        in_part = labels[where] == label
        if volumes[label] < smallest * inner_volume:
            continue
        low = np.array([part.start for part in where])
        high = np.array([part.stop for part in where])
        cell = low + np.unravel_index((depth[where] * in_part).argmax(), in_part.shape)
        pose = paving.box[0].copy()
        pose[moving] = start + (cell + 0.5) * size
        group = int(groups[tuple(cell)])
        box = np.array([start + low * size, start + high * size])
        parts.append(Component(float(volumes[label]), pose, box, group))
    parts.sort(key=lambda part: -part.volume)
    group_count = len({part.group for part in parts})
    possible_groups = len(np.unique(groups[inside]))
    connected = True if count == 1 else False if possible_groups > 1 else None
    share = sum(part.volume for part in parts) / inner_volume
    return Components(tuple(parts), group_count, connected, share)


class Lattice(NamedTuple):
    """Equal cells that cover everything not proved outside."""

    start: Array
    """(k,): the least corner of the first cell."""
    size: Array
    """(k,): of a cell."""
    inside: NDArray[np.bool_]
    """Whether a cell is proved inside."""
    possible: NDArray[np.bool_]
    """Whether a cell may have poses inside."""


def lattice(paving: Paving, most: int = _CELLS) -> Lattice:
    """Return a paving as a lattice with the spacing of its smallest boxes, or `most` cells."""
    moving = [paving.robot.coordinates.index(axis) for axis in paving.axes]
    start, extent = paving.box[0, moving], (paving.box[1] - paving.box[0])[moving]
    sizes = [list(paving.group_by_size(boxes)) for boxes in (paving.inner, paving.boundary)]
    finest = np.array([depth for depth, _ in chain(*sizes)]).max(axis=0, initial=0)
    nonempty = np.concatenate([paving.inner, paving.boundary])
    low = (nonempty[:, 0].min(axis=0) - start) / extent
    high = (nonempty[:, 1].max(axis=0) - start) / extent
    while np.prod(np.ceil((high - low) * 2.0**finest) + 1.0) > most:
        finest[finest.argmax()] -= 1
    first = np.floor(low * 2.0**finest + ROUNDING).astype(np.int64)
    shape = np.ceil(high * 2.0**finest - ROUNDING).astype(np.int64) - first
    inner, undecided = (_filled_shares(boxes, finest, first, tuple(shape)) for boxes in sizes)
    size = extent / 2.0**finest
    full = inner > 1.0 - ROUNDING
    return Lattice(start + first * size, size, full, inner + undecided > 0.0)


def _filled_shares(
    sizes: list[tuple[NDArray[np.int64], NDArray[np.int64]]],
    finest: NDArray[np.int64],
    first: NDArray[np.int64],
    shape: tuple[int, ...],
) -> Array:
    """Return the share of each cell that boxes fill, grouped as by `Paving.group_by_size`."""
    shares = np.zeros(int(np.prod(shape)))
    strides = np.cumprod(np.append(1, shape[:0:-1]))[::-1]
    for depth, places in sizes:
        cells_per_box = 2 ** np.maximum(finest - depth, 0)
        corner = ((places >> np.maximum(depth - finest, 0)) * cells_per_box - first) @ strides
        offsets = np.array(list(np.ndindex(*cells_per_box))) @ strides
        cells = (corner[:, None] + offsets).ravel()
        shares += 0.5 ** float(np.maximum(depth - finest, 0).sum()) * np.bincount(
            cells, minlength=len(shares)
        )
    return shares.reshape(shape)
