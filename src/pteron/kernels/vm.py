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
from pteron.kernels.exponential import with_lowered_exponentials
from pteron.kernels.graph import INPUT, Graph, Node, expression, graph_of, rewrite_operations
from pteron.kernels.kernel import Array, ArrayKernel, Port, as_array
from pteron.kernels.program_cache import cached_result
from pteron.kernels.sincos import LIMIT, reduced_sincos

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
    "select": lambda test, chosen, out: np.copyto(out, np.where(test != 0.0, chosen, 0.0)),
}
"""Operations whose last argument receives the result."""

_THREAD = threading.local()
"""Each thread's rows of a block's length, which all functions fill in turn."""


class BatchInterpreter:
    """A batch interpreter of a function with lowered sines, for the thread that constructs it.

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
                operation = _OPERATIONS.get(node.operation) or _casadi_operation(node, place.shape)
                operands = (places[i] for i in node.arguments)
                self._steps[node.shared].append((operation, *operands, place))
        self._outputs = [
            (i, j, places[k]) for i, nodes in enumerate(graph.outputs) for j, k in enumerate(nodes)
        ]

    def run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Fill the first `batch` rows of `outputs` from those of `inputs`."""
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
    """Return the storage array of each graph node that the outputs depend on, rows reused.

    A shared value has a scalar of its own, others a row, which is reused after its last use; rows
    of inputs are not reused before the end.
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


def _casadi_operation(node: Node, shape: tuple[int, ...]) -> Callable[..., None]:
    """Return a function that evaluates a graph node element by element by CasADi."""
    symbols = [ca.SX.sym("value") for _ in node.arguments]
    scalar_function = ca.Function("one", symbols, [expression(node, symbols)])
    buffer, evaluate = scalar_function.map(int(np.prod(shape))).buffer()
    rows = [np.zeros(shape) for _ in symbols]
    for i, row in enumerate(rows):
        buffer.set_arg(i, row.reshape(-1).data)
    # A sine or cosine is needed beyond the limit only: see `_with_lowered_sines`.
    lowered = node.operation in ("sin", "cos")

    def operation(*arrays: Array) -> None:
        """Fill the last array with the node's operation on the others."""
        *arguments, out = arrays
        if lowered and np.abs(arguments[0]).max() <= LIMIT:
            return
        for row, array in zip(rows, arguments, strict=True):
            row[...] = array
        buffer.set_res(0, out.reshape(-1).data)
        evaluate()

    return operation


_FLOAT = np.dtype(float)

_MANY = 320
"""States from which on NumPy's blocks take less time than CasADi's calls."""

_CALLS = 32, 4, 1
"""States in one call: fewer than many are cut into the largest calls first. Through a buffer CasADi
reads NumPy's memory in place (about 1 us a call), where a call with matrices takes 40 us."""


class VirtualMachine(ArrayKernel):
    """A kernel that CasADi's virtual machine executes."""

    @cached_property
    def _lowered_function(self) -> ca.Function:
        """The kernel's function with sines, cosines and exponentials in plain arithmetic."""
        return _lower(self.function)

    @cached_property
    def _thread_memory(self) -> threading.local:
        """Each thread's buffers of a single state and its batch interpreter."""
        return threading.local()

    def evaluate_checked(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        """Evaluate the kernel; plain arrays of one state take less than half the time of others."""
        outputs = None if fixed else self._evaluate_one_state(values)
        return super().evaluate_checked(*values, **fixed) if outputs is None else outputs

    def _evaluate_one_state(self, values: Sequence[Any]) -> Any:
        """Return the outputs for plain arrays of one state; None where something else is given."""
        if len(values) != len(self.inputs):
            return None
        for number, port in zip(values, self.inputs, strict=True):
            is_plain = type(number) is np.ndarray and number.dtype == _FLOAT
            if not is_plain or number.shape != port.shape:
                return None
        memory: OneState | None = getattr(self._thread_memory, "state", None)
        if memory is None:
            memory = self._thread_memory.state = OneState(self)
        for mine, number in zip(memory.inputs, values, strict=True):
            mine[...] = number
        memory.evaluate()
        copies = tuple([array.copy() for array in memory.outputs])
        return copies[0] if len(copies) == 1 else copies

    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Fill `outputs` for a batch of states: most by the interpreter, the rest by CasADi."""
        shared = tuple(i for i, port in enumerate(self.ports) if port.shared)
        function = self._lowered_function
        remainder = batch % LENGTH
        start = batch - remainder if remainder < _MANY else batch
        if start:
            memory = vars(self._thread_memory)
            if "sweep" not in memory:
                memory["sweep"] = BatchInterpreter(function, self.ports)
            memory["sweep"].run(start, inputs, outputs)
        for size in _CALLS:
            stop = batch - (batch - start) % size
            if start < stop:
                mapped = _map_states(function, shared, size) if size > 1 else function
                _evaluate_calls(mapped, inputs, outputs, range(start, stop, size), size)
            start = stop


class OneState:
    """A thread's memory for one state, which CasADi reads and fills in place."""

    def __init__(self, kernel: VirtualMachine) -> None:
        self._buffer, self.evaluate = kernel._lowered_function.buffer()
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
def _lower(function: ca.Function) -> ca.Function:
    """Return a CasADi function rewritten in plain arithmetic, cached on disk."""

    def rewrite() -> str:
        """Return the function as serialised text, rewritten in plain arithmetic."""
        lowered: str = _with_lowered_sines(with_lowered_exponentials(function)).serialize()
        return lowered

    return ca.Function.deserialize(cached_result(("lowered", function.serialize()), (), rewrite))


def _with_lowered_sines(function: ca.Function) -> ca.Function:
    """Return a CasADi function with its sines and cosines replaced by plain arithmetic."""
    rules = {"sin": partial(_sine_or_cosine, 0, ca.sin), "cos": partial(_sine_or_cosine, 1, ca.cos)}
    return rewrite_operations(function, rules)


def _sine_or_cosine(
    place: int, exact: Callable[[Expression], Expression], angle: Expression
) -> Expression:
    """Return sin (place 0) or cos (1) of an angle, rad: plain arithmetic within `LIMIT`."""
    return ca.if_else(ca.fabs(angle) <= LIMIT, reduced_sincos()(angle)[place], exact(angle))


@lru_cache(maxsize=512)
def _map_states(function: ca.Function, shared: tuple[int, ...], size: int) -> ca.Function:
    """Return the CasADi function that evaluates `size` states side by side, cached."""
    return function.map(f"{function.name()}_block", "serial", size, list(shared), [])


def _evaluate_calls(
    function: ca.Function,
    inputs: Sequence[Array],
    outputs: Sequence[Array],
    starts: range,
    step: int,
) -> None:
    """Call a mapped CasADi function from each start row on, reading and writing array views."""
    buffer, evaluate = function.buffer()
    for i, array in enumerate(inputs):
        if array.ndim == 1:
            buffer.set_arg(i, array.data)
    batched = [(i, array) for i, array in enumerate(inputs) if array.ndim == 2]
    for start in starts:
        for i, array in batched:
            buffer.set_arg(i, array[start : start + step].data)
        for i, array in enumerate(outputs):
            buffer.set_res(i, array[start : start + step].data)
        evaluate()
