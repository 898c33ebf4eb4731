"""Surfaces from a map over three coordinates: of the reach, and of equal values of an index.

The triangles are those of marching cubes (T. Lewiner et al., Journal of Graphics Tools 8(2) (2003)
1-15), between poses in reach and in limits; the reach's surface is where its margin is zero. They
are written to VTK, PLY or STL files for other programs to draw.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.atomic import write_bytes
from pteron.errors import DataError, ModelError
from pteron.extras import install_command
from pteron.kernels import Array
from pteron.maps.map import MARGIN, Map, column_heading
from pteron.result import Result

ENDINGS = (".vtk", ".vtu", ".ply", ".stl")
"""Endings of files that hold surfaces; STL does not hold the value that a surface belongs to."""

_SHARES = (0.25, 0.5, 0.75)
"""Quantiles of an index at which its surfaces are by default."""

_BEYOND = 1e-9
"""Places outside of the grid get minus this as margin, m, so that the reach's surface is closed."""


@dataclass(frozen=True, eq=False, repr=False)
class Surface(Result):
    """A surface in three coordinates.

    Attributes
    ----------
    level : float or None
        The value that the index has all over it, in its unit; None on the surface of the reach.
    points : array, shape (P, 3)
        The map's axes in their order, m or rad.
    triangles : array of int, shape (T, 3)
        The numbers of their corners.
    values : array, shape (P,)
        The index at the points.
    """

    ROWS = "points:1 values"

    level: float | None
    points: Array
    triangles: NDArray[np.int64]
    values: Array


def surfaces(
    index_map: Map, name: str, levels: Sequence[float] | None = None
) -> tuple[Surface, ...]:
    """Return the surface of the reach, if the map has its margin, and isosurfaces of an index.

    Parameters
    ----------
    index_map : Map
        Over three axes.
    name : str
        The index.
    levels : sequence of float, optional
        Values, in the index's unit; by default those which 25, 50 and 75 % of the poses that serve
        keep below, and none of ``margin``.

    Returns
    -------
    tuple of Surface
        Those that there are: where no two neighbours that serve are to both sides of a level, it
        has none.

    Raises
    ------
    DataError
        If the map has not three axes or no such index, or it is determined at no pose that serves.
    ModelError
        If scikit-image is not installed.
    """
    measure = checked_surfaces()[0].marching_cubes
    if len(index_map.grid.axes) != 3:
        varying = ", ".join(axis.name for axis in index_map.grid.axes)
        raise DataError(
            f"surfaces need a map over three coordinates, and here there vary {varying}"
        )
    index_map.statistics(name)  # or says that there is none
    amounts, serves = index_map.values[name], index_map.reachable
    known = serves & np.isfinite(amounts)
    if levels is None:
        shares = () if name == MARGIN.name else _SHARES
        levels = np.unique(np.quantile(amounts[known], shares)).tolist()
    # Undetermined poses have their nearest neighbour's value, so that interpolation stays finite.
    nearest = scipy.ndimage.distance_transform_edt(
        ~known, return_distances=False, return_indices=True
    )
    filled = amounts[tuple(nearest)]
    parts = []
    if MARGIN.name in index_map.values:
        closed = np.pad(index_map.values[MARGIN.name], 1, constant_values=-_BEYOND)
        corners, triangles, *_ = measure(closed, 0.0)
        corners = np.clip(corners - 1.0, 0.0, np.array(amounts.shape) - 1.0)
        corner_values = scipy.ndimage.map_coordinates(filled, corners.T, order=1)
        parts.append(_surface(index_map, None, corners, triangles, corner_values))
    for level in levels:
        if filled.min() < level < filled.max():
            with suppress(RuntimeError):  # no triangle between poses that serve
                corners, triangles, *_ = measure(filled, level, mask=known)
                corner_values = np.full(len(corners), level)
                parts.append(_surface(index_map, level, corners, triangles, corner_values))
    return tuple(parts)


def save_surfaces(index_map: Map, target: Path) -> Path:
    """Write a file of the surfaces of a map's first index.

    Its points carry the index, under its name and unit. In VTK's files its triangles carry
    `surface`, 0 for the reach's, else the level's number from 1; STL holds no more than triangles.
    """
    (_, meshio), ending = checked_surfaces(), target.suffix.lower()
    index = index_map.indices[0]
    parts = surfaces(index_map, index.name)
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    triangles = [part.triangles + start for part, start in zip(parts, starts, strict=False)]
    levels = sorted(part.level for part in parts if part.level is not None)
    numbers = [0 if part.level is None else 1 + levels.index(part.level) for part in parts]
    # VTK reads no shorter integers from its own legacy files.
    kinds = [
        np.full(len(part_triangles), k, np.int64)
        for part_triangles, k in zip(triangles, numbers, strict=True)
    ]
    mesh = meshio.Mesh(
        np.concatenate([part.points for part in parts]),
        [("triangle", np.concatenate(triangles).astype(np.int32))],
    )
    if ending != ".stl":
        # Names in these files have no blanks.
        label = column_heading(index).replace(" [", "[").replace(" ", "_")
        mesh.point_data[label] = np.concatenate([part.values for part in parts])
    if ending.startswith(".vt"):
        mesh.cell_data["surface"] = [np.concatenate(kinds)]
    with TemporaryDirectory(prefix="pteron-surface-") as folder:
        file = Path(folder, f"surface{ending}")
        meshio.write(file, mesh, binary=True)
        return write_bytes(target, file.read_bytes())


def checked_surfaces() -> tuple[Any, Any]:
    """Return the modules that find surfaces and write their files."""
    try:
        import meshio
        from skimage import measure
    except ImportError as error:
        raise ModelError(
            f"surfaces need {error.name}, which is not installed; {install_command('surfaces')}"
        ) from None
    return measure, meshio


def _surface(
    index_map: Map, level: float | None, corners: Array, triangles: NDArray[Any], amounts: Array
) -> Surface:
    """Return a surface of places in the grid (P, 3), without the triangles that have no area."""
    axes = index_map.grid.axes
    steps = [(axis.greatest - axis.least) / (axis.count - 1) for axis in axes]
    points = np.asarray([axis.least for axis in axes] + corners * steps)
    a, b, c = np.moveaxis(corners[triangles], 1, 0)
    flat = (np.cross(b - a, c - a) == 0.0).all(axis=-1)
    return Surface(level, points, triangles[~flat].astype(np.int64), amounts)
