"""Target `c`: C99 that this computer's compiler builds, as a module that Python calls directly.

Through Numba or ctypes a call costs more than the arithmetic: boxing one array takes Numba 450 ns.
So the module takes NumPy's arrays itself. A batch is computed in blocks held as structures of
arrays, one state a vector lane. Products and sums are not contracted to fused operations: it costs
nothing measurable here (17.5 against 16.8 ns a state without the sines), and the targets `vm`, `c`
and `numba` then return the same bits, whatever the size of the batch.
"""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import sys
import sysconfig
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache, partial
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import ModelError
from pteron.kernels.cache import digest, entry, find
from pteron.kernels.code import (
    C,
    Language,
    c_constant,
    module_values,
    render_template,
    single_precision,
)
from pteron.kernels.compilers import compile_library, run
from pteron.kernels.exponential import with_lowered_exponentials
from pteron.kernels.graph import LOAD, STORE, Graph, graph_of
from pteron.kernels.kernel import SHARE, Array, ArrayKernel, Port
from pteron.kernels.program_cache import cached_result, is_stored

FLAGS = (
    *("-std=c99", "-O3", "-march=native", "-fno-math-errno", "-fPIC"),
    # The traps of floating-point operations are not used; support for them keeps loops scalar.
    "-fno-trapping-math",
    # gcc 12 makes fused operations of pairs of statements even so (vfmaddsub), unless it is kept
    # from pairing them; loops, which are what is vectorised here, do not need that.
    *("-ffp-contract=off", "-fno-tree-slp-vectorize"),
)
"""Options of the compiler."""

LINKED = (
    "-shared",
    # On macOS a module must say that Python itself brings the symbols of its interface.
    *(("-undefined", "dynamic_lookup") if sys.platform == "darwin" else ()),
)
"""Options of a library."""

SUFFIX = EXTENSION_SUFFIXES[0]
"""The end of a library's name."""

_LIBRARY = "pteron_kernel" + SUFFIX


def c_compiler() -> tuple[str, ...] | None:
    """Return the C compiler's command as a tuple of words; None without a compiler.

    The environment variable CC names a compiler other than `cc` and `gcc`, with options: `CC="gcc
    -m64"`.
    """
    return _command(os.environ.get("CC", ""), os.environ.get("PATH", ""))


def compiler() -> tuple[str, ...] | None:
    """Return the C compiler's command; None without a compiler or Python's headers."""
    headers = Path(sysconfig.get_path("include"), "Python.h").exists()
    return c_compiler() if headers else None


@lru_cache(maxsize=4)
def _command(setting: str, path: str) -> tuple[str, ...] | None:
    """Return the compiler's executable and options from CC's value; None if not installed."""
    try:
        words = shlex.split(setting) or ["cc" if shutil.which("cc", path=path) else "gcc"]
    except ValueError:
        return None
    executable = shutil.which(words[0], path=path)
    return (executable, *words[1:]) if executable else None


@lru_cache(maxsize=4)
def compiler_version(command: tuple[str, ...]) -> str:
    """Return the version text that a compiler prints."""
    return run([*command, "--version"]).stdout


def module_source(
    name: str,
    graph: Graph,
    inputs: Sequence[Port],
    outputs: Sequence[Port],
    dtype: str,
    block: int = 32,
) -> str:
    """Return the C source of a module that evaluates a graph, in blocks of states.

    The module reads the caller's arrays in place, without copies.
    """
    variables = module_values(name, graph, inputs, outputs, c_language(dtype))
    return module_of("module.c.j2", variables, dtype, block)


def module_of(template: str, values: Mapping[str, Any], dtype: str, block: int = 32) -> str:
    """Return the C source of a module template filled with the values of `module_values`."""
    real = "float" if dtype == "float32" else "double"
    return render_template("pteron.kernels", template, real=real, block=block, **values)


def c_language(dtype: str) -> Language:
    """Return how operations, constants and statements are written in the C of modules."""
    printed = single_precision(C) if dtype == "float32" else C
    return Language(
        printed
        | {
            STORE: "{0}",
            LOAD: "{0}",
            "sin": "sincos_({0}).sine",
            "cos": "sincos_({0}).cosine",
            "fmin": "fmin_({0}, {1})",
            "fmax": "fmax_({0}, {1})",
        },
        form="const real {0} = {1};",
        near_form="const double {0} = {1};",
        constant=partial(c_constant, dtype=dtype),
        pair="const pair a{0} = sincos_({1});",
        parts={"sin": "a{0}.sine", "cos": "a{0}.cosine"},
        cell="in[{0}][k]",
        stored="out[{0}][k] = {1};",
        returned="{0}[{1}] = {2};",
    )


