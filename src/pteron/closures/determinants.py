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
            _sign((*three, *_others(three))) * volume * lower[_others(three)]
            for three, volume in upper.items()
        )
    return ca.mtimes(m[0, :], adjugate(m)[:, 0])


def solved(m: Expression, right: Expression) -> tuple[Expression, Expression]:
    """Return x (n, K) and d = det m with m x = d right."""
    across = adjugate(m)
    return ca.mtimes(across, right), ca.mtimes(m[0, :], across[:, 0])


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


def solved_across(rows: Expression, right: Expression) -> tuple[Expression, Expression]:
    """Return x (n, K) and d with A^T x = d w; for A's rows, n = 2 to 4 or 6.

    d is det A, or 1 where x is found without it, and not finite where det A is 0.
    """
    if rows.shape[0] == 6 and right.shape[1] == 1:
        return _six_solved_across(rows, right), ca.SX(1)
    if right.shape[1] > 1 or rows.shape[0] == 2:
        across = adjugate(rows)
        return ca.mtimes(across.T, right), ca.mtimes(rows[0, :], across[:, 0])
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

    # With w in place of one row's vector, put last: its sign is that of the way there.
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
    found = []
    for column in range(4):
        i, j, k = (c for c in range(4) if c != column)
        minor = other[i] * minors[j, k] - other[j] * minors[i, k] + other[k] * minors[i, j]
        found.append((-1) ** (row + column) * minor)
    return ca.vertcat(*found)


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


def _others(three: _Three) -> _Three:
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
            rest = _others((i, j, c))
            for half, order in enumerate([(i, j, c, *rest), (*rest, i, j, c)]):
                slopes[half] += _sign(order) * crosses[half][i, j] * triples[1 - half][rest]
        rows.append(ca.vertcat(*slopes).T)
    return ca.vertcat(*rows)


class _Reflected(NamedTuple):
    """The factors of A^T = L Q for six rows, Q being a product of Householder's reflections.

    L is lower triangular. A reflection takes x to x - v (v.x) 2/(v.v); row by row it makes zeros
    right of L's diagonal, whose sign is that which cancels nothing in v.
    """

    lower: list[list[Expression]]
    """L's rows."""
    squares: list[Expression]
    """Those of L's diagonal."""
    mirrors: list[tuple[Expression, Expression]]
    """v and 2/(v.v), of each row but the last."""

    @classmethod
    def of(cls, rows: Expression) -> _Reflected:
        """Return the factors for the rows of A."""
        lower, squares, mirrors = made = cls([], [], [])
        for k, row in enumerate(ca.horzsplit(rows)):
            for mirror in mirrors:
                row = _mirrored(row, mirror)
            first, square = row[k], ca.dot(row[k:], row[k:])
            if k < 5:
                size = ca.sqrt(square) * (ca.if_else(first > 0, 2, 0) - 1)
                v = ca.vertcat(ca.SX(k, 1), first + size, row[k + 1 :])
                mirrors.append((v, 1 / (square + size * first)))
                first = -size
            lower.append([*ca.vertsplit(row[:k]), first])
            squares.append(square)
        return made


def _mirrored(x: Expression, mirror: tuple[Expression, Expression]) -> Expression:
    v, factor = mirror
    return x - v * (ca.dot(v, x) * factor)


def determinant_square(rows: Expression) -> Expression:
    """Return the square of the determinant of six rows, at no cost beside `solved_across`."""
    return reduce(mul, _Reflected.of(rows).squares)


def _six_solved_across(rows: Expression, right: Expression) -> Expression:
    """Return x with A^T x = w: L Q x = w."""
    lower, _, mirrors = _Reflected.of(rows)
    found: list[Expression] = []
    for row, rest in zip(lower, ca.vertsplit(right), strict=True):
        for value, entry in zip(found, row, strict=False):
            rest = rest - value * entry
        found.append(rest / row[-1])
    return reduce(_mirrored, reversed(mirrors), ca.vertcat(*found))
