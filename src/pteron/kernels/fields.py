"""Exact arithmetic for CasADi graphs: in the rational numbers, and in a prime field.

`evaluate` walks the instructions of an SX function with numbers of a field instead of floats. An
angle is given by the tangent t of its half, so that its sine and cosine are rational. A square
root must exist in the field, or `NoSquareRoot` is raised.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import isqrt
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
    work: list[Element] = [field.number(0)] * function.sz_w()
    outputs = [[field.number(0)] * function.nnz_out(i) for i in range(function.n_out())]
    two, one = field.number(2), field.number(1)
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        source = function.instruction_input(k)
        target = function.instruction_output(k)
        if op == ca.OP_OUTPUT:
            outputs[target[0]][target[1]] = work[source[0]]
            continue
        if op == ca.OP_INPUT:
            value = inputs[source[0]][source[1]]
        elif op == ca.OP_CONST:
            value = field.number(Fraction(function.instruction_constant(k)))
        else:
            a = work[source[0]]
            b = work[source[1]] if len(source) > 1 else a
            if op == ca.OP_ADD:
                value = field.add(a, b)
            elif op == ca.OP_SUB:
                value = field.subtract(a, b)
            elif op == ca.OP_MUL or op == ca.OP_SQ:
                value = field.multiply(a, b)
            elif op == ca.OP_DIV:
                value = field.divide(a, b)
            elif op == ca.OP_NEG:
                value = field.subtract(field.number(0), a)
            elif op == ca.OP_TWICE:
                value = field.add(a, a)
            elif op == ca.OP_INV:
                value = field.divide(one, a)
            elif op == ca.OP_SQRT:
                value = field.square_root(a)
            elif op == ca.OP_ASSIGN:
                value = a
            elif op in (ca.OP_COS, ca.OP_SIN):
                t2 = field.multiply(a, a)
                top = field.subtract(one, t2) if op == ca.OP_COS else field.multiply(two, a)
                value = field.divide(top, field.add(one, t2))
            else:
                raise ValueError(f"operation {op} of {function.name()} is not exact in a field")
        work[target[0]] = value
    return outputs
