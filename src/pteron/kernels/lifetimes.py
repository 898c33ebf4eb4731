"""An order of a graph's operations in which few values are alive at once, for a GPU's registers.

A thread has 255 registers, enough for some 120 numbers of double precision; values beyond these are
*spilled* to memory. NVIDIA's compiler mostly preserves the order of statements. A graph's own order
follows its outputs and keeps values of all legs alive until they are added up; the order here
evaluates a leg's contributions together where the sums allow it, and where registers are full it
stores the numbers that are used last. No sum is rearranged, so that the results have the same bits.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Mapping, Sequence

from pteron.kernels.graph import CONSTANT, INPUT, LOAD, STORE, Graph, Node
from pteron.kernels.program_cache import cached_result

_CLUSTER, _WORK = 40, 150_000
"""Most operations of a cluster, see `_order_by_clusters`, and the most that this number times the
number of all operations may be, so that the order takes some seconds. Measured on the forward
dynamics of hexapods: clusters of 10 leave up to twice as many bytes spilled, of 120 none fewer."""

_FEW = 3
"""Unevaluated uses of a value from which on its last use is foreseen; 8 give the same orders."""

NUMBERS = 116
"""Numbers of double precision in the registers of a thread: 255 of 32 bits, less some for addresses
and intermediate results."""

_Operands = Mapping[int, Sequence[int]]
"""The operations that each operation reads, once each; operations are numbers of graph nodes."""


def with_short_lifetimes(graph: Graph, numbers: int = NUMBERS) -> Graph:
    """Return the graph with its operations in an order in which few values are alive at once.

    Where there are more than `numbers`, the one whose next use comes last is stored in memory
    (operation `STORE`) and loaded before that use (`LOAD`). Operations that are computed before all
    others (shared ones, sines and cosines of inputs) remain first. Those that no output needs are
    left out.
    """
    steps = cached_result(("statements", graph, numbers), (), lambda: _steps(graph, numbers))
    nodes, places, stores = list[Node](), dict[int, int](), dict[int, int]()
    for operation, k in steps:
        node = graph.nodes[k]
        if operation == LOAD:
            node = Node(LOAD, (stores[k],))
        elif operation == STORE:
            stores[k] = len(nodes)
            node = Node(STORE, (places[k],))
        elif operation != INPUT:
            node = node._replace(arguments=tuple(places[a] for a in node.arguments))
        places[k] = len(nodes)
        nodes.append(node)
    outputs = (tuple(places[k] for k in part) for part in graph.outputs)
    return Graph(tuple(nodes), tuple(outputs))


def _steps(graph: Graph, numbers: int) -> list[tuple[str, int]]:
    """Return (operation, node) of the nodes that outputs need, of stores and of loads, in order."""
    nodes, results = graph.nodes, {k for part in graph.outputs for k in part}
    needed = set(results)
    for k in reversed(range(len(nodes))):
        if k in needed and nodes[k].operation != INPUT:
            needed.update(nodes[k].arguments)
    movable = {
        k
        for k in needed
        if not (nodes[k].operation in (INPUT, CONSTANT) or nodes[k].shared or nodes[k].outlying)
    }
    operands = {
        k: [a for a in dict.fromkeys(nodes[k].arguments) if a in movable] for k in sorted(movable)
    }
    starts = (_backward(operands, results & movable, sign) for sign in (1, -1))
    orders = [_order_by_clusters(start, operands, results) for start in starts]
    steps = min((_with_transfers(order, operands, results, numbers) for order in orders), key=len)
    first = [(k, "") for k in sorted(needed - movable)]
    return [(operation or nodes[k].operation, k) for k, operation in (*first, *steps)]


def _users(operands: _Operands) -> dict[int, list[int]]:
    """Return the operations that read each operation."""
    users: dict[int, list[int]] = {k: [] for k in operands}
    for k, read in operands.items():
        for a in read:
            users[a].append(k)
    return users


def _backward(operands: _Operands, results: set[int], sign: int) -> list[int]:
    """Return the operations in an order chosen from the last one to the first.

    Each time the operation is chosen that adds fewest values to those alive; among equals, the one
    whose value became alive last for `sign` 1, first for -1.
    """
    uses = {k: len(users) for k, users in _users(operands).items()}
    since = dict.fromkeys(operands, 0)
    alive, ready, order = set(results), {k for k in uses if not uses[k]}, list[int]()
    while ready:
        k = min(
            ready, key=lambda k: (sum(a not in alive for a in operands[k]), -sign * since[k], -k)
        )
        ready.remove(k)
        alive.discard(k)
        order.append(k)
        for a in operands[k]:
            if a not in alive:
                alive.add(a)
                since[a] = len(order)
            uses[a] -= 1
            if not uses[a]:
                ready.add(a)
    return order[::-1]


def _order_by_clusters(order: Sequence[int], operands: _Operands, results: set[int]) -> list[int]:
    """Return the operations in an order improved by clusters.

    A cluster is an operation with all that must be evaluated before it. The next one is always the
    cluster after which fewest values are alive; among equals, the smallest. A heap has the clusters
    by score; scores that an evaluated cluster changes are renewed.
    """
    users, ranks = _users(operands), {k: rank for rank, k in enumerate(order)}
    uses = Counter({k: len(users[k]) + (k in results) for k in order})
    clusters: dict[int, list[int]] = {k: [] for k in order}
    holders: dict[int, set[int]] = {k: set() for k in order}
    versions, heap = dict.fromkeys(order, 0), list[tuple[int, int, int, int, int]]()
    evaluated = dict[int, None]()
    most = min(_CLUSTER, _WORK // max(1, len(order)))

    def renew(last: int) -> None:
        """Find the cluster that ends with an operation, and score it unless it is too large."""
        for k in clusters[last]:
            holders[k].discard(last)
        versions[last] += 1
        cluster = clusters[last] = [] if last in evaluated else [last]
        members = {last}
        for k in cluster:  # which grows
            if len(cluster) > most:
                break
            for a in operands[k]:
                if a not in members and a not in evaluated:
                    members.add(a)
                    cluster.append(a)
        for k in cluster:
            holders[k].add(last)
        if 0 < len(cluster) <= most:
            read = Counter(a for k in cluster for a in operands[k])
            begun = sum(uses[k] > read[k] for k in cluster)
            ended = sum(a in evaluated and uses[a] == count for a, count in read.items())
            score = begun - ended, len(cluster), ranks[last]
            heapq.heappush(heap, (*score, last, versions[last]))

    for k in order:
        renew(k)
    while heap:
        *_, last, version = heapq.heappop(heap)
        if version != versions[last]:
            continue
        cluster = sorted(clusters[last], key=ranks.__getitem__)
        evaluated.update(dict.fromkeys(cluster))
        uses.subtract(a for k in cluster for a in operands[k])
        changed = {last for k in cluster for last in holders[k]}
        for a in {a for k in cluster for a in operands[k] if 0 < uses[a] <= _FEW}:
            for k in users[a]:
                changed |= holders[k]
        for k in changed:
            renew(k)
    return list(evaluated)


def _with_transfers(
    order: Sequence[int], operands: _Operands, results: set[int], numbers: int
) -> list[tuple[int, str]]:
    """Return the order as pairs (operation, ""), with stores and loads where registers are full.

    The number whose next use comes last is stored (L. A. Belady, IBM Systems Journal 5 (1966)
    78-101).
    """
    uses = {k: [len(order)] if k in results else [] for k in order}
    for place in reversed(range(len(order))):
        for a in operands[order[place]]:
            uses[a].append(place)
    present, stored, steps = set[int](), set[int](), list[tuple[int, str]]()
    for k in order:
        steps += ((a, LOAD) for a in operands[k] if a not in present)
        steps.append((k, ""))
        present.update(operands[k], (k,))
        for a in operands[k]:
            uses[a].pop()
        present -= {a for a in operands[k] if not uses[a]}
        while len(present) > numbers:
            last = max(present, key=lambda a: uses[a][-1])
            present.remove(last)
            if last not in stored:
                stored.add(last)
                steps.append((last, STORE))
    return steps
