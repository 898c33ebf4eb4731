"""Exact numbers q sqrt(s), such as sqrt(3)/2, and their recognition in floats.

A file holds sqrt(3)/2 as sixteen digits. The rank of a regressor, for one, depends on exact
relations between such numbers, hence on the number that was meant.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

from pteron.kernels import Field
from pteron.reduction.primes import prime_factors

Element = TypeVar("Element")


@dataclass(frozen=True)
class Surd:
    """The number q sqrt(s), with s a positive integer that no square divides."""

    q: Fraction
    s: int = 1

    @classmethod
    def root(cls, square: Fraction, sign: float) -> Surd:
        """Return the square root of a rational number, with the sign of `sign`."""
        factors = Counter((*prime_factors(square.numerator), *prime_factors(square.denominator)))
        outside, inside = 1, 1
        for prime, power in factors.items():
            outside *= prime ** (power // 2)
            inside *= prime ** (power % 2)
        return cls(Fraction(int(math.copysign(outside, sign)), square.denominator), inside)

    def __float__(self) -> float:
        return float(self.q) * math.sqrt(self.s)

    def __str__(self) -> str:
        return str(self.q) if self.s == 1 else f"{self.q} sqrt({self.s})"

    @property
    def square(self) -> Fraction:
        """The square of the number: q^2 s."""
        return self.q * self.q * self.s

    def times(self, factor: Fraction) -> Surd:
        """Return the number times a rational one."""
        return Surd(self.q * factor, self.s)

    def field_element(self, field: Field[Element]) -> Element:
        """Return the number as an element of a field.

        The root of s is the product of the roots of its primes, so that sqrt(2) sqrt(3) = sqrt(6)
        holds in every field.
        """
        element = field.number(self.q)
        for prime in prime_factors(self.s):
            element = field.multiply(element, field.square_root(field.number(prime)))
        return element


_COSINE_TOLERANCE = 1e-9
"""Greatest difference of a unit vector's component, or its square, from a simple fraction."""

_COSINE_DENOMINATOR = 300
"""A random number in [-1, 1] passes for a fraction of this denominator with odds below 1e-4."""

_LENGTH_TOLERANCE = 1e-15
"""Greatest difference of a length, m, or its square, from a simple fraction."""

_LENGTH_DENOMINATOR = 10**6
"""Lengths in metres are decimals to the micrometre, or roots of such."""


def direction_cosine(component: float) -> Surd | None:
    """Return the simple exact number nearest to a unit vector's component; None without.

    Simple: itself or its square a fraction with a denominator up to 300, within 1e-9.
    """
    return _simple(component, _COSINE_DENOMINATOR, _COSINE_TOLERANCE, _COSINE_TOLERANCE)


def length(metres: float) -> Surd | None:
    """Return the simple exact number nearest to a length in metres; None without.

    Simple: a decimal to the micrometre, or the root of a fraction with a denominator up to 10^6.
    """
    least = abs(metres) * _LENGTH_TOLERANCE
    return _simple(metres, _LENGTH_DENOMINATOR, _LENGTH_TOLERANCE, least)


def _simple(number: float, most: int, near: float, near_square: float) -> Surd | None:
    """Return a fraction of at most this denominator near a number, or the root of one."""
    plain = Fraction(number).limit_denominator(most)
    if abs(plain - Fraction(number)) <= near:
        return Surd(plain)
    square = Fraction(number * number).limit_denominator(most)
    if square > 0 and abs(square - Fraction(number * number)) <= near_square:
        return Surd.root(square, number)
    return None
