"""Maps in files: tables, NumPy archives, Zarr stores, and surfaces for programs that draw them."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from pteron.atomic import write_bytes
from pteron.errors import DataError, OutputError
from pteron.maps.grid import Axis, Grid
from pteron.maps.map import ALL, Map
from pteron.maps.stores import MapStore, read_store
from pteron.maps.surfaces import ENDINGS as SURFACES
from pteron.maps.surfaces import checked_surfaces, surface_bytes
from pteron.tables import read_table, write_table

_TABLES = (".csv", ".parquet")


def save_map(given: Map, path: str | Path) -> Path:
    """Write a map to a file; the ending says what it is.

    ===================  ==========================================================================
    .csv, .parquet       a row a pose: coordinates, indices with units in brackets, and status
    .npz                 NumPy's arrays: each index, status, each axis, and the grid as JSON
    .zarr                a folder in chunks, which xarray opens
    .vtk .vtu .ply .stl  the surface of the reach and surfaces of equal value, of a map in 3 axes
    ===================  ==========================================================================

    Parameters
    ----------
    given : Map
        What to write.
    path : str or Path
        The file; it is replaced whole, or not at all.

    Returns
    -------
    Path

    Raises
    ------
    OutputError
        If the ending is another one, or it cannot be written.
    DataError
        If it is for surfaces and the map has not three axes, or nothing in it is in reach.
    ModelError
        If a library is missing: the message names the extra.
    """
    target = checked_map_file(path)
    return _WRITERS[target.suffix.lower()](given, target)


def load_map(path: str | Path) -> Map:
    """Return the map that a table, a NumPy archive or a Zarr store holds.

    Parameters
    ----------
    path : str or Path
        What `save_map` or `map_index` has written, but surfaces.

    Returns
    -------
    Map
        Of a table the machine's name is the file's.

    Raises
    ------
    DataError
        If there is no such file, or it holds no whole map.
    """
    source = Path(path)
    ending = source.suffix.lower()
    if ending not in _READERS:
        raise DataError(f"{path}: a map is read from {', '.join(_READERS)}")
    if not source.exists():
        raise DataError(f"{path}: no such file")
    return _READERS[ending](source)


def checked_map_file(path: str | Path) -> Path:
    """Return a path after a check, before the work begins, that a map can be written there.

    Raises
    ------
    OutputError
        If its ending is unknown or its folder is missing.
    ModelError
        If a library is missing: the message names the extra.
    """
    target = Path(path)
    ending = target.suffix.lower()
    if ending not in _WRITERS:
        raise OutputError(f"{path}: {ending or 'no'} ending, {', '.join(_WRITERS)} expected")
    if not target.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {target.parent}; make it first")
    if target.is_dir() and ending != ".zarr":
        raise OutputError(f"{path}: is a folder; name a file in it")
    if target.is_file() and ending == ".zarr":
        raise OutputError(f"{path}: is a file, and a Zarr store is a folder; name another place")
    if ending in SURFACES:
        checked_surfaces()
    return target


def _table(given: Map, target: Path) -> Path:
    return write_table(given.table(), target)


def _from_table(source: Path) -> Map:
    table = read_table(source)
    columns = {name.partition(" [")[0]: name for name in table.columns}
    names = tuple(name for name in columns if name in ("x", "y", "z", "phi"))
    indices = [name for name in columns if name in ALL]
    if not names or not indices or "status" not in columns:
        raise DataError(f"{source}: is no map's table: coordinates, indices and status expected")
    given = table.numbers([columns[name] for name in (*names, *indices, "status")], "nan")
    cells = dict(zip((*names, *indices, "status"), given.T, strict=True))
    axes, pose = [], []
    for name in names:
        own = np.unique(cells[name])
        pose.append(0.5 * float(own[0] + own[-1]))
        if len(own) > 1:
            axes.append(Axis(name, float(own[0]), float(own[-1]), len(own)))
    grid = Grid(names, tuple(pose), tuple(axes))
    if grid.size != len(given):
        raise DataError(f"{source}: {len(given)} rows, {grid.size} expected: a whole grid of poses")
    values = {name: cells[name].reshape(grid.shape) for name in indices}
    return Map(source.stem, grid, values, cells["status"].reshape(grid.shape).astype(np.int8))


def _archive(given: Map, target: Path) -> Path:
    buffer = io.BytesIO()
    about = {"robot": given.robot, "units": given.units, "grid": asdict(given.grid)}
    axes = {axis.name: axis.values for axis in given.grid.axes}
    values: dict[str, Any] = {**axes, **given.values}
    np.savez_compressed(buffer, **values, status=given.status, about=np.array(json.dumps(about)))
    return write_bytes(target, buffer.getvalue())


def _from_archive(source: Path) -> Map:
    try:
        with np.load(source) as archive:
            about = json.loads(str(archive["about"]))
            values = {name: archive[name] for name in about["units"]}
            status = archive["status"]
    except (OSError, ValueError, KeyError, BadZipFile):
        raise DataError(f"{source}: is no map's archive") from None
    given = about["grid"]
    axes = tuple(Axis(**axis) for axis in given["axes"])
    grid = Grid(tuple(given["coordinates"]), tuple(given["pose"]), axes)
    return Map(about["robot"], grid, values, status)


def _zarr(given: Map, target: Path) -> Path:
    grid = given.grid
    store = MapStore.of(target, given.robot, grid, tuple(given.values), {"saved": True})
    for number, region in enumerate(grid.regions()):
        found = {name: values[region] for name, values in given.values.items()}
        store.write(number, found | {"status": given.status[region]})
    return target


def _surfaces(given: Map, target: Path) -> Path:
    return write_bytes(target, surface_bytes(given, target.suffix.lower()))


_WRITERS: dict[str, Callable[[Map, Path], Path]] = {
    **dict.fromkeys(_TABLES, _table),
    ".npz": _archive,
    ".zarr": _zarr,
    **dict.fromkeys(SURFACES, _surfaces),
}

_READERS: dict[str, Callable[[Path], Map]] = {
    **dict.fromkeys(_TABLES, _from_table),
    ".npz": _from_archive,
    ".zarr": read_store,
}
