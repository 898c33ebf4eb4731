"""Exact arithmetic for CasADi graphs, in the rationals and prime fields; target `exact`.

`evaluate` walks the instructions of an SX function with numbers of a field instead of floats;
`Evaluation` does so at many states, and evaluates state-independent nodes once. An angle is
given by the tangent t of its half, so that its sine and cosine are rational. A square root must
exist in the field, or `NoSquareRoot` is raised.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache
from math import isnan, isqrt
from types import CodeType
from typing import Any, Generic, Protocol, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError, PteronError
from pteron.kernels.graph import CONSTANT, INPUT, graph_of
from pteron.kernels.kernel import Kernel, require_unmasked

Element = TypeVar("Element")


class NoSquareRoot(PteronError, ArithmeticError):
    """A number has no square root in the field."""


class Field(Protocol, Generic[Element]):
    """The arithmetic that `evaluate` and the exact linear algebra need."""

    def number(self, value: Fraction | int) -> Element:
        """Return a rational number as an element of the field."""

    def add(self, a: Element, b: Element) -> Element:
        """Return a + b in the field."""

    def subtract(self, a: Element, b: Element) -> Element:
        """Return a - b in the field."""

    def multiply(self, a: Element, b: Element) -> Element:
        """Return the product a b in the field."""

    def divide(self, a: Element, b: Element) -> Element:
        """Return a / b in the field; raise ZeroDivisionError if b is zero."""

    def square_root(self, a: Element) -> Element:
        """Return a square root of a in the field, or raise `NoSquareRoot`."""


class RationalField:
    """The rational numbers, as `fractions.Fraction`."""

    number = staticmethod(Fraction)
    add = staticmethod(operator.add)
    subtract = staticmethod(operator.sub)
    multiply = staticmethod(operator.mul)
    divide = staticmethod(operator.truediv)

    def square_root(self, a: Fraction) -> Fraction:
        """Return the rational square root of a; raise `NoSquareRoot` if it is irrational."""
        if a >= 0:
            root = Fraction(isqrt(a.numerator), isqrt(a.denominator))
            if root * root == a:
                return root
        raise NoSquareRoot


class PrimeField:
    """The integers modulo a prime p with p = 3 (mod 4), where a root of a is a^((p + 1) / 4)."""

    def __init__(self, prime: int) -> None:
        if prime % 4 != 3:
            raise ValueError(f"prime {prime}: expected 3 modulo 4")
        self.prime = prime

    def number(self, value: Fraction | int) -> int:
        """Return the residue of a rational number modulo the prime."""
        f = Fraction(value)
        return self.divide(f.numerator % self.prime, f.denominator % self.prime)

    def add(self, a: int, b: int) -> int:
        """Return (a + b) modulo the prime."""
        return (a + b) % self.prime

    def subtract(self, a: int, b: int) -> int:
        """Return (a - b) modulo the prime."""
        return (a - b) % self.prime

    def multiply(self, a: int, b: int) -> int:
        """Return a b modulo the prime."""
        return a * b % self.prime

    def divide(self, a: int, b: int) -> int:
        """Return a / b modulo the prime."""
        if b == 0:
            raise ZeroDivisionError
        return a * pow(b, -1, self.prime) % self.prime

    def square_root(self, a: int) -> int:
        """Return a square root of a modulo the prime; raise `NoSquareRoot` if none exists."""
        root = pow(a, (self.prime + 1) // 4, self.prime)
        if root * root % self.prime != a:
            raise NoSquareRoot
        return root


_SIGNS = {"add": "+", "sub": "-", "mul": "*"}
"""Operations that Python has, followed by the remainder."""


@lru_cache(maxsize=64)
def _compile_function(lines: str) -> CodeType:
    """Return the code of a function `compute(e)` with these lines as its body."""
    return compile(f"def compute(e):\n pass\n{lines}", "<evaluation>", "exec")


class Evaluation(Generic[Element]):
    """A function in a field, for many states: nodes of its first inputs alone are precomputed.

    Parameters
    ----------
    function : casadi.Function
        An SX function.
    field : Field
        The arithmetic.
    fixed : sequence of sequence
        The function's first inputs, the same for every state.
    """

    def __init__(
        self,
        function: ca.Function,
        field: Field[Element],
        fixed: Sequence[Sequence[Element]] = (),
    ) -> None:
        self._graph = graph = graph_of(function)
        self._outputs = graph.outputs
        self._known: list[Any] = [None] * len(graph.nodes)
        self._inputs: list[tuple[int, int, int]] = []
        self._steps: dict[int, tuple[Callable[..., Element], tuple[int, ...]]] = {}
        operations, self._field = _operations(field), field
        moving: set[int] = set()
        for k, node in enumerate(graph.nodes):
            if node.operation == CONSTANT:
                number = Fraction(0 if isnan(node.value) else node.value)
                self._known[k] = field.number(number)
            elif node.operation == INPUT:
                port, element = node.arguments
                if port < len(fixed):
                    self._known[k] = fixed[port][element]
                else:
                    self._inputs.append((k, port - len(fixed), element))
                    moving.add(k)
            elif node.operation not in operations:
                raise ValueError(
                    f"operation {node.operation} of {function.name()} is not exact in a field"
                )
            else:
                step = operations[node.operation], node.arguments
                if moving.isdisjoint(node.arguments):
                    # An error is raised when a state needs the node.
                    with suppress(NoSquareRoot, ZeroDivisionError):
                        self._known[k] = step[0](*[self._known[j] for j in step[1]])
                        continue
                moving.add(k)
                self._steps[k] = step
        self._operations = operations
        self._codes: list[Callable[[list[Element]], None]] | None = None

    def __call__(self, *inputs: Sequence[Element]) -> list[list[Element]]:
        """Return the function's outputs, as field elements by column, at these inputs.

        Raises
        ------
        NoSquareRoot
            If a radicand is no square in the field.
        ZeroDivisionError
            If a denominator vanishes.
        """
        elements = self._initial_elements(inputs)
        self._compute_steps(elements, self._steps)
        return [[elements[k] for k in nodes] for nodes in self._outputs]

    def elements(self, *inputs: Sequence[Element]) -> Iterator[Element]:
        """Yield the function's outputs element by element, each computed lazily."""
        if self._codes is None:
            self._codes = [self._code_of(steps) for steps in self._separate_steps()]
        known = self._initial_elements(inputs)
        output_nodes = (k for nodes in self._outputs for k in nodes)
        for k, compute in zip(output_nodes, self._codes, strict=True):
            compute(known)
            yield known[k]

    def _code_of(self, steps: list[int]) -> Callable[[list[Element]], None]:
        """Return a function that computes graph nodes in place; compiled for a prime field."""
        if not isinstance(self._field, PrimeField):
            return lambda elements: self._compute_steps(elements, steps)
        lines = []
        for k in steps:
            name, arguments = self._graph.nodes[k].operation, self._graph.nodes[k].arguments
            parts = [f"e[{i}]" for i in arguments]
            sign = _SIGNS.get(name)
            text = f"({sign.join(parts)}) % p" if sign else f"{name}_({', '.join(parts)})"
            lines.append(f" e[{k}] = {text}\n")
        space: dict[str, Any] = {f"{name}_": rule for name, rule in self._operations.items()}
        space["p"] = self._field.prime
        exec(_compile_function("".join(lines)), space)
        compute: Callable[[list[Element]], None] = space["compute"]
        return compute

    def _initial_elements(self, inputs: Sequence[Sequence[Element]]) -> list[Element]:
        """Return field elements by graph node: precomputed ones and the inputs of a state."""
        elements = self._known.copy()
        for k, port, element in self._inputs:
            elements[k] = inputs[port][element]
        return elements

    def _compute_steps(self, elements: list[Element], steps: Iterable[int]) -> None:
        """Compute the graph nodes `steps` in `elements`, in place and in this order."""
        for k in steps:
            operation, arguments = self._steps[k]
            if len(arguments) == 2:
                i, j = arguments
                elements[k] = operation(elements[i], elements[j])
            else:
                elements[k] = operation(elements[arguments[0]])

    def _separate_steps(self) -> list[list[int]]:
        """Return, for each output element, the graph nodes that no previous element needs."""
        done: set[int] = set()
        steps_by_element = []
        for root in (k for nodes in self._outputs for k in nodes):
            new_steps, waiting = set(), [root]
            while waiting:
                k = waiting.pop()
                if k in self._steps and k not in done and k not in new_steps:
                    new_steps.add(k)
                    waiting += self._steps[k][1]
            done |= new_steps
            steps_by_element.append(sorted(new_steps))
        return steps_by_element


