"""Target `cuda`: a kernel of one thread a state, which NVRTC compiles when it is first called.

`run_loop` runs a control loop there, one thread a machine.

The code is that of the target `c`, and so are the bits, where products and sums are not contracted
to fused operations; only atan2, and sines and cosines of angles beyond 1e5 rad, are CUDA's own, to
two units in the last place. CuPy compiles and launches: it is kept for this, keeps compiled code on
disk, allocates the results, and exchanges arrays with PyTorch and JAX by DLPack, on their streams.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from importlib import import_module
from math import prod
from typing import Any

import numpy as np

from pteron.errors import DataError, ModelError
from pteron.extras import import_extra
from pteron.kernels.c import c_language, module_of
from pteron.kernels.code import module_values
from pteron.kernels.exponential import with_lowered_exponentials
from pteron.kernels.graph import graph_of
from pteron.kernels.kernel import Kernel, Port, broadcast_lead
from pteron.kernels.lifetimes import NUMBERS, with_short_lifetimes
from pteron.kernels.loop_code import RESULTS, STATE, LoopCode

_THREADS = 128
"""Threads of a block: 65 536 registers of a multiprocessor are enough for 512 to 1024 threads with
128 or 64 each, whole blocks of which fill it."""

_PORT = np.dtype([("numbers", np.uintp), ("machine", "q"), ("sample", "q")], align=True)
"""An array of a loop: its place, and how many numbers its machines and samples lie apart."""

_BLOCKS = 1 << 16
"""Most blocks of a grid; more states than its threads are evaluated in turns."""


class DeviceKernel(Kernel):
    """A kernel on a GPU. It takes and returns arrays of CuPy, PyTorch or JAX that are there.

    NumPy arrays are copied to the GPU; results are arrays of the library of the first input, of
    CuPy for NumPy's. Arrays may have any strides: those of which the elements of a state lie
    farther apart than its neighbours (columns) give results of that layout.
    """

    fast = False
    """Whether products and sums are contracted to fused operations."""

    @cached_property
    def source(self) -> str:
        """The CUDA source of the kernel."""
        graph = graph_of(with_lowered_exponentials(self.function), self.ports)
        graph = with_short_lifetimes(graph, NUMBERS * 8 // np.dtype(self.dtype).itemsize)
        language = c_language(self.dtype)
        texts = module_values(self.name, graph, self.ports, self.outputs, language)
        return module_of("kernel.cu.j2", texts, self.dtype)

    @cached_property
    def _launch(self) -> Any:
        """The compiled CUDA kernel, to be launched by CuPy."""
        return compiled_module(self.source, self.fast).get_function("run")

    def _evaluate(self, *values: Any, **fixed: Any) -> Any:
        """Evaluate the kernel on GPU arrays, after checks of shapes and types."""
        cupy = device_library()
        by_port = self._values_by_port(values, fixed)
        arrays = {port.name: self._move_input(by_port[port.name], port) for port in self.ports}
        lead = broadcast_lead(
            {
                port.name: arrays[port.name].shape[: arrays[port.name].ndim - len(port.shape)]
                for port in self.ports
                if not port.shared
            }
        )
        batch, arguments, by_columns = prod(lead), [], False
        for port in self.ports:
            array = arrays[port.name]
            if port.shared:
                arguments.append(cupy.ascontiguousarray(array))
                continue
            flat = cupy.broadcast_to(array, lead + port.shape).reshape(batch, port.size)
            strides = [step // flat.itemsize for step in flat.strides]
            by_columns |= port is self.ports[0] and batch > 1 and strides[0] < strides[1]
            arguments += [flat, *strides]
        results = []
        for port in self.outputs:
            order = (port.size, batch) if by_columns else (batch, port.size)
            array = cupy.empty(order, dtype=self.dtype)
            array = array.T if by_columns else array
            arguments += [array, *(step // array.itemsize for step in array.strides)]
            results.append(array.reshape(lead + port.shape))
        if batch:
            launch(self._launch, batch, arguments)
        present = tuple(like(array, values[0] if values else None) for array in results)
        return present[0] if len(present) == 1 else present

    def _move_input(self, array: Any, port: Port) -> Any:
        """Return an input as a CuPy array; raise DataError if its shape or type is wrong."""
        array = move_to_device(array, port.name, self.dtype)
        shape = array.shape
        if port.shared and shape != port.shape:
            raise DataError(
                f"{port.name}: shape {shape} given, {port.shape} expected: one value for all states"
            )
        if shape[max(len(shape) - len(port.shape), 0) :] != port.shape:
            expected = ", ".join(["...", *map(str, port.shape)])
            raise DataError(f"{port.name}: shape {shape} given, ({expected}) expected")
        return array


def launch(kernel: Any, batch: int, arguments: Sequence[Any]) -> None:
    """Launch a CUDA kernel for a batch of states, at most `_BLOCKS` blocks of threads."""
    blocks = min(-(-batch // _THREADS), _BLOCKS)
    integers = (np.int64(a) if isinstance(a, int) else a for a in arguments)
    kernel((blocks,), (_THREADS,), (np.int64(batch), *integers))


def run_loop(
    code: LoopCode,
    arrays: Mapping[str, Any],
    samples: int,
    times: Sequence[float],
    counts: Sequence[int],
) -> None:
    """Run a number of samples of a simulation loop on the GPU; results are copied back.

    NumPy arrays are copied to the GPU, and arrays that the loop changes are copied back.
    """
    cupy = device_library()
    present = {
        name: array if isinstance(array, cupy.ndarray) else cupy.asarray(array)
        for name, array in arrays.items()
        if name in code.names
    }
    ports = np.zeros(len(code.names), _PORT)
    for port, name in zip(ports, code.names, strict=True):
        if (array := present.get(name)) is not None:
            steps = [array.strides[k] // 8 if array.shape[k] > 1 else 0 for k in (0, 1)]
            port["numbers"], port["machine"], port["sample"] = array.data.ptr, *steps
    tables = np.array(times), np.array(counts, "l"), np.frombuffer(ports.tobytes(), np.uint8)
    arguments = [np.int64(samples), *map(cupy.asarray, tables)]
    launch(compiled_module(code.source).get_function("run"), len(present["state"]), arguments)
    for name in (*STATE, *RESULTS):
        array = arrays.get(name)
        if array is not None and not isinstance(array, cupy.ndarray):
            array[...] = present[name].get()


def device_library() -> Any:
    """Return the module CuPy; raise ModelError if it or a GPU is missing."""
    cupy = import_extra("cuda", "cupy", 'target: "cuda" needs CuPy')
    if not _has_device(cupy):
        raise ModelError(
            'target: "cuda" needs an NVIDIA GPU and its driver, which are not here; use "c"'
        )
    return cupy


@lru_cache(maxsize=2)
def _has_device(cupy: Any) -> bool:
    """Return whether CuPy finds a GPU."""
    return bool(cupy.is_available())


@lru_cache(maxsize=64)
def compiled_module(source: str, fast: bool = False) -> Any:
    """Return the CuPy module compiled from CUDA source."""
    options = "-std=c++17", "--device-int128", f"--fmad={str(fast).lower()}"
    return device_library().RawModule(code=source, options=options)


def move_to_device(array: Any, name: str, dtype: str) -> Any:
    """Return an array as a CuPy array: the same memory if on the GPU, else a copy there."""
    cupy = device_library()
    if isinstance(array, cupy.ndarray):
        known = array
    elif hasattr(array, "__dlpack__") and not isinstance(array, np.ndarray):
        try:
            known = cupy.from_dlpack(array.detach() if hasattr(array, "detach") else array)
        except (BufferError, RuntimeError, TypeError, ValueError) as error:
            raise DataError(f"{name}: an array on the GPU expected ({error})") from None
    else:
        try:
            return cupy.asarray(np.asarray(array, dtype))
        except (TypeError, ValueError):
            raise DataError(f"{name}: not an array of real numbers") from None
    if known.dtype != np.dtype(dtype):
        raise DataError(f"{name}: an array of {known.dtype} given, {dtype} expected")
    return known


def like(array: Any, other: Any) -> Any:
    """Return a CuPy array as an array of the library of `other`, sharing its memory."""
    return convert_to_library(array, type(other).__module__.partition(".")[0])


def convert_to_library(array: Any, library: str) -> Any:
    """Return a CuPy array as an array of PyTorch or JAX, sharing its memory; else as it is."""
    names = {"torch": "torch", "jax": "jax.numpy", "jaxlib": "jax.numpy"}
    return import_module(names[library]).from_dlpack(array) if library in names else array
