"""Exact arithmetic for CasADi graphs, in the rationals and prime fields; target `exact`.

`evaluate` walks the instructions of an SX function with numbers of a field instead of floats. An
angle is given by the tangent t of its half, so that its sine and cosine are rational. A square
root must exist in the field, or `NoSquareRoot` is raised.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from fractions import Fraction
from math import isnan, isqrt
from typing import Any, Generic, Protocol, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError, PteronError
from pteron.kernels.graph import CONSTANT, Node, graph_of
from pteron.kernels.kernel import Kernel, unmasked

Element = TypeVar("Element")


class NoSquareRoot(PteronError, ArithmeticError):
    """A number has no square root in the field."""


class Field(Protocol, Generic[Element]):
    """The arithmetic that `evaluate` and the exact linear algebra need."""

    def number(self, value: Fraction | int) -> Element:
        """Return a rational number as an element."""

    def add(self, a: Element, b: Element) -> Element:
        """Return a + b."""

    def subtract(self, a: Element, b: Element) -> Element:
        """Return a - b."""

    def multiply(self, a: Element, b: Element) -> Element:
        """Return a b."""

    def divide(self, a: Element, b: Element) -> Element:
        """Return a / b; ZeroDivisionError where b is zero."""

    def square_root(self, a: Element) -> Element:
        """Return a square root of a, or raise `NoSquareRoot`."""


class RationalField:
    """The rational numbers, as `fractions.Fraction`."""

    number = staticmethod(Fraction)
    add = staticmethod(operator.add)
    subtract = staticmethod(operator.sub)
    multiply = staticmethod(operator.mul)
    divide = staticmethod(operator.truediv)

    def square_root(self, a: Fraction) -> Fraction:
        """Return the positive square root of a perfect square."""
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
        """Return the residue of a rational number."""
        f = Fraction(value)
        return self.divide(f.numerator % self.prime, f.denominator % self.prime)

    def add(self, a: int, b: int) -> int:
        """Return a + b."""
        return (a + b) % self.prime

    def subtract(self, a: int, b: int) -> int:
        """Return a - b."""
        return (a - b) % self.prime

    def multiply(self, a: int, b: int) -> int:
        """Return a b."""
        return a * b % self.prime

    def divide(self, a: int, b: int) -> int:
        """Return a / b."""
        if b == 0:
            raise ZeroDivisionError
        return a * pow(b, -1, self.prime) % self.prime

    def square_root(self, a: int) -> int:
        """Return one of the two square roots, always the same one."""
        root = pow(a, (self.prime + 1) // 4, self.prime)
        if root * root % self.prime != a:
            raise NoSquareRoot
        return root


def evaluate(
    function: ca.Function, field: Field[Element], inputs: Sequence[Sequence[Element]]
) -> list[list[Element]]:
    """Return the outputs of an SX function, evaluated in a field; nonzeros by columns.

    Raises
    ------
    NoSquareRoot
        If a radicand is no square in the field.
    ZeroDivisionError
        If a denominator vanishes.
    """
    zero, one = field.number(0), field.number(1)

    def sine(t: Element) -> Element:
        return field.divide(field.add(t, t), field.add(one, field.multiply(t, t)))

    def cosine(t: Element) -> Element:
        square = field.multiply(t, t)
        return field.divide(field.subtract(one, square), field.add(one, square))

    def select(test: Element, value: Element) -> Element:
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
        operations["less"] = lambda a, b: one if a < b else zero

    def rule(node: Node, arguments: list[Element]) -> Element:
        if node.operation == CONSTANT:
            return field.number(Fraction(0 if isnan(node.value) else node.value))
        if node.operation not in operations:
            raise ValueError(
                f"operation {node.operation} of {function.name()} is not exact in a field"
            )
        return operations[node.operation](*arguments)

    graph = graph_of(function)
    return graph.results(graph.values(lambda i, j: inputs[i][j], rule))


class Exact(Kernel):
    """A kernel in fractions.

    It takes one state: integers, fractions and floats (as the fractions they are), and returns
    fractions. An angle phi is given as tan(phi / 2), so that its sine and cosine are rational.
    `NoSquareRoot` says that a root is not rational, `ZeroDivisionError` that a denominator
    vanishes.
    """

    def _evaluate(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        given = self._by_name(values, fixed)
        inputs = []
        for port in self.ports:
            array = np.asarray(unmasked(given[port.name], port.name), dtype=object)
            if array.shape != port.shape:
                raise DataError(
                    f"{port.name}: shape {array.shape} given, {port.shape} expected: one state"
                )
            inputs.append([Fraction(value) for value in array.ravel().tolist()])
        try:
            found = evaluate(self.function, RationalField(), inputs)
        except NoSquareRoot:
            raise NoSquareRoot(
                f"{self.function.name()}: in fractions a square root of this state does not exist "
                '(it is irrational, or the pose out of reach); use another target, such as "c"'
            ) from None
        results = tuple(
            np.array(value, dtype=object).reshape(port.shape)
            for value, port in zip(found, self.outputs, strict=True)
        )
        return results[0] if len(results) == 1 else results
