"""Target `intervals`: proved bounds on a function's outputs in boxes of its inputs.

A box holds every state between two corners. The graph of a CasADi function is evaluated with NumPy
arrays of intervals, one operation at a time for many boxes. `kernels.interval_arithmetic` shows
that the bounds hold in spite of rounding, and how a function that is undefined is marked.

This is the natural form: intervals in place of numbers. It is exact, but for rounding, where every
input occurs once, and else too wide, as x - x is; `kernels.bounds` adds a narrower form.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.errors import DataError
from pteron.kernels import interval_arithmetic as arithmetic
from pteron.kernels.graph import CONSTANT, INPUT, Graph, graph_of
from pteron.kernels.interval_arithmetic import RULES, Interval, constant
from pteron.kernels.kernel import Array, Kernel, as_array

_CHUNK = 1 << 13
"""Boxes at a time: what an operation reads and writes stays in the processor's cache."""


@dataclass(frozen=True)
class Enclosure:
    """Bounds on a function's output in each of the boxes (...).

    Attributes
    ----------
    low, high : array, shape (..., *output)
        Every value that it takes in the box, where it is defined, is between them; -inf and inf
        where nothing is known, NaN where it is defined nowhere in the box.
    defined : array of bool, shape (..., *output)
        Whether it is proved to be defined in all of the box.
    """

    low: Array
    high: Array
    defined: NDArray[np.bool_]


