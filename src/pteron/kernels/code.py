"""Straight-line code from a graph: what the printers of C, Python and Structured Text share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from pteron.kernels.graph import CONSTANT, INPUT, Graph

__all__ = ["C", "PYTHON", "c_constant", "names_of", "statements", "used_inputs"]

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
    "fmin": "fmin({0}, {1})",
    "fmax": "fmax({0}, {1})",
    "less": "({0} < {1})",
    "select": "({0} ? {1} : 0)",
}
"""Operations in C; `less` is a truth value, by which `select` takes its argument or zero."""

PYTHON = C | {"select": "({1} if {0} else 0.0)"}
"""Operations in Python, for a namespace that has sqrt, sin and so on."""


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
        value = printed[node.operation].format(*(names[i] for i in node.arguments))
        lines.append(form.format(names[k], value))
    return lines


def used_inputs(graph: Graph) -> list[tuple[int, int]]:
    """Return the (port, element) pairs that the graph reads, in order."""
    places = (node.arguments for node in graph.nodes if node.operation == INPUT)
    return sorted((port, element) for port, element in places)
