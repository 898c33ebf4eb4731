"""`map_index`: performance indices over a grid of poses, chunk by chunk, here or on a cluster."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, get_args

import numpy as np

from pteron.errors import DataError
from pteron.indices.evaluation import values_in_reach
from pteron.indices.index import Index, expect_index
from pteron.kernels import Array, numeric
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.manipulator.saving import text_of
from pteron.maps.accelerated import indices_by_jax
from pteron.maps.files import checked_map_file, save_map
from pteron.maps.grid import Grid, Region, pose_grid
from pteron.maps.map import MARGIN, Map
from pteron.maps.plan import RESULTS
from pteron.maps.stores import MapStore, MemoryStore
from pteron.maps.surfaces import ENDINGS as SURFACES
from pteron.maps.sweep import cores, sweep
from pteron.progress import Progress
from pteron.shapes import Workers
from pteron.workspace import REACHABLE

Engine = Literal["auto", "jax"]
"""The kernels of `pteron.kernels.choice`, or JAX."""

_BLOCK = 1 << 14
"""Poses in one call of a kernel: its data then stay in the processor's cache."""

_MANY = 1 << 18
"""Poses for which it pays to wait for the compiler."""


def map_index(
    robot: RobotLike,
    index: str | Index | Sequence[str | Index] = (),
    grid: Grid | None = None,
    *,
    engine: Engine = "auto",
    out: str | Path | None = None,
    scheduler: str | None = None,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> Map:
    """Return indices of performance over a grid of poses, and which of the poses are usable.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    index : str, Index or sequence of them
        Names of indices, as `pteron.indices.INDICES` has them, or ``"margin"``, the distance to the
        end of the reach, m, which is there too where none is named. Or an `Index` of one's own,
        with a function.
    grid : Grid, optional
        The poses; by default those of `pose_grid(robot)`.
    engine : {"auto", "jax"}
        The means: this processor's compiled kernels, or JAX, on the accelerator if it finds
        one. They agree to rounding.
    out : str or Path, optional
        A file or a Zarr store, as `save_map` has them. What is computed streams to a ``.zarr``
        chunk by chunk: after an interruption the same call goes on with what is left.
    scheduler, workers
        As `sweep` has them; by default this process does the work, in a thread a processor.
    progress : callable, optional
        Takes the share of the work that is done.

    Returns
    -------
    Map
        The same bits, whoever has computed it.

    Raises
    ------
    DataError
        If an index or the engine is unknown.
    ModelError
        If a library is missing: the message names the extra.
    OutputError
        If `out` cannot be written, or holds the map of another machine, index or grid.
    PteronError
        As `sweep` raises.

    Examples
    --------
    >>> import pteron
    >>> from pteron.maps import map_index, pose_grid
    >>> robot = pteron.load("quadrupteron")
    >>> found = map_index(robot, "condition", pose_grid(robot, {"z": 0.0, "phi": 0.0}, points=41))
    >>> found, round(found.statistics("condition").best, 3)
    (<Map of 'quadrupteron': condition over x 41 x y 41>, 2.414)
    """
    robot = as_manipulator(robot)
    indices = checked_indices(robot, index)
    if engine not in get_args(Engine):
        raise DataError(f"engine: {engine!r} given, one of {', '.join(get_args(Engine))} expected")
    target = None if out is None else checked_map_file(out)
    poses = pose_grid(robot) if grid is None else grid
    if poses.coordinates != robot.coordinates:
        raise DataError(
            f"grid: of poses ({', '.join(poses.coordinates)}), while those of {robot.name} are "
            f"({', '.join(robot.coordinates)})"
        )
    if target is not None and target.suffix.lower() in SURFACES:
        indices = tuple(dict.fromkeys((*indices, MARGIN)))  # whose zero is the reach's surface
    names = tuple(index.name for index in indices)
    own_indices = tuple(index for index in indices if index.function is not None)
    if engine == "jax" and own_indices:
        raise DataError(
            f'index: {own_indices[0].name!r} is a function, and engine "jax" takes indices of '
            "Pteron alone; leave the engine out"
        )
    streams = target is not None and target.suffix.lower() == ".zarr"
    here = scheduler is None and workers is None
    with ExitStack() as opened:
        store: MapStore | MemoryStore
        if streams or not here:
            plan = {"robot": text_of(robot), "engine": engine, "pteron": RESULTS}
            place = target
            if place is None or not streams:
                folder = opened.enter_context(TemporaryDirectory(prefix="pteron-map-"))
                place = Path(folder, "map.zarr")
            store = MapStore.create(place, robot.name, poses, names, plan, own_indices)
        else:
            store = MemoryStore(poses, names)
        if engine == "auto":
            prepare(robot, _kernel_names(indices), poses.size)  # once, for all processes
        sweep(
            partial(_compute_region, robot, indices, poses, engine),
            poses.regions(),
            store,
            scheduler=scheduler,
            workers=workers,
            threads=1 if engine == "jax" else cores(),
            progress=progress,
        )
        index_map = replace(store.map(robot.name, text_of(robot)), own_indices=own_indices)
    if target is not None and not streams:
        save_map(index_map, target)
    return index_map


def checked_indices(
    robot: Manipulator, index: str | Index | Sequence[str | Index]
) -> tuple[Index, ...]:
    """Return the indices of names after a check that the machine has them; `MARGIN` if none."""
    several = (index,) if isinstance(index, str | Index) else tuple(dict.fromkeys(index))
    indices = tuple(MARGIN if k == MARGIN.name else expect_index(robot, k) for k in several)
    names = [chosen.name for chosen in indices]
    if repeated := next((name for name in names if names.count(name) > 1), None):
        raise DataError(f"index: {repeated!r} is named twice; give each its own name")
    return indices or (MARGIN,)


def _kernel_names(indices: tuple[Index, ...]) -> tuple[str, ...]:
    """Return the names of the indices that have kernels."""
    return tuple(k.name for k in indices if k.function is None and k != MARGIN)


def _compute_region(
    robot: Manipulator, indices: tuple[Index, ...], grid: Grid, engine: str, region: Region
) -> dict[str, Array]:
    """Return the indices of a part of a grid, and `status`."""
    names = tuple(index.name for index in indices)
    if engine == "jax":
        return indices_by_jax(robot, names, grid, region)
    prepare(robot, _kernel_names(indices), grid.size)
    poses = grid.poses(region)
    rows = poses.reshape(-1, poses.shape[-1])
    outputs = {name: np.empty(len(rows)) for name in (*names, "status")}
    for start in range(0, len(rows), _BLOCK):
        part = slice(start, start + _BLOCK)
        status, margin, _ = numeric(robot, "standing")(rows[part])
        outputs["status"][part] = status
        for index in indices:
            if index == MARGIN:
                index_values = margin
            elif index.function is None:
                index_values = evaluate_kernel(robot, index.name, "nan", rows[part])
            else:
                index_values = values_in_reach(robot, index, rows[part], status <= REACHABLE)
            outputs[index.name][part] = index_values
    return {name: array.reshape(poses.shape[:-1]) for name, array in outputs.items()}


@lru_cache(maxsize=64)
def prepare(robot: Manipulator, names: tuple[str, ...], poses: int) -> None:
    """Load the kernels, compiled if the number of poses justifies it."""
    for name in ("standing", *names):
        numeric(robot, name).tier.fetch(at_any_cost=poses >= _MANY)
