"""Base classes of kernels: CasADi functions made executable for batches, with checks of inputs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import prod
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.errors import DataError
from pteron.kernels.named_columns import pick_columns
from pteron.shapes import PoseLike

Array = NDArray[np.float64]
"""An array of float64, of any shape."""

SHARE = 4096
"""Least states for each thread: fewer take less time than it costs to start one."""

_AXES = 32
"""Most axes that NumPy broadcasts."""

_FREE = frozenset({ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_ASSIGN})
"""Instructions that do not count as operations."""


@dataclass(frozen=True)
class Port:
    """An input or an output of a kernel.

    Parameters
    ----------
    name : str
        Name of the quantity that it holds, such as "pose".
    shape : tuple of int
        Its shape for one state; the batch axes lead.
    shared : bool
        For an input: one value serves the whole batch.
    columns : tuple of str
        Names of the columns of a table that may be given in its place; empty where none may.
    """

    name: str
    shape: tuple[int, ...]
    shared: bool = False
    columns: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of elements of this input or output for one state."""
        return prod(self.shape)


class Kernel(ABC):
    """Base class of a callable that evaluates a function for batches of states.

    A target subclasses it; see `pteron.kernels.targets`.

    Parameters
    ----------
    name : str
        The public function it stands for.
    function : casadi.Function
        The SX function it executes. A matrix is stored by columns, hence its outputs are
        transposed: row-major memory on the other side.
    inputs, outputs : tuple of Port
        Names and shapes, of the function's arguments and results.
    fixed : dict, optional
        Values of shared inputs that need not be given in a call, by name.
    dtype : {"float64", "float32"}
        Type of the numbers it computes with.
    threads : int
        How many threads share a batch.

    Attributes
    ----------
    ports : tuple of Port
        All inputs, the fixed ones too.
    inputs : tuple of Port
        What a call takes, in order.
    made : dict
        For a fixed input of which the code takes numbers that are made of it, what makes them.
    call : callable
        What `kernel(...)` runs: the same, some 0.1 us cheaper. It may change; do not keep it.
    """

    def __init__(
        self,
        name: str,
        function: ca.Function,
        inputs: tuple[Port, ...],
        outputs: tuple[Port, ...],
        fixed: Mapping[str, Array] | None = None,
        dtype: str = "float64",
        threads: int = 1,
    ) -> None:
        self.name = name
        self.function = function
        self.fixed = dict(fixed or {})
        self.ports = inputs
        self.inputs = tuple(port for port in inputs if port.name not in self.fixed)
        self.outputs = outputs
        self.dtype = dtype
        self.threads = threads
        self.made: dict[str, ca.Function] = {}
        self.call: Callable[..., Any] = self._evaluate

    def __repr__(self) -> str:
        input_names, output_names = (
            ", ".join(port.name for port in ports) for ports in (self.inputs, self.outputs)
        )
        return f"<{type(self).__name__} {self.name}: {input_names} -> {output_names}>"

    @property
    def operations(self) -> int:
        """Number of arithmetic operations for one state; see `count_operations`."""
        return count_operations(self.function)

    @property
    def source(self) -> str:
        """The code of the kernel as text: CasADi's instructions, one a line."""
        return str(self.function.str(True))

    def __call__(self, *values: Any, **fixed: Any) -> Any:
        """Evaluate the kernel.

        Parameters
        ----------
        *values : array, shape (..., *port.shape)
            The `inputs`, in order. Leading axes broadcast.
        **fixed : array, shape port.shape
            Values of fixed inputs, such as `parameters`, in place of the machine's own.

        Returns
        -------
        array or tuple of array
            The outputs, with the broadcast leading axes; not a tuple where there is one.

        Raises
        ------
        DataError
            If the number of inputs, a name or a shape is wrong.
        ModelError
            If the target's compiler or library is not installed.
        """
        return self.call(*values, **fixed) if fixed else self.call(*values)

    @abstractmethod
    def _evaluate(self, *values: Any, **fixed: Any) -> Any:
        """Evaluate the kernel as `call` does; a target may replace `call` by something faster."""

    def _values_by_port(self, values: Sequence[Any], fixed: Mapping[str, Any]) -> dict[str, Any]:
        """Return the value of each input by name, fixed ones included; raise for wrong names."""
        if len(values) != len(self.inputs):
            names = ", ".join(port.name for port in self.inputs)
            raise DataError(
                f"{self.name}: {len(values)} inputs given, {len(self.inputs)} expected ({names})"
            )
        for name in fixed:
            if name not in self.fixed:
                known = ", ".join(self.fixed) or 'none (grade="parametric" has `parameters`)'
                raise DataError(
                    f"{self.name}: {name!r} cannot be given by name; inputs that can: {known}"
                )
        by_port = {port.name: array for port, array in zip(self.inputs, values, strict=True)}
        for name in fixed.keys() & self.made.keys():
            make = self.made[name]
            numbers = as_array(fixed[name], name, (make.size1_in(0),))
            fixed = {**fixed, name: np.array(make(numbers)).ravel()}
        return {**self.fixed, **fixed, **by_port}


