"""A CasADi function as a graph of named operations, for code printers and other arithmetics.

Nodes are single assignments, in order. Marked are those that depend on shared inputs alone, which
are computed once for a batch, and sines and cosines of inputs, which leave the loop that a compiler
vectorises.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, TypeVar

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.kernels.kernel import Port

Value = TypeVar("Value")

INPUT, CONSTANT = "input", "constant"
"""Operations of nodes that compute nothing."""

STORE, LOAD = "store", "load"
"""Operations that put a value in memory and return it, for lack of registers: see `lifetimes`."""

_CODES = {
    "add": ca.OP_ADD,
    "sub": ca.OP_SUB,
    "mul": ca.OP_MUL,
    "div": ca.OP_DIV,
    "neg": ca.OP_NEG,
    "sqrt": ca.OP_SQRT,
    "sin": ca.OP_SIN,
    "cos": ca.OP_COS,
    "exp": ca.OP_EXP,
    "atan2": ca.OP_ATAN2,
    "fabs": ca.OP_FABS,
    "floor": ca.OP_FLOOR,
    "fmin": ca.OP_FMIN,
    "fmax": ca.OP_FMAX,
    "less": ca.OP_LT,
    "less_equal": ca.OP_LE,
    "equal": ca.OP_EQ,
    "unequal": ca.OP_NE,
    "not": ca.OP_NOT,
    "and": ca.OP_AND,
    "or": ca.OP_OR,
    "select": ca.OP_IF_ELSE_ZERO,
    "tanh": ca.OP_TANH,
    "sign": ca.OP_SIGN,
    "tan": ca.OP_TAN,
}
"""CasADi's codes of operations by name; printers know all but the last row."""

_NAMES = {code: name for name, code in _CODES.items()}


class Node(NamedTuple):
    """One value: an operation on earlier nodes, an input's element, or a constant."""

    operation: str
    """A name, or for operations that have none CasADi's number."""
    arguments: tuple[int, ...] = ()
    """Earlier nodes; for an input its port and element."""
    value: float = 0.0
    """The number of a constant."""
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
        """Return the indices of the nodes that compute something, in order."""
        return [k for k, node in enumerate(self.nodes) if node.operation not in (INPUT, CONSTANT)]

    def values(
        self, inputs: Callable[[int, int], Value], rule: Callable[[Node, list[Value]], Value]
    ) -> list[Value]:
        """Return a value for each node: from `inputs`, or by `rule` from its arguments' values.

        `inputs` returns the value of an input element, by port and element number.
        """
        computed: list[Value] = []
        for node in self.nodes:
            if node.operation == INPUT:
                computed.append(inputs(*node.arguments))
            else:
                computed.append(rule(node, [computed[k] for k in node.arguments]))
        return computed

    def results(self, values: Sequence[Value]) -> list[list[Value]]:
        """Return the values of each output's elements, from the values of all nodes."""
        return [[values[k] for k in nodes] for nodes in self.outputs]


@lru_cache(maxsize=256)
def graph_of(function: ca.Function, inputs: tuple[Port, ...] = ()) -> Graph:
    """Return the graph of operations of a CasADi function; `inputs` say which are shared."""
    nodes: list[Node] = []
    slots: dict[int, int] = {}
    seen: dict[tuple[str, tuple[int, ...], str], int] = {}
    outputs = [[-1] * function.nnz_out(i) for i in range(function.n_out())]

    def add(node: Node) -> int:
        """Return the index of a node in the graph, added unless an equal node exists."""
        key = (node.operation, node.arguments, node.value.hex())
        if key not in seen:
            seen[key] = len(nodes)
            nodes.append(node)
        return seen[key]

    def constant(number: float) -> int:
        """Return the index of the graph node of a constant."""
        return add(Node(CONSTANT, value=number, shared=True))

    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_OUTPUT:
            outputs[target[0]][target[1]] = slots[source[0]]
        elif code == ca.OP_INPUT:
            shared = bool(inputs) and inputs[source[0]].shared
            slots[target[0]] = add(Node(INPUT, (source[0], source[1]), shared=shared))
        elif code == ca.OP_CONST:
            slots[target[0]] = constant(float(function.instruction_constant(k)))
        elif code == ca.OP_ASSIGN:
            slots[target[0]] = slots[source[0]]
        else:
            arguments = tuple(slots[i] for i in source)
            # Twice x is x + x, a square x x, to the same bit.
            if code in (ca.OP_TWICE, ca.OP_SQ):
                code, arguments = (ca.OP_ADD if code == ca.OP_TWICE else ca.OP_MUL), arguments * 2
            elif code == ca.OP_INV:
                code, arguments = ca.OP_DIV, (constant(1.0), *arguments)
            shared = all(nodes[i].shared for i in arguments)
            outlying = code in (ca.OP_SIN, ca.OP_COS) and nodes[arguments[0]].operation == INPUT
            name = _NAMES.get(code, str(code))
            slots[target[0]] = add(Node(name, arguments, 0.0, shared, outlying and not shared))
    return Graph(tuple(nodes), tuple(map(tuple, outputs)))


def expression(node: Node, arguments: Sequence[Expression]) -> Expression:
    """Return the CasADi expression of a graph node from its arguments' expressions."""
    if node.operation == CONSTANT:
        return ca.SX(node.value)
    make = ca.SX.unary if len(arguments) == 1 else ca.SX.binary
    return make(_CODES.get(node.operation) or int(node.operation), *arguments)


def rewrite_operations(
    function: ca.Function, rules: Mapping[str, Callable[..., Expression]]
) -> ca.Function:
    """Return a CasADi function with some operations replaced by the expressions of `rules`."""
    graph = graph_of(function)
    if not any(node.operation in rules for node in graph.nodes):
        return function
    entries = [symbol.nonzeros() for symbol in function.sx_in()]

    def rule(node: Node, arguments: list[Expression]) -> Expression:
        """Return a graph node's expression, by the rule of its operation if there is one."""
        replacement = rules.get(node.operation)
        return replacement(*arguments) if replacement else expression(node, arguments)

    computed = graph.values(lambda i, j: entries[i][j], rule)
    return function_like(function, graph.results(computed))


def function_like(
    model: ca.Function,
    elements: Sequence[Sequence[Expression]],
    inputs: Sequence[Expression] | None = None,
    *,
    once: bool = False,
) -> ca.Function:
    """Return a CasADi function with names and sparsity of `model`, its output elements new.

    Common subexpressions are merged; `once` asserts that they are already, which saves the search.
    """
    outputs = [ca.SX(model.sparsity_out(i), ca.vertcat(*parts)) for i, parts in enumerate(elements)]
    arguments = model.sx_in() if inputs is None else inputs
    names = model.name_in(), model.name_out()
    return ca.Function(model.name(), arguments, outputs if once else ca.cse(outputs), *names)
