"""The order of operations for a GPU's registers: the same values, fewer of them alive at once."""

from collections import Counter

import casadi as ca
import numpy as np
import pytest

import pteron
from pteron.kernels import program
from pteron.kernels.graph import expression, function_like, graph_of
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


@pytest.mark.parametrize(
    ("name", "what", "share"),
    [("delta", "forward_dynamics", 0.9), ("stewart", "inverse_dynamics", 0.7)],
)
def test_fewer_values_are_alive_and_results_equal(name, what, share):
    function = program(pteron.load(name), what).function
    graph = graph_of(function)
    ordered = with_short_lifetimes(graph)
    assert most_alive(ordered) < share * most_alive(graph)
    operations = [Counter(node.operation for node in g.nodes) for g in (graph, ordered)]
    assert operations[0] == operations[1]
    entries = [symbol.nonzeros() for symbol in function.sx_in()]
    values = ordered.values(lambda i, j: entries[i][j], expression)
    rebuilt = function_like(function, ordered.results(values), once=True)
    rng = np.random.default_rng(0)
    inputs = [0.1 * rng.normal(size=function.size_in(i)) for i in range(function.n_in())]
    np.testing.assert_array_equal(rebuilt.call(inputs)[0], function.call(inputs)[0])


def test_operations_that_no_output_needs_are_left_out():
    x = ca.SX.sym("x", 2)
    graph = graph_of(ca.Function("f", [x], [x[0] * x[1], ca.sqrt(x[0] + x[1])]))
    shorter = with_short_lifetimes(type(graph)(graph.nodes, (graph.outputs[0], ())))
    assert [shorter.nodes[k].operation for k in shorter.operations()] == ["mul"]