class Boxed(Kernel):
    """A kernel of intervals, by natural extension.

    It takes a box for each input that is not shared, shape (..., 2, *port.shape), least values
    first, and returns an `Enclosure` for each output.
    """

    def _evaluate(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        """Return an `Enclosure` of each output over boxes of the inputs (..., 2, n)."""
        by_port = self._values_by_port(values, fixed)
        arrays = []
        for port in self.ports:
            shape = port.shape if port.shared else (2, *port.shape)
            arrays.append(as_array(by_port[port.name], port.name, shape))
        lead = np.broadcast_shapes(
            *(
                array.shape[: array.ndim - len(port.shape) - 1]
                for array, port in zip(arrays, self.ports, strict=True)
                if not port.shared
            )
        )
        count = int(np.prod(lead))
        lows, highs = [], []
        for array, port in zip(arrays, self.ports, strict=True):
            if port.shared:
                lows.append(array.reshape(1, -1))
                highs.append(lows[-1])
                continue
            boxes = np.broadcast_to(array, (*lead, 2, *port.shape)).reshape(count, 2, -1)
            if not (boxes[:, 0] <= boxes[:, 1]).all():
                raise DataError(f"{port.name}: a box's least value is above its greatest, or NaN")
            lows.append(boxes[:, 0])
            highs.append(boxes[:, 1])
        graph = graph_of(self.function)
        enclosed_nodes = enclose_nodes(
            graph, [k for nodes in graph.outputs for k in nodes], lows, highs, count
        )
        ends = np.cumsum([len(nodes) for nodes in graph.outputs])[:-1]
        results = []
        for port, *parts in zip(
            self.outputs,
            *(np.split(part, ends, axis=1) for part in enclosed_nodes[:3]),
            strict=True,
        ):
            results.append(Enclosure(*(part.reshape(lead + port.shape) for part in parts)))
        return results[0] if len(results) == 1 else tuple(results)


def enclose_nodes(
    graph: Graph,
    nodes: Sequence[int],
    lows: Sequence[Array],
    highs: Sequence[Array],
    count: int,
) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return bounds low, high, defined, continuous (B, N) of N graph nodes in B boxes.

    Only what the nodes depend on is computed.
    """
    needed = dependencies_of(graph, nodes)
    columns = list(zip(*(_columns(*both) for both in zip(lows, highs, strict=True)), strict=True))
    low, high = np.empty((len(nodes), count)), np.empty((len(nodes), count))
    defined, continuous = (np.ones((len(nodes), count), bool) for _ in range(2))
    with np.errstate(all="ignore"):
        for start in range(0, count, _CHUNK):
            part = slice(start, min(start + _CHUNK, count))
            intervals = _walk(graph, needed, columns, part)
            for row, k in enumerate(nodes):
                interval = intervals[k]
                assert interval is not None
                low[row, part], high[row, part] = interval.low, interval.high
                _mark(low[row, part], high[row, part], interval)
                if interval.maybe is not None:
                    defined[row, part] = ~interval.maybe
                if interval.maybe is not None or interval.jump is not None:
                    jump = arithmetic.either(interval.maybe, interval.jump)
                    continuous[row, part] = ~np.asarray(jump)
    return low.T, high.T, defined.T, continuous.T


def _columns(low: Array, high: Array) -> tuple[list[Array], list[Array]]:
    """Return an input's low and high elements as columns (B,), or (1,) where all boxes agree."""
    lows, highs = [], []
    for a, b in zip(low.T, high.T, strict=True):
        alike = len(a) > 0 and bool((a == a[0]).all() and (b == b[0]).all())
        lows.append(a[:1] if alike else a.copy())
        highs.append(b[:1] if alike else b.copy())
    return lows, highs


def _walk(
    graph: Graph,
    needed: Sequence[int],
    columns: Sequence[Sequence[Sequence[Array]]],
    part: slice,
) -> list[Interval | None]:
    """Return the interval of each graph node in a slice of the boxes; None if not needed."""
    intervals: list[Interval | None] = [None] * len(graph.nodes)
    for k in needed:
        node = graph.nodes[k]
        if node.operation == INPUT:
            port, element = node.arguments
            low, high = (side[port][element] for side in columns)
            intervals[k] = Interval(low, high) if len(low) == 1 else Interval(low[part], high[part])
        elif node.operation == CONSTANT:
            intervals[k] = constant(node.value)
        elif node.operation == "mul" and node.arguments[0] == node.arguments[1]:
            intervals[k] = arithmetic.square(intervals[node.arguments[0]])  # type: ignore[arg-type]
        elif node.operation not in RULES:
            raise DataError(f"operation {node.operation} has no rule for intervals")
        else:
            intervals[k] = RULES[node.operation](*(intervals[i] for i in node.arguments))
    return intervals


def _mark(low: Array, high: Array, interval: Interval) -> None:
    """Set NaN bounds (B,) to infinity, and bounds where nothing is defined to NaN, in place."""
    low[np.isnan(low)], high[np.isnan(high)] = -np.inf, np.inf
    if interval.never is not None:
        never = np.broadcast_to(interval.never, low.shape)
        low[never] = high[never] = np.nan


def dependencies_of(graph: Graph, nodes: Sequence[int]) -> list[int]:
    """Return the indices of the graph nodes that the given nodes depend on, sorted."""
    needed = set(nodes)
    for k in range(max(nodes, default=-1), -1, -1):
        if k in needed and graph.nodes[k].operation != INPUT:
            needed.update(graph.nodes[k].arguments)
    return sorted(needed)


def occurs_once(graph: Graph, node: int, moving: Collection[int]) -> bool:
    """Return whether a graph node depends on each `moving` input element only once.

    Then its natural interval is exact up to rounding. Elements of the first input that are not in
    `moving` are numbers, not intervals.
    """
    uses: dict[int, int] = {}
    fixed: set[int] = set()
    for k in dependencies_of(graph, [node]):
        operation, arguments = graph.nodes[k].operation, graph.nodes[k].arguments
        if operation == INPUT:
            is_fixed = arguments[1] not in moving
        else:
            is_fixed = fixed.issuperset(arguments)
            for i in set(arguments) - fixed:
                uses[i] = uses.get(i, 0) + 1
        if is_fixed:
            fixed.add(k)
    return max(uses.values(), default=0) <= 1
