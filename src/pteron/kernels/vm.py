"""Target `vm`: CasADi's own virtual machine, ready at once, no compiler needed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.kernels.exponential import straight
from pteron.kernels.graph import Node, expression, function_like, graph_of
from pteron.kernels.kernel import Array, ArrayKernel
from pteron.kernels.sincos import LIMIT, near

_BLOCK = 256
"""States in one call of the mapped function. Through a buffer CasADi reads NumPy's memory in
place (about 1 us a call), where a call with matrices takes 40 us."""


class VirtualMachine(ArrayKernel):
    """A kernel that CasADi's virtual machine executes."""

    @property
    def source(self) -> str:
        """The instructions, one a line, as CasADi prints them."""
        return str(self.function.str(True))

    @cached_property
    def _lowered(self) -> ca.Function:
        return _lowered(straight(self.function))

    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        shared = tuple(i for i, port in enumerate(self.ports) if port.shared)
        function = self._lowered
        whole = batch - batch % _BLOCK
        if whole:
            _sweep(_mapped(function, shared), inputs, outputs, range(0, whole, _BLOCK), _BLOCK)
        if whole < batch:
            _sweep(function, inputs, outputs, range(whole, batch), 1)


@lru_cache(maxsize=256)
def _lowered(function: ca.Function) -> ca.Function:
    """Return the function with the sines and cosines that every target has."""
    entries = [symbol.nonzeros() for symbol in function.sx_in()]

    def rule(node: Node, arguments: list[Expression]) -> Expression:
        value = expression(node, arguments)
        if node.operation not in ("sin", "cos"):
            return value
        close = near()(*arguments)[node.operation == "cos"]
        return ca.if_else(ca.fabs(arguments[0]) <= LIMIT, close, value)

    graph = graph_of(function)
    values = graph.values(lambda i, j: entries[i][j], rule)
    return function_like(function, graph.results(values))


@lru_cache(maxsize=256)
def _mapped(function: ca.Function, shared: tuple[int, ...]) -> ca.Function:
    return function.map(f"{function.name()}_block", "serial", _BLOCK, list(shared), [])


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
