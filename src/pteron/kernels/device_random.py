"""NumPy's random generators on a GPU: the numbers of many, each in its own sequence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pteron.kernels.code import render_template
from pteron.kernels.cuda import compiled_module, device_library, launch

_LOW = (1 << 64) - 1


class DeviceGenerators:
    """Generators of NumPy, `Generator(PCG64)`, whose states are on the GPU."""

    def __init__(self, count: int) -> None:
        self._states = device_library().zeros((count, 4), np.uint64)

    def put(self, rows: Sequence[int], generators: Sequence[np.random.Generator]) -> None:
        """Copy generators to the GPU in place of those of the rows."""
        states: list[dict[str, int]] = [rng.bit_generator.state["state"] for rng in generators]
        halves = [
            [word >> 64, word & _LOW] for state in states for word in (state["state"], state["inc"])
        ]
        cupy = device_library()
        numbers = np.array(halves, np.uint64).reshape(-1, 4)
        self._states[cupy.asarray(np.array(rows, np.int64))] = cupy.asarray(numbers)

    def random(self, rows: Any, count: int) -> Any:
        """Return the next `count` numbers in [0, 1) of the generators of rows (R,), (R, count)."""
        cupy = device_library()
        numbers = cupy.empty((len(rows), count))
        if len(rows):
            module = compiled_module(render_template("pteron.kernels", "pcg64.cu.j2"))
            launch(module.get_function("run"), len(rows), [rows, self._states, numbers, count])
        return numbers
