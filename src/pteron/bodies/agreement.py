"""Exact time derivatives of CasADi expressions, and comparison of expressions at time 0.

The conformance tests of legs, platforms and closures use them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.bodies.motion import Expression

_SAME = 1e-9
"""Greatest relative difference of quantities that count as equal."""

_SMALL = 1e-3
"""Least size to which a difference is relative, SI units."""

TIME = ca.SX.sym("t")


def rate_of(value: Expression) -> Expression:
    """Return the derivative of an expression with respect to `TIME`."""
    return ca.jtimes(value, TIME, ca.SX(1))


def differing(pairs: Mapping[str, tuple[Expression, Expression]]) -> Iterator[str]:
    """Yield the names of pairs whose two expressions differ at t = 0."""
    for name, (found, expected) in pairs.items():
        one, other = _now(found), _now(expected)
        size = max(np.abs(one).max(initial=0.0), np.abs(other).max(initial=0.0), _SMALL)
        if not np.abs(one - other).max(initial=0.0) <= _SAME * size:  # NaN differs too
            yield name


def _now(value: Expression) -> NDArray[np.float64]:
    return np.asarray(ca.DM(ca.evalf(ca.substitute(ca.densify(ca.SX(value)), TIME, 0)))).ravel()
