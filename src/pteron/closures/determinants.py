"""Determinants, adjugates and solutions of CasADi systems of n rows and m <= n columns, no pivots.

Square systems are solved by minors of half their rows, by Laplace's expansion; others, and large
ones with one right side, by Householder reflections, in the sense of least squares or least norm.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from itertools import combinations
from operator import mul
from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression

_Minors = dict[tuple[int, ...], Expression]
"""The minors of some rows, by their columns."""


def determinant(m: Expression) -> Expression:
    """Return a square matrix's determinant; with more rows than columns sqrt(det(m^T m))."""
    n, columns = m.shape
    if n > columns:  # Cauchy and Binet; accurate near 0, too
        return ca.norm_2(ca.vertcat(*_minors(m.T).values()))
    if n > 4:
        half = n // 2
        return _expanded(_minors(m[:half, :]), _minors(m[half:, :]), range(n))
    return ca.mtimes(m[0, :], adjugate(m)[:, 0])


def solve(m: Expression, right: Expression) -> tuple[Expression, Expression]:
    """Return x (m, K) and d = det A with A x = d right, for A (n, m).

    If n > m, x is the least-squares solution, and d = 1.
    """
    if m.shape[0] > m.shape[1]:
        return _LQFactors.factorise(m).solve(right), ca.SX(1)
    adj = adjugate(m)
    return ca.mtimes(adj, right), ca.mtimes(m[0, :], adj[:, 0])


