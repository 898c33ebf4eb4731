"""Stores of the chunks of a map of poses: memory, or a Zarr folder that all workers reach."""

from __future__ import annotations

import hashlib
import json
import math
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect_to_fit
from pteron.errors import DataError, OutputError
from pteron.extras import import_extra
from pteron.indices import Index
from pteron.maps.checksums import checksum
from pteron.maps.grid import Grid
from pteron.maps.map import ALL, Map, own_attributes, own_indices_of
from pteron.maps.plan import expect_same
from pteron.platforms.coordinates import COORDINATES

_CHECKSUM = "checksum"
"""Name of the array of the chunks' checksums."""

_STATUS = "status"
"""Name of the array that says whether poses are in reach."""

_NOT_COMPUTED = -128
"""`status` where no chunk has been written yet, so that no pose there counts as in reach."""


class MemoryStore:
    """A map in this process's memory."""

    def __init__(self, grid: Grid, names: tuple[str, ...]) -> None:
        poses = " x ".join(map(str, grid.shape))
        expect_to_fit("grid", f"{poses} poses", (len(names) + 1.0) * math.prod(grid.shape))
        self._grid = grid
        self._regions = grid.regions()
        self._values = {name: np.empty(grid.shape) for name in names}
        self._status = np.empty(grid.shape, dtype=np.int8)

    def finished_chunks(self) -> tuple[int, ...]:
        """Return no numbers: a new store in memory is empty."""
        return ()

    def write(self, number: int, chunk: Mapping[str, NDArray[Any]]) -> None:
        """Keep a chunk's values."""
        region = self._regions[number]
        for name, index_values in self._values.items():
            index_values[region] = chunk[name]
        self._status[region] = chunk[_STATUS]

    def map(self, robot: str, machine: str) -> Map:
        """Return the map, in memory, of a machine of this name and file text."""
        return Map(robot, self._grid, self._values, self._status, machine)


@dataclass(frozen=True)
class MapStore:
    """A map in a Zarr store: a folder with one file for each chunk of each index.

    No two chunks share a file, so that workers write at the same time. The store has an array of
    the grid's shape for each index and for `status`, one array for each axis's values, and
    `checksum`, one number for each chunk. That number is written last: it shows that the chunk is
    whole and holds the values that were written. Arrays carry the names of their axes and their
    units, so that xarray reads the store.

    `seal` is the checksum of the machine's name, the plan, the arrays' metadata and the axes: of
    the store as it was made, before its first chunk.
    """

    path: Path
    grid: Grid
    names: tuple[str, ...]
    seal: str

    @classmethod
    def create(
        cls,
        path: Path,
        robot: str,
        grid: Grid,
        names: tuple[str, ...],
        plan: Mapping[str, Any],
        own_indices: tuple[Index, ...] = (),
    ) -> MapStore:
        """Return the store of a map at a path; it is created if missing.

        A store of the same map is continued. `robot` is the machine's name, `names` are those of
        the indices, and `plan` is all else that the numbers depend on; but for the functions of
        `own_indices`, which only their author knows.
        """
        full_plan = {**plan, "index": list(names), "grid": grid.plain()}
        if not path.exists():
            with _temporary_beside(path) as work:
                _make(work, grid, names, {"name": robot, "plan": full_plan}, own_indices)
                _move_into_place(work, path)
        attributes = _attributes(path)
        if "plan" not in attributes:
            raise OutputError(f"{path}: is no map's store; name another place, or remove it")
        expect_same(path, attributes["plan"], full_plan)
        try:
            return cls(path.resolve(), grid, names, _checked_seal(path, attributes))
        except DataError as error:
            raise OutputError(f"{error}; remove it, or name another place") from None

    def finished_chunks(self) -> frozenset[int]:
        """Return the numbers of the chunks that are complete."""
        count = len(self.grid.regions())
        return frozenset(k for k in range(count) if self._read(k) is not None)

    def write(self, number: int, chunk: Mapping[str, NDArray[Any]]) -> None:
        """Write a chunk's values, each array's part through a temporary file and a rename."""
        region, group = self.grid.regions()[number], _group(self.path)
        arrays = {name: np.asarray(chunk[name], dtype=_dtype(name)) for name in self._arrays}
        for name, index_values in arrays.items():
            group[name][region] = index_values
        group[_CHECKSUM][number] = self._checksum(number, arrays)

    def map(self, robot: str, machine: str) -> Map:
        """Return the map, in memory, of a machine of this name and file text."""
        regions = self.grid.regions()
        arrays_by_name = {name: np.empty(self.grid.shape, _dtype(name)) for name in self._arrays}
        missing = 0
        for number, region in enumerate(regions):
            chunk = self._read(number)
            missing += chunk is None
            for name, array in (chunk or {}).items():
                arrays_by_name[name][region] = array
        if missing:
            raise DataError(
                f"{self.path}: {missing} of {len(regions)} chunks are not finished, lost or "
                "damaged; run again what made it, which computes them"
            )
        status = arrays_by_name.pop(_STATUS)
        return Map(robot, self.grid, arrays_by_name, status, machine)

    @property
    def _arrays(self) -> tuple[str, ...]:
        """Names of the arrays in the store: the indices and the status."""
        return (*self.names, _STATUS)

    def _read(self, number: int) -> dict[str, NDArray[Any]] | None:
        """Return a chunk; None if it is missing or damaged."""
        region, group = self.grid.regions()[number], _group(self.path)
        try:
            recorded = int(group[_CHECKSUM][number])
            if not recorded:
                return None
            arrays = {name: np.asarray(group[name][region]) for name in self._arrays}
        except Exception:  # codecs and their libraries raise what they like at damaged bytes
            return None
        return arrays if recorded == self._checksum(number, arrays) else None

    def _checksum(self, number: int, arrays: Mapping[str, NDArray[Any]]) -> int:
        """Return the checksum, above 0, of a chunk's values, its number and the store's seal."""
        return int(checksum([self.seal, number], arrays)[:15], 16) or 1


