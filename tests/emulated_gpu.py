"""A GPU of the host: CuPy's interface as far as Pteron uses it, with CUDA compiled by g++.

`emulated` puts it in CuPy's place. Device arrays are of a class of their own, so that a NumPy array
that is taken for one is seen; a grid runs thread after thread.
"""

import ctypes
import hashlib
import os
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np

SHIM = """
#include <cmath>
#include <cstring>
#define __CUDACC__ 1
#define __CUDACC_RTC__ 1
#define __device__
#define __global__
#define __forceinline__ inline
#define __noinline__
struct Index { unsigned x; };
static Index blockIdx, blockDim, gridDim, threadIdx;
extern "C" void set_thread(unsigned block, unsigned thread, unsigned blocks, unsigned threads)
{
    blockIdx.x = block, threadIdx.x = thread, gridDim.x = blocks, blockDim.x = threads;
}
"""
FLAGS = (
    *("-std=c++17", "-O1", "-ffp-contract=off", "-fPIC", "-shared", "-w"),
    *os.environ.get("EMULATED_GPU_FLAGS", "").split(),
)
"""Options of the compiler; the environment adds to them, see `sanitized`."""

SANITIZERS = (
    *("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-g1"),
    # What is read before it is written is a number that the target "c" does not have.
    "-ftrivial-auto-var-init=pattern",
)
# A compiler that a sanitized process starts is not sanitized.
os.environ.pop("LD_PRELOAD", None)

GRID, BLOCK = 2, 3
"""Blocks and threads of an emulated grid at most: states are evaluated in turns."""


class DeviceArray(np.ndarray):
    """An array of the emulated GPU; NumPy's functions refuse others beside it, as CuPy's do."""

    def __array_ufunc__(self, ufunc, method, *inputs, out=None, **options):
        """Return the result of a function of elements as an array of the GPU."""
        _expect_on_device((inputs, out))
        plain = [np.asarray(array) for array in inputs]
        if out is not None:
            options["out"] = tuple(map(np.asarray, out))
        result = getattr(ufunc, method)(*plain, **options)
        return np.asarray(result).view(DeviceArray) if out is None else out[0]

    def __array_function__(self, function, types, arguments, options):
        """Return the result of a function of arrays as an array of the GPU."""
        _expect_on_device((arguments, options))
        return _viewed(function(*_viewed(arguments, np.ndarray), **_viewed(options, np.ndarray)))

    def __setitem__(self, place, values):
        """Set elements to numbers, or an array on the GPU."""
        _expect_on_device((place, values))
        super().__setitem__(place, values)

    def __getitem__(self, place):
        """Return elements as an array on the GPU, also a single one."""
        _expect_on_device(place)
        return np.asarray(super().__getitem__(place)).view(DeviceArray)

    @property
    def data(self):
        """The memory, as CuPy names its address."""
        return SimpleNamespace(ptr=self.ctypes.data)

    def get(self):
        """Return a copy on the host."""
        return np.array(self)


def _viewed(values, kind=DeviceArray):
    """Return values with their arrays seen as arrays of a kind; numbers of NumPy as arrays too."""
    if isinstance(values, (tuple, list)):
        return type(values)(_viewed(value, kind) for value in values)
    if isinstance(values, dict):
        return {key: _viewed(value, kind) for key, value in values.items()}
    is_array = isinstance(values, np.ndarray | np.generic)
    return np.asarray(values).view(kind) if is_array else values


def _expect_on_device(values):
    """Raise TypeError for an array with axes that is not on the GPU."""
    if isinstance(values, (tuple, list)):
        for value in values:
            _expect_on_device(value)
    elif isinstance(values, dict):
        _expect_on_device(list(values.values()))
    elif isinstance(values, np.ndarray) and values.ndim and not isinstance(values, DeviceArray):
        raise TypeError(f"an array of NumPy beside arrays on the GPU: {values.shape}")


def asarray(values, dtype=None):
    """Return a copy of values on the emulated GPU."""
    return np.array(values, dtype).view(DeviceArray)


def from_dlpack(array):
    """Return an array of the emulated GPU in the memory of another library's array."""
    return np.from_dlpack(array).view(DeviceArray)


