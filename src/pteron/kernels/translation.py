"""CasADi functions to graphs of many-term sums, and back."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import casadi as ca

from pteron.kernels.terms import TermGraph, sign_of

_ARITY = {
    **dict.fromkeys((ca.OP_SQRT, ca.OP_SIN, ca.OP_COS, ca.OP_FABS), 1),
    **dict.fromkeys((ca.OP_ATAN2, ca.OP_FMIN, ca.OP_FMAX, ca.OP_LT, ca.OP_IF_ELSE_ZERO), 2),
}
"""Operations that the pass does not look into."""

_ARITHMETIC: dict[int, Callable[[TermGraph, int, int], int]] = {
    ca.OP_ASSIGN: lambda graph, a, b: a,
    ca.OP_NEG: lambda graph, a, b: -a,
    ca.OP_ADD: lambda graph, a, b: graph.sum([a, b]),
    ca.OP_SUB: lambda graph, a, b: graph.sum([a, -b]),
    ca.OP_TWICE: lambda graph, a, b: graph.sum([a, a]),
    ca.OP_MUL: lambda graph, a, b: graph.product([a, b]),
    ca.OP_SQ: lambda graph, a, b: graph.product([a, a]),
    ca.OP_DIV: lambda graph, a, b: graph.quotient(a, b),
    ca.OP_INV: lambda graph, a, b: graph.reciprocal(a),
}


def read(function: ca.Function) -> tuple[TermGraph, list[int]] | None:
    """Return the graph of a function and the values of its outputs' elements, one after another."""
    graph = TermGraph()
    slots: dict[int, int] = {}
    roots: dict[tuple[int, int], int] = {}
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_INPUT:
            slots[target[0]] = graph.add("input", *source[:2])
        elif code == ca.OP_CONST:
            slots[target[0]] = graph.constant(float(function.instruction_constant(k)))
        elif code == ca.OP_OUTPUT:
            roots[target[0], target[1]] = slots[source[0]]
        elif code in _ARITHMETIC:
            slots[target[0]] = _ARITHMETIC[code](graph, slots[source[0]], slots[source[-1]])
        elif code in _ARITY:
            slots[target[0]] = graph.add(code, *(slots[i] for i in source[: _ARITY[code]]))
        else:
            return None
    places = [(i, j) for i in range(function.n_out()) for j in range(function.nnz_out(i))]
    return graph, [roots[place] for place in places]


def written(graph: TermGraph, roots: list[int], function: ca.Function) -> ca.Function:
    """Return the graph as a CasADi function with the inputs and outputs of the one given."""
    symbols = function.sx_in()
    elements = [symbol.nonzeros() for symbol in symbols]
    order = graph.order(roots)
    wanted = _wanted_signs(graph, order, roots)
    # Each node's expression, and whether it is the node's value (1) or its negative (-1): a
    # difference comes in the order that its users want, so that few values need a negation.
    found: dict[int, tuple[Any, int]] = {}

    def signed(value: int) -> tuple[Any, int]:
        expression, sign = found[abs(value)]
        return expression, sign * sign_of(value)

    def plain(value: int) -> Any:
        expression, sign = signed(value)
        return expression if sign > 0 else -expression

    for k in order:
        kind, operands = graph.nodes[k][0], graph.operands(k)
        if kind == "input":
            _, port, element = graph.nodes[k]
            found[k] = elements[port][element], 1
        elif kind == "constant":
            found[k] = ca.SX(graph.nodes[k][1]), 1
        elif kind == "sum":
            found[k] = _sum([signed(v) for v in operands], wanted[k])
        elif kind == "product":
            below = [graph.operands(f)[0] for f in operands if graph.is_a("inverse", f)]
            above = [f for f in operands if not graph.is_a("inverse", f)]
            found[k] = _product([found[f] for f in above], [found[f] for f in below], wanted[k])
        elif kind in ("inverse", ca.OP_INV):
            found[k] = _product([], [found[operands[0]]], wanted[k])
        else:
            make = ca.SX.unary if len(operands) == 1 else ca.SX.binary
            found[k] = make(kind, *(plain(v) for v in operands)), 1
    values = [plain(v) for v in roots]
    outputs = []
    for i in range(function.n_out()):
        size = function.nnz_out(i)
        outputs.append(ca.SX(function.sparsity_out(i), ca.vertcat(*values[:size])))
        values = values[size:]
    name, inputs, results = function.name(), function.name_in(), function.name_out()
    return ca.Function(name, symbols, ca.cse(outputs), inputs, results)


def _wanted_signs(graph: TermGraph, order: list[int], roots: list[int]) -> Counter[int]:
    """Return for each node whether its value (> 0) or its negative (< 0) serves its users more."""
    wanted: Counter[int] = Counter()
    for v in roots:
        wanted[abs(v)] += sign_of(v)
    for k in reversed(order):
        kind, operands = graph.nodes[k][0], graph.operands(k)
        if kind == "product":
            turning = [f for f in operands if graph.is_a("sum", f) or graph.is_a("product", f)]
            wanted.update(dict.fromkeys(turning[:1], wanted[k]))  # one that turns is enough
        elif kind in _ARITY:
            wanted.update({abs(v): sign_of(v) for v in operands})
    return wanted


def _sum(terms: list[tuple[Any, int]], wanted: int) -> tuple[Any, int]:
    """Return a sum of signed terms, or its negative where that is wanted or saves a negation."""
    positive = sum(sign > 0 for _, sign in terms)
    turn = -1 if positive == 0 or (wanted < 0 and positive < len(terms)) else 1
    first, *rest = sorted(terms, key=lambda item: -turn * item[1])
    total = first[0]
    for expression, sign in rest:
        total = total + expression if sign == turn else total - expression
    return total, turn


def _product(
    above: list[tuple[Any, int]], below: list[tuple[Any, int]], wanted: int
) -> tuple[Any, int]:
    """Return a quotient of signed factors."""
    # CasADi turns a product with 1/x into a quotient, which is slower, but leaves -1/x alone.
    one = 1 if wanted > 0 else -1
    (total, sign), *rest = above or [(one, one)]
    for expression, turn in rest:
        total, sign = total * expression, sign * turn
    for expression, turn in below:
        total, sign = total / expression, sign * turn
    return total, sign
