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
    """Return the machine's geometric numbers in a prime field.

    None if not exactly representable.
    """
    geometry: list[int] = []
    for leg in robot.legs:
        units: list[list[int]] = []
        for quantity in leg.quantities:
            if quantity.role in ("direction", "normal"):
                unit = _unit(quantity.value, field)
                if unit is None:
                    return None
                units.append(unit)
                geometry += unit
            else:
                geometry += (field.number(_decimal(number)) for number in quantity.value)
        vectors = [q.value for q in leg.quantities if q.role in ("direction", "normal")]
        if not _same_right_angles(vectors, units, field):
            return None
        for point in (leg.platform_point, leg.fixed_offset):
            geometry += (field.number(_decimal(number)) for number in point)
    frame = [_unit(axis, field) for axis in robot.platform.frame]
    known = [axis for axis in frame if axis is not None]
    if len(known) < len(frame) or not _same_right_angles(robot.platform.frame, known, field):
        return None
    for axis in known:
        geometry += axis
    for name, vector in robot.platform.quantities.items():
        if name.endswith("axis"):
            unit = _unit(vector, field)
            if unit is None:
                return None
            geometry += unit
        else:
            geometry += (field.number(_decimal(number)) for number in vector)
    return [*geometry, *(field.number(_decimal(number)) for number in robot.gravity)]


def _decimal(number: float) -> Fraction:
    """Return a number rounded to `_DIGITS` decimals, as a fraction."""
    return Fraction(repr(round(float(number), _DIGITS)))


def _unit(vector: Sequence[float], field: PrimeField) -> list[int] | None:
    """Return a unit vector (3,) in the field; None unless its squares are simple fractions."""
    squares = [Fraction(v * v).limit_denominator(_SIMPLE) for v in vector]
    near = all(abs(float(q) - v * v) < _ROUNDING for q, v in zip(squares, vector, strict=True))
    if not near or sum(squares) != 1:
        return None
    return [
        field.number(0) if v == 0.0 or not q else _signed_root(q, v < 0.0, field)
        for q, v in zip(squares, vector, strict=True)
    ]


def _signed_root(square: Fraction, negative: bool, field: PrimeField) -> int:
    """Return a residue whose square is the fraction `square`, negated if `negative`."""
    product = square.numerator * square.denominator
    root = reduce(mul, (_prime_root(p, field) for p in _prime_factors(product)), 1)
    share = field.divide(root % field.prime, field.number(square.denominator))
    return field.subtract(0, share) if negative else share


def _prime_root(p: int, field: PrimeField) -> int:
    """Return sqrt(p) in the field; for -p, which stands for p^2 in `_prime_factors`, p itself."""
    return -p if p < 0 else field.square_root(p)


def _prime_factors(number: int) -> list[int]:
    """Return the prime factors of a number; a squared factor p^2 is given as -p."""
    factors, p = [], 2
    while p <= isqrt(number):
        if number % (p * p) == 0:
            factors.append(-p)
            number //= p * p
        elif number % p == 0:
            factors.append(p)
            number //= p
        else:
            p += 1
    return factors + ([number] if number > 1 else [])


def _same_right_angles(
    vectors: Sequence[Sequence[float]], units: Sequence[Sequence[int]], field: PrimeField
) -> bool:
    """Return whether vectors perpendicular up to rounding are perpendicular in the field."""
    pairs = [(i, j) for i in range(len(units)) for j in range(i)]
    return all(
        sum(a * b for a, b in zip(units[i], units[j], strict=True)) % field.prime == 0
        for i, j in pairs
        if abs(sum(a * b for a, b in zip(vectors[i], vectors[j], strict=True))) < _ROUNDING
    )
