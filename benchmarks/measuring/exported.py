"""The exported C99, compiled with a loop around it in which each call waits for the last."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Sequence
from ctypes import c_double, c_float, c_long, c_void_p
from functools import partial
from pathlib import Path

import numpy as np

import pteron
from measuring import Array, Contestant, States, relative_error
from pteron.export import Real

__all__ = ["FORMS", "LEVELS", "exported"]

LEVELS: tuple[tuple[str, ...], ...] = (
    ("-O2",),
    ("-O2", "-fno-tree-slp-vectorize"),
    ("-O3", "-march=native"),
    ("-O3", "-march=native", "-fno-tree-slp-vectorize"),
)
"""Compiler options: as is usual for a controller, and for this processor.

GCC gathers lone scalars into short vectors, from 12 on at -O2 too; in straight-line code like this
the gathering costs more than it saves.
"""

FORMS = {
    "standard": ("inverse_dynamics", False),
    "base": ("inverse_dynamics_base", False),
    "specialised": ("inverse_dynamics", True),
    "base, specialised": ("inverse_dynamics_base", True),
}
"""Exported function, and whether the machine's numbers are folded in."""

_FLAGS = ("-std=c99", "-fPIC", "-fvisibility=hidden")
_LOOP = ("-O2", "-fno-tree-vectorize")
"""The loop's own flags, always the same."""

_COUNT = 20_000


def exported(
    robot: pteron.Manipulator,
    compiler: Sequence[str],
    folder: Path,
    form: str,
    real: Real,
    level: tuple[str, ...],
    states: States,
    expected: Array,
) -> Contestant:
    """Return the contestant.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    compiler : sequence of str
        The C compiler's command.
    folder : path
        An empty folder, whose files must stay.
    form : str
        One of `FORMS`.
    real : {"double", "float"}
        The numbers' type.
    level : tuple of str
        The compiler's flags.
    states : tuple of array
        As many as a power of two.
    expected : array
        Their forces.
    """
    function, specialised = FORMS[form]
    source = pteron.export_c(robot, [function], folder, real=real, specialised=specialised)
    name = next(path.stem for path in source if path.suffix == ".h")
    defined = [f'-DHEADER="{name}.h"', f"-DREAL={real}", f"-DFUNCTION={name}_{function}"]
    defined += [f"-DM={expected.shape[1]}"]
    if not specialised:
        table = "base_parameters" if function == "inverse_dynamics_base" else "parameters"
        defined.append(f"-DTABLE={name}_{table}")
    library, loop = folder / "latency.so", folder / "latency.o"
    driver = [str(Path(__file__).with_name("latency.c")), *defined, f"-I{folder}"]
    subprocess.run([*compiler, *_FLAGS, *_LOOP, *driver, "-c", "-o", str(loop)], check=True)
    function_itself = [*level, str(folder / f"{name}.c"), str(loop)]
    subprocess.run(
        [*compiler, *_FLAGS, "-shared", *function_itself, "-o", str(library), "-lm"], check=True
    )

    loaded = ctypes.CDLL(str(library))
    number = c_double if real == "double" else c_float
    loaded.evaluate.argtypes = [c_void_p, c_void_p]
    loaded.latency.argtypes = [c_long, c_long, c_void_p, number, c_void_p]
    loaded.latency.restype = c_double
    given = np.ascontiguousarray(np.concatenate(states, axis=-1), dtype=real_type(real))
    found = np.zeros_like(expected, dtype=given.dtype)
    for row, forces in zip(given, found, strict=True):
        if loaded.evaluate(row.ctypes.data, forces.ctypes.data) != 0:
            raise ValueError(f"{name}: the exported function does not take a state")
    last = np.zeros_like(found[0])
    kept = partial(_seconds, loaded, given, last)
    return Contestant(
        f"{form}, {real}, {' '.join(level)}", kept, relative_error(found.astype(float), expected)
    )


def real_type(real: Real) -> str:
    """Return NumPy's name of a type of C."""
    return "float64" if real == "double" else "float32"


def _seconds(loaded: ctypes.CDLL, given: Array, last: Array) -> float:
    addresses = given.ctypes.data, 0.0, last.ctypes.data
    return float(loaded.latency(_COUNT, len(given) - 1, *addresses))
