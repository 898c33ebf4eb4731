"""Loop-invariant code motion: a program is split so that a batch's shared part is computed once."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.kernels.graph import Node, expression, function_like, graph_of
from pteron.kernels.kept import Program


def hoisted(program: Program, name: str) -> tuple[Program, ca.Function]:
    """Return a program without the work that depends on its input x alone, and that work.

    They are functions `first` and `second` with function(..., x, ...) = first(..., second(x), ...):
    second(x) has the largest subexpressions of x. Inputs and outputs keep their names and order.
    """
    function = program.function
    place = function.name_in().index(name)
    symbols = function.sx_in()
    ports = [replace(port, shared=port.name == name) for port in program.inputs]
    graph = graph_of(function, tuple(ports))
    numbers: dict[int, tuple[Expression, Expression]] = {}

    def outside(k: int, value: Expression) -> Expression:
        """Return a node's value as the first function sees it."""
        if not graph.nodes[k].shared or value.is_constant():
            return value
        return numbers.setdefault(k, (value, ca.SX.sym(f"n{len(numbers)}")))[1]

    def rule(node: Node, values: list[Expression]) -> Expression:
        if not node.shared:
            values = [outside(k, v) for k, v in zip(node.arguments, values, strict=True)]
        return expression(node, values)

    values = graph.values(lambda i, j: symbols[i].nonzeros()[j], rule)
    results = [[outside(k, values[k]) for k in nodes] for nodes in graph.outputs]
    made = ca.Function(
        name, [symbols[place]], [ca.densify(ca.vertcat(*(v for v, _ in numbers.values())))]
    )
    inputs = list(symbols)
    inputs[place] = ca.vertcat(*(symbol for _, symbol in numbers.values()))
    ports = list(program.inputs)
    ports[place] = replace(ports[place], shape=(len(numbers),))
    first = function_like(function, results, inputs)
    return replace(program, function=first, inputs=tuple(ports)), made
