"""`save_map` and `load_map`: maps of indices in tables, NumPy archives, Zarr stores, surfaces."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pteron.errors import DataError, OutputError
from pteron.maps.archive import read_archive, write_archive
from pteron.maps.map import Map
from pteron.maps.stores import read_store, save_store
from pteron.maps.surfaces import ENDINGS as SURFACES, checked_surfaces, save_surfaces
from pteron.maps.table_file import read_map_table, write_map_table

_TABLES = (".csv", ".parquet")
"""File name endings of tables."""


def save_map(index_map: Map, path: str | Path) -> Path:
    """Write a map to a file whose ending says its format.

    ===================  ==========================================================================
    .csv, .parquet       a row a pose: coordinates, indices with units in brackets, and status
    .npz                 NumPy's arrays: each index, status, each axis, and the grid as JSON
    .zarr                a folder in chunks, which xarray opens
    .vtk .vtu .ply .stl  the surface of the reach and surfaces of equal value, of a map in 3 axes
    ===================  ==========================================================================

    Parameters
    ----------
    index_map : Map
        The map.
    path : str or Path
        The file; it is replaced whole, or not at all.

    Returns
    -------
    Path

    Raises
    ------
    OutputError
        If the ending is none of these, or the file cannot be written.
    DataError
        If surfaces are asked for and the map does not have three axes, or no pose is in reach.
    ModelError
        If a library is missing: the message names the extra.
    """
    target = checked_map_file(path)
    return _WRITERS[target.suffix.lower()](index_map, target)


def load_map(path: str | Path) -> Map:
    """Return the map that a table, a NumPy archive or a Zarr store holds.

    Parameters
    ----------
    path : str or Path
        A file of `save_map` or `map_index`; files of surfaces cannot be read.

    Returns
    -------
    Map
        The map; for a table the name of the file stands for the machine's name.

    Raises
    ------
    DataError
        If there is no such file, or it does not hold a whole map.
    """
    source = Path(path)
    ending = source.suffix.lower()
    if ending not in _READERS:
        raise DataError(f"{path}: a map is read from {', '.join(_READERS)}")
    if not source.exists():
        raise DataError(f"{path}: no such file")
    return _READERS[ending](source)


def checked_map_file(path: str | Path) -> Path:
    """Return a path after a check, before the work begins, that a map can be written there."""
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


_WRITERS: dict[str, Callable[[Map, Path], Path]] = {
    **dict.fromkeys(_TABLES, write_map_table),
    ".npz": write_archive,
    ".zarr": save_store,
    **dict.fromkeys(SURFACES, save_surfaces),
}

_READERS: dict[str, Callable[[Path], Map]] = {
    **dict.fromkeys(_TABLES, read_map_table),
    ".npz": read_archive,
    ".zarr": read_store,
}
