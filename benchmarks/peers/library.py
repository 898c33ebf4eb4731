"""C and C++ sources that lie beside this file, compiled and loaded.

What is compiled is kept in the cache that Pteron's own kernels use: Pinocchio's templates take most
of a minute.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from ctypes import c_double, c_int64, c_void_p
from pathlib import Path

import numpy as np

from peers.closure import Array
from pteron.kernels.cache import digest, entry

__all__ = ["Missing", "Sweep", "compiled"]

_FLAGS = ("-O3", "-march=native", "-DNDEBUG", "-shared", "-fPIC", "-w")
"""The usual ones; -w because the headers of others warn."""


class Missing(Exception):
    """A peer lacks something; the message says what."""


def compiled(
    compiler: str,
    source: str,
    options: Sequence[str],
    version: str,
    closed_form: str,
) -> ctypes.CDLL:
    """Compile a source that lies beside this file, or find it compiled, and load it.

    Parameters
    ----------
    compiler : str
        The command, such as ``"gcc"``.
    source : str
        The file's name.
    options : sequence of str
        What goes after the source: flags, include directories and libraries.
    version : str
        Of the engine whose headers and libraries the options name.
    closed_form : str
        The text of the header with the closed form around it.

    Returns
    -------
    ctypes.CDLL

    Raises
    ------
    Missing
        If there is no such compiler, or if it fails.
    """
    command = shutil.which(compiler)
    if command is None:
        raise Missing(f"{compiler}: no such compiler")
    path = Path(__file__).with_name(source)
    banner = subprocess.run([command, "--version"], capture_output=True, text=True, check=False)
    texts = [path.read_text(encoding="utf-8"), closed_form]
    name = f"peer-{path.stem}-{digest(*texts, banner.stdout, version, *_FLAGS, *options)}"
    library = f"{path.stem}.so"

    def build(folder: Path) -> None:
        header = folder / "closed_form.h"
        header.write_text(closed_form, encoding="utf-8")
        flags = [*_FLAGS, f'-DCLOSED_FORM="{header}"']
        run = subprocess.run(
            [command, *flags, str(path), *options, "-o", str(folder / library)],
            capture_output=True,
            text=True,
            check=False,
        )
        if run.returncode:
            errors = [line for line in run.stderr.splitlines() if "error" in line]
            raise Missing(f"{compiler} cannot compile {source}: {(errors or [run.stderr])[0]}")

    try:
        return ctypes.CDLL(str(entry(name, library, build)))
    except OSError as error:
        raise Missing(f"{source}: {error}") from None


class Sweep:
    """A compiled peer: the functions `create` and `sweep` of its library.

    Parameters
    ----------
    library : ctypes.CDLL
        The library.
    *arguments : ctypes value
        What its `create` asks for.
    """

    def __init__(self, library: ctypes.CDLL, *arguments: object) -> None:
        library.create.restype = c_void_p
        library.sweep.restype = c_double
        library.sweep.argtypes = [c_void_p, c_int64, *[c_void_p] * 4]
        self._sweep = library.sweep
        self._peer = library.create(*arguments)
        if not self._peer:
            raise Missing("the engine does not take the tree")

    def _run(self, pose: Array, velocity: Array, acceleration: Array) -> tuple[Array, float]:
        states = [np.ascontiguousarray(x, dtype=float) for x in (pose, velocity, acceleration)]
        found = np.empty_like(states[0])
        pointers = [x.ctypes.data for x in (*states, found)]
        return found, float(self._sweep(self._peer, len(found), *pointers))

    def forces(self, pose: Array, velocity: Array, acceleration: Array) -> Array:
        """Return the actuator forces (B, n)."""
        return self._run(pose, velocity, acceleration)[0]

    def seconds(self, pose: Array, velocity: Array, acceleration: Array) -> float:
        """Return the seconds a state that one sweep over the batch takes, timed in C."""
        return self._run(pose, velocity, acceleration)[1] / len(pose)
