"""Exact derivatives along a motion x(t), and whether two expressions of t are equal at t = 0.

Conformance tests of legs, platforms and closures stand on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.bodies.motion import Expression

_SAME = 1e-9
"""Share of its size by which a quantity may differ from what it should be."""

_SMALL = 1e-3
"""Sizes below which quantities are compared as they are, SI units."""

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
