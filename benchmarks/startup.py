"""Start-up: a fresh Python process to its first result, with a filled cache.

Each process imports pteron, compiles the quadrupteron's inverse dynamics and computes one state. A
first start finds an empty cache, a second one what the first has left. Also what the import brings.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
from measuring import quick

from pteron.kernels.c import compiler

_EMPTY = "print('[]', flush=True)"
_IMPORT = "import pteron, sys, json; print(json.dumps(sorted(sys.modules)), flush=True)"
_RESULT = """\
import pteron
kernel = pteron.compile(pteron.load("quadrupteron"), "inverse_dynamics", "{target}")
forces = kernel([0.01, -0.02, 0.03, 0.2], [0.1, 0.0, -0.2, 1.0], [2.0, 1.0, 0.0, 5.0])
print(forces.tolist(), flush=True)
"""

_BRINGS = ("casadi", "numpy", "numba", "llvmlite", "jax", "scipy", "sympy", "pydantic", "polars")


def main() -> None:
    """Print the times of first and second starts, and the modules of the import."""
    rounds = 1 if quick() else 7
    targets = ["c", "numba"]
    if compiler() is None:
        print("target c: left out, no C compiler")
        targets.remove("c")
    if quick():
        del targets[1:]
    names = ["python alone", "import pteron"]
    names += [f"{start}, {target}" for target in targets for start in ("first", "second")]
    times: dict[str, list[float]] = {name: [] for name in names}
    start(_IMPORT, None)  # the disk's cache is warm from here on
    for _ in range(rounds):
        times["python alone"].append(start(_EMPTY, None)[0])
        with tempfile.TemporaryDirectory() as folder:
            seconds, brought = start(_IMPORT, folder)
            times["import pteron"].append(seconds)
            compiled = entries(folder)
        for target in targets:
            code = _RESULT.format(target=target)
            with tempfile.TemporaryDirectory() as folder:
                times[f"first, {target}"].append(start(code, folder)[0])
                first = entries(folder)
                times[f"second, {target}"].append(start(code, folder)[0])
                if not first or entries(folder) != first:
                    sys.exit(f"target {target}: the second start has not used the cache")

    print(f"Seconds from the start of a process to its result, {rounds} rounds taking turns")
    print(f"{'':<24}{'median':>9}{'min':>9}{'max':>9}")
    for name, seconds_of in times.items():
        middle, least, most = np.median(seconds_of), min(seconds_of), max(seconds_of)
        print(f"{name:<24}{middle:>9.2f}{least:>9.2f}{most:>9.2f}")
    print("The second start compiles nothing: the cache's files are those of the first, untouched.")

    there = [name for name in _BRINGS if name in brought]
    absent = [name for name in _BRINGS if name not in brought]
    print(f"\nimport pteron: {len(brought)} modules; compiled code left in the cache:", end=" ")
    print(", ".join(compiled) if compiled else "none")
    print(f"It imports {', '.join(there)}; it does not import {', '.join(absent)}.")
    if compiled or {"numba", "jax"} & set(there):
        sys.exit("import pteron compiles, or imports a compiler")


def start(code: str, cache: str | None) -> tuple[float, list[object]]:
    """Run a fresh Python; return the seconds until its result is here, and the result."""
    environment = dict(os.environ)
    if cache is not None:
        environment["PTERON_CACHE"] = cache
    begin = perf_counter()
    with subprocess.Popen(
        [sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        seconds = perf_counter() - begin
        process.communicate()
    if process.returncode != 0:
        sys.exit("a process has failed")
    result: list[object] = json.loads(line)
    return seconds, result


def entries(folder: str) -> dict[str, int]:
    """Return the files of a cache with the times at which they were written."""
    files = sorted(path for path in Path(folder).rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.stat().st_mtime_ns for path in files}


if __name__ == "__main__":
    main()
