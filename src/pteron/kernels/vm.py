"""Target `vm`: ready at once, no compiler needed.

CasADi's own virtual machine evaluates one state or a few. For many NumPy does each operation on a
block of states at once: 0.5 ns for an operation on a state, where CasADi takes 2 ns. Both round
each operation alike: results are the same to the bit. What NumPy might round otherwise, such as
atan2, is left to CasADi.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache, partial
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pteron.bodies.motion import Expression
from pteron.kernels.exponential import straight
from pteron.kernels.graph import INPUT, Graph, Node, expression, graph_of, rewritten
from pteron.kernels.kernel import Array, ArrayKernel, Port, as_array
from pteron.kernels.sincos import LIMIT, near

LENGTH = 1024
"""States of a block."""

_OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "sqrt": np.sqrt,
    "fabs": np.fabs,
    "floor": np.floor,
    "fmin": np.fmin,
    "fmax": np.fmax,
    "less": np.less,
    "less_equal": np.less_equal,
    "equal": np.equal,
    "unequal": np.not_equal,
    "not": np.logical_not,
    "and": np.logical_and,
    "or": np.logical_or,
    "select": lambda held, value, out: np.copyto(out, np.where(held != 0.0, value, 0.0)),
}
"""Operations whose last argument is where the result goes."""

_THREAD = threading.local()
"""Each thread's rows of a block's length, which all functions fill in turn."""


class Sweep:
    """A function, its sines and cosines lowered, for batches; it serves the thread that makes it.

    Parameters
    ----------
    function : casadi.Function
        An SX function.
    ports : tuple of Port
        Its inputs. What depends on shared ones alone is computed once a batch.
    """

    def __init__(self, function: ca.Function, ports: tuple[Port, ...]) -> None:
        graph = graph_of(function, ports)
        self._places = places = _places(graph)
        self._inputs: list[tuple[Any, ...]] = []
        # By whether they are shared: an operation, its arguments, the place of its result.
        self._steps: dict[bool, list[tuple[Any, ...]]] = {True: [], False: []}
        for k, place in places.items():
            node = graph.nodes[k]
            if node.operation == INPUT:
                self._inputs.append((*node.arguments, place))
            elif node.arguments:
                made = _OPERATIONS.get(node.operation) or _by_casadi(node, place.shape)
                self._steps[node.shared].append((made, *(places[i] for i in node.arguments), place))
        self._outputs = [
            (i, j, places[k]) for i, nodes in enumerate(graph.outputs) for j, k in enumerate(nodes)
        ]

    def run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Fill the first rows of `outputs` by those of `inputs`, see `ArrayKernel`."""
        with np.errstate(all="ignore"):
            for i, j, place in self._inputs:
                if not place.ndim:
                    place[...] = inputs[i][j]
            for operation, *places in self._steps[True]:
                operation(*places)
            for first in range(0, batch, LENGTH):
                last = min(first + LENGTH, batch)
                for i, j, place in self._inputs:
                    if place.ndim:
                        place[: last - first] = inputs[i][first:last, j]
                for operation, *places in self._steps[False]:
                    operation(*places)
                for i, j, place in self._outputs:
                    outputs[i][first:last, j] = place[: last - first] if place.ndim else place


def _places(graph: Graph) -> dict[int, Array]:
    """Return the place of the value of each node that the outputs depend on.

    A value that is shared has a place of its own, another a row, which serves again after its last
    use; a row of an input is not written to before.
    """
    count = len(graph.nodes)
    last = {k: count for nodes in graph.outputs for k in nodes}
    for k in reversed(range(count)):
        if k in last and graph.nodes[k].operation != INPUT:
            last.update((i, k) for i in graph.nodes[k].arguments if i not in last)
    rows: list[Array] = vars(_THREAD).setdefault("rows", [])
    places: dict[int, Array] = {}
    free: list[Array] = []
    taken = 0
    for k in sorted(last):
        node = graph.nodes[k]
        if node.shared:
            places[k] = np.array(node.value)
            continue
        if node.operation != INPUT:
            ends = {i for i in node.arguments if last[i] == k and not graph.nodes[i].shared}
            free += [places[i] for i in ends]
        if node.operation != INPUT and free:
            places[k] = free.pop()
            continue
        if taken == len(rows):
            rows.append(np.zeros(LENGTH))
        places[k], taken = rows[taken], taken + 1
    return places