class Code:
    """The C code of a function, compiled when it is first called; kernels may share it."""

    def __init__(
        self,
        name: str,
        function: ca.Function,
        inputs: tuple[Port, ...],
        outputs: tuple[Port, ...],
        dtype: str = "float64",
    ) -> None:
        self.name = name
        self.ports = inputs
        self.dtype = dtype
        self._program = function, outputs
        self._module: ModuleType | None = None

    @property
    def instruction_count(self) -> int:
        """The number of CasADi's instructions, inputs and outputs included."""
        count: int = self._program[0].n_instructions()
        return count

    @cached_property
    def source(self) -> str:
        """The C code, cached on disk: writing it takes 0.1 s and more."""
        return cached_result(self._key, ("templates",), self._write_source)

    @cached_property
    def _key(self) -> tuple[Any, ...]:
        """The cache key of the source: all that the C code depends on."""
        function, outputs = self._program
        parts = self.name, function.serialize(), self.ports, outputs, self.dtype
        return "c source", *parts, version("jinja2")

    def _write_source(self) -> str:
        """Return the C source of the module that evaluates the function."""
        function, outputs = self._program
        graph = graph_of(with_lowered_exponentials(function), self.ports)
        return module_source(self.name, graph, self.ports, outputs, self.dtype)

    @property
    def _entry(self) -> str:
        """The name of the compiled library in the cache; raises ModelError without a compiler."""
        command = compiler()
        if command is None:
            setting = os.environ.get("CC")
            why = f"CC={setting} is not one" if setting else "which are not here"
            raise ModelError(
                f'target: "c" needs a C compiler and Python\'s headers, {why}; '
                'install them, or use "vm" or "numba"'
            )
        return f"c-{self.name}-{digest(self.source, *command, compiler_version(command), *FLAGS)}"

    def is_cached(self) -> bool:
        """Return whether the compiled code is on disk, ready to be loaded."""
        return is_stored(self._key, ("templates",)) and find(self._entry, _LIBRARY) is not None

    @property
    def module(self) -> ModuleType:
        """The Python module of the compiled C code, loaded on first use.

        It is not a `cached_property`, on whose lock a forked process could wait for ever if another
        thread held it.
        """
        if self._module is None:
            self._module = self._load_module()
        return self._module

    def _load_module(self) -> ModuleType:
        """Return the compiled library as a Python module, from the cache or compiled on demand."""
        path = str(entry(self._entry, _LIBRARY, self._build))
        loader = ExtensionFileLoader("pteron_kernel", path)
        spec = importlib.util.spec_from_file_location("pteron_kernel", path, loader=loader)
        assert spec is not None
        try:
            module = importlib.util.module_from_spec(spec)
            loader.exec_module(module)
        except ImportError as error:
            raise ModelError(
                f'target: "c" was compiled with {" ".join(compiler() or ())} to what Python cannot '
                f'load ({error}); use "vm" or "numba", or set CC to another compiler'
            ) from None
        return module

    def _build(self, folder: Path) -> None:
        """Compile the source to the library in a folder; ModelError if the compiler fails."""
        command = compiler()
        assert command is not None  # `_entry` has asked
        headers = (f"-I{path}" for path in (sysconfig.get_path("include"), np.get_include()))
        advice = 'use "vm" or "numba", or set CC to another compiler'
        flags, sources = [*FLAGS, *headers, *LINKED], {"kernel.c": self.source}
        compile_library(command, flags, sources, folder / _LIBRARY, 'target: "c"', advice)

    def bound(
        self, fixed: Mapping[str, Array], otherwise: Callable[..., Any], most: int = sys.maxsize
    ) -> Callable[..., Any]:
        """Return a fast callable of the compiled code with the inputs in `fixed` bound.

        Calls with inputs that need conversion or checks, and batches of `most` states or more, are
        passed to `otherwise`.
        """
        fixed_arrays = (
            np.array(fixed[port.name], self.dtype).reshape(port.shape)
            if port.name in fixed
            else None
            for port in self.ports
        )
        bound: Callable[..., Any] = self.module.bind(otherwise, most, *fixed_arrays)
        return bound


class Compiled(ArrayKernel):
    """A kernel in machine code."""

    _strided = True

    @cached_property
    def code(self) -> Code:
        """The C code of the kernel, with its compiled module."""
        return Code(self.name, self.function, self.ports, self.outputs, self.dtype)

    @property
    def source(self) -> str:
        """The C source of the kernel."""
        return self.code.source

    def _evaluate(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        """Evaluate the first call; later calls go straight to the compiled function."""
        # Threads are for batches: `evaluate_checked` splits them.
        most = 2 * SHARE if self.threads > 1 else sys.maxsize
        self.call = self.code.bound(self.fixed, self.evaluate_checked, most)
        return self.call(*values, **fixed)

    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Fill `outputs` from `inputs` by the compiled function."""
        self.code.module.run(*inputs, *outputs)
