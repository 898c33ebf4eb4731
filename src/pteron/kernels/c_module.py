"""The C code of target `c`: one state, a batch in blocks, and what Python calls.

A batch is computed in blocks held as structures of arrays, one state a vector lane; the arrays of
the caller are read as they lie in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pteron.kernels.code import C, Stages, c_constant, names_of, single_precision, statements
from pteron.kernels.graph import Graph
from pteron.kernels.kernel import Port

__all__ = ["module_source"]


def module_source(
    name: str, graph: Graph, inputs: Sequence[Port], outputs: Sequence[Port], dtype: str
) -> str:
    """Return the source of a module whose `call` and `run` evaluate a graph."""
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
    stages = Stages.of(graph, inputs, outputs)

    def input_name(i: int, j: int) -> str:
        return f"{inputs[i].name}[{j}]" if inputs[i].shared else f"in[{stages.rows[i, j]}][k]"

    names = names_of(graph, input_name, _constant(dtype))
    rows = [(row, inputs[i], j) for (i, j), row in stages.rows.items()]
    lines = statements(graph, stages.shared, names, printed, "const real {0} = {1};")
    lines += [
        f"real in[{max(stages.height, 1)}][BLOCK], out[{len(stages.results)}][BLOCK];",
        "for (npy_intp start = 0; start < n; start += BLOCK) {",
        "    const npy_intp count = n - start < BLOCK ? n - start : BLOCK;",
        "    if (packed) for (npy_intp k = 0; k < count; k++) {",
        *(f"        in[{row}][k] = {p.name}[{_element(p, j)}];" for row, p, j in rows),
        "    }",
        "    else for (npy_intp k = 0; k < count; k++) {",
        *(f"        in[{row}][k] = {p.name}[{_strided(p, j)}];" for row, p, j in rows),
        "    }",
        "    for (npy_intp k = 0; k < count; k++) {",
    ]
    for row, k in stages.outlying_rows():
        node = graph.nodes[k]
        value = printed[node.operation].format(names[node.arguments[0]])
        names[k] = f"in[{row}][k]"
        lines.append(f"        {names[k]} = {value};")
    body = statements(graph, stages.rest, names, printed, "const real {0} = {1};")
    body += [f"out[{row}][k] = {names[k]};" for row, (_, _, k) in enumerate(stages.results)]
    lines += [
        "    }",
        "    /* A block that is not full repeats its last state: full vectors, no surprises. */",
        "    for (npy_intp k = count; k < BLOCK; k++)",
        f"        for (int row = 0; row < {stages.height}; row++) in[row][k] = in[row][count - 1];",
        "    for (int k = 0; k < BLOCK; k++) {",
        *(f"        {line}" for line in body),
        "    }",
        "    for (npy_intp k = 0; k < count; k++) {",
        *(
            f"        {port.name}_out[{_element(port, j)}] = out[{row}][k];"
            for row, (port, j, _) in enumerate(stages.results)
        ),
        "    }",
        "}",
    ]
    return _lines(lines, 1)


def _element(port: Port, j: int) -> str:
    return f"{port.size} * (start + k) + {j}"


def _strided(port: Port, j: int) -> str:
    return f"{port.name}_strides[0] * (start + k) + {port.name}_strides[1] * {j}"


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
