"""Determinants and adjugates of small matrices of expressions, without a pivot to choose."""

from __future__ import annotations

from itertools import combinations

import casadi as ca

from pteron.bodies.motion import Expression


def determinant(m: Expression) -> Expression:
    """Return the determinant of a matrix (2, 2) to (4, 4)."""
    return ca.mtimes(m[0, :], adjugate(m)[:, 0])


def adjugate(m: Expression) -> Expression:
    """Return the adjugate of a matrix (2, 2) to (4, 4): its product with the matrix is det 1."""
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
    """Return x (n, K) and d with A^T x = d w, d = det A, for A's rows, n = 2 to 4, and w (n, K)."""
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
