"""A machine's geometry in integers modulo a prime, for exact tests: lengths and unit vectors.

A number of a file is the decimal that it prints as, to a picometre. A direction's components are
taken for square roots of simple fractions, such as 0.6 or sqrt(3) / 2, whose squares sum to one;
other directions are not recognised. A root of a product is the product of its prime factors' roots,
so that any choice of signs gives a conjugate geometry: a number that is zero in one is in all.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import reduce
from math import isqrt
from operator import mul

from pteron.kernels import PrimeField
from pteron.manipulator import Manipulator

_SIMPLE = 1000
"""Largest denominator of a component's square."""

_ROUNDING = 1e-14
"""Largest error of a component's square, or of a right angle, that counts as rounding."""


_DIGITS = 12
"""Decimals of a number of a file, m or without unit."""


def modular_geometry(robot: Manipulator, field: PrimeField) -> list[int] | None:
    """Return the numbers of `equations.machine.numbers` in a prime field, or None if not known."""
    found: list[int] = []
    for leg in robot.legs:
        units: list[list[int]] = []
        for quantity in leg.quantities:
            if quantity.role in ("direction", "normal"):
                unit = _unit(quantity.value, field)
                if unit is None:
                    return None
                units.append(unit)
                found += unit
            else:
                found += (field.number(_decimal(value)) for value in quantity.value)
        vectors = [q.value for q in leg.quantities if q.role in ("direction", "normal")]
        if not _same_right_angles(vectors, units, field):
            return None
        for point in (leg.platform_point, leg.fixed_offset):
            found += (field.number(_decimal(value)) for value in point)
    frame = [_unit(axis, field) for axis in robot.platform.frame]
    known = [axis for axis in frame if axis is not None]
    if len(known) < len(frame) or not _same_right_angles(robot.platform.frame, known, field):
        return None
    for axis in known:
        found += axis
    for name, values in robot.platform.quantities.items():
        if name.endswith("axis"):
            unit = _unit(values, field)
            if unit is None:
                return None
            found += unit
        else:
            found += (field.number(_decimal(value)) for value in values)
    return [*found, *(field.number(_decimal(value)) for value in robot.gravity)]


def _decimal(value: float) -> Fraction:
    return Fraction(repr(round(float(value), _DIGITS)))


def _unit(vector: Sequence[float], field: PrimeField) -> list[int] | None:
    """Return a unit vector in the field; None where its components are not simple."""
    squares = [Fraction(v * v).limit_denominator(_SIMPLE) for v in vector]
    near = all(abs(float(q) - v * v) < _ROUNDING for q, v in zip(squares, vector, strict=True))
    if not near or sum(squares) != 1:
        return None
    return [
        field.number(0) if v == 0.0 or not q else _signed_root(q, v < 0.0, field)
        for q, v in zip(squares, vector, strict=True)
    ]


def _signed_root(square: Fraction, negative: bool, field: PrimeField) -> int:
    whole = square.numerator * square.denominator
    root = reduce(mul, (_prime_root(p, field) for p in _prime_factors(whole)), 1)
    share = field.divide(root % field.prime, field.number(square.denominator))
    return field.subtract(0, share) if negative else share


def _prime_root(p: int, field: PrimeField) -> int:
    """Return a factor of a root: of a square the number itself, by `_prime_factors` negative."""
    return -p if p < 0 else field.square_root(p)


def _prime_factors(whole: int) -> list[int]:
    """Return the primes of a number, each pair of equal ones as one, negative."""
    found, p = [], 2
    while p <= isqrt(whole):
        if whole % (p * p) == 0:
            found.append(-p)
            whole //= p * p
        elif whole % p == 0:
            found.append(p)
            whole //= p
        else:
            p += 1
    return found + ([whole] if whole > 1 else [])


def _same_right_angles(
    vectors: Sequence[Sequence[float]], units: Sequence[Sequence[int]], field: PrimeField
) -> bool:
    """Say whether vectors that are perpendicular but for rounding are so in the field."""
    pairs = [(i, j) for i in range(len(units)) for j in range(i)]
    return all(
        sum(a * b for a, b in zip(units[i], units[j], strict=True)) % field.prime == 0
        for i, j in pairs
        if abs(sum(a * b for a, b in zip(vectors[i], vectors[j], strict=True))) < _ROUNDING
    )