def _operations(field: Field[Element]) -> dict[str, Callable[..., Element]]:
    """Return the exact field operation for each operation name of a graph."""
    zero, unit = field.number(0), field.number(1)

    def sine(t: Element) -> Element:
        """Return sin(a) in the field for t = tan(a / 2)."""
        return field.divide(field.add(t, t), field.add(unit, field.multiply(t, t)))

    def cosine(t: Element) -> Element:
        """Return cos(a) in the field for t = tan(a / 2)."""
        square = field.multiply(t, t)
        return field.divide(field.subtract(unit, square), field.add(unit, square))

    def select(test: Element, chosen: Element) -> Element:
        """Return zero if the test is zero; raise NoSquareRoot otherwise."""
        # What is left out of range is NaN in floats; an exact number it is not.
        if test != zero:
            raise NoSquareRoot
        return zero

    operations: dict[str, Callable[..., Element]] = {
        "add": field.add,
        "sub": field.subtract,
        "mul": field.multiply,
        "div": field.divide,
        "neg": lambda a: field.subtract(zero, a),
        "sqrt": field.square_root,
        "sin": sine,
        "cos": cosine,
        "select": select,
    }
    if isinstance(field, RationalField):
        operations["less"] = lambda a, b: unit if a < b else zero
    return operations


