"""The exponential in straight-line arithmetic: the same bits on the targets `vm`, `c` and `numba`.

With it come tanh, and what plain operations give as they are, sign and tan.

A call of the C library's `exp` keeps a compiler from turning a loop into vector code, as one of its
`sin` does (see `sincos`). Here a polynomial gives E(r) = exp(r) - 1 at r = x / 4096, and twelve
doublings, E(2 r) = E(r) (2 + E(r)), lead back to x.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import factorial

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.kernels.graph import rewrite_operations

_DOUBLINGS = 12
"""Doublings of the argument: 2^12 = 4096."""

_DEGREE = 11
"""Degree of the Taylor polynomial: at 709 / 4096, about 0.17, its other terms are below 1e-17 of
it."""

_MOST = 709.0
"""The largest |x|, as exp(710) overflows; an x beyond it is replaced by it."""


def exponential(x: Expression) -> Expression:
    """Return exp(x) in plain arithmetic, accurate to 3e-16 absolutely for x <= 0.

    For positive x the relative error grows, to 1e-12 at 700. NaN counts as x = -709: in friction
    laws other terms contain the speed too, and make the result NaN.
    """
    r = ca.fmin(ca.fmax(x, -_MOST), _MOST) * 0.5**_DOUBLINGS
    total: Expression = 1.0 / factorial(_DEGREE)
    for k in range(_DEGREE - 1, 0, -1):
        total = 1.0 / factorial(k) + r * total
    minus_one = r * total
    for _ in range(_DOUBLINGS - 1):
        minus_one = minus_one * (2.0 + minus_one)
    # The last as a square, of which CasADi takes no part away, as it would of 1 - (1 + E).
    root = 1.0 + minus_one
    return root * root


@lru_cache(maxsize=1)
def exponential_function() -> ca.Function:
    """Return `exponential` as a CasADi function."""
    x = ca.SX.sym("exponent")
    return ca.Function("exponential", [x], [exponential(x)])


def _tanh(x: Expression) -> Expression:
    """Return tanh(x) in plain arithmetic, without overflow."""
    small = exponential(-2 * ca.fabs(x))
    return _sign(x) * (1 - small) / (1 + small)


def _sign(x: Expression) -> Expression:
    """Return the sign of x: 1, -1, or 0 at zero."""
    return ca.if_else(x > 0, 1, 0) - ca.if_else(x < 0, 1, 0)


_RULES: dict[str, Callable[..., Expression]] = {
    "exp": exponential,
    "tanh": _tanh,
    "sign": _sign,
    "tan": lambda x: ca.sin(x) / ca.cos(x),
}
"""Operations that are written by others."""


@lru_cache(maxsize=256)
def with_lowered_exponentials(function: ca.Function) -> ca.Function:
    """Return a CasADi function with exp and tanh replaced by plain arithmetic."""
    return rewrite_operations(function, _RULES)
