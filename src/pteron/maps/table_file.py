"""Maps as tables (.csv, .parquet), a row a pose: writing, and reading from rows in any order."""

from __future__ import annotations

import io
from itertools import product, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pteron.atomic import write_bytes
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.maps.checksums import checksum
from pteron.maps.grid import Axis, Grid
from pteron.maps.map import ALL, Map, column_heading
from pteron.platforms.coordinates import COORDINATES
from pteron.tables import Table, join_names, read_table, write_table
from pteron.tolerances import SAME
from pteron.workspace import BEYOND_LIMITS

_STATUS = "status"
"""Column that says whether a pose is in reach and within limits."""

_CHECKSUMS = ("pteron.sha256", "pteron.sha256.again")
"""Keys of the checksum in a Parquet file's metadata: two, so that damage to one of them is
harmless."""

_WRITER = "ARROW:schema"
"""Key that every file of a data frame has; where it is missing, the metadata are damaged."""


def write_map_table(index_map: Map, target: Path) -> Path:
    """Write a map to a CSV file, or to a Parquet file, which carries a checksum."""
    frame = index_map.table()
    if target.suffix.lower() == ".csv":
        return write_table(frame, target)
    buffer = io.BytesIO()
    frame.write_parquet(buffer, metadata=dict.fromkeys(_CHECKSUMS, _checksum(index_map)))
    return write_bytes(target, buffer.getvalue())


def read_map_table(source: Path) -> Map:
    """Return the map of a table."""
    table = read_table(source)
    coordinates = {name: f"{name} [{at.unit}]" for name, at in COORDINATES.items()}
    headings = {**coordinates, **{index.name: column_heading(index) for index in ALL.values()}}
    columns = {name: _column(table, name, full) for name, full in headings.items()}
    columns = {name: column for name, column in columns.items() if column}
    names = tuple(name for name in COORDINATES if name in columns)
    indices = [name for name in columns if name in ALL]
    if not names or not indices or _STATUS not in table.columns:
        raise DataError(f"{source}: is no map's table: coordinates, indices and status expected")
    poses = table.numbers([columns[name] for name in names])
    status = _status_column(table, len(names))
    grid, order = _grid(table, names, poses)
    columns_of_indices = table.numbers([columns[name] for name in indices], "nan")[order]
    index_values = {
        name: numbers.reshape(grid.shape)
        for name, numbers in zip(indices, columns_of_indices.T, strict=True)
    }
    index_map = Map(source.stem, grid, index_values, status[order].reshape(grid.shape))
    if source.suffix.lower() != ".csv":
        _expect_whole(source, index_map)
    return index_map


def _column(table: Table, name: str, heading: str) -> str:
    """Return the column of a coordinate or an index; empty if it is missing."""
    columns = [column for column in table.columns if column.partition(" [")[0] == name]
    if len(columns) > 1:
        raise DataError(f"{table.source}: columns {join_names(columns)} are all {name}; keep one")
    if columns and columns[0] not in (name, heading):
        raise DataError(f"{table.source}: column {join_names(columns)} given, {heading} expected")
    return columns[0] if columns else ""


def _status_column(table: Table, legs: int) -> NDArray[np.int8]:
    """Return the status of each row."""
    numbers = table.numbers([_STATUS])[:, 0]
    wrong = (numbers != np.rint(numbers)) | (numbers < BEYOND_LIMITS) | (numbers > legs)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{table.place(row)}, column {_STATUS}: {numbers[row]:g} given, {BEYOND_LIMITS} to "
            f"{legs} expected"
        )
    return numbers.astype(np.int8)


def _grid(table: Table, names: tuple[str, ...], poses: Array) -> tuple[Grid, NDArray[np.int64]]:
    """Return the grid of a table's poses (N, m), and its rows in the order of the grid."""
    axes: list[Axis] = []
    middles: list[float] = []
    ranks = []
    for name, coordinates in zip(names, poses.T, strict=True):
        levels, numbers = np.unique(coordinates, return_inverse=True)
        middles.append(0.5 * float(levels[0]) + 0.5 * float(levels[-1]))
        if len(levels) > 1:
            axes.append(_axis(table, name, levels))
            ranks.append(numbers)
    grid = Grid(names, tuple(middles), tuple(axes))
    places = np.array(ranks, dtype=np.int64).reshape(len(axes), len(poses))
    order = np.lexsort(places[::-1]) if axes else np.arange(len(poses))
    again = (np.diff(places[:, order]) == 0).all(axis=0)
    if again.any():
        first, second = sorted(order[int(np.argmax(again)) :][:2].tolist())
        raise DataError(
            f"{table.place(second)}: is the pose of row {first + 1} again; {int(again.sum())} rows "
            "are there already: drop them"
        )
    if grid.size > len(poses):
        lost = dict(grid.fixed_coordinates)
        for axis, rank in zip(axes, _first_missing(grid.shape, places[:, order]), strict=True):
            lost[axis.name] = float(axis.values[rank])
        first_missing = ", ".join(f"{name} = {lost[name]:g}" for name in names)
        raise DataError(
            f"{table.source}: {grid.size - len(poses)} of {grid.size} poses of a grid are missing, "
            f"the first at {first_missing}"
        )
    return grid, order


def _first_missing(shape: tuple[int, ...], ranks: NDArray[np.int64]) -> tuple[int, ...]:
    """Return the place in a grid of the first pose that sorted places (axes, N) lack."""
    places, known = product(*map(range, shape)), map(tuple, ranks.T.tolist())
    return next(place for place, other in zip_longest(places, known) if place != other)


def _axis(table: Table, name: str, coordinates: Array) -> Axis:
    """Return the axis of a coordinate's values, after a check that their steps are equal."""
    axis = Axis(name, float(coordinates[0]), float(coordinates[-1]), len(coordinates))
    differences = np.abs(coordinates - axis.values)
    if differences.max() > SAME * (axis.greatest - axis.least) / (axis.count - 1):
        raise DataError(
            f"{table.source}: {name} = {coordinates[int(differences.argmax())]:g} is not in equal "
            "steps with the others, so that these are not the poses of a grid"
        )
    return axis


def _checksum(index_map: Map) -> str:
    """Return the checksum of a map's columns in a table."""
    indices: dict[str, Any] = {
        name: np.where(np.isfinite(array), array, np.nan)
        for name, array in index_map.values.items()
    }
    return checksum(index_map.grid.plain(), {**indices, _STATUS: index_map.status})


def _expect_whole(source: Path, index_map: Map) -> None:
    """Raise DataError if a Parquet file has a checksum that does not match its contents."""
    import polars as pl

    metadata = pl.read_parquet_metadata(source)
    recorded = {metadata[key] for key in _CHECKSUMS if key in metadata}
    if recorded - {_checksum(index_map)} or (not recorded and _WRITER not in metadata):
        raise DataError(f"{source}: is damaged: it does not hold what was written; save it again")
