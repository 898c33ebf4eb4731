"""Two links that close a triangle: the intersection of two circles.

Vectors of the links' plane are two-vectors (2, 1); `plane_of` gives its axes. The random vectors
are rational: exact reduction closes legs with them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from random import Random

import casadi as ca
import numpy as np

from pteron.bodies.motion import Expression
from pteron.bodies.vectors import Vector, cross

_ROUNDING = 1e-15
"""Tolerance of an axis' component that is 0, 1 or -1: rounding."""


def edges_of_reach(lu: Expression, ll: Expression, n2: Expression) -> tuple[Expression, Expression]:
    """Return (lu + ll)^2 - n2 and n2 - (lu - ll)^2, m^2, negative out of reach; n2 = u . u."""
    longest, shortest = lu + ll, lu - ll  # Remark 1: radii, not diameters
    return longest * longest - n2, n2 - shortest * shortest


def squared_reach(lu: Expression, ll: Expression, n2: Expression) -> Expression:
    """Return Delta = ((lu + ll)^2 - n2) (n2 - (lu - ll)^2), m^4, negative out of reach."""
    stretched, folded = edges_of_reach(lu, ll, n2)
    return stretched * folded


def quarter_turn(v: Expression) -> Expression:
    """Return v (2, K), or each column, rotated by +90 degrees in the plane."""
    return ca.vertcat(-v[1, :], v[0, :])


def links_from_triangle(
    lu: Expression, ll: Expression, sigma: Expression, u: Expression
) -> tuple[Expression, Expression, Expression]:
    """Return the two links l_u + l_l = u (2, 1), and 1 / D with D = (l_u x l_l) . d.

    D = -sigma sqrt(Delta) / 2: twice the area of the links' triangle.
    """
    n2 = ca.dot(u, u)
    root = ca.sqrt(squared_reach(lu, ll, n2))
    share = 0.5 + (0.5 * (lu * lu - ll * ll)) / n2  # Lemma 1, Contribution 1
    offset = (0.5 * sigma) * (root / n2)
    l_u = share * u + offset * quarter_turn(u)  # Eq. (1)
    return l_u, u - l_u, (-2 * sigma) / root  # Eq. (2)


def first_moment(
    vector: Expression, hx: Expression, hy: Expression
) -> tuple[Expression, Expression]:
    """Return the first moment h (2, K) of (hx, hy) along `vector`, and d x h."""
    turned = quarter_turn(vector)
    return (
        ca.mtimes(vector, hx) + ca.mtimes(turned, hy),
        ca.mtimes(turned, hx) - ca.mtimes(vector, hy),
    )


def pole(direction: Sequence[float]) -> tuple[int, int]:
    """Return index and sign of a unit vector's largest component, as `plane_axis` takes them."""
    i = max(range(3), key=lambda j: abs(direction[j]))
    return i, 1 if direction[i] > 0 else -1


def plane_axis(d: Expression, i: int, sign: int) -> Expression:
    """Return a unit vector (3, 1) perpendicular to d, by a formula without a square root.

    It is axis i + 1 reflected by the reflection that maps axis i to -sign d. `sign` is the sign of
    d's component i, so that the denominator is at least 1.
    """
    unit = ca.DM.eye(3)
    v = d + sign * unit[:, i]
    j = (i + 1) % 3
    return unit[:, j] - (v[j] / (1 + sign * d[i])) * v


def plane_of(d: Expression, a: Expression) -> Expression:
    """Return (3, 2): the axes a and d x a of the plane perpendicular to d."""
    plane = ca.horzcat(a, ca.cross(d, a))
    if not plane.is_constant():
        return plane
    # Entries equal to 0, 1 or -1 up to rounding are rounded: products with these cost nothing.
    entries = np.array(ca.evalf(plane))
    rounded = np.round(entries)
    return ca.SX(ca.DM(np.where(np.abs(entries - rounded) < _ROUNDING, rounded, entries)))


@lru_cache(maxsize=256)
def perpendicular_to(d: Vector) -> Vector:
    """Return a unit vector perpendicular to the unit vector d."""
    x, y, z = (float(part) for part in ca.vertsplit(plane_axis(ca.DM(list(d)), *pole(d))))
    return (x, y, z)


def random_vector(length: Fraction, dimension: int, rng: Random) -> list[Fraction]:
    """Return a random vector (dimension,) of this length with rational components."""
    flat = [random_fraction(rng) for _ in range(dimension - 1)]
    square = sum(t * t for t in flat)
    return [length * part / (1 + square) for part in (*(2 * t for t in flat), 1 - square)]


def random_triangle(
    values: Mapping[str, Sequence[Fraction]], rng: Random
) -> tuple[list[Fraction], int]:
    """Return the sum u (3,) of two random links in their plane, and the elbow's sign."""
    a = values["plane_axis"]
    b = cross(values["direction"], a)
    (ua, ub), (la, lb) = (
        random_vector(values[key][0], 2, rng) for key in ("upper_length", "lower_length")
    )
    u = [(ua + la) * p + (ub + lb) * q for p, q in zip(a, b, strict=True)]
    # D = (l_u x l_l) . d has the sign of -sigma.
    return u, -1 if ua * lb - ub * la > 0 else 1


def random_fraction(rng: Random) -> Fraction:
    """Return a random fraction, mostly between -10 and 10."""
    return Fraction(rng.randint(-400, 400), rng.randint(1, 200))
