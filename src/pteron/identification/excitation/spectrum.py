"""Smooth measures of an information matrix, as expressions that can be differentiated."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import casadi as ca

from pteron.equations.geometry import Expression

__all__ = ["Criterion", "measure"]

Criterion = Literal["condition", "logdet"]
"""What is made small: the scaled condition number, or the volume of the confidence ellipsoid."""


def measure(information: Expression, criterion: Criterion, doublings: int) -> Expression:
    """Return what an optimiser makes small, of the information matrix M = W^T W (p, p).

    R is M with rows and columns divided by the roots of its diagonal, so that the condition number
    of R is the square of the scaled condition number of W.

    ``"logdet"``: -log det M / p. Scaling the columns of W only adds a constant to it.

    ``"condition"``: log(tr(R^q) tr(R^-q)) / (2 q), q = 2^doublings. It is smooth, at least the log
    of the scaled condition number, and at most log(p) / q above it.
    """
    p = information.shape[0]
    scale = 1.0 / ca.sqrt(ca.diag(information))
    equilibrated = information * ca.mtimes(scale, scale.T)
    inverse, logdet = _inverse(p)(equilibrated)
    if criterion == "logdet":
        return (2.0 * ca.sum1(ca.log(scale)) - logdet) / p
    return 0.5 * (_log_trace(equilibrated, doublings) + _log_trace(inverse, doublings))


def _log_trace(matrix: Expression, doublings: int) -> Expression:
    """Return log(tr(A^q)) / q with q = 2^doublings, of a symmetric matrix, free of overflow."""
    power = 1
    total = ca.log(ca.trace(matrix))
    matrix = matrix / ca.trace(matrix)
    for _ in range(doublings):
        matrix = ca.mtimes(matrix, matrix)
        power *= 2
        trace = ca.trace(matrix)
        total = 2.0 * total + ca.log(trace)
        matrix = matrix / trace
    return total / power


@lru_cache(maxsize=16)
def _inverse(p: int) -> ca.Function:
    """Return the function that inverts a positive definite matrix, and gives its log det."""
    matrix = ca.SX.sym("matrix", p, p)
    upper = ca.chol(matrix)
    inverse = ca.solve(upper, ca.SX.eye(p))
    logdet = 2.0 * ca.sum1(ca.log(ca.diag(upper)))
    return ca.Function(
        "inverse", [matrix], [ca.densify(ca.mtimes(inverse, inverse.T)), logdet], {"cse": True}
    )
