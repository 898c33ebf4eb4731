"""Translation of CasADi functions to graphs of many-term sums (see `terms`), and back."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from typing import Any

import casadi as ca

from pteron.kernels.graph import CONSTANT, INPUT, Node, expression, function_like, graph_of
from pteron.kernels.terms import TermGraph, sign_of

_ARITHMETIC: dict[str, Callable[..., int]] = {
    "neg": lambda graph, a: -a,
    "add": lambda graph, a, b: graph.sum([a, b]),
    "sub": lambda graph, a, b: graph.sum([a, -b]),
    "mul": lambda graph, a, b: graph.product([a, b]),
    "div": lambda graph, a, b: graph.quotient(a, b),
}
"""Operations that become sums and products; others are nodes of their own."""

_BINARY = ca.SX.binary
"""CasADi's own binary operation: eight times faster than `*` and others, which check for arrays."""


def read(function: ca.Function) -> tuple[TermGraph, list[int]]:
    """Return a function's graph, and the nodes of its outputs' elements in one list."""
    graph, given = TermGraph(), graph_of(function)

    def rule(node: Node, values: list[int]) -> int:
        if node.operation == CONSTANT:
            return graph.constant(node.value)
        if node.operation in _ARITHMETIC:
            return _ARITHMETIC[node.operation](graph, *values)
        return graph.add(node.operation, *values)

    values = given.values(lambda i, j: graph.add(INPUT, i, j), rule)
    return graph, [values[k] for nodes in given.outputs for k in nodes]


def written(graph: TermGraph, roots: list[int], function: ca.Function) -> ca.Function:
    """Return the graph as a CasADi function with the inputs and outputs of `function`."""
    elements = [symbol.nonzeros() for symbol in function.sx_in()]
    order = graph.order(roots)
    wanted = _wanted_signs(graph, order, roots)
    # Each node's expression, and whether it is the node's value (1) or its negative (-1): each
    # difference is written in the order for which fewest values need a negation.
    found: dict[int, tuple[Any, int]] = {}

    def signed(value: int) -> tuple[Any, int]:
        size, sign = found[abs(value)]
        return size, sign * sign_of(value)

    negatives: dict[int, Any] = {}

    def plain(value: int) -> Any:
        size, sign = signed(value)
        if sign < 0 and abs(value) not in negatives:
            negatives[abs(value)] = -size
        return size if sign > 0 else negatives[abs(value)]

    for k in order:
        kind, operands = graph.kinds[k], graph.operands[k]
        if kind == INPUT:
            _, port, element = graph.nodes[k]
            found[k] = elements[port][element], 1
        elif kind == CONSTANT:
            found[k] = ca.SX(graph.nodes[k][1]), 1
        elif kind == "sum":
            found[k] = _sum([signed(v) for v in operands], wanted[k])
        elif kind == "product":
            below = [graph.operands[f][0] for f in operands if graph.is_a("inverse", f)]
            above = [f for f in operands if not graph.is_a("inverse", f)]
            found[k] = _product([found[f] for f in above], [found[f] for f in below], wanted[k])
        elif kind in ("inverse", "reciprocal"):
            found[k] = _product([], [found[operands[0]]], wanted[k])
        else:
            found[k] = expression(Node(kind), [plain(v) for v in operands]), 1
    values = iter(roots)
    return function_like(
        function,
        [[plain(v) for v in islice(values, function.nnz_out(i))] for i in range(function.n_out())],
        once=True,
    )


def _wanted_signs(graph: TermGraph, order: list[int], roots: list[int]) -> list[int]:
    """Return for each node whether more users need its value (> 0) or its negative (< 0)."""
    wanted = [0] * len(graph.nodes)
    for v in roots:
        wanted[abs(v)] += sign_of(v)
    for k in reversed(order):
        kind, operands = graph.kinds[k], graph.operands[k]
        if kind == "product":
            # One negated factor is enough, or -1/x in place of 1/x: see `_product`.
            reciprocals = [f for f in operands if graph.kinds[f] == "reciprocal"]
            turning = [f for f in operands if graph.kinds[f] in ("sum", "product")]
            if turning:
                wanted[turning[0]] += (-1) ** len(reciprocals) * wanted[k]
            elif reciprocals:
                wanted[reciprocals[0]] += wanted[k]
        elif kind not in ("sum", "inverse", "reciprocal"):
            for size, sign in {abs(v): sign_of(v) for v in operands}.items():
                wanted[size] += sign
    return wanted


def _sum(terms: list[tuple[Any, int]], wanted: int) -> tuple[Any, int]:
    """Return a sum of signed terms or its negative, by the number of negations, and the sign."""
    positive = sum(sign > 0 for _, sign in terms)
    turn = -1 if positive == 0 or (wanted < 0 and positive < len(terms)) else 1
    first, *rest = sorted(terms, key=lambda item: -turn * item[1])
    total = first[0]
    for term, sign in rest:
        total = _BINARY(ca.OP_ADD if sign == turn else ca.OP_SUB, total, term)
    return total, turn


def _product(
    above: list[tuple[Any, int]], below: list[tuple[Any, int]], wanted: int
) -> tuple[Any, int]:
    """Return a quotient of signed factors, and its sign."""
    # CasADi turns a product with 1/x into a quotient, which is slower, but leaves -1/x alone.
    one = 1 if wanted > 0 else -1
    (total, sign), *rest = above or [(one, one)]
    for factor, turn in rest:
        total, sign = _BINARY(ca.OP_MUL, total, factor), sign * turn
    for factor, turn in below:
        total, sign = _BINARY(ca.OP_DIV, total, factor), sign * turn
    return total, sign
