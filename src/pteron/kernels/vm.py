"""Target `vm`: CasADi's own virtual machine, ready at once, no compiler needed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca

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
        return _lowered(self.function)

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
    inputs = function.sx_in()
    outputs = [ca.SX(function.sparsity_out(i)) for i in range(function.n_out())]
    entries = [symbol.nz for symbol in inputs]
    slots: dict[int, Any] = {}
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_INPUT:
            slots[target[0]] = entries[source[0]][source[1]]
        elif code == ca.OP_CONST:
            slots[target[0]] = ca.SX(function.instruction_constant(k))
        elif code == ca.OP_OUTPUT:
            outputs[target[0]].nz[target[1]] = slots[source[0]]
        elif code in (ca.OP_SIN, ca.OP_COS):
            angle = slots[source[0]]
            far = ca.SX.unary(code, angle)
            close = near()(angle)[0 if code == ca.OP_SIN else 1]
            slots[target[0]] = ca.if_else(ca.fabs(angle) <= LIMIT, close, far)
        elif len(source) == 1:
            slots[target[0]] = ca.SX.unary(code, slots[source[0]])
        else:
            slots[target[0]] = ca.SX.binary(code, *(slots[i] for i in source))
    return ca.Function(function.name(), inputs, ca.cse(outputs))


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
