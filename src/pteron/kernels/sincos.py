"""Sine and cosine in straight-line arithmetic: the same bits on the targets `vm`, `c` and `numba`.

Calls of a C library's `sin` and `cos` keep a compiler from turning a loop into vector code, and
libraries differ in the last bit. Here both are an expression of plain arithmetic: the angle minus q
pi/2, in three parts (Cody and Waite), then a polynomial for each. The error is below one unit in
the last place (measured: 0.8).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca

LIMIT = 1e5
"""Angle, rad, above which q pi/2 has too few digits and the C library's functions serve."""

_PARTS = (1.5707963267923333, 2.5633441515839558e-12, 1.0562999066987428e-23)
"""pi/2; the first two have 37 bits, so that their product with q is exact up to the limit."""

_SINE = (
    *(-0.16666666666666666, 0.008333333333330946, -0.0001984126983675497),
    *(2.755731610068303e-06, -2.5051131455427946e-08, 1.591810123027412e-10),
)
"""(sin r - r) / r^3 in powers of r^2, interpolated between Chebyshev's points of [-pi/4, pi/4]."""

_COSINE = (
    *(0.041666666666666664, -0.0013888888888887395, 2.4801587298763433e-05),
    *(-2.7557317270560326e-07, 2.0876146024689747e-09, -1.1382614868556325e-11),
)
"""(cos r - 1 + r^2/2) / r^4, likewise."""


@lru_cache(maxsize=1)
def reduced_sincos() -> ca.Function:
    """Return the CasADi function of an angle, rad, up to `LIMIT`: its sine and cosine."""
    x = ca.SX.sym("angle")
    # r + low = x - q pi/2, where low is what r has no bits for. (Differences throughout: CasADi
    # takes a + b - a for b.)
    q = ca.floor(x * 0.6366197723675814 + 0.5)
    first = x - q * _PARTS[0]
    second = q * _PARTS[1]
    rounded = first - second
    third = q * _PARTS[2] - ((first - rounded) - second)
    r = rounded - third
    low = (rounded - r) - third
    square = r * r
    cube = square * r
    sine = r - (
        (square * (0.5 * low - cube * _polynomial(_SINE[1:], square)) - low) - cube * _SINE[0]
    )
    half = 0.5 * square
    most = 1.0 - half
    cosine = most + (
        ((1.0 - most) - half) + (square * (square * _polynomial(_COSINE, square)) - r * low)
    )
    # The quadrant, q modulo 4, is 2 above + odd. A product with 0 or 1 is exact.
    pairs = ca.floor(0.5 * q)
    odd = q - 2 * pairs
    above = pairs - 2 * ca.floor(0.5 * pairs)
    even = 1 - odd
    turned = 1 - 2 * above
    sines = turned * (even * sine + odd * cosine)
    cosines = turned * (even - odd) * (even * cosine + odd * sine)
    return ca.Function("near", [x], ca.cse([sines, cosines]))


def _polynomial(coefficients: tuple[float, ...], x: Any) -> Any:
    """Return the value of a polynomial at x, by Horner's scheme; the constant is first."""
    total: Any = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = coefficient + x * total
    return total