def adjugate(m: Expression) -> Expression:
    """Return the adjugate, det(m) m^-1, of a square matrix, without division."""
    n = m.shape[0]
    if n == 2:
        return ca.vertcat(ca.horzcat(m[1, 1], -m[0, 1]), ca.horzcat(-m[1, 0], m[0, 0]))
    if n == 3:
        a, b, c = m[0, :].T, m[1, :].T, m[2, :].T
        return ca.horzcat(ca.cross(b, c), ca.cross(c, a), ca.cross(a, b))
    # Laplace: the minors of the upper and of the lower half of the rows serve all cofactors.
    halves = range(n // 2), range(n // 2, n)
    minors = [_minors(m[half, :]) for half in halves]
    return ca.horzcat(
        *(_cofactors(m, row, half, minors[1 - k]) for k, half in enumerate(halves) for row in half)
    )


def solve_transposed(rows: Expression, right: Expression) -> tuple[Expression, Expression]:
    """Return x (n, K) and d with A^T x = d right, from A (n, m); least norm if n > m.

    d is det A, or 1 if the solution needs no determinant; x is not finite if A has a rank below m.
    """
    n, columns = rows.shape
    if n > columns or (n > 4 and right.shape[1] == 1):
        return _LQFactors.factorise(rows).solve_transposed(right), ca.SX(1)
    if right.shape[1] > 1 or n == 2:
        adj = adjugate(rows)
        return ca.mtimes(adj.T, right), ca.mtimes(rows[0, :], adj[:, 0])
    # Cramer's rule, with each minor computed once.
    if n == 3:
        a, b, c = (row.T for row in ca.vertsplit(rows))
        minor, turned = ca.cross(b, c), ca.cross(a, right)
        parts = ca.dot(minor, right), ca.dot(c, turned), -ca.dot(b, turned)
        return ca.vertcat(*parts), ca.dot(a, minor)
    vectors = ca.horzcat(rows.T, right)
    upper, lower = _minors(vectors[:2, :]), _minors(vectors[2:, :])

    def volume(i: int, j: int, k: int, m: int) -> Expression:
        """Return the determinant of four of the vectors, chosen by their indices."""
        terms = ((i, j), (k, m), 1), ((i, k), (j, m), -1), ((i, m), (j, k), 1)
        return sum(s * (upper[a] * lower[b] + upper[b] * lower[a]) for a, b, s in terms)

    # Cramer's numerators: w replaces one row's vector and stands last, hence the signs.
    swapped = -volume(1, 2, 3, 4), volume(0, 2, 3, 4), -volume(0, 1, 3, 4), volume(0, 1, 2, 4)
    return ca.vertcat(*swapped), volume(0, 1, 2, 3)


def determinant_square(rows: Expression) -> Expression:
    """Return det(A^T A) of A (n, m), from the factors that `solve_transposed` computes."""
    return reduce(mul, _LQFactors.factorise(rows).squares)


def _minors(rows: Expression) -> _Minors:
    """Return the minors of all rows of a matrix, by the tuple of their columns."""
    minors: _Minors = {(i,): entry for i, entry in enumerate(ca.horzsplit(rows[0, :]))}
    for row in ca.vertsplit(rows)[1:]:
        last: _Minors = {(i,): entry for i, entry in enumerate(ca.horzsplit(row))}
        size = len(next(iter(minors))) + 1
        subsets = combinations(range(rows.shape[1]), size)
        minors = {columns: _expanded(minors, last, columns) for columns in subsets}
    return minors


def _expanded(upper: _Minors, lower: _Minors, columns: Sequence[int]) -> Expression:
    """Return a determinant of these columns by Laplace's expansion in two sets of minors."""
    total = ca.SX(0)
    for subset in combinations(columns, len(next(iter(upper)))):
        complement = tuple(column for column in columns if column not in subset)
        inversions = sum(a > b for a in subset for b in complement)
        total += (-1) ** inversions * (upper[subset] * lower[complement])
    return total


def _cofactors(m: Expression, row: int, half: Sequence[int], minors: _Minors) -> Expression:
    """Return the cofactors (n, 1) of a row, from minors of the half of rows without it."""
    n, others = m.shape[0], [k for k in half if k != row]
    own = _minors(m[others, :])
    # The other rows of its half go first.
    swaps = half[0] * len(others)
    cofactors = []
    for column in range(n):
        columns = [k for k in range(n) if k != column]
        cofactors.append((-1) ** (row + column + swaps) * _expanded(own, minors, columns))
    return ca.vertcat(*cofactors)


class _LQFactors(NamedTuple):
    """The LQ factors of A^T (m, n), Q being a product of Householder reflections.

    L is lower triangular. A reflection takes x to x - v (v.x) 2/(v.v); row by row it makes zeros
    right of L's diagonal, whose sign avoids cancellation in v.
    """

    lower: list[list[Expression]]
    """L's rows (m, m)."""
    squares: list[Expression]
    """Squares of L's diagonal."""
    mirrors: list[tuple[Expression, Expression]]
    """v (n, 1) and 2/(v.v), of each row, but of the last one of a square matrix."""
    size: int
    """n."""

    @classmethod
    def factorise(cls, rows: Expression) -> _LQFactors:
        """Return the LQ factors of A (n, m) by Householder reflections."""
        n = rows.shape[0]
        lower, squares, mirrors, _ = factors = cls([], [], [], n)
        for k, row in enumerate(ca.horzsplit(rows)):
            for mirror in mirrors:
                row = _reflect(row, mirror)
            first, square = row[k], ca.dot(row[k:], row[k:])
            if k < n - 1:
                size = ca.sqrt(square) * (ca.if_else(first > 0, 2, 0) - 1)
                v = ca.vertcat(ca.SX(k, 1), first + size, row[k + 1 :])
                mirrors.append((v, 1 / (square + size * first)))
                first = -size
            lower.append([*ca.vertsplit(row[:k]), first])
            squares.append(square)
        return factors

    def solve_transposed(self, right: Expression) -> Expression:
        """Return x (n, K) of least norm with A^T x = right (m, K), from the factors."""
        components: list[Expression] = []
        for row, residual in zip(self.lower, ca.vertsplit(right), strict=True):
            for component, coefficient in zip(components, row, strict=False):
                residual = residual - component * coefficient
            components.append(residual / row[-1])
        zeros = ca.SX(self.size - len(components), right.shape[1])
        return reduce(_reflect, reversed(self.mirrors), ca.vertcat(*components, zeros))

    def solve(self, right: Expression) -> Expression:
        """Return the least-squares x (m, K) with A x = right (n, K), from the factors."""
        rotated = ca.vertsplit(reduce(_reflect, self.mirrors, right))
        components: dict[int, Expression] = {}
        for k in reversed(range(len(self.lower))):
            sums = sum(self.lower[i][k] * component for i, component in components.items())
            components[k] = (rotated[k] - sums) / self.lower[k][k]
        return ca.vertcat(*(components[k] for k in range(len(self.lower))))


def _reflect(x: Expression, mirror: tuple[Expression, Expression]) -> Expression:
    """Return x (n, K) reflected by a Householder mirror (vector, factor)."""
    v, factor = mirror
    return x - ca.mtimes(v, ca.mtimes(v.T, x) * factor)
