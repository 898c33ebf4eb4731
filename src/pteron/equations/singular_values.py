"""Singular values of small matrices of expressions, without a branch: one-sided Jacobi.

Each rotation makes two columns perpendicular; after some sweeps over all pairs all of them are, and
their lengths are the singular values. Small ones keep their digits better than by eigenvalues of
A^T A, which lose half of them, and equal singular values are no special case: no quotient becomes
0/0. A fixed number of sweeps is straight-line code, which a compiler vectorises.

M. R. Hestenes, Journal of SIAM 6 (1958) 51-90; J. Demmel, K. Veselic, SIAM Journal on Matrix
Analysis and Applications 13 (1992) 1204-1245.
"""

from __future__ import annotations

from functools import reduce
from itertools import combinations

import casadi as ca

from pteron.bodies.motion import Expression

_SWEEPS = {0: 0, 1: 0, 2: 1, 3: 4, 4: 5, 5: 6, 6: 6}
"""Sweeps, by the number of columns, that bring random and graded matrices to rounding."""

_TINY = 1e-300
"""Added to a denominator, against 0/0: it changes no other number."""


def singular_values(matrix: Expression) -> list[Expression]:
    """Return the min(k, n) singular values of a matrix (k, n), unsorted.

    A matrix with more columns than rows is transposed first.
    """
    if matrix.shape[1] > matrix.shape[0]:
        matrix = matrix.T
    columns = ca.horzsplit(ca.densify(matrix))
    for _ in range(_SWEEPS[len(columns)]):
        for i, j in combinations(range(len(columns)), 2):
            columns[i], columns[j] = _orthogonalise(columns[i], columns[j])
    return [ca.sqrt(ca.dot(column, column)) for column in columns]


def _orthogonalise(u: Expression, v: Expression) -> tuple[Expression, Expression]:
    """Return two columns rotated, by 45 degrees at most, to be orthogonal (a Jacobi rotation).

    Its angle is the smaller solution of tan(2 angle) = 2 u.v / (u.u - v.v).
    """
    square_difference, twice_product = ca.dot(u, u) - ca.dot(v, v), 2 * ca.dot(u, v)
    denominator = (
        ca.fabs(square_difference)
        + ca.sqrt(square_difference * square_difference + twice_product * twice_product)
        + _TINY
    )
    tangent = twice_product / denominator * (1 - 2 * (square_difference < 0))
    cosine = 1 / ca.sqrt(1 + tangent * tangent)
    sine = tangent * cosine
    return cosine * u + sine * v, cosine * v - sine * u


def largest(sigmas: list[Expression]) -> Expression:
    """Return the largest of a list of singular values."""
    return reduce(ca.fmax, sigmas)


def smallest(sigmas: list[Expression]) -> Expression:
    """Return the smallest of a list of singular values."""
    return reduce(ca.fmin, sigmas)