def far_apart(values, axis):
    """Return a copy of values on the emulated GPU, which an axis spreads over 2^32 numbers."""
    steps = list(np.array(values).strides)
    steps[axis] = values.itemsize * (2**32 // values.shape[axis] + 1)
    size = sum((n - 1) * step for n, step in zip(values.shape, steps, strict=True))
    with tempfile.TemporaryFile() as file:  # one of holes, of which few pages are used
        memory = np.memmap(file, values.dtype, shape=size // values.itemsize + 1)
    array = np.lib.stride_tricks.as_strided(memory, values.shape, steps)
    array[...] = np.asarray(values)
    return array.view(DeviceArray)


@cache
def _library(code, flags=FLAGS):
    """Return the library of a source, compiled once."""
    folder = Path(tempfile.gettempdir(), "pteron-emulated-gpu")
    folder.mkdir(exist_ok=True)
    text = SHIM + code
    name = hashlib.sha256((text + " ".join(flags)).encode()).hexdigest()[:24]
    library = folder / f"{name}.so"
    if not library.exists():
        with tempfile.TemporaryDirectory(dir=folder) as made:
            (Path(made) / "kernel.cpp").write_text(text)
            command = ["g++", *flags, "kernel.cpp", "-o", "kernel.so"]
            done = subprocess.run(command, cwd=made, capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr
            (Path(made) / "kernel.so").rename(library)
    return ctypes.CDLL(str(library))


class RawModule:
    """A module of CUDA code."""

    def __init__(self, code, options=()):
        assert all(option.startswith(("-std=", "--fmad=", "--device-int128")) for option in options)
        self._library = _library(code)

    def get_function(self, name):
        """Return a function that launches a kernel."""
        kernel = getattr(self._library, name)

        def launch(grid, block, arguments):
            values = []
            for argument in arguments:
                if isinstance(argument, np.integer):
                    values.append(ctypes.c_longlong(int(argument)))
                else:
                    assert isinstance(argument, DeviceArray), type(argument)
                    values.append(ctypes.c_void_p(argument.ctypes.data))
            assert 0 < grid[0] < 2**31, "no grid of CUDA"
            blocks, threads = min(grid[0], GRID), min(block[0], BLOCK)
            for k in range(blocks * threads):
                self._library.set_thread(k // threads, k % threads, blocks, threads)
                kernel(*values)

        return launch


def module(available=True):
    """Return a module in place of CuPy."""
    cupy = ModuleType("cupy")
    cupy.ndarray, cupy.RawModule = DeviceArray, RawModule
    cupy.asarray, cupy.from_dlpack = asarray, from_dlpack
    cupy.empty = lambda shape, dtype=float: np.empty(shape, dtype).view(DeviceArray)
    cupy.broadcast_to = lambda array, shape: np.broadcast_to(array, shape, subok=True)
    cupy.ascontiguousarray = lambda array: np.ascontiguousarray(array).view(DeviceArray)
    cupy.zeros = lambda shape, dtype=float: np.zeros(shape, dtype).view(DeviceArray)
    cupy.is_available = lambda: available
    # What benchmarks use beside.
    cupy.tile = lambda array, count: np.tile(array, count).view(DeviceArray)
    cupy.ones = lambda size: np.ones(size).view(DeviceArray)
    cupy.copyto, cupy.asnumpy = np.copyto, np.array
    device = SimpleNamespace(mem_info=(2**32, 2**32), synchronize=lambda: None)
    runtime = SimpleNamespace(getDeviceProperties=lambda _: {"name": b"emulated"})
    cupy.cuda = SimpleNamespace(Device=lambda: device, runtime=runtime)
    return cupy


def sanitized(command):
    """Run a command whose emulated GPU traps what is undefined or outside of an array."""
    names = ("libasan.so", "libubsan.so")
    queries = [["g++", f"-print-file-name={name}"] for name in names]
    paths = [subprocess.check_output(query, text=True).strip() for query in queries]
    environment = {
        "EMULATED_GPU_FLAGS": " ".join(SANITIZERS),
        # An address space for shadows; what Python leaves at its end is no leak.
        "ASAN_OPTIONS": "detect_leaks=0",
        "LD_PRELOAD": " ".join(paths),
    }
    return subprocess.run(
        command, env=os.environ | environment, capture_output=True, text=True, check=False
    )


@contextmanager
def emulated(available=True):
    """Put the emulated GPU in CuPy's place."""
    from pteron.kernels import cuda

    before, sys.modules["cupy"] = sys.modules.get("cupy"), module(available)
    cuda.compiled_module.cache_clear()
    try:
        yield sys.modules["cupy"]
    finally:
        cuda.compiled_module.cache_clear()
        del sys.modules["cupy"]
        if before is not None:
            sys.modules["cupy"] = before
