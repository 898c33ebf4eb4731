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
import re
import shutil
import subprocess
import sysconfig
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from pteron.errors import ModelError
from pteron.kernels.cache import digest, entry, find
from pteron.kernels.code import C, c_constant, names_of, statements, used_inputs
from pteron.kernels.graph import Graph, graph_of
from pteron.kernels.kernel import Array, Kernel, Port

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
class Compiled(Kernel):
    """A kernel in machine code."""

    _strided = True

    @cached_property
    def source(self) -> str:
        """The C code."""
        graph = graph_of(self.function, self.inputs)
        return _source(self.name, graph, self.inputs, self.outputs, self.dtype)

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
                call(*values, *fixed) if values and np.ndim(values[0]) < 2 else None
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


def _source(
    name: str, graph: Graph, inputs: Sequence[Port], outputs: Sequence[Port], dtype: str
) -> str:
    real = "float" if dtype == "float32" else "double"
    printed = C
    if dtype == "float32":
        printed = single_precision(C)
    arguments = ", ".join(
        [f"const real *restrict {port.name}" for port in inputs]
        + [f"real *restrict {port.name}_out" for port in outputs]
    )
    batched = [port.name for port in inputs if not port.shared]
    strides = "".join(f", const npy_intp *{name}_strides" for name in batched)
    pieces = {
        "strides": strides,
        "name": name,
        "real": real,
        "npy": "NPY_FLOAT" if dtype == "float32" else "NPY_DOUBLE",
        "arguments": arguments,
        "one": _one(graph, inputs, outputs, printed, dtype),
        "sweep": _sweep(graph, inputs, outputs, printed, dtype),
        "glue": _glue(inputs, outputs),
    }
    return _TEMPLATE.format(**pieces)


def single_precision(printed: Mapping[str, str]) -> dict[str, str]:
    """Return the operations with math.h's functions for float: sqrtf for sqrt, and so on."""
    return {op: re.sub(r"^(\w+)\(", r"\1f(", text) for op, text in printed.items()}


def _constant(dtype: str) -> Callable[[float], str]:
    return lambda value: c_constant(value, dtype)


def _lines(lines: Sequence[str], depth: int) -> str:
    return "\n".join("    " * depth + line for line in lines)


def _one(
    graph: Graph,
    inputs: Sequence[Port],
    outputs: Sequence[Port],
    printed: dict[str, str],
    dtype: str,
) -> str:
    names = names_of(graph, lambda i, j: f"{inputs[i].name}[{j}]", _constant(dtype))
    lines = statements(graph, graph.operations(), names, printed, "const real {0} = {1};")
    for port, nodes in zip(outputs, graph.outputs, strict=True):
        lines += [f"{port.name}_out[{j}] = {names[k]};" for j, k in enumerate(nodes)]
    return _lines(lines, 1)


def _sweep(
    graph: Graph,
    inputs: Sequence[Port],
    outputs: Sequence[Port],
    printed: dict[str, str],
    dtype: str,
) -> str:
    """Return the body of the function for a batch: blocks of states, their values side by side."""
    used = [(i, j) for i, j in used_inputs(graph) if not inputs[i].shared]
    place = {pair: k for k, pair in enumerate(used)}
    operations = graph.operations()
    outlying = [k for k in operations if graph.nodes[k].outlying]

    def input_name(i: int, j: int) -> str:
        return f"{inputs[i].name}[{j}]" if inputs[i].shared else f"in[{place[i, j]}][k]"

    names = names_of(graph, input_name, _constant(dtype))
    shared = [k for k in operations if graph.nodes[k].shared]
    rest = [k for k in operations if not graph.nodes[k].shared and not graph.nodes[k].outlying]
    lines = statements(graph, shared, names, printed, "const real {0} = {1};")
    rows = len(used) + len(outlying)
    results = [
        (port, j, k)
        for port, nodes in zip(outputs, graph.outputs, strict=True)
        for j, k in enumerate(nodes)
    ]
    lines += [
        f"real in[{max(rows, 1)}][BLOCK], out[{len(results)}][BLOCK];",
        "for (npy_intp start = 0; start < n; start += BLOCK) {",
        "    const npy_intp count = n - start < BLOCK ? n - start : BLOCK;",
        "    if (packed) for (npy_intp k = 0; k < count; k++) {",
        *(
            f"        in[{row}][k] = {inputs[i].name}[{inputs[i].size} * (start + k) + {j}];"
            for (i, j), row in place.items()
        ),
        "    }",
        "    else for (npy_intp k = 0; k < count; k++) {",
        *(
            f"        in[{row}][k] = {inputs[i].name}[{_place(inputs[i].name, j)}];"
            for (i, j), row in place.items()
        ),
        "    }",
    ]
    if outlying:
        lines.append("    for (npy_intp k = 0; k < count; k++) {")
        for row, k in enumerate(outlying, len(used)):
            node = graph.nodes[k]
            value = printed[node.operation].format(names[node.arguments[0]])
            names[k] = f"in[{row}][k]"
            lines.append(f"        {names[k]} = {value};")
        lines.append("    }")
    lines += [
        "    /* A block that is not full repeats its last state: full vectors, no surprises. */",
        "    for (npy_intp k = count; k < BLOCK; k++)",
        f"        for (int row = 0; row < {rows}; row++) in[row][k] = in[row][count - 1];",
        "    for (int k = 0; k < BLOCK; k++) {",
    ]
    body = statements(graph, rest, names, printed, "const real {0} = {1};")
    body += [f"out[{row}][k] = {names[k]};" for row, (_, _, k) in enumerate(results)]
    lines += ["        " + line for line in body]
    lines += ["    }", "    for (npy_intp k = 0; k < count; k++) {"]
    lines += [
        f"        {port.name}_out[{port.size} * (start + k) + {j}] = out[{row}][k];"
        for row, (port, j, _) in enumerate(results)
    ]
    lines += ["    }", "}"]
    return _lines(lines, 1)


