"""Exact arithmetic for CasADi graphs: in the rational numbers, and in a prime field.

`evaluate` walks the instructions of an SX function with numbers of a field instead of floats. An
angle is given by the tangent t of its half, so that its sine and cosine are rational. A square
root must exist in the field, or `NoSquareRoot` is raised.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache
from math import isnan, isqrt
from typing import Generic, Protocol, TypeVar

import casadi as ca

__all__ = ["Field", "NoSquareRoot", "PrimeField", "RationalField", "evaluate"]

Element = TypeVar("Element")


class NoSquareRoot(ArithmeticError):
    """The number has no square root in the field."""


class Field(Protocol, Generic[Element]):
    """What `evaluate` and the exact linear algebra ask of a field."""

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

    def number(self, value: Fraction | int) -> Fraction:
        """Return the number itself."""
        return Fraction(value)

    def add(self, a: Fraction, b: Fraction) -> Fraction:
        """Return a + b."""
        return a + b

    def subtract(self, a: Fraction, b: Fraction) -> Fraction:
        """Return a - b."""
        return a - b

    def multiply(self, a: Fraction, b: Fraction) -> Fraction:
        """Return a b."""
        return a * b

    def divide(self, a: Fraction, b: Fraction) -> Fraction:
        """Return a / b."""
        return a / b

    def square_root(self, a: Fraction) -> Fraction:
        """Return the positive square root of a perfect square."""
        if a >= 0:
            root = Fraction(isqrt(a.numerator), isqrt(a.denominator))
            if root * root == a:
                return root
        raise NoSquareRoot(a)


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
            raise NoSquareRoot(a)
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
    zero, one, two = field.number(0), field.number(1), field.number(2)
    unary: dict[int, Callable[[Element], Element]] = {
        ca.OP_SQ: lambda a: field.multiply(a, a),
        ca.OP_NEG: lambda a: field.subtract(zero, a),
        ca.OP_TWICE: lambda a: field.add(a, a),
        ca.OP_INV: lambda a: field.divide(one, a),
        ca.OP_SQRT: field.square_root,
        ca.OP_ASSIGN: lambda a: a,
        ca.OP_SIN: lambda t: field.divide(
            field.multiply(two, t), field.add(one, field.multiply(t, t))
        ),
        ca.OP_COS: lambda t: field.divide(
            field.subtract(one, field.multiply(t, t)), field.add(one, field.multiply(t, t))
        ),
    }
    binary: dict[int, Callable[[Element, Element], Element]] = {
        ca.OP_ADD: field.add,
        ca.OP_SUB: field.subtract,
        ca.OP_MUL: field.multiply,
        ca.OP_DIV: field.divide,
    }
    work = [zero] * function.sz_w()
    outputs = [[zero] * function.nnz_out(i) for i in range(function.n_out())]
    if isinstance(field, RationalField):
        # What is left out of range is NaN in floats; an exact number it is not.
        binary[ca.OP_LT] = lambda a, b: one if a < b else zero
    tape, constants = _tape(function)
    for op, first, second, target in tape:
        if op in binary:
            work[target] = binary[op](work[first], work[second])
        elif op in unary:
            work[target] = unary[op](work[first])
        elif op == ca.OP_IF_ELSE_ZERO:
            if work[first] != zero:
                raise NoSquareRoot("out of reach")
            work[target] = zero
        elif op == ca.OP_INPUT:
            work[target] = inputs[first][second]
        elif op == ca.OP_OUTPUT:
            outputs[first][second] = work[target]
        else:
            work[target] = field.number(constants[first])
    return outputs


@lru_cache(maxsize=64)
def _tape(function: ca.Function) -> tuple[list[tuple[int, int, int, int]], list[Fraction]]:
    """Return the instructions as (operation, first, second, work slot), and the constants.

    An input's pair is (argument, element), an output's (result, element), a constant's first its
    place in the list. Asking CasADi for them costs more than the arithmetic, hence the cache.
    """
    tape: list[tuple[int, int, int, int]] = []
    constants: list[Fraction] = []
    exact = {
        *(ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV, ca.OP_SQ, ca.OP_NEG, ca.OP_TWICE),
        *(ca.OP_INV, ca.OP_SQRT, ca.OP_ASSIGN, ca.OP_SIN, ca.OP_COS),
        *(ca.OP_LT, ca.OP_IF_ELSE_ZERO),
    }
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_OUTPUT:
            tape.append((op, target[0], target[1], source[0]))
        elif op == ca.OP_INPUT:
            tape.append((op, source[0], source[1], target[0]))
        elif op == ca.OP_CONST:
            tape.append((op, len(constants), 0, target[0]))
            value = function.instruction_constant(k)
            constants.append(Fraction(0 if isnan(value) else value))
        elif op in exact:
            tape.append((op, source[0], source[-1], target[0]))
        else:
            raise ValueError(f"operation {op} of {function.name()} is not exact in a field")
    return tape, constants
