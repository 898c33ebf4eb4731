"""A kernel: a CasADi function made executable, with its name, its shapes and its cost."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from math import prod
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.errors import DataError
from pteron.kernels.operations import count_operations

__all__ = ["Array", "ArrayKernel", "Kernel", "Port"]

Array = NDArray[np.float64]

_SHARE = 4096
"""States below which a batch is not split over threads: a thread costs more than they do."""


@dataclass(frozen=True)
class Port:
    """An input or an output of a kernel.

    Parameters
    ----------
    name : str
        What it holds.
    shape : tuple of int
        Its shape for one state; the batch axes lead.
    shared : bool
        For an input: one value serves the whole batch.
    """

    name: str
    shape: tuple[int, ...]
    shared: bool = False

    @property
    def size(self) -> int:
        """Number of values for one state."""
        return prod(self.shape)


@dataclass(frozen=True)
class Kernel(ABC):
    """Something that can be called with batches of states.

    A target subclasses it; see `pteron.kernels.targets`.

    Parameters
    ----------
    name : str
        The public function it stands for.
    function : casadi.Function
        The SX function it executes. A matrix is stored by columns, hence its outputs are
        transposed: row-major memory on the other side.
    inputs, outputs : tuple of Port
        Names and shapes.
    fixed : dict
        Values of shared inputs that need not be given in a call, by name.
    dtype : {"float64", "float32"}
        Of the numbers it computes with.
    threads : int
        How many threads share a batch.
    """

    name: str
    function: ca.Function
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    fixed: dict[str, Array] = field(default_factory=dict, hash=False, compare=False)
    dtype: str = "float64"
    threads: int = 1

    @property
    def operations(self) -> int:
        """Arithmetic operations for one state; see `count_operations`."""
        return count_operations(self.function)

    @property
    @abstractmethod
    def source(self) -> str:
        """The code that runs, as text."""

    @abstractmethod
    def __call__(self, *values: Any) -> Any:
        """Evaluate the kernel: the inputs that are not fixed, in order."""

    def _asked(self, values: Sequence[Any]) -> list[Port]:
        """Return the inputs that are not fixed, of which as many values must be given."""
        ports = [port for port in self.inputs if port.name not in self.fixed]
        if len(values) != len(ports):
            names = ", ".join(port.name for port in ports)
            raise DataError(
                f"{self.name}: {len(values)} inputs given, {len(ports)} expected ({names})"
            )
        return ports


@dataclass(frozen=True)
class ArrayKernel(Kernel):
    """A kernel that fills arrays of floats with batches of states; a target gives `_run`."""

    @abstractmethod
    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Fill `outputs` (batch, size) from `inputs` (batch, size), or (size,) where shared."""

    _strided: ClassVar[bool] = False
    """Whether `_run` takes batches as they lie in memory; else their rows follow one another."""

    @cached_property
    def _direct(self) -> Callable[..., Any] | None:
        """Evaluates plain calls without checks, and returns None for any other; see `__call__`."""
        return None

    def __call__(self, *values: ArrayLike) -> Any:
        """Evaluate the kernel.

        Parameters
        ----------
        *values : array, shape (..., *port.shape)
            The inputs that are not fixed, in order. Leading axes broadcast.

        Returns
        -------
        array or tuple of array
            The outputs, with the broadcast leading axes; not a tuple where there is one.

        Raises
        ------
        DataError
            If the number of inputs or a shape is wrong.
        """
        direct = self._direct
        if direct is not None:
            results = direct(*values)
            if results is not None:
                return results
        return self._checked(values)

    def _checked(self, values: Sequence[ArrayLike]) -> Any:
        """Evaluate what may need checking, converting and broadcasting first."""
        ports = self._asked(values)
        given = {
            port.name: as_array(value, port.name, port.shape, self.dtype)
            for port, value in zip(ports, values, strict=True)
        }
        lead = broadcast_lead(
            {
                port.name: given[port.name].shape[: given[port.name].ndim - len(port.shape)]
                for port in ports
                if not port.shared
            }
        )
        batch = prod(lead)
        inputs: list[Array] = []
        for port in self.inputs:
            if port.shared or port.name in self.fixed:
                value = self.fixed.get(port.name, given.get(port.name))
                inputs.append(np.ascontiguousarray(value, dtype=self.dtype).reshape(port.size))
            else:
                whole = given[port.name]
                if whole.shape != lead + port.shape:
                    whole = np.broadcast_to(whole, lead + port.shape)
                plain = whole if self._strided else np.ascontiguousarray(whole)
                inputs.append(plain.reshape(batch, port.size))
        outputs = [np.empty((batch, port.size), dtype=self.dtype) for port in self.outputs]
        if self.threads > 1 and batch >= 2 * _SHARE:
            self._split(batch, inputs, outputs)
        else:
            self._run(batch, inputs, outputs)
        results = tuple(
            out.reshape(lead + port.shape) for out, port in zip(outputs, self.outputs, strict=True)
        )
        return results[0] if len(results) == 1 else results

    def _split(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Run slices of the batch in threads; a state's numbers do not depend on its slice."""
        count = min(self.threads, batch // _SHARE)
        bounds = [batch * k // count for k in range(count + 1)]

        def run(start: int, stop: int) -> None:
            part = [value if value.ndim == 1 else value[start:stop] for value in inputs]
            self._run(stop - start, part, [value[start:stop] for value in outputs])

        with ThreadPoolExecutor(count) as pool:
            list(pool.map(run, bounds[:-1], bounds[1:]))


def as_array(value: ArrayLike, name: str, shape: tuple[int, ...], dtype: str = "float64") -> Array:
    """Return `value` as floats whose last axes are `shape`, or say what was expected."""
    try:
        given = np.asarray(value)
        if given.dtype.kind not in "biufO":
            raise TypeError
        if given.dtype.kind == "O" and any(isinstance(v, str | bytes) for v in given.flat):
            raise TypeError
        array = np.require(given, dtype, "A")
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"{name}: not an array of real numbers") from None
    if len(shape) > array.ndim or array.shape[array.ndim - len(shape) :] != shape:
        expected = ", ".join(["...", *map(str, shape)])
        raise DataError(f"{name}: shape {array.shape} given, ({expected}) expected")
    return array


def broadcast_lead(shapes: dict[str, tuple[int, ...]]) -> tuple[int, ...]:
    """Return the common shape of the leading axes, or name the inputs that do not agree."""
    first, *others = shapes.values()
    if all(shape == first for shape in others):
        return first
    try:
        return np.broadcast_shapes(first, *others)
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise DataError(f"leading axes do not broadcast: {listed}") from None
