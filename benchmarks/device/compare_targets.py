"""Equality and speed of exported CUDA; needs NumPy and CuPy, and JAX for one column.

It stands beside the files that `benchmarks/gpu.py FOLDER` writes. `--seconds` bounds each timing.
"""

import argparse
import importlib.util
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

cupy: Any = importlib.import_module("cupy")

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
MACHINES = sorted(path.stem.removesuffix("_states") for path in HERE.glob("*_states.npz"))
PORT = np.dtype([("numbers", np.uintp), ("machine", "l"), ("sample", "l")], align=True)


def seconds_of(call: Callable[[], Any], most: float) -> float:
    """Return the least seconds of some calls, by the clock, after one to warm up."""
    call()
    cupy.cuda.Device().synchronize()
    times: list[float] = []
    begin = perf_counter()
    while perf_counter() - begin < most or len(times) < 3:
        start = perf_counter()
        call()
        cupy.cuda.Device().synchronize()
        times.append(perf_counter() - start)
    return min(times)


def compare_states(name: str) -> None:
    """Print how many numbers of a machine's functions equal those of the C target."""
    code, states = importlib.import_module(f"{name}_cuda"), np.load(HERE / f"{name}_states.npz")
    motion = [states[key] for key in ("pose", "velocity", "acceleration")]
    calls: dict[str, Callable[[], Any]] = {
        "joints": lambda: code.inverse_kinematics(motion[0]),
        "forces": lambda: code.inverse_dynamics(*motion),
        "accelerations": lambda: code.forward_dynamics(*motion[:2], states["forces"]),
    }
    for key, call in calls.items():
        result, status = (cupy.asnumpy(array) for array in call())
        same = int(((result == states[key]) | (np.isnan(result) & np.isnan(states[key]))).sum())
        scale = np.nanmax(np.abs(states[key]))
        error = np.nanmax(np.abs(result - states[key])) / scale
        print(
            f"{name:14} {key:14} {same} of {result.size} numbers equal, greatest difference "
            f"{error:.1e} of {scale:.3g}, status 0 in {int((status == 0).sum())}"
        )


def loop_arguments(file: Any) -> tuple[dict[str, Any], tuple[Any, ...]]:
    """Return a loop's arrays on the GPU and the arguments of its kernel."""
    arrays = {
        key.removeprefix("before_"): cupy.asarray(file[key])
        for key in file.files
        if key.startswith("before_")
    }
    ports = np.zeros(len(file["names"]), PORT)
    for port, name in zip(ports, file["names"], strict=True):
        if (array := arrays.get(str(name))) is not None:
            steps = [array.strides[k] // 8 if array.shape[k] > 1 else 0 for k in (0, 1)]
            port["numbers"], port["machine"], port["sample"] = array.data.ptr, *steps
    tables = file["times"], file["counts"].astype("l"), np.frombuffer(ports.tobytes(), np.uint8)
    count, samples = len(arrays["state"]), int(file["samples"])
    return arrays, (np.int64(count), np.int64(samples), *map(cupy.asarray, tables))


def compare_rollouts(name: str) -> None:
    """Print how many final states of rollouts equal those of the C target, and steps a second."""
    file, text = np.load(HERE / f"{name}_rollouts.npz"), (HERE / f"{name}_loop.cu").read_text()
    start = perf_counter()
    module = cupy.RawModule(code=text, options=("-std=c++17", "--fmad=false"))
    kernel = module.get_function("run")
    compiling = perf_counter() - start
    arrays, arguments = loop_arguments(file)
    count = int(arguments[0])
    kernel((-(-count // 64),), (64,), arguments)
    states = cupy.asnumpy(arrays["state"])
    same = int((states == file["after_state"]).sum())
    error = np.abs(states - file["after_state"]).max()
    print(
        f"{name:14} rollouts of {count}: {same} of {states.size} numbers equal, greatest "
        f"difference {error:.1e}; compiled in {compiling:.1f} s"
    )


def time_copy(size: int, most: float) -> None:
    """Print bytes a second that a copy reads and writes."""
    array, other = cupy.ones(size), cupy.empty(size)
    seconds = seconds_of(lambda: cupy.copyto(other, array), most)
    print(f"a copy of the card's memory: {2 * array.nbytes / seconds / 1e9:.0f} GB/s")


def time_states(name: str, sizes: Sequence[int], most: float) -> None:
    """Print states a second of the inverse dynamics, and bytes a second, by size of the batch."""
    code, states = importlib.import_module(f"{name}_cuda"), np.load(HERE / f"{name}_states.npz")
    motion = [cupy.asarray(states[key]) for key in ("pose", "velocity", "acceleration")]
    width = motion[0].shape[1]
    for size in sizes:
        if size * width * 8 * 5 > 0.6 * cupy.cuda.Device().mem_info[0]:
            break
        rows = -(-size // len(motion[0]))
        inputs = [cupy.tile(array, (rows, 1))[:size] for array in motion]
        seconds = seconds_of(partial(code.inverse_dynamics, *inputs), most)
        rate = size / seconds
        print(f"{name:14} {size:>10} states: {rate:.3g} /s, {rate * width * 32 / 1e9:.0f} GB/s")


def time_jax(name: str, size: int, most: float) -> None:
    """Print states a second of JAX's own code."""
    if importlib.util.find_spec("jax") is None:
        print(f"{name:14} JAX is not here")
        return
    jax: Any = importlib.import_module("jax")
    jax.config.update("jax_enable_x64", True)
    jnp = jax.numpy
    space: dict[str, Any] = {
        key: getattr(jnp, key) for key in ("sqrt", "sin", "cos", "exp", "floor", "fmin")
    }
    space |= {"fmax": jnp.fmax, "where": jnp.where, "nan": jnp.nan, "atan2": jnp.arctan2}
    space |= {"fabs": jnp.abs, "stack": lambda *parts: jnp.stack(parts, axis=-1)}
    exec((HERE / f"{name}_jax.py").read_text(), space)
    states = np.load(HERE / f"{name}_states.npz")
    rows = -(-size // len(states["pose"]))
    keys = ("pose", "velocity", "acceleration")
    motion = [jnp.asarray(np.tile(states[key], (rows, 1))[:size]) for key in keys]
    function = jax.jit(space["inverse_dynamics"])
    seconds = seconds_of(lambda: jax.block_until_ready(function(*motion)), most)
    platform = jax.devices()[0].platform
    print(f"{name:14} {size:>10} states by JAX on {platform}: {size / seconds:.3g} /s")


def main() -> None:
    """Compare and time all machines of the folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=0.3)
    parser.add_argument("--largest", type=float, default=1e8)
    options = parser.parse_args()
    properties = cupy.cuda.runtime.getDeviceProperties(0)
    print("card:", properties["name"].decode())
    time_copy(int(min(options.largest, 1e8)), options.seconds)
    for name in MACHINES:
        compare_states(name)
        compare_rollouts(name)
    sizes = [10**k for k in range(3, 9) if 10**k <= options.largest]
    for name in MACHINES:
        time_states(name, sizes, options.seconds)
        time_jax(name, min(10**6, sizes[-1]), options.seconds)


if __name__ == "__main__":
    main()
