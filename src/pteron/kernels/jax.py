"""Target `jax`: a pure function of arrays, which jits, maps, differentiates and runs on a GPU.

The function is elementwise from its inputs' components to its outputs', so that XLA fuses it into
loops: on the CPU 23 for the inverse dynamics, since it does not repeat a root or a quotient that
several expressions use.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from importlib.util import find_spec
from typing import Any

import numpy as np

from pteron.errors import DataError
from pteron.extras import import_extra
from pteron.kernels.code import PYTHON, names_of, statements
from pteron.kernels.graph import graph_of
from pteron.kernels.kernel import Kernel, require_unmasked
from pteron.kernels.named_columns import pick_columns

_TRUTHS = ("less", "less_equal", "equal", "unequal", "not", "and", "or")
"""Operations whose truth values are made 1.0 or 0.0: in JAX they would not add up as numbers."""

_PRINTED = (
    PYTHON
    | {"select": "where({0}, {1}, 0.0)"}
    | {operation: f"where({PYTHON[operation]}, 1.0, 0.0)" for operation in _TRUTHS}
)

_ROUNDED = ("float32", "float64")
"""The types of an array and of a kernel with which digits would be lost without notice."""


class Traced(Kernel):
    """A kernel that JAX traces. It takes and returns JAX arrays, and may be called inside `jit`.

    What is given by name, such as `parameters`, can be differentiated with respect to as well.
    With dtype float64 it switches JAX to 64 bits (`jax_enable_x64`), for the process, when it is
    made: arrays made from then on have them. Earlier ones, which do not, are refused.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if self.dtype == "float64" and find_spec("jax"):
            # Without it JAX would take float64 for float32 and say nothing.
            import jax

            jax.config.update("jax_enable_x64", True)

    @cached_property
    def source(self) -> str:
        """The Python source of the JAX function."""
        graph = graph_of(self.function, self.ports)
        names = names_of(graph, lambda i, j: f"{self.ports[i].name}[..., {j}]", repr)
        arguments = ", ".join(port.name for port in self.ports)
        lines = [f"def {self.name}({arguments}):"]
        lines += statements(graph, graph.operations(), names, _PRINTED, "    {0} = {1}")
        results = []
        for port, nodes in zip(self.outputs, graph.outputs, strict=True):
            elements = ", ".join(names[k] for k in nodes)
            lines.append(f"    {port.name}_out = stack({elements})")
            results.append(f"{port.name}_out")
        return "\n".join([*lines, f"    return {', '.join(results)},\n"])

    @cached_property
    def _jitted_function(self) -> Callable[..., Any]:
        """The JAX function, compiled just in time; leading axes broadcast."""
        jax = import_extra("jax", "jax", 'target: "jax" needs JAX')
        jnp = jax.numpy

        def stack(*values: Any) -> Any:
            """Return values broadcast together and stacked along a new last axis."""
            return jnp.stack(jnp.broadcast_arrays(*values), axis=-1)

        names = ("sqrt", "sin", "cos", "exp", "floor", "fmin", "fmax", "where", "nan")
        space: dict[str, Any] = {name: getattr(jnp, name) for name in names}
        space |= {"atan2": jnp.arctan2, "fabs": jnp.abs, "stack": stack}
        exec(self.source, space)
        function = space[self.name]

        def evaluate(*values: Any) -> Any:
            """Return the outputs as JAX arrays; leading axes of the inputs broadcast."""
            arrays = [jnp.asarray(part, np.dtype(self.dtype)) for part in values]
            lead = jnp.broadcast_shapes(
                *(
                    array.shape[: array.ndim - len(port.shape)]
                    for array, port in zip(arrays, self.ports, strict=True)
                )
            )
            results = []
            for part, port in zip(function(*arrays), self.outputs, strict=True):
                part = jnp.broadcast_to(part, (*lead, part.shape[-1]))
                results.append(part.reshape(lead + port.shape))
            return results[0] if len(results) == 1 else tuple(results)

        compiled: Callable[..., Any] = jax.jit(evaluate)
        return compiled

    def _evaluate(self, *values: Any, **fixed: Any) -> Any:
        """Evaluate the kernel on arrays or tracers, after checks of shapes and digits."""
        traced, by_port = self._jitted_function, self._values_by_port(values, fixed)
        for port in self.ports:
            by_port[port.name] = pick_columns(
                require_unmasked(by_port[port.name], port.name), port.columns, port.name
            )
            self._check_digits(port.name, by_port[port.name])
            shape = np.shape(by_port[port.name])
            if shape[max(len(shape) - len(port.shape), 0) :] != port.shape:
                expected = ", ".join(["...", *map(str, port.shape)])
                raise DataError(f"{port.name}: shape {shape} given, ({expected}) expected")
        return traced(*(by_port[port.name] for port in self.ports))

    def _check_digits(self, name: str, array: Any) -> None:
        """Raise for a float32 JAX array where float64 is expected."""
        import jax

        if isinstance(array, jax.Array) and (str(array.dtype), self.dtype) == _ROUNDED:
            raise DataError(
                f"{name}: a float32 array of JAX given, float64 expected; make it after `compile`, "
                'or after jax.config.update("jax_enable_x64", True), or compile with '
                'dtype="float32"'
            )
