"""The order of operations for a GPU's registers: the same values, fewer of them alive at once."""

from collections import Counter

import casadi as ca
import numpy as np
import pytest

import pteron
from pteron.kernels import program
from pteron.kernels.graph import LOAD, STORE, expression, function_like, graph_of
from pteron.kernels.lifetimes import with_short_lifetimes


def most_alive(graph):
    """Return the largest number of computed values that are alive at once."""
    operations, alive, most = graph.operations(), 0, 0
    last = {a: k for k in operations for a in graph.nodes[k].arguments}
    last |= {k: -1 for part in graph.outputs for k in part}
    ends = Counter(last[k] for k in operations)
    for k in operations:
        alive += 1 - ends[k]
        most = max(most, alive)
    return most


def values_of(graph, entries):
    """Return the outputs' elements as CasADi expressions."""

    def rule(node, operands):
        """Return a node's expression; one that is stored or loaded is its operand."""
        return operands[0] if node.operation in (STORE, LOAD) else expression(node, operands)

    return graph.results(graph.values(lambda i, j: entries[i][j], rule))


@pytest.mark.parametrize(
    ("name", "what", "share", "numbers"),
    [
        ("delta", "forward_dynamics", 0.9, 116),
        ("delta", "forward_dynamics", 0.9, 20),
        ("stewart", "inverse_dynamics", 0.7, 116),
    ],
)
def test_fewer_values_are_alive_and_results_equal(name, what, share, numbers):
    function = program(pteron.load(name), what).function
    graph = graph_of(function)
    ordered = with_short_lifetimes(graph, numbers)
    assert most_alive(ordered) < share * most_alive(graph)
    counts = [Counter(node.operation for node in g.nodes) for g in (graph, ordered)]
    assert (counts[1].pop(STORE, 0) > 0) == (counts[1].pop(LOAD, 0) > 0) == (numbers == 20)
    assert counts[0] == counts[1]
    values = values_of(ordered, [symbol.nonzeros() for symbol in function.sx_in()])
    rebuilt = function_like(function, values, once=True)
    rng = np.random.default_rng(0)
    inputs = [0.1 * rng.normal(size=function.size_in(i)) for i in range(function.n_in())]
    np.testing.assert_array_equal(rebuilt.call(inputs)[0], function.call(inputs)[0])


def test_operations_that_no_output_needs_are_left_out():
    x = ca.SX.sym("x", 2)
    graph = graph_of(ca.Function("f", [x], [x[0] * x[1], ca.sqrt(x[0] + x[1])]))
    shorter = with_short_lifetimes(type(graph)(graph.nodes, (graph.outputs[0], ())))
    assert [shorter.nodes[k].operation for k in shorter.operations()] == ["mul"]
