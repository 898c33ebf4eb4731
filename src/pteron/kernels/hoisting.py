"""Loop-invariant code motion: a program is split so that a batch's shared part is computed once."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.kernels.graph import Node, expression, function_like, graph_of
from pteron.kernels.program_cache import Program


def hoist_invariants(program: Program, name: str) -> tuple[Program, ca.Function]:
    """Return a program without the operations on the input `name` alone, and their function.

    The two functions `first` and `second` satisfy function(..., x, ...) = first(..., second(x),
    ...), where x is the input: second(x) has the largest subexpressions of x alone. Inputs and
    outputs keep their names and order.
    """
    function = program.function
    place = function.name_in().index(name)
    symbols = function.sx_in()
    ports = [replace(port, shared=port.name == name) for port in program.inputs]
    graph = graph_of(function, tuple(ports))
    numbers: dict[int, tuple[Expression, Expression]] = {}

    def symbol_of(k: int, computed: Expression) -> Expression:
        """Return a graph node's value, as a symbol where the hoisted function computes it."""
        if not graph.nodes[k].shared or computed.is_constant():
            return computed
        return numbers.setdefault(k, (computed, ca.SX.sym(f"n{len(numbers)}")))[1]

    def rule(node: Node, computed: list[Expression]) -> Expression:
        """Return a graph node's expression, hoisted arguments replaced by symbols."""
        if not node.shared:
            computed = [symbol_of(k, v) for k, v in zip(node.arguments, computed, strict=True)]
        return expression(node, computed)

    computed = graph.values(lambda i, j: symbols[i].nonzeros()[j], rule)
    results = [[symbol_of(k, computed[k]) for k in nodes] for nodes in graph.outputs]
    hoisted_function = ca.Function(
        name, [symbols[place]], [ca.densify(ca.vertcat(*(v for v, _ in numbers.values())))]
    )
    inputs = list(symbols)
    inputs[place] = ca.vertcat(*(symbol for _, symbol in numbers.values()))
    ports = list(program.inputs)
    ports[place] = replace(ports[place], shape=(len(numbers),))
    first = function_like(function, results, inputs)
    return replace(program, function=first, inputs=tuple(ports)), hoisted_function