def read_store(path: Path) -> Map:
    """Return the map of a Zarr store."""
    attributes = _attributes(path)
    if "plan" not in attributes:
        raise DataError(f"{path}: is no map's store")
    seal = _checked_seal(path, attributes)
    plan, name = attributes["plan"], attributes["name"]
    names = tuple(plan["index"])
    store = MapStore(path.resolve(), Grid.from_plain(plan["grid"]), names, seal)
    group = _group(path)
    own_indices = own_indices_of({k: dict(group[k].attrs) for k in names if k not in ALL})
    index_map = store.map(name, "" if plan["robot"] == name else plan["robot"])
    return replace(index_map, own_indices=own_indices)


def save_store(index_map: Map, path: Path) -> Path:
    """Write a map to a Zarr store, atomically."""
    plan = {"robot": index_map.machine or index_map.robot, "saved": True}
    names, own_indices = tuple(index_map.values), index_map.own_indices
    if path.exists():
        MapStore.create(path, index_map.robot, index_map.grid, names, plan, own_indices)
    with _temporary_beside(path) as work:
        new_store = work / path.name
        store = MapStore.create(
            new_store, index_map.robot, index_map.grid, names, plan, own_indices
        )
        for number, region in enumerate(index_map.grid.regions()):
            arrays = {name: array[region] for name, array in index_map.values.items()}
            store.write(number, arrays | {_STATUS: index_map.status[region]})
        if path.exists():
            path.rename(work / "former")
        return new_store.rename(path)


def _make(
    work: Path,
    grid: Grid,
    names: tuple[str, ...],
    attributes: dict[str, Any],
    own_indices: tuple[Index, ...],
) -> None:
    """Make a store without chunks in a folder."""
    group = _zarr().create_group(work, attributes=attributes)
    axes = tuple(axis.name for axis in grid.axes)
    known = {**ALL, **{index.name: index for index in own_indices}}
    for axis in grid.axes:
        array = group.create_array(axis.name, data=axis.values, dimension_names=(axis.name,))
        array.attrs["units"] = axis.unit
    for name in (*names, _STATUS):
        index = known.get(name)
        array = group.create_array(
            name,
            shape=grid.shape,
            chunks=grid.chunk,
            dtype=_dtype(name),
            fill_value=np.nan if index else _NOT_COMPUTED,
            dimension_names=axes,
            config={"write_empty_chunks": True},
        )
        if index:
            array.attrs.update({"units": index.unit, "long_name": index.title})
        if index in own_indices:
            array.attrs.update(own_attributes(index))
    group.create_array(
        _CHECKSUM,
        shape=(len(grid.regions()),),
        chunks=(1,),
        dtype="uint64",
        compressors=None,
        dimension_names=("chunk",),
    )
    group.attrs["sha256"] = _seal(work, attributes)


def _seal(path: Path, attributes: Mapping[str, Any]) -> str:
    """Return the checksum of a store's attributes, its arrays' metadata and its axes."""
    axes = [file for name in COORDINATES for file in path.glob(f"{name}/c/*")]
    total = hashlib.sha256(
        json.dumps([attributes["name"], attributes["plan"]], sort_keys=True).encode()
    )
    for file in sorted([*path.glob("*/zarr.json"), *axes]):
        total.update(f"\0{file.relative_to(path).as_posix()}\0".encode())
        total.update(file.read_bytes())
    return total.hexdigest()


def _checked_seal(path: Path, attributes: Mapping[str, Any]) -> str:
    """Return a store's seal, after a check that its plan, arrays and axes are unchanged."""
    try:
        seal = _seal(path, attributes)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        seal = ""
    if not seal or seal != attributes.get("sha256"):
        raise DataError(
            f"{path}: is damaged: its plan, axes or arrays are not as they were written"
        )
    return seal


def _dtype(name: str) -> str:
    """Return the NumPy type of an array in the store: int8 for the status, float64 for indices."""
    return "int8" if name == _STATUS else "float64"


@contextmanager
def _temporary_beside(path: Path) -> Iterator[Path]:
    """Yield a temporary folder beside a path; it is removed at the end, unless it was renamed."""
    try:
        work = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from None
    try:
        yield work
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _move_into_place(work: Path, path: Path) -> None:
    """Rename a finished store to its path, unless another process has just made it there."""
    try:
        work.chmod(0o755)
        work.rename(path)
    except OSError:
        if not path.exists():
            raise


@lru_cache(maxsize=8)
def _group(path: Path) -> Any:
    """Return an open store; each process opens it once."""
    return _zarr().open_group(path, mode="r+")


def _attributes(path: Path) -> dict[str, Any]:
    """Return the attributes in a store's file; empty if the path is no store."""
    _zarr()
    try:
        attributes = json.loads((path / "zarr.json").read_bytes())["attributes"]
        return dict(attributes) if isinstance(attributes["plan"], dict) else {}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return {}


def _zarr() -> Any:
    """Return the module zarr, or raise an error with the pip command of its extra."""
    return import_extra("cluster", "zarr", "a .zarr store needs Zarr")
