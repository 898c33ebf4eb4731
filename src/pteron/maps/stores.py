"""Where the chunks of a map go: to memory, or to a Zarr store on a disk that all reach."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError, ModelError, OutputError
from pteron.maps.grid import Axis, Grid
from pteron.maps.map import ALL, Map
from pteron.maps.plan import expect_same

_FINISHED = "finished"
_STATUS = "status"


class MemoryStore:
    """A map in this process's memory."""

    def __init__(self, grid: Grid, names: tuple[str, ...]) -> None:
        self._grid = grid
        self._regions = grid.regions()
        self._values = {name: np.empty(grid.shape) for name in names}
        self._status = np.empty(grid.shape, dtype=np.int8)

    def finished(self) -> tuple[int, ...]:
        """Return no chunk: nothing is there before the sweep begins."""
        return ()

    def write(self, number: int, result: Mapping[str, NDArray[Any]]) -> None:
        """Keep what a chunk gave."""
        region = self._regions[number]
        for name, values in self._values.items():
            values[region] = result[name]
        self._status[region] = result[_STATUS]

    def map(self, robot: str) -> Map:
        """Return the map of a machine of that name."""
        return Map(robot, self._grid, self._values, self._status)


@dataclass(frozen=True)
class MapStore:
    """A map in a Zarr store, which is a folder: a file a chunk and index, so that tasks share none.

    It is an array of the grid's shape for each index, one for `status`, one for each axis's values,
    and `finished`, a number a chunk: written last, it says that the chunk is whole. Arrays carry
    the names of their axes and their units, so that xarray reads the store.
    """

    path: Path
    grid: Grid
    names: tuple[str, ...]

    @classmethod
    def of(
        cls, path: Path, robot: str, grid: Grid, names: tuple[str, ...], plan: Mapping[str, Any]
    ) -> MapStore:
        """Return the store of a map of a machine of that name, made if it is not there.

        Parameters
        ----------
        path : Path
            Where the same map was begun, it goes on.
        robot, grid, names
            The machine's name, the poses and the indices.
        plan : mapping
            What else makes the numbers what they are, as JSON has them.

        Raises
        ------
        OutputError
            If it is the store of another map, or cannot be written.
        ModelError
            If Zarr is not installed.
        """
        store = cls(path.resolve(), grid, names)
        wanted = {"index": list(names), "grid": _plain(grid), **plan}
        if not path.exists():
            store._make({"name": robot, "plan": wanted})
        found = _attributes(path)
        if "plan" not in found:
            raise OutputError(f"{path}: is no map's store; name another place, or remove it")
        expect_same(path, found["plan"], wanted)
        return store

    def finished(self) -> frozenset[int]:
        """Return the numbers of the chunks that are written."""
        return frozenset(np.flatnonzero(_group(self.path)[_FINISHED][:]).tolist())

    def write(self, number: int, result: Mapping[str, NDArray[Any]]) -> None:
        """Write what a chunk gave, each array's part through a temporary file and a rename."""
        region, group = self.grid.regions()[number], _group(self.path)
        for name in (*self.names, _STATUS):
            group[name][region] = result[name]
        group[_FINISHED][number] = 1

    def map(self, robot: str) -> Map:
        """Return the map, read into memory."""
        group = _group(self.path)
        values = {name: np.asarray(group[name][...]) for name in self.names}
        return Map(robot, self.grid, values, np.asarray(group[_STATUS][...]))

    def _make(self, attributes: dict[str, Any]) -> None:
        """Make the store without chunks, whole or not at all."""
        zarr, grid = _zarr(), self.grid
        try:
            work = tempfile.mkdtemp(prefix=f".{self.path.name}.", dir=self.path.parent)
        except OSError as error:
            raise OutputError(
                f"{self.path}: cannot be written ({error.strerror or error})"
            ) from None
        try:
            group = zarr.create_group(work, attributes=attributes)
            axes = tuple(axis.name for axis in grid.axes)
            for axis in grid.axes:
                made = group.create_array(axis.name, data=axis.values, dimension_names=(axis.name,))
                made.attrs["units"] = axis.unit
            for name in (*self.names, _STATUS):
                index = ALL.get(name)
                made = group.create_array(
                    name,
                    shape=grid.shape,
                    chunks=grid.chunk,
                    dtype="float64" if index else "int8",
                    fill_value=np.nan if index else 0,
                    dimension_names=axes,
                    config={"write_empty_chunks": True},
                )
                if index:
                    made.attrs.update({"units": index.unit, "long_name": index.title})
            count = len(grid.regions())
            group.create_array(
                _FINISHED, shape=(count,), chunks=(1,), dtype="uint8", compressors=None
            )
            Path(work).chmod(0o755)
            Path(work).rename(self.path)
        except OSError:
            if not self.path.exists():  # else another has just made it
                raise
        finally:
            shutil.rmtree(work, ignore_errors=True)


def read_store(path: Path) -> Map:
    """Return the map of a Zarr store.

    Raises
    ------
    DataError
        If it is none, or not finished.
    """
    found = _attributes(path)
    if "plan" not in found:
        raise DataError(f"{path}: is no map's store")
    given = found["plan"]["grid"]
    grid = Grid(
        tuple(given["coordinates"]),
        tuple(given["pose"]),
        tuple(Axis(**axis) for axis in given["axes"]),
    )
    store = MapStore(path.resolve(), grid, tuple(found["plan"]["index"]))
    missing = len(grid.regions()) - len(store.finished())
    if missing:
        raise DataError(
            f"{path}: {missing} of {len(grid.regions())} chunks are not finished yet; run again "
            "what made it"
        )
    return store.map(found["name"])


def _plain(grid: Grid) -> dict[str, Any]:
    """Return a grid as JSON has it."""
    return {
        "coordinates": list(grid.coordinates),
        "pose": list(grid.pose),
        "axes": [asdict(axis) for axis in grid.axes],
    }


@lru_cache(maxsize=8)
def _group(path: Path) -> Any:
    """Return an open store; it is opened once a process."""
    return _zarr().open_group(path, mode="r+")


def _attributes(path: Path) -> dict[str, Any]:
    try:
        return dict(_zarr().open_group(path, mode="r").attrs)
    except (FileNotFoundError, ValueError, KeyError, OSError):
        return {}


def _zarr() -> Any:
    try:
        import zarr
    except ImportError:
        raise ModelError(
            'a .zarr store needs Zarr, which is not installed; pip install "pteron[cluster]"'
        ) from None
    return zarr