def _place(name: str, j: int) -> str:
    return f"{name}_strides[0] * (start + k) + {name}_strides[1] * {j}"


def _glue(inputs: Sequence[Port], outputs: Sequence[Port]) -> str:
    def table(ports: Sequence[Port]) -> str:
        rows = []
        for port in ports:
            shape = ", ".join(map(str, port.shape)) or "0"
            rows.append(f"{{{len(port.shape)}, {{{shape}}}, {int(port.shared)}, {port.size}}}")
        return ", ".join(rows)

    values = [f"(const real *)data[{i}]" for i in range(len(inputs))]
    values += [f"(real *)data[{len(inputs) + i}]" for i in range(len(outputs))]
    states = [
        value if port.shared else f"{value} + {port.size} * k"
        for port, value in zip([*inputs, *outputs], values, strict=True)
    ]
    return _GLUE.format(
        inputs=len(inputs),
        outputs=len(outputs),
        table=table([*inputs, *outputs]),
        values=", ".join(values),
        states=", ".join(states),
        strides="".join(f", strides[{i}]" for i, p in enumerate(inputs) if not p.shared),
    )


_TEMPLATE = """\
/* {name}: generated by Pteron. One state, batches of them, and what Python calls. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include <numpy/arrayobject.h>
#include <math.h>

typedef {real} real;
#define REAL {npy}
#define BLOCK 64
#define FEW 16

static void one({arguments})
{{
{one}
}}

static void sweep(npy_intp n, int packed, {arguments}{strides})
{{
{sweep}
}}

{glue}"""

