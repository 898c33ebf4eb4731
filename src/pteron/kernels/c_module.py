"""The C code of target `c`: one state, a batch in blocks, and what Python calls.

A batch is computed in blocks held as structures of arrays, one state a vector lane; the arrays of
the caller are read as they lie in memory. The text is in `templates/`.
"""

from __future__ import annotations

from collections.abc import Sequence

from pteron.kernels.code import (
    C,
    Stages,
    c_constant,
    names_of,
    near_statements,
    rendered,
    single_precision,
    statements,
)
from pteron.kernels.graph import Graph
from pteron.kernels.kernel import Port
from pteron.kernels.sincos import LIMIT

_FORM = "const real {0} = {1};"


def module_source(
    name: str,
    graph: Graph,
    inputs: Sequence[Port],
    outputs: Sequence[Port],
    dtype: str,
    block: int = 32,
) -> str:
    """Return the source of a module whose `bind` and `run` evaluate a graph.

    A batch is computed in blocks of `block` states.
    """
    printed = single_precision(C) if dtype == "float32" else C
    printed = printed | {
        "sin": "sincos_({0}).sine",
        "cos": "sincos_({0}).cosine",
        "fmin": "fmin_({0}, {1})",
        "fmax": "fmax_({0}, {1})",
    }
    near, near_results = near_statements(C, "const double {0} = {1};")
    stages = Stages.of(graph, inputs, outputs)

    def constant(value: float) -> str:
        return c_constant(value, dtype)

    # One state.
    names = names_of(graph, lambda i, j: f"{inputs[i].name}[{j}]", constant)
    one = []
    for number, (angle, nodes) in enumerate(stages.angles, 1):
        one.append(f"const pair a{number} = sincos_({names[angle]});")
        for k in nodes:
            names[k] = f"a{number}.{_part(graph, k)}"
    one += statements(graph, stages.shared + stages.rest, names, printed, _FORM)
    one += [f"{port.name}_out[{j}] = {names[k]};" for port, j, k in stages.results]

    # A batch: an angle's sine and cosine take two rows of a block, behind the inputs.
    def input_name(i: int, j: int) -> str:
        return f"{inputs[i].name}[{j}]" if inputs[i].shared else f"in[{stages.rows[i, j]}][k]"

    names = names_of(graph, input_name, constant)
    shared = statements(graph, stages.shared, names, printed, _FORM)
    angles = []
    for number, (angle, nodes) in enumerate(stages.angles):
        row = len(stages.rows) + 2 * number
        rows = {"sine": f"in[{row}][k]", "cosine": f"in[{row + 1}][k]"}
        angles.append((names[angle], rows["sine"], rows["cosine"]))
        for k in nodes:
            names[k] = rows[_part(graph, k)]
    body = statements(graph, stages.rest, names, printed, _FORM)
    body += [f"out[{row}][k] = {names[k]};" for row, (_, _, k) in enumerate(stages.results)]

    return rendered(
        __package__,
        "module.c.j2",
        name=name,
        real="float" if dtype == "float32" else "double",
        block=block,
        limit=LIMIT,
        near=near,
        near_results=near_results,
        inputs=inputs,
        outputs=outputs,
        one=one,
        shared=shared,
        angles=angles,
        body=body,
        rows=[(row, inputs[i], j) for (i, j), row in stages.rows.items()],
        results=[(row, port, j) for row, (port, j, _) in enumerate(stages.results)],
    )


def _part(graph: Graph, k: int) -> str:
    return "sine" if graph.nodes[k].operation == "sin" else "cosine"
