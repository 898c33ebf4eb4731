"""A CasADi function as a list of named operations, which the printers turn into code.

A printer needs no more than this: single-assignment nodes in order, and what goes where. Nodes
are sorted into stages, so that what depends on shared inputs alone is done once for a batch, and
sines and cosines of the inputs leave the loop that a compiler vectorises.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca

from pteron.kernels.kernel import Port

INPUT, CONSTANT = "input", "constant"

_OPERATIONS = {
    ca.OP_ADD: "add",
    ca.OP_SUB: "sub",
    ca.OP_MUL: "mul",
    ca.OP_DIV: "div",
    ca.OP_NEG: "neg",
    ca.OP_SQRT: "sqrt",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_ATAN2: "atan2",
    ca.OP_FABS: "fabs",
    ca.OP_FLOOR: "floor",
    ca.OP_FMIN: "fmin",
    ca.OP_FMAX: "fmax",
    ca.OP_SQ: "sq",
    ca.OP_TWICE: "twice",
    ca.OP_LT: "less",
    ca.OP_LE: "less_equal",
    ca.OP_EQ: "equal",
    ca.OP_NE: "unequal",
    ca.OP_NOT: "not",
    ca.OP_AND: "and",
    ca.OP_OR: "or",
    ca.OP_IF_ELSE_ZERO: "select",
}

_UNARY = frozenset({"neg", "sqrt", "sin", "cos", "fabs", "floor", "not"})


@dataclass(frozen=True)
class Node:
    """One value: an operation on earlier nodes, an input's element, or a constant."""

    operation: str
    arguments: tuple[int, ...] = ()
    """Earlier nodes; for an input its port and element."""
    value: float = 0.0
    """Of a constant."""
    shared: bool = False
    """Whether it depends on shared inputs and constants alone."""
    outlying: bool = False
    """Whether it is a sine or a cosine that depends on inputs alone."""


@dataclass(frozen=True)
class Graph:
    """The nodes of a function, in order, and the node of each element of each output."""

    nodes: tuple[Node, ...]
    outputs: tuple[tuple[int, ...], ...]

    def operations(self) -> list[int]:
        """Return the nodes that compute something, in order."""
        return [k for k, node in enumerate(self.nodes) if node.operation not in (INPUT, CONSTANT)]


@lru_cache(maxsize=128)
def graph_of(function: ca.Function, inputs: tuple[Port, ...]) -> Graph:
    """Return the graph of an SX function; `inputs` say which of its arguments are shared.

    Raises
    ------
    ValueError
        If the function holds an operation that the printers do not know.
    """
    nodes: list[Node] = []
    slots: dict[int, int] = {}
    seen: dict[tuple[str, tuple[int, ...], str], int] = {}
    outputs = [[-1] * function.nnz_out(i) for i in range(function.n_out())]

    def add(node: Node) -> int:
        key = (node.operation, node.arguments, node.value.hex())
        if key not in seen:
            seen[key] = len(nodes)
            nodes.append(node)
        return seen[key]

    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_INPUT:
            place = (source[0], source[1])
            slots[target[0]] = add(Node(INPUT, place, shared=inputs[source[0]].shared))
        elif code == ca.OP_CONST:
            value = float(function.instruction_constant(k))
            slots[target[0]] = add(Node(CONSTANT, value=value, shared=True))
        elif code == ca.OP_OUTPUT:
            outputs[target[0]][target[1]] = slots[source[0]]
        elif code == ca.OP_ASSIGN:
            slots[target[0]] = slots[source[0]]
        elif code in _OPERATIONS:
            slots[target[0]] = add(_node(_OPERATIONS[code], [slots[i] for i in source], nodes))
        else:
            raise ValueError(f"operation {code} of {function.name()} has no printer")
    return Graph(tuple(nodes), tuple(map(tuple, outputs)))


def _node(operation: str, arguments: list[int], nodes: Sequence[Node]) -> Node:
    """Return the node of an operation; a square is x x and twice x is x + x, to the same bit."""
    if operation in ("sq", "twice"):
        operation, arguments = ("mul" if operation == "sq" else "add"), [arguments[0]] * 2
    if operation in _UNARY:
        arguments = arguments[:1]
    shared = all(nodes[i].shared for i in arguments)
    of_input = nodes[arguments[0]].operation == INPUT
    outlying = operation in ("sin", "cos") and of_input and not shared
    return Node(operation, tuple(arguments), shared=shared, outlying=outlying)
