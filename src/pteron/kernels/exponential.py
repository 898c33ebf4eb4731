"""The exponential in straight-line arithmetic, the same bits on every float64 target.

libm's keeps a compiler from turning a loop into vector code, as its sine does; see `sincos`. Here
exp(x) - 1 comes from a polynomial at x / 4096, and twelve doublings by E (2 + E).
"""

from __future__ import annotations

from functools import lru_cache
from math import factorial

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.kernels.graph import Node, expression, function_like, graph_of

_DOUBLINGS = 12

_DEGREE = 11
"""At 709 / 4096, about 0.17, what the polynomial leaves out is below 1e-17 of it."""

_MOST = 709.0
"""Beyond it floats end: there it counts as this."""


def exponential(x: Expression) -> Expression:
    """Return exp(x): to 3e-16 absolutely where x is negative, as friction's laws have it.

    Where x is positive the relative error grows, to 1e-12 at 700. NaN counts as the least x: a law
    of friction has its speed in other terms too, and is NaN by these.
    """
    r = ca.fmin(ca.fmax(x, -_MOST), _MOST) * 0.5**_DOUBLINGS
    total: Expression = 1.0 / factorial(_DEGREE)
    for k in range(_DEGREE - 1, 0, -1):
        total = 1.0 / factorial(k) + r * total
    less = r * total
    for _ in range(_DOUBLINGS):
        less = less * (2.0 + less)
    return 1.0 + less


@lru_cache(maxsize=256)
def straight(function: ca.Function) -> ca.Function:
    """Return a function without calls of libm's exponential."""
    graph = graph_of(function)
    if not any(node.operation == "exp" for node in graph.nodes):
        return function
    entries = [symbol.nonzeros() for symbol in function.sx_in()]

    def rule(node: Node, arguments: list[Expression]) -> Expression:
        return exponential(*arguments) if node.operation == "exp" else expression(node, arguments)

    values = graph.values(lambda i, j: entries[i][j], rule)
    return function_like(function, graph.results(values))