def evaluate(
    function: ca.Function, field: Field[Element], inputs: Sequence[Sequence[Element]]
) -> list[list[Element]]:
    """Return the outputs of a CasADi function evaluated in a field, as elements by column.

    Raises
    ------
    NoSquareRoot
        If a radicand is no square in the field.
    ZeroDivisionError
        If a denominator vanishes.
    """
    return Evaluation(function, field)(*inputs)


class Exact(Kernel):
    """A kernel in fractions.

    It takes one state: integers, fractions and floats (as the fractions they are), and returns
    fractions. An angle phi is given as tan(phi / 2), so that its sine and cosine are rational.
    `NoSquareRoot` says that a root is not rational, `ZeroDivisionError` that a denominator
    vanishes.
    """

    def _evaluate(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        """Return the outputs of a single state as arrays of fractions."""
        by_port = self._values_by_port(values, fixed)
        inputs = []
        for port in self.ports:
            array = np.asarray(require_unmasked(by_port[port.name], port.name), dtype=object)
            if array.shape != port.shape:
                raise DataError(
                    f"{port.name}: shape {array.shape} given, {port.shape} expected: one state"
                )
            inputs.append([Fraction(numbers) for numbers in array.ravel().tolist()])
        try:
            exact_outputs = evaluate(self.function, RationalField(), inputs)
        except NoSquareRoot:
            raise NoSquareRoot(
                f"{self.function.name()}: in fractions a square root of this state does not exist "
                '(it is irrational, or the pose out of reach); use another target, such as "c"'
            ) from None
        results = tuple(
            np.array(numbers, dtype=object).reshape(port.shape)
            for numbers, port in zip(exact_outputs, self.outputs, strict=True)
        )
        return results[0] if len(results) == 1 else results
