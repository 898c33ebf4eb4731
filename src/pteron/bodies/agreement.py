"""Exact time derivatives of CasADi expressions, and comparison of expressions at time 0.

The conformance tests of legs, platforms and closures use them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.bodies.motion import Expression
from pteron.tolerances import ROUNDING

_SMALL = 1e-3
"""Lower bound of the size that differences are relative to, SI units."""

TIME = ca.SX.sym("t")


def rate_of(expression: Expression) -> Expression:
    """Return the derivative of an expression by the time symbol `TIME`."""
    return ca.jtimes(expression, TIME, ca.SX(1))


def mismatched_names(pairs: Mapping[str, tuple[Expression, Expression]]) -> Iterator[str]:
    """Yield the names of the pairs of expressions that differ at time 0."""
    for name, (actual, expected) in pairs.items():
        value_now, expected_now = _evaluate_at_zero(actual), _evaluate_at_zero(expected)
        size = max(
            np.abs(value_now).max(initial=0.0), np.abs(expected_now).max(initial=0.0), _SMALL
        )
        if (
            not np.abs(value_now - expected_now).max(initial=0.0) <= ROUNDING * size
        ):  # NaN differs too
            yield name


def _evaluate_at_zero(expression: Expression) -> NDArray[np.float64]:
    """Return an expression's elements at time 0 as floats (n,)."""
    return np.asarray(
        ca.DM(ca.evalf(ca.substitute(ca.densify(ca.SX(expression)), TIME, 0)))
    ).ravel()
