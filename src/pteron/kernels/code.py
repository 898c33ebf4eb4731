"""Straight-line code from a graph: what the printers of C, Python and Structured Text share."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from pteron.kernels.graph import CONSTANT, INPUT, Graph, graph_of
from pteron.kernels.kernel import Port
from pteron.kernels.sincos import near

if TYPE_CHECKING:
    import jinja2

C = {
    "add": "{0} + {1}",
    "sub": "{0} - {1}",
    "mul": "{0} * {1}",
    "div": "{0} / {1}",
    "neg": "-{0}",
    "sqrt": "sqrt({0})",
    "sin": "sin({0})",
    "cos": "cos({0})",
    "atan2": "atan2({0}, {1})",
    "fabs": "fabs({0})",
    "floor": "floor({0})",
    "fmin": "fmin({0}, {1})",
    "fmax": "fmax({0}, {1})",
    "less": "({0} < {1})",
    "less_equal": "({0} <= {1})",
    "equal": "({0} == {1})",
    "unequal": "({0} != {1})",
    "not": "({0} == 0)",
    "and": "(({0} != 0) & ({1} != 0))",
    "or": "(({0} != 0) | ({1} != 0))",
    "select": "({0} ? {1} : 0)",
}
"""Operations in C; comparisons give truth values, by which `select` takes its argument or zero."""

PYTHON = C | {"select": "({1} if {0} else 0.0)"}
"""Operations in Python, for a namespace that has sqrt, sin and so on."""


def single_precision(printed: Mapping[str, str]) -> dict[str, str]:
    """Return the operations with math.h's functions for float: sqrtf for sqrt, and so on."""
    return {op: re.sub(r"^(\w+)\(", r"\1f(", text) for op, text in printed.items()}


def c_constant(value: float, dtype: str = "float64") -> str:
    """Return a floating-point literal of C, in brackets where it has a sign."""
    if np.isnan(value):
        return "NAN"
    text = f"{np.float32(value)!s}" if dtype == "float32" else repr(float(value))
    if not any(sign in text for sign in ".en"):
        text += ".0"
    text += "F" if dtype == "float32" else ""
    return f"({text})" if text.startswith("-") else text


def names_of(
    graph: Graph,
    inputs: Callable[[int, int], str],
    constant: Callable[[float], str],
    labels: Mapping[int, str] | None = None,
) -> list[str]:
    """Return how each node is written: an input's name, a literal, a label or `t` and a number."""
    names = []
    count = 0
    for k, node in enumerate(graph.nodes):
        if node.operation == INPUT:
            names.append(inputs(node.arguments[0], node.arguments[1]))
        elif node.operation == CONSTANT:
            names.append(constant(node.value))
        elif labels and k in labels:
            names.append(labels[k])
        else:
            count += 1
            names.append(f"t{count}")
    return names


def statements(
    graph: Graph,
    nodes: Iterable[int],
    names: Sequence[str],
    printed: Mapping[str, str],
    form: str,
) -> list[str]:
    """Return a statement for each of the nodes; `form` has {0} for the name, {1} for the value."""
    lines = []
    for k in nodes:
        node = graph.nodes[k]
        if node.operation not in printed:
            raise ValueError(f"operation {node.operation} has no printer")
        value = printed[node.operation].format(*(names[i] for i in node.arguments))
        lines.append(form.format(names[k], value))
    return lines


def used_inputs(graph: Graph) -> list[tuple[int, int]]:
    """Return the (port, element) pairs that the graph reads, in order."""
    places = (node.arguments for node in graph.nodes if node.operation == INPUT)
    return sorted((port, element) for port, element in places)


@dataclass(frozen=True)
class Stages:
    """How a batch is computed: what is done once, what ahead of the long loop, what inside."""

    shared: list[int]
    """Nodes that depend on shared inputs alone."""
    angles: list[tuple[int, list[int]]]
    """Inputs whose sine or cosine is asked for, each with the nodes of these."""
    rest: list[int]
    rows: dict[tuple[int, int], int]
    """The row of a block that holds an element of a batched input, by (port, element)."""
    results: list[tuple[Port, int, int]]
    """Port, element and node of each number that goes out."""

    @classmethod
    def of(cls, graph: Graph, inputs: Sequence[Port], outputs: Sequence[Port]) -> Stages:
        """Sort the nodes of a graph."""
        nodes, operations = graph.nodes, graph.operations()
        used = [(i, j) for i, j in used_inputs(graph) if not inputs[i].shared]
        angles: dict[int, list[int]] = {}
        for k in operations:
            if nodes[k].outlying:
                angles.setdefault(nodes[k].arguments[0], []).append(k)
        return cls(
            [k for k in operations if nodes[k].shared],
            list(angles.items()),
            [k for k in operations if not nodes[k].shared and not nodes[k].outlying],
            {pair: row for row, pair in enumerate(used)},
            [
                (port, j, k)
                for port, places in zip(outputs, graph.outputs, strict=True)
                for j, k in enumerate(places)
            ],
        )


def near_statements(printed: Mapping[str, str], form: str) -> tuple[list[str], list[str]]:
    """Return the statements of `sincos.near` for `angle`, and the names of its two results."""
    graph = graph_of(near(), (Port("angle", (1,)),))
    names = names_of(graph, lambda i, j: "angle", c_constant)
    lines = statements(graph, graph.operations(), names, printed, form)
    return lines, [names[nodes[0]] for nodes in graph.outputs]


def rendered(package: str, template: str, **values: Any) -> str:
    """Return the text of a template in the folder `templates` of a package."""
    return _environment(package).get_template(template).render(values)


@lru_cache(maxsize=4)
def _environment(package: str) -> jinja2.Environment:
    import jinja2  # here, since `import pteron` does without

    return jinja2.Environment(
        loader=jinja2.PackageLoader(package),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
