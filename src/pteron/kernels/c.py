"""Target `c`: C99 that the machine's own compiler builds, as a module that Python calls directly.

Through Numba or ctypes a call costs more than the arithmetic: boxing one array takes Numba 450 ns.
So the module takes NumPy's arrays itself. A batch is computed in blocks held as structures of
arrays, one state a vector lane. Products and sums are not contracted to fused operations: it costs
nothing measurable here (17.5 against 16.8 ns a state without the sines), and every float64 target
then returns the same bits, whatever the size of the batch.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sysconfig
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from pteron.errors import ModelError
from pteron.kernels.c_module import module_source
from pteron.kernels.cache import digest, entry, find
from pteron.kernels.graph import graph_of
from pteron.kernels.kernel import Array, ArrayKernel

__all__ = ["Compiled", "compiler"]

_FLAGS = (
    *("-std=c99", "-O3", "-march=native", "-fno-math-errno", "-fPIC"),
    # gcc 12 makes fused operations of pairs of statements even so (vfmaddsub), unless it is kept
    # from pairing them; loops, which are what is vectorised here, do not need that.
    *("-ffp-contract=off", "-fno-tree-slp-vectorize"),
)


@lru_cache(maxsize=1)
def compiler() -> str | None:
    """Return the C compiler, if there is one and Python's headers are there too."""
    given = os.environ.get("CC")
    found = shutil.which(given) if given else shutil.which("cc") or shutil.which("gcc")
    headers = Path(sysconfig.get_path("include"), "Python.h").exists()
    return found if headers else None


@lru_cache(maxsize=1)
def _version(compiler: str) -> str:
    done = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False)
    return done.stdout


@dataclass(frozen=True)
class Compiled(ArrayKernel):
    """A kernel in machine code."""

    _strided = True

    @cached_property
    def source(self) -> str:
        """The C code."""
        graph = graph_of(self.function, self.inputs)
        return module_source(self.name, graph, self.inputs, self.outputs, self.dtype)

    @property
    def _name(self) -> str:
        path = compiler()
        if path is None:
            raise ModelError(
                'target: "c" needs a C compiler and Python\'s headers, which are not here; '
                'install them, or use "numba"'
            )
        return f"c-{self.name}-{digest(self.source, _version(path), *_FLAGS)}"

    def is_cached(self) -> bool:
        """Return whether the code is on disk, ready to be loaded."""
        return find(self._name) is not None

    def prepare(self) -> None:
        """Compile the code now, or load it."""
        _ = self._module

    @cached_property
    def _module(self) -> ModuleType:
        return _load(entry(self._name, self._build))

    def _build(self, folder: Path) -> None:
        path = compiler()
        assert path is not None  # `_name` has asked
        source, library = folder / "kernel.c", folder / _LIBRARY
        source.write_text(self.source, encoding="utf-8")
        headers = (sysconfig.get_path("include"), np.get_include())
        command = [path, *_FLAGS, *(f"-I{header}" for header in headers), "-shared"]
        command += [str(source), "-o", str(library), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            raise ModelError(
                f'target: "c" could not be compiled with {path}: {lines[0]}; use "numba", or set '
                "CC to another compiler"
            )

    def with_fixed(self, fixed: dict[str, Array]) -> Compiled:
        """Return the kernel with other fixed inputs, and the code that is already loaded."""
        other = replace(self, fixed=fixed)
        other.__dict__.update(source=self.source, _module=self._module)
        return other

    @cached_property
    def _direct(self) -> Callable[..., Any] | None:
        call: Callable[..., Any] = self._module.call
        given = [port.name in self.fixed for port in self.inputs]
        if given != sorted(given):
            return None
        fixed = [
            np.ascontiguousarray(self.fixed[port.name], dtype=self.dtype).reshape(port.shape)
            for port in self.inputs
            if port.name in self.fixed
        ]
        if self.threads > 1:
            # Threads are for batches: those go through `_checked`, which splits them.
            return lambda *values: (
                call(*values, *fixed) if values and getattr(values[0], "ndim", 2) < 2 else None
            )
        return (lambda *values: call(*values, *fixed)) if fixed else call

    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        self._module.run(*inputs, *outputs)


_LIBRARY = "pteron_kernel" + EXTENSION_SUFFIXES[0]


def _load(folder: Path) -> ModuleType:
    path = str(folder / _LIBRARY)
    loader = ExtensionFileLoader("pteron_kernel", path)
    spec = importlib.util.spec_from_file_location("pteron_kernel", path, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module
