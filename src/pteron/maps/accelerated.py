"""Maps of performance indices over poses, computed by JAX: the engine "jax" of `map_index`.

One function of the axes' values is compiled for all chunks; JAX runs it on an accelerator if it
has one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from pteron.extras import import_extra
from pteron.kernels import Array
from pteron.kernels.choice import kernel_with_status
from pteron.kernels.jax import Traced
from pteron.manipulator import Manipulator
from pteron.maps.grid import Grid, Region
from pteron.maps.map import MARGIN


def indices_by_jax(
    robot: Manipulator, names: tuple[str, ...], grid: Grid, region: Region
) -> dict[str, Array]:
    """Return the indices of a part of a grid, and `status`, computed by JAX where it runs."""
    places = tuple(grid.coordinates.index(axis.name) for axis in grid.axes)
    function = _function(robot, names, places, grid.chunk)
    # A chunk at the grid's rim is filled up: another shape would be compiled anew.
    axis_values = [
        np.pad(array, (0, side - len(array)), mode="edge")
        for array, side in (
            (axis.values[part], side)
            for axis, part, side in zip(grid.axes, region, grid.chunk, strict=True)
        )
    ]
    outputs = function(np.array(grid.pose), *axis_values)
    region_of_chunk = tuple(slice(0, part.stop - part.start) for part in region)
    return {name: np.asarray(array)[region_of_chunk] for name, array in outputs.items()}


@lru_cache(maxsize=16)
def _function(
    robot: Manipulator, names: tuple[str, ...], places: tuple[int, ...], shape: tuple[int, ...]
) -> Callable[..., dict[str, Any]]:
    """Return a JAX function from a pose and the axes' values to the indices."""
    jax = import_extra("jax", "jax", 'engine: "jax" needs JAX')
    jnp = jax.numpy
    jax.config.update("jax_enable_x64", True)
    kernels = {
        name: kernel_with_status(robot, name, Traced)
        for name in ("standing", *names)
        if name != MARGIN.name
    }

    def evaluate(pose: Any, *axis_values: Any) -> dict[str, Any]:
        """Return the indices and the status, by name, on the grid through a pose."""
        columns = [jnp.broadcast_to(coordinate, shape) for coordinate in pose]
        for k, (place, coordinate) in enumerate(zip(places, axis_values, strict=True)):
            columns[place] = jnp.broadcast_to(
                coordinate.reshape((-1,) + (1,) * (len(shape) - 1 - k)), shape
            )
        poses = jnp.stack(columns, axis=-1)
        status, margin, _ = kernels["standing"](poses)
        outputs = {"status": status, MARGIN.name: margin}
        for name in names:
            if name != MARGIN.name:
                amounts, serves = kernels[name](poses)
                outputs[name] = jnp.where(serves > 0.0, amounts, jnp.nan)
        return {name: outputs[name] for name in (*names, "status")}

    compiled: Callable[..., dict[str, Any]] = jax.jit(evaluate)
    return compiled
