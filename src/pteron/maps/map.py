"""`Map`, the result of `map_index`: indices over a grid of poses, and whether each is in reach."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.html_table import Overview, frame_overview
from pteron.indices import INDICES, Index
from pteron.kernels import Array
from pteron.maps.grid import Grid
from pteron.platforms.coordinates import coordinate
from pteron.renamed import former_attribute, warn_former
from pteron.result import Result
from pteron.workspace import BEYOND_LIMITS, REACHABLE

if TYPE_CHECKING:
    import polars as pl

MARGIN = Index(
    "margin",
    "distance to the end of the reach",
    r"\min_i \min(d_i, l_i)",
    "the legs' closed forms",
    "m",
    "more",
)
"""The default index of maps; negative out of reach or beyond limits."""

ALL = {MARGIN.name: MARGIN, **INDICES}
"""All indices that a map may hold, by name."""


@dataclass(frozen=True, eq=False, repr=False)
class Summary(Result):
    """Statistics of an index over the poses of a map that are in reach and within limits.

    Attributes
    ----------
    name, unit : str
        Name and unit of the index.
    best, worst : float
        The extreme values; which of them is the greatest depends on the index.
    best_pose, worst_pose : array, shape (m,)
        Poses that have them, m and rad.
    mean, median : float
        Mean and median over the poses where it is a finite number.
    count : int
        Number of these.
    infinite : int
        Number of the other poses in reach and within limits: they are singular, or next to it.
    """

    name: str
    unit: str
    best: float
    best_pose: Array
    worst: float
    worst_pose: Array
    mean: float
    median: float
    count: int
    infinite: int


@dataclass(frozen=True, eq=False, repr=False)
class Map(Result):
    """Indices over a grid of poses.

    Attributes
    ----------
    robot : str
        The machine's name.
    grid : Grid
        The poses.
    values : mapping of str to array, shape grid.shape
        Each index, in its `units`; NaN where the pose is out of reach, or the index is not
        determined. ``margin`` is determined everywhere.
    status : array of int, shape grid.shape
        `REACHABLE`, 0; `BEYOND_LIMITS`, -1; or the leg, from 1, that misses the pose by most.
    machine : str
        The text of the machine's file, as `save` writes it; empty where it is not known, as of a
        map that was read from a table.
    own_indices : tuple of Index
        Those of its values that are no indices of Pteron.
    """

    robot: str
    grid: Grid
    values: Mapping[str, Array]
    status: NDArray[np.int8]
    machine: str = ""
    own_indices: tuple[Index, ...] = ()

    def __repr__(self) -> str:
        sides = " x ".join(f"{axis.name} {axis.count}" for axis in self.grid.axes)
        return f"<Map of {self.robot!r}: {', '.join(self.values)} over {sides}>"

    @property
    def indices(self) -> tuple[Index, ...]:
        """The indices of its values, in their order."""
        return tuple(map(self.index, self.values))

    def index(self, name: str) -> Index:
        """Return the index of a name, a custom one or one of Pteron."""
        return {**ALL, **{index.name: index for index in self.own_indices}}[name]

    @property
    def units(self) -> dict[str, str]:
        """The unit of each index; empty for a plain number."""
        return {index.name: index.unit for index in self.indices}

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """Whether each pose is usable, shape grid.shape."""
        return np.asarray(self.status == REACHABLE)

    @property
    def share(self) -> float:
        """The share of usable poses."""
        return float(self.reachable.mean())

    @property
    def causes(self) -> dict[str, float]:
        """Why poses are not usable, and the share of all poses for each cause."""
        codes, counts = np.unique(self.status, return_counts=True)
        shares = zip(codes.tolist(), (counts / self.status.size).tolist(), strict=True)
        return {cause(code): share for code, share in shares if code != REACHABLE}

    def summary(self, name: str = "") -> Any:
        """Return the statistics of each index, for people, as lines of text."""
        if name:
            warn_former("Map.summary(name)", ".statistics(name)")
            return self.statistics(name)
        lines = [f"{self.robot}: {self.share:.1%} of {self.status.size} poses in reach"]
        lines += [f"{cause}: {share:.1%}" for cause, share in self.causes.items()]
        for index in self.indices:
            if np.isfinite(self.values[index.name][self.reachable]).any():
                figures = self.statistics(index.name)
                numbers = f"best {figures.best:.4g}, worst {figures.worst:.4g}"
                lines.append(
                    f"{index.name}: {numbers}, mean {figures.mean:.4g} {index.unit}".rstrip()
                )
        return "\n".join(lines)

    def statistics(self, name: str) -> Summary:
        """Return the best, the worst and the mean of an index over the usable poses.

        Raises
        ------
        DataError
            If the map has no such index, or it is determined at no pose that serves.
        """
        if name not in self.values:
            raise DataError(f"{name}: is not in this map; it has {', '.join(self.values)}")
        index, amounts, serves = self.index(name), self.values[name], self.reachable
        known = serves & np.isfinite(amounts)
        if not known.any():
            raise DataError(f"{name}: determined at no pose of this map that serves")
        sign = 1.0 if index.better == "more" else -1.0
        low, high = (
            int(np.argmin(np.where(known, side * sign * amounts, np.inf))) for side in (1.0, -1.0)
        )
        chosen = amounts[known]
        return Summary(
            name,
            index.unit,
            float(amounts.flat[high]),
            self._pose(high),
            float(amounts.flat[low]),
            self._pose(low),
            float(chosen.mean()),
            float(np.median(chosen)),
            len(chosen),
            int(serves.sum()) - len(chosen),
        )

    def _pose(self, place: int) -> Array:
        """Return the pose (m,) at a flat index of the grid."""
        region = tuple(
            slice(int(i), int(i) + 1) for i in np.unravel_index(place, self.status.shape)
        )
        return self.grid.poses(region).reshape(-1)

    def table(self) -> pl.DataFrame:
        """Return a table with a row per pose: its coordinates, the indices, and `status`.

        The names of columns have units in brackets, as tables are read here.
        """
        import polars as pl

        poses = self.grid.poses().reshape(-1, len(self.grid.coordinates))
        columns = {
            f"{name} [{coordinate(name).unit}]": poses[:, k]
            for k, name in enumerate(self.grid.coordinates)
        }
        columns |= {column_heading(i): self.values[i.name].ravel() for i in self.indices}
        frame = pl.DataFrame(columns | {"status": self.status.ravel()})
        return frame.with_columns(pl.col(pl.Float64).fill_nan(None))

    def slice_at(self, name: str, coordinate: float) -> Map:
        """Return the map at the grid value of a coordinate nearest to a number, m or rad."""
        k = [axis.name for axis in self.grid.axes].index(name)
        axes = list(self.grid.axes)
        steps = axes.pop(k).values
        i = int(np.abs(steps - coordinate).argmin())
        pose = list(self.grid.pose)
        pose[self.grid.coordinates.index(name)] = float(steps[i])
        indices = {index: np.take(array, i, axis=k) for index, array in self.values.items()}
        grid = Grid(self.grid.coordinates, tuple(pose), tuple(axes))
        status = np.take(self.status, i, axis=k)
        return Map(self.robot, grid, indices, status, self.machine, self.own_indices)

    at = former_attribute("at", "slice_at")

    def _overview(self) -> Overview:
        """Return the share of poses in reach and the table of the indices, for notebooks."""
        about = f"{self.share:.1%} of {self.status.size} poses in reach"
        return frame_overview(self.robot, about, self.table())


def own_attributes(index: Index) -> dict[str, str]:
    """Return the attributes in which a file stores a custom index, for `own_indices_of`."""
    return {"units": index.unit, "long_name": index.title, "better": index.better}


def own_indices_of(attributes: Mapping[str, Mapping[str, Any]]) -> tuple[Index, ...]:
    """Return custom indices, without functions, from the attributes in a file, by name."""
    return tuple(
        Index(name, str(said["long_name"]), unit=str(said["units"]), better=said["better"])
        for name, said in attributes.items()
    )


def column_heading(index: Index) -> str:
    """Return the heading of an index's column."""
    return f"{index.name} [{index.unit}]" if index.unit else index.name


def cause(status: int) -> str:
    """Return the text of a status other than `REACHABLE`."""
    return "beyond a joint's limit" if status == BEYOND_LIMITS else f"out of reach of leg {status}"
