"""Target `vm`: CasADi's own virtual machine, ready at once, no compiler needed."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pteron.bodies.motion import Expression
from pteron.kernels.exponential import straight
from pteron.kernels.graph import Node, expression, function_like, graph_of
from pteron.kernels.kernel import Array, ArrayKernel, as_array
from pteron.kernels.sincos import LIMIT, near

_FLOAT = np.dtype(float)

_BLOCKS = 256, 32, 4, 1
"""States in one call: a batch is cut into the largest blocks first. Through a buffer CasADi reads
NumPy's memory in place (about 1 us a call), where a call with matrices takes 40 us."""


class VirtualMachine(ArrayKernel):
    """A kernel that CasADi's virtual machine executes."""

    @property
    def source(self) -> str:
        """The instructions, one a line, as CasADi prints them."""
        return str(self.function.str(True))

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
        held: _OneState | None = getattr(self._held, "state", None)
        if held is None:
            held = self._held.state = _OneState(self)
        for mine, value in zip(held.inputs, values, strict=True):
            mine[...] = value
        held.evaluate()
        found = tuple([output.copy() for output in held.outputs])
        return found[0] if len(found) == 1 else found

    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        shared = tuple(i for i, port in enumerate(self.ports) if port.shared)
        function = self._lowered
        start = 0
        for size in _BLOCKS:
            stop = batch - (batch - start) % size
            if start < stop:
                mapped = _mapped(function, shared, size) if size > 1 else function
                _sweep(mapped, inputs, outputs, range(start, stop, size), size)
            start = stop


class _OneState:
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
    graph = graph_of(function)
    if not any(node.operation in ("sin", "cos") for node in graph.nodes):
        return function
    entries = [symbol.nonzeros() for symbol in function.sx_in()]

    def rule(node: Node, arguments: list[Expression]) -> Expression:
        value = expression(node, arguments)
        if node.operation not in ("sin", "cos"):
            return value
        close = near()(*arguments)[node.operation == "cos"]
        return ca.if_else(ca.fabs(arguments[0]) <= LIMIT, close, value)

    values = graph.values(lambda i, j: entries[i][j], rule)
    return function_like(function, graph.results(values))


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
