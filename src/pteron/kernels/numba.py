"""Target `numba`: straight-line Python that Numba compiles, for machines without a C compiler.

There are two functions: one for a single state, and one for batches, in blocks of states held as
structures of arrays, in loops that LLVM turns into vector code. Numba caches the result on disk
within an entry of `kernels.cache`, which tells whether it is whole.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Sequence
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import ModelError
from pteron.extras import install_command
from pteron.kernels.cache import digest, entry, find
from pteron.kernels.code import PYTHON, Language, module_values, render_template
from pteron.kernels.exponential import with_lowered_exponentials
from pteron.kernels.graph import Graph, graph_of
from pteron.kernels.kernel import Array, ArrayKernel, Port

_FILE = "kernel.py"

_BLOCK = 64
"""States in a block."""


class Jitted(ArrayKernel):
    """A kernel that Numba compiles."""

    @cached_property
    def source(self) -> str:
        """The Python source of the Numba function."""
        graph = graph_of(with_lowered_exponentials(self.function), self.ports)
        return _source(self.name, graph, self.ports, self.outputs)

    @property
    def _entry(self) -> str:
        """The cache name of the compiled module; raises ModelError if Numba is not installed."""
        if importlib.util.find_spec("numba") is None:
            raise ModelError(
                f'target: "numba" needs Numba, which is not installed; {install_command("numba")}'
            )
        return f"numba-{self.name}-{digest(self.source, version('numba'), version('llvmlite'))}"

    def is_cached(self) -> bool:
        """Return whether the compiled function is in the disk cache."""
        return find(self._entry, _FILE) is not None

    @cached_property
    def _module(self) -> ModuleType:
        """The Python module with the compiled function, from the cache or written on demand."""
        name = self._entry

        def build(folder: Path) -> None:
            """Write the module's source to a folder and import it there, which compiles it."""
            (folder / _FILE).write_text(self.source, encoding="utf-8")
            _load(folder / _FILE, name)

        return _load(entry(name, _FILE, build), name)

    def _evaluate(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        """Evaluate the first call; later calls go straight to the compiled function."""
        self.call = self._direct()
        return self.call(*values, **fixed)

    def _direct(self) -> Callable[..., Any]:
        """Return the fastest callable of the kernel: direct for plain arrays, checked otherwise."""
        evaluate_state = self._module.one  # which says in a line if Numba is missing
        from numba.core.errors import NumbaError

        evaluate_any, count, empty = self.evaluate_checked, len(self.inputs), np.empty
        shapes = [port.shape for port in self.outputs]
        sizes = [port.size for port in self.outputs]
        order = [port.name in self.fixed for port in self.ports]
        known = [
            np.array(number, dtype=float).ravel()
            for number in (self.fixed[p.name] for p in self.ports if p.name in self.fixed)
        ]

        def call(*values: Any, **fixed: Any) -> Any:
            """Return the outputs: directly for plain vectors, otherwise after checks."""
            if not fixed and len(values) == count and getattr(values[0], "ndim", 0) == 1:
                outputs = [empty(size) for size in sizes]
                try:
                    if evaluate_state(*values, *known, *outputs):
                        if len(outputs) == 1:
                            return outputs[0].reshape(shapes[0])
                        return tuple(map(np.reshape, outputs, shapes))
                except (TypeError, NumbaError):  # integers, or not to be written
                    pass
            return evaluate_any(*values, **fixed)

        # Fixed inputs come last, as `compile` has them.
        return call if order == sorted(order) else evaluate_any

    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Fill `outputs` from `inputs` by the compiled function."""
        # To Numba an array that must not be written is of another type.
        writable = [array if array.flags.writeable else array.copy() for array in inputs]
        self._module.run(*writable, *outputs)


def _load(path: Path, name: str) -> ModuleType:
    """Import a Python file as the module `name`, under which Numba finds its cache."""
    name = name.replace("-", "_")
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    written = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = written
    return module


def _source(name: str, graph: Graph, inputs: Sequence[Port], outputs: Sequence[Port]) -> str:
    """Return the Python source of the module that Numba compiles."""
    language = Language(
        PYTHON | {"sin": "sine({0})", "cos": "cosine({0})"},
        form="{0} = {1}",
        near_form="{0} = {1}",
        constant=lambda value: f"({value!r})" if value < 0 else repr(value),
        pair="s{0}, c{0} = sincos({1})",
        parts={"sin": "s{0}", "cos": "c{0}"},
        cell="block[{0}, k]",
        stored="result[{0}, k] = {1}",
        returned="{0}[{1}] = {2}",
    )
    template_values = module_values(name, graph, inputs, outputs, language)
    return render_template("pteron.kernels", "numba.py.j2", width=_BLOCK, **template_values)
