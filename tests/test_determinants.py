"""Determinants and solutions of systems of n rows and m <= n columns, against NumPy."""

import casadi as ca
import numpy as np
import pytest

from pteron.closures.determinants import (
    adjugate,
    determinant,
    determinant_square,
    solve,
    solve_transposed,
)

SQUARE, TALL = [2, 3, 4, 5, 6, 7], [(3, 2), (4, 2), (4, 3), (5, 3), (6, 5), (8, 6)]


def values(expressions, symbols, numbers):
    function = ca.Function("values", symbols, [ca.densify(part) for part in expressions])
    return [np.array(part) for part in function.call(numbers)]


def system(n, m):
    rng = np.random.default_rng(n * 10 + m)
    rows, forces, rates = (rng.normal(size=shape) for shape in ((n, m), (m, 2), (n, 2)))
    symbols = [ca.SX.sym("entry", *part.shape) for part in (rows, forces, rates)]
    return [rows, forces, rates], symbols


@pytest.mark.parametrize("n", SQUARE)
def test_square_systems_of_any_size(n):
    numbers, symbols = system(n, n)
    rows, forces, rates = numbers
    a, w, q = symbols
    parts = determinant(a), adjugate(a), determinant_square(a), *solve(a, q)
    d, adj, square, x, divisor = values(parts, symbols, numbers)
    assert d == pytest.approx(np.linalg.det(rows), rel=1e-12)
    assert square == pytest.approx(np.linalg.det(rows) ** 2, rel=1e-12)
    assert adj @ rows == pytest.approx(np.linalg.det(rows) * np.eye(n), abs=1e-11)
    assert rows @ x == pytest.approx(divisor * rates, abs=1e-11)
    for columns in (1, 2):  # several right sides go another way
        x, divisor = values(solve_transposed(a, w[:, :columns]), symbols, numbers)
        assert rows.T @ x == pytest.approx(divisor * forces[:, :columns], abs=1e-11)


@pytest.mark.parametrize(("n", "m"), TALL)
def test_more_rows_than_columns_are_solved_in_least_squares_and_least_norm(n, m):
    numbers, symbols = system(n, m)
    rows, forces, rates = numbers
    a, w, q = symbols
    parts = determinant(a), determinant_square(a), *solve(a, q), *solve_transposed(a, w)
    d, square, x, one, y, _ = values(parts, symbols, numbers)
    gram = np.linalg.det(rows.T @ rows)
    assert d == pytest.approx(np.sqrt(gram), rel=1e-12)
    assert square == pytest.approx(gram, rel=1e-12)
    assert x == pytest.approx(one * (np.linalg.pinv(rows) @ rates), abs=1e-12)
    assert y == pytest.approx(np.linalg.pinv(rows.T) @ forces, abs=1e-12)


def test_a_determinant_of_more_rows_is_zero_where_columns_are_dependent():
    rows = ca.SX([[1.0, 2.0], [2.0, 4.0], [3.0, 6.0]])
    assert float(determinant(rows)) == 0.0
