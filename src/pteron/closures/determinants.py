"""Determinants, adjugates and solutions of CasADi systems, 2 to 4 or 6 in size, without pivots."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from itertools import combinations
from operator import mul
from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression


def determinant(m: Expression) -> Expression:
    """Return the determinant of a matrix (2, 2) to (4, 4), or (6, 6)."""
    if m.shape[0] == 6:
        upper, lower = (_triples(ca.horzsplit(half)) for half in (m[:3, :], m[3:, :]))
        return sum(
            _sign((*three, *_complement(three))) * volume * lower[_complement(three)]
            for three, volume in upper.items()
        )
    return ca.mtimes(m[0, :], adjugate(m)[:, 0])


def solve(m: Expression, right: Expression) -> tuple[Expression, Expression]:
    """Return x (n, K) and d = det m with m x = d right."""
    adj = adjugate(m)
    return ca.mtimes(adj, right), ca.mtimes(m[0, :], adj[:, 0])


def adjugate(m: Expression) -> Expression:
    """Return the adjugate, det(m) m^-1, of a matrix (2, 2) to (4, 4), or (6, 6)."""
    if m.shape[0] == 6:
        return _adjugate_of_six(m)
    if m.shape[0] == 2:
        return ca.vertcat(ca.horzcat(m[1, 1], -m[0, 1]), ca.horzcat(-m[1, 0], m[0, 0]))
    if m.shape[0] == 3:
        a, b, c = m[0, :].T, m[1, :].T, m[2, :].T
        return ca.horzcat(ca.cross(b, c), ca.cross(c, a), ca.cross(a, b))
    # Laplace: the minors of the upper and of the lower pair of rows serve all cofactors.
    upper, lower = _minors(m[:2, :]), _minors(m[2:, :])
    columns = [_cofactors(m, i, lower if i < 2 else upper) for i in range(4)]
    return ca.horzcat(*columns)


def solve_transposed(rows: Expression, right: Expression) -> tuple[Expression, Expression]:
    """Return x (n, K) and d with A^T x = d w, from the rows of A (n, n), n = 2 to 4 or 6.

    d is det A, or 1 where the solution needs no determinant; x is not finite where det A is 0.
    """
    if rows.shape[0] == 6 and right.shape[1] == 1:
        return _solve_six_transposed(rows, right), ca.SX(1)
    if right.shape[1] > 1 or rows.shape[0] == 2:
        adj = adjugate(rows)
        return ca.mtimes(adj.T, right), ca.mtimes(rows[0, :], adj[:, 0])
    # Cramer's rule, with each minor computed once.
    if rows.shape[0] == 3:
        a, b, c = (row.T for row in ca.vertsplit(rows))
        minor, turned = ca.cross(b, c), ca.cross(a, right)
        parts = ca.dot(minor, right), ca.dot(c, turned), -ca.dot(b, turned)
        return ca.vertcat(*parts), ca.dot(a, minor)
    vectors = ca.horzcat(rows.T, right)
    upper, lower = _minors(vectors[:2, :]), _minors(vectors[2:, :])

    def volume(i: int, j: int, k: int, m: int) -> Expression:
        """Return the determinant of four of the vectors."""
        terms = ((i, j), (k, m), 1), ((i, k), (j, m), -1), ((i, m), (j, k), 1)
        return sum(s * (upper[a] * lower[b] + upper[b] * lower[a]) for a, b, s in terms)

    # Cramer's numerators: w replaces one row's vector and stands last, hence the signs.
    swapped = -volume(1, 2, 3, 4), volume(0, 2, 3, 4), -volume(0, 1, 3, 4), volume(0, 1, 2, 4)
    return ca.vertcat(*swapped), volume(0, 1, 2, 3)


def _minors(rows: Expression) -> dict[tuple[int, int], Expression]:
    """Return the minors of two rows, by their columns."""
    return {
        (i, j): rows[0, i] * rows[1, j] - rows[0, j] * rows[1, i]
        for i, j in combinations(range(rows.shape[1]), 2)
    }


def _cofactors(m: Expression, row: int, minors: dict[tuple[int, int], Expression]) -> Expression:
    """Return the cofactors of a row (4, 1), from the minors of the pair of rows it is not in."""
    other = m[row ^ 1, :]
    cofactors = []
    for column in range(4):
        i, j, k = (c for c in range(4) if c != column)
        minor = other[i] * minors[j, k] - other[j] * minors[i, k] + other[k] * minors[i, j]
        cofactors.append((-1) ** (row + column) * minor)
    return ca.vertcat(*cofactors)


# Six rows: Laplace's expansion by three rows and three, whose minors are triple products.

_Three = tuple[int, ...]


def _triples(columns: Sequence[Expression]) -> dict[_Three, Expression]:
    crosses = _crosses(columns)
    return {
        (i, j, k): ca.dot(crosses[i, j], columns[k])
        for i, j, k in combinations(range(len(columns)), 3)
    }


def _crosses(columns: Sequence[Expression]) -> dict[tuple[int, int], Expression]:
    pairs = combinations(range(len(columns)), 2)
    return {(i, j): ca.cross(columns[i], columns[j]) for i, j in pairs}


def _complement(three: _Three) -> _Three:
    return tuple(i for i in range(6) if i not in three)


def _sign(order: Sequence[int]) -> int:
    return -1 if sum(a > b for a, b in combinations(order, 2)) % 2 else 1


def _adjugate_of_six(m: Expression) -> Expression:
    """Return the adjugate: row c is the gradient of det m by column c."""
    halves = [ca.horzsplit(half) for half in (m[:3, :], m[3:, :])]
    crosses, triples = [_crosses(half) for half in halves], [_triples(half) for half in halves]
    rows = []
    for c in range(6):
        slopes = [ca.SX(3, 1), ca.SX(3, 1)]
        for i, j in combinations([k for k in range(6) if k != c], 2):
            complement = _complement((i, j, c))
            for half, order in enumerate([(i, j, c, *complement), (*complement, i, j, c)]):
                slopes[half] += _sign(order) * crosses[half][i, j] * triples[1 - half][complement]
        rows.append(ca.vertcat(*slopes).T)
    return ca.vertcat(*rows)


class _LQFactors(NamedTuple):
    """The LQ factors of A^T for six rows, Q being a product of Householder reflections.

    L is lower triangular. A reflection takes x to x - v (v.x) 2/(v.v); row by row it makes zeros
    right of L's diagonal, whose sign avoids cancellation in v.
    """

    lower: list[list[Expression]]
    """L's rows."""
    squares: list[Expression]
    """Squares of L's diagonal."""
    mirrors: list[tuple[Expression, Expression]]
    """v and 2/(v.v), of each row but the last."""

    @classmethod
    def factorise(cls, rows: Expression) -> _LQFactors:
        """Return the factors for the rows of A."""
        lower, squares, mirrors = factors = cls([], [], [])
        for k, row in enumerate(ca.horzsplit(rows)):
            for mirror in mirrors:
                row = _reflect(row, mirror)
            first, square = row[k], ca.dot(row[k:], row[k:])
            if k < 5:
                size = ca.sqrt(square) * (ca.if_else(first > 0, 2, 0) - 1)
                v = ca.vertcat(ca.SX(k, 1), first + size, row[k + 1 :])
                mirrors.append((v, 1 / (square + size * first)))
                first = -size
            lower.append([*ca.vertsplit(row[:k]), first])
            squares.append(square)
        return factors


def _reflect(x: Expression, mirror: tuple[Expression, Expression]) -> Expression:
    v, factor = mirror
    return x - v * (ca.dot(v, x) * factor)


def determinant_square(rows: Expression) -> Expression:
    """Return the square of the determinant of six rows, at no cost beside `solve_transposed`."""
    return reduce(mul, _LQFactors.factorise(rows).squares)


def _solve_six_transposed(rows: Expression, right: Expression) -> Expression:
    """Return x with A^T x = w: L Q x = w."""
    lower, _, mirrors = _LQFactors.factorise(rows)
    components: list[Expression] = []
    for row, residual in zip(lower, ca.vertsplit(right), strict=True):
        for component, coefficient in zip(components, row, strict=False):
            residual = residual - component * coefficient
        components.append(residual / row[-1])
    return reduce(_reflect, reversed(mirrors), ca.vertcat(*components))