_GLUE = """\
enum {{ INPUTS = {inputs}, OUTPUTS = {outputs}, PORTS = INPUTS + OUTPUTS }};
static const struct {{ int nd; npy_intp shape[4]; int shared; npy_intp size; }} PORT[PORTS] =
    {{{table}}};

/* The array, if its numbers can be read as they lie in memory. */
static PyArrayObject *plain(PyObject *value)
{{
    if (!PyArray_CheckExact(value)) return NULL;
    PyArrayObject *array = (PyArrayObject *)value;
    return PyArray_TYPE(array) == REAL && PyArray_ISBEHAVED_RO(array) ? array : NULL;
}}

/* How far apart, in numbers, two states and two elements of an input lie; 0 if that has no answer,
   2 if the numbers follow one another. */
static int placed(PyArrayObject *array, int i, npy_intp *strides)
{{
    const int extra = PyArray_NDIM(array) - PORT[i].nd;
    const npy_intp size = (npy_intp)sizeof(real);
    strides[0] = PORT[i].size;
    strides[1] = 1;
    if (PyArray_IS_C_CONTIGUOUS(array)) return 2;
    if (PORT[i].shared || extra > 1 || PORT[i].nd > 1) return 0;
    if (extra) strides[0] = PyArray_STRIDE(array, 0) / size;
    if (PORT[i].nd) strides[1] = PyArray_STRIDE(array, extra) / size;
    if (extra && strides[0] * size != PyArray_STRIDE(array, 0)) return 0;
    return PORT[i].nd && strides[1] * size != PyArray_STRIDE(array, extra) ? 0 : 1;
}}

static void evaluate(npy_intp n, int packed, npy_intp strides[][2], char **data)
{{
    (void)strides;
    if (n < FEW && packed) {{
        for (npy_intp k = 0; k < n; k++) one({states});
    }} else if (n < 1000) {{
        sweep(n, packed, {values}{strides});
    }} else {{
        Py_BEGIN_ALLOW_THREADS
        sweep(n, packed, {values}{strides});
        Py_END_ALLOW_THREADS
    }}
}}

/* call(*inputs) -> outputs, or None where the inputs need checking, converting or broadcasting. */
static PyObject *call(PyObject *self, PyObject *const *args, Py_ssize_t nargs)
{{
    char *data[PORTS];
    npy_intp lead[NPY_MAXDIMS], strides[INPUTS][2], n = 1;
    int nlead = -1, packed = 1;
    (void)self;
    if (nargs != INPUTS) Py_RETURN_NONE;
    for (int i = 0; i < INPUTS; i++) {{
        PyArrayObject *array = plain(args[i]);
        if (!array) Py_RETURN_NONE;
        const int nd = PyArray_NDIM(array), extra = nd - PORT[i].nd;
        const npy_intp *shape = PyArray_DIMS(array);
        if (extra < 0 || (PORT[i].shared && extra > 0)) Py_RETURN_NONE;
        for (int k = 0; k < PORT[i].nd; k++)
            if (shape[extra + k] != PORT[i].shape[k]) Py_RETURN_NONE;
        if (!PORT[i].shared) {{
            if (nlead < 0) {{
                nlead = extra;
                for (int k = 0; k < extra; k++) n *= lead[k] = shape[k];
            }} else {{
                if (extra != nlead) Py_RETURN_NONE;
                for (int k = 0; k < extra; k++)
                    if (shape[k] != lead[k]) Py_RETURN_NONE;
            }}
        }}
        const int layout = placed(array, i, strides[i]);
        if (!layout) Py_RETURN_NONE;
        packed = packed && layout == 2;
        data[i] = PyArray_BYTES(array);
    }}
    if (nlead < 0 || nlead + 4 > NPY_MAXDIMS) Py_RETURN_NONE;
    PyObject *out[OUTPUTS];
    for (int i = 0; i < OUTPUTS; i++) {{
        for (int k = 0; k < PORT[INPUTS + i].nd; k++) lead[nlead + k] = PORT[INPUTS + i].shape[k];
        out[i] = PyArray_SimpleNew(nlead + PORT[INPUTS + i].nd, lead, REAL);
        if (!out[i]) {{
            while (i--) Py_DECREF(out[i]);
            return NULL;
        }}
        data[INPUTS + i] = PyArray_BYTES((PyArrayObject *)out[i]);
    }}
    if (n > 0) evaluate(n, packed, strides, data);
    if (OUTPUTS == 1) return out[0];
    PyObject *all = PyTuple_New(OUTPUTS);
    for (int i = 0; i < OUTPUTS; i++) {{
        if (all) PyTuple_SET_ITEM(all, i, out[i]);
        else Py_DECREF(out[i]);
    }}
    return all;
}}

/* run(*inputs, *outputs): fill arrays of (n, size) from arrays of (n, size) in any layout, shared
   ones of (size,); the caller has checked them. */
static PyObject *run(PyObject *self, PyObject *const *args, Py_ssize_t nargs)
{{
    char *data[PORTS];
    (void)self;
    if (nargs != PORTS) {{
        PyErr_SetString(PyExc_TypeError, "run: as many arrays as ports expected");
        return NULL;
    }}
    npy_intp n = -1, strides[PORTS][2];
    int packed = 1;
    for (int i = 0; i < PORTS; i++) {{
        PyArrayObject *array = plain(args[i]);
        const int nd = PORT[i].shared ? 1 : 2;
        int fits = array && PyArray_NDIM(array) == nd && PyArray_DIM(array, nd - 1) == PORT[i].size;
        if (fits && nd == 2) {{
            fits = n < 0 || PyArray_DIM(array, 0) == n;
            n = PyArray_DIM(array, 0);
        }}
        if (fits) {{
            strides[i][0] = nd == 2 ? PyArray_STRIDE(array, 0) / (npy_intp)sizeof(real) : 0;
            strides[i][1] = PyArray_STRIDE(array, nd - 1) / (npy_intp)sizeof(real);
            fits = PyArray_IS_C_CONTIGUOUS(array) || (i < INPUTS && nd == 2);
            packed = packed && PyArray_IS_C_CONTIGUOUS(array);
        }}
        if (!fits) {{
            PyErr_Format(PyExc_TypeError, "run: array %d does not fit", i);
            return NULL;
        }}
        data[i] = PyArray_BYTES(array);
    }}
    if (n > 0) evaluate(n, packed, strides, data);
    Py_RETURN_NONE;
}}

static PyMethodDef METHODS[] = {{
    {{"call", (PyCFunction)(void (*)(void))call, METH_FASTCALL, "outputs of inputs, or None"}},
    {{"run", (PyCFunction)(void (*)(void))run, METH_FASTCALL, "fill outputs"}},
    {{NULL, NULL, 0, NULL}}}};

static int start(PyObject *module)
{{
    (void)module;
    import_array1(-1);
    return 0;
}}

/* Initialised in two phases: Python takes modules of one phase and of one name for the same. */
static PyModuleDef_Slot SLOTS[] = {{{{Py_mod_exec, (void *)start}}, {{0, NULL}}}};
static struct PyModuleDef MODULE = {{
    PyModuleDef_HEAD_INIT, "pteron_kernel", NULL, 0, METHODS, SLOTS, NULL, NULL, NULL}};

PyMODINIT_FUNC PyInit_pteron_kernel(void);
PyMODINIT_FUNC PyInit_pteron_kernel(void)
{{
    return PyModuleDef_Init(&MODULE);
}}
"""