def _by_casadi(node: Node, shape: tuple[int, ...]) -> Callable[..., None]:
    """Return an operation that CasADi does, element by element."""
    symbols = [ca.SX.sym("value") for _ in node.arguments]
    one = ca.Function("one", symbols, [expression(node, symbols)])
    buffer, evaluate = one.map(int(np.prod(shape))).buffer()
    held = [np.zeros(shape) for _ in symbols]
    for i, row in enumerate(held):
        buffer.set_arg(i, row.reshape(-1).data)
    # A sine or cosine is needed beyond the limit only: see `_lowered`.
    lowered = node.operation in ("sin", "cos")

    def made(*given: Array) -> None:
        *arguments, out = given
        if lowered and np.abs(arguments[0]).max() <= LIMIT:
            return
        for row, value in zip(held, arguments, strict=True):
            row[...] = value
        buffer.set_res(0, out.reshape(-1).data)
        evaluate()

    return made


_FLOAT = np.dtype(float)

_MANY = 320
"""States from which on NumPy's blocks take less time than CasADi's calls."""

_CALLS = 32, 4, 1
"""States in one call: fewer than many are cut into the largest calls first. Through a buffer CasADi
reads NumPy's memory in place (about 1 us a call), where a call with matrices takes 40 us."""


class VirtualMachine(ArrayKernel):
    """A kernel that CasADi's virtual machine executes."""

    @cached_property
    def _lowered(self) -> ca.Function:
        return _lowered(straight(self.function))

    @cached_property
    def _held(self) -> threading.local:
        return threading.local()

    def checked(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        """Evaluate the kernel; plain arrays of one state take less than half the time of others."""
        found = None if fixed else self._of_one_state(values)
        return super().checked(*values, **fixed) if found is None else found

    def _of_one_state(self, values: Sequence[Any]) -> Any:
        """Return the outputs for plain arrays of one state; None where something else is given."""
        if len(values) != len(self.inputs):
            return None
        for value, port in zip(values, self.inputs, strict=True):
            plain = type(value) is np.ndarray and value.dtype == _FLOAT
            if not plain or value.shape != port.shape:
                return None
        held: OneState | None = getattr(self._held, "state", None)
        if held is None:
            held = self._held.state = OneState(self)
        for mine, value in zip(held.inputs, values, strict=True):
            mine[...] = value
        held.evaluate()
        found = tuple([output.copy() for output in held.outputs])
        return found[0] if len(found) == 1 else found

    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        shared = tuple(i for i, port in enumerate(self.ports) if port.shared)
        function = self._lowered
        rest = batch % LENGTH
        start = batch - rest if rest < _MANY else batch
        if start:
            held = vars(self._held)
            if "sweep" not in held:
                held["sweep"] = Sweep(function, self.ports)
            held["sweep"].run(start, inputs, outputs)
        for size in _CALLS:
            stop = batch - (batch - start) % size
            if start < stop:
                mapped = _mapped(function, shared, size) if size > 1 else function
                _sweep(mapped, inputs, outputs, range(start, stop, size), size)
            start = stop


class OneState:
    """A thread's memory for one state, which CasADi reads and fills in place."""

    def __init__(self, kernel: VirtualMachine) -> None:
        self._buffer, self.evaluate = kernel._lowered.buffer()
        self.inputs: list[Array] = []
        self._fixed: list[Array] = []
        for i, port in enumerate(kernel.ports):
            fixed = kernel.fixed.get(port.name)
            array = np.zeros(port.shape)
            if fixed is not None:
                array[...] = as_array(fixed, port.name, port.shape)
            (self.inputs if fixed is None else self._fixed).append(array)
            self._buffer.set_arg(i, array.reshape(-1).data)
        self.outputs = [np.zeros(port.shape) for port in kernel.outputs]
        for i, array in enumerate(self.outputs):
            self._buffer.set_res(i, array.reshape(-1).data)


@lru_cache(maxsize=256)
def _lowered(function: ca.Function) -> ca.Function:
    """Return the function with the sines and cosines of `sincos`."""
    rules = {"sin": partial(_close, 0, ca.sin), "cos": partial(_close, 1, ca.cos)}
    return rewritten(function, rules)


def _close(place: int, exact: Callable[[Expression], Expression], angle: Expression) -> Expression:
    return ca.if_else(ca.fabs(angle) <= LIMIT, near()(angle)[place], exact(angle))


@lru_cache(maxsize=512)
def _mapped(function: ca.Function, shared: tuple[int, ...], size: int) -> ca.Function:
    return function.map(f"{function.name()}_block", "serial", size, list(shared), [])


def _sweep(
    function: ca.Function,
    inputs: Sequence[Array],
    outputs: Sequence[Array],
    starts: range,
    step: int,
) -> None:
    buffer, evaluate = function.buffer()
    for i, value in enumerate(inputs):
        if value.ndim == 1:
            buffer.set_arg(i, value.data)
    batched = [(i, value) for i, value in enumerate(inputs) if value.ndim == 2]
    for start in starts:
        for i, value in batched:
            buffer.set_arg(i, value[start : start + step].data)
        for i, value in enumerate(outputs):
            buffer.set_res(i, value[start : start + step].data)
        evaluate()
