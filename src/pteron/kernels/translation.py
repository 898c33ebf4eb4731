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


def to_term_graph(function: ca.Function) -> tuple[TermGraph, list[int]]:
    """Return a CasADi function as a term graph, with the signed nodes of its output elements."""
    graph, operations = TermGraph(), graph_of(function)

    def rule(node: Node, operands: list[int]) -> int:
        """Return the term graph's signed node for a node of the operation graph."""
        if node.operation == CONSTANT:
            return graph.constant(node.value)
        if node.operation in _ARITHMETIC:
            return _ARITHMETIC[node.operation](graph, *operands)
        return graph.add(node.operation, *operands)

    node_values = operations.values(lambda i, j: graph.add(INPUT, i, j), rule)
    return graph, [node_values[k] for nodes in operations.outputs for k in nodes]


def to_function(graph: TermGraph, roots: list[int], function: ca.Function) -> ca.Function:
    """Return the graph as a CasADi function with the inputs and outputs of `function`."""
    elements = [symbol.nonzeros() for symbol in function.sx_in()]
    order = graph.order(roots)
    wanted_signs = _sign_balances(graph, order, roots)
    # Each node's expression, and whether it is the node's value (1) or its negative (-1): each
    # difference is written in the order for which fewest values need a negation.
    expressions: dict[int, tuple[Any, int]] = {}

    def signed_expression(operand: int) -> tuple[Any, int]:
        """Return an operand's unsigned expression and its sign, 1 or -1."""
        size, sign = expressions[abs(operand)]
        return size, sign * sign_of(operand)

    negatives: dict[int, Any] = {}

    def plain_expression(operand: int) -> Any:
        """Return an operand's signed expression; each node is negated at most once."""
        size, sign = signed_expression(operand)
        if sign < 0 and abs(operand) not in negatives:
            negatives[abs(operand)] = -size
        return size if sign > 0 else negatives[abs(operand)]

    for k in order:
        kind, operands = graph.kinds[k], graph.operands[k]
        if kind == INPUT:
            _, port, element = graph.nodes[k]
            expressions[k] = elements[port][element], 1
        elif kind == CONSTANT:
            expressions[k] = ca.SX(graph.nodes[k][1]), 1
        elif kind == "sum":
            expressions[k] = _sum([signed_expression(v) for v in operands], wanted_signs[k])
        elif kind == "product":
            below = [graph.operands[f][0] for f in operands if graph.is_kind("inverse", f)]
            above = [f for f in operands if not graph.is_kind("inverse", f)]
            expressions[k] = _product(
                [expressions[f] for f in above], [expressions[f] for f in below], wanted_signs[k]
            )
        elif kind in ("inverse", "reciprocal"):
            expressions[k] = _product([], [expressions[operands[0]]], wanted_signs[k])
        else:
            expressions[k] = expression(Node(kind), [plain_expression(v) for v in operands]), 1
    root_values = iter(roots)
    return function_like(
        function,
        [
            [plain_expression(v) for v in islice(root_values, function.nnz_out(i))]
            for i in range(function.n_out())
        ],
        once=True,
    )


def _sign_balances(graph: TermGraph, order: list[int], roots: list[int]) -> list[int]:
    """Return for each node the number of uses of its value minus those of its negative."""
    balance = [0] * len(graph.nodes)
    for v in roots:
        balance[abs(v)] += sign_of(v)
    for k in reversed(order):
        kind, operands = graph.kinds[k], graph.operands[k]
        if kind == "product":
            # One negated factor is enough, or -1/x in place of 1/x: see `_product`.
            reciprocals = [f for f in operands if graph.kinds[f] == "reciprocal"]
            turning = [f for f in operands if graph.kinds[f] in ("sum", "product")]
            if turning:
                balance[turning[0]] += (-1) ** len(reciprocals) * balance[k]
            elif reciprocals:
                balance[reciprocals[0]] += balance[k]
        elif kind not in ("sum", "inverse", "reciprocal"):
            for size, sign in {abs(v): sign_of(v) for v in operands}.items():
                balance[size] += sign
    return balance


def _sum(terms: list[tuple[Any, int]], balance: int) -> tuple[Any, int]:
    """Return a sum of (expression, sign) terms, or its negative if cheaper, with the sign."""
    positive = sum(sign > 0 for _, sign in terms)
    turn = -1 if positive == 0 or (balance < 0 and positive < len(terms)) else 1
    first, *others = sorted(terms, key=lambda term_and_sign: -turn * term_and_sign[1])
    total = first[0]
    for term, sign in others:
        total = _BINARY(ca.OP_ADD if sign == turn else ca.OP_SUB, total, term)
    return total, turn


def _product(
    above: list[tuple[Any, int]], below: list[tuple[Any, int]], balance: int
) -> tuple[Any, int]:
    """Return the product of `above` over that of `below`, (expression, sign) each, and sign."""
    # CasADi turns a product with 1/x into a quotient, which is slower, but leaves -1/x alone.
    unit = 1 if balance > 0 else -1
    (total, sign), *others = above or [(unit, unit)]
    for factor, turn in others:
        total, sign = _BINARY(ca.OP_MUL, total, factor), sign * turn
    for factor, turn in below:
        total, sign = _BINARY(ca.OP_DIV, total, factor), sign * turn
    return total, sign