class ArrayKernel(Kernel):
    """A kernel that fills arrays of floats with batches of states; a target gives `_run`."""

    _strided = False
    """Whether `_run` takes batches as they lie in memory; else their rows follow one another."""

    @abstractmethod
    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Fill `outputs` (batch, size) from `inputs`, (batch, size) or (size,) where shared."""

    def _evaluate(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        """Evaluate the kernel; a target may override it with a faster first call."""
        return self.evaluate_checked(*values, **fixed)

    def evaluate_checked(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        """Evaluate the kernel after checking, converting and broadcasting the inputs."""
        by_port = self._values_by_port(values, fixed)
        for port in self.ports:
            by_port[port.name] = as_array(
                by_port[port.name], port.name, port.shape, self.dtype, port.columns
            )
            if port.shared and by_port[port.name].shape != port.shape:
                raise DataError(
                    f"{port.name}: shape {by_port[port.name].shape} given, {port.shape} expected: "
                    "one value for all states"
                )
        lead = broadcast_lead(
            {
                port.name: by_port[port.name].shape[: by_port[port.name].ndim - len(port.shape)]
                for port in self.ports
                if not port.shared
            }
        )
        batch = prod(lead)
        inputs: list[Array] = []
        for port in self.ports:
            array = by_port[port.name]
            if not port.shared and array.shape != lead + port.shape:
                array = np.broadcast_to(array, lead + port.shape)
            if port.shared or not self._strided:
                array = np.ascontiguousarray(array)
            inputs.append(array.reshape(port.size if port.shared else (batch, port.size)))
        outputs = [np.empty((batch, port.size), dtype=self.dtype) for port in self.outputs]
        if self.threads > 1 and batch >= 2 * SHARE:
            self._run_in_threads(batch, inputs, outputs)
        else:
            self._run(batch, inputs, outputs)
        results = tuple(
            out.reshape(lead + port.shape) for out, port in zip(outputs, self.outputs, strict=True)
        )
        return results[0] if len(results) == 1 else results

    def _run_in_threads(
        self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]
    ) -> None:
        """Fill `outputs` for a batch by slices in several threads."""
        count = min(self.threads, batch // SHARE)
        bounds = [batch * k // count for k in range(count + 1)]

        def run(start: int, stop: int) -> None:
            """Fill the outputs of the states `start` to `stop`."""
            self._run(stop - start, *slice_states(inputs, outputs, start, stop))

        with ThreadPoolExecutor(count) as pool:
            list(pool.map(run, bounds[:-1], bounds[1:]))


def slice_states(
    inputs: Sequence[Array], outputs: Sequence[Array], start: int, stop: int
) -> tuple[list[Array], list[Array]]:
    """Return views of the inputs and outputs for the states `start` to `stop`."""
    parts = [array if array.ndim == 1 else array[start:stop] for array in inputs]
    return parts, [array[start:stop] for array in outputs]


def count_operations(function: ca.Function) -> int:
    """Return the number of arithmetic operations of one evaluation of a CasADi function.

    + - * / negation, square root, sine, cosine and the like count one each; inputs, outputs, moves
    and constants are free. Shared subexpressions count once, if `casadi.cse` was applied.
    """
    return sum(function.instruction_id(k) not in _FREE for k in range(function.n_instructions()))


def as_array(
    value: PoseLike,
    name: str,
    shape: tuple[int, ...],
    dtype: str = "float64",
    columns: Sequence[str] = (),
) -> Array:
    """Return `value` as an array of floats with last axes `shape`; raise if it has others.

    For a table they are its columns of the names `columns`.
    """
    array: Array
    if type(value) is np.ndarray and value.dtype == np.dtype(dtype) and value.flags.aligned:
        array = value
    else:
        array = _convert_to_floats(pick_columns(value, columns, name), name, dtype)
    if len(shape) > array.ndim or array.shape[array.ndim - len(shape) :] != shape:
        expected = ", ".join(["...", *map(str, shape)])
        raise DataError(f"{name}: shape {array.shape} given, ({expected}) expected")
    if array.ndim > _AXES:
        raise DataError(f"{name}: {array.ndim} axes given, at most {_AXES} expected")
    return array


def _convert_to_floats(raw: ArrayLike, name: str, dtype: str) -> Array:
    """Return an input as an aligned array of floats; DataError if it is not real numbers."""
    raw = require_unmasked(raw, name)
    try:
        array = np.asarray(raw)
        if array.dtype.kind not in "iufO":
            raise TypeError
        if array.dtype.kind == "O" and any(isinstance(v, str | bytes) for v in array.flat):
            raise TypeError
        return np.require(array, dtype, "A")
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"{name}: not an array of real numbers") from None


def require_unmasked(array: Any, name: str) -> Any:
    """Return the data of a masked array, raising if any element is masked; others unchanged."""
    if not isinstance(array, np.ma.MaskedArray):
        return array
    if np.ma.is_masked(array):
        raise DataError(
            f"{name}: {array.size - array.count()} of {array.size} elements are masked; "
            "leave those states out, or fill them with NaN: .filled(numpy.nan)"
        )
    return array.data


def broadcast_lead(shapes: dict[str, tuple[int, ...]]) -> tuple[int, ...]:
    """Return the common shape of the leading axes; raise where they do not broadcast."""
    first, *others = shapes.values()
    if all(shape == first for shape in others):
        return first
    try:
        return np.broadcast_shapes(first, *others)
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise DataError(f"leading axes do not broadcast: {listed}") from None
