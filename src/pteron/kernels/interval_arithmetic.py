"""Arithmetic of intervals, many at a time: what each operation of a graph makes of enclosures.

**The inclusion.** An `Interval` holds two arrays, one element a box. Each rule returns bounds
between which the exact result lies, for all exact arguments between theirs at which the operation
is defined. By induction over the graph the outputs' intervals hold every value that the function,
in real arithmetic, takes in a box. Rounding does not break it: + - * / and square roots are
correctly rounded (IEEE 754), so that a computed bound x is wrong by half a unit in its last place
at most, and x - 2^-52 |x|, rounded, is at least a whole one below x; where a product or a quotient
may underflow, 1e-300 more is taken. Sines, cosines, arc tangents and exponentials of NumPy err by
4 units at most and are widened by 8 and more. A sum that is zero is exact, and a square is not
negative.

**Partial domains.** A root of what may be negative, or a quotient by what may be zero, is defined
in a part of the box: its interval holds the values there, and `maybe` says so. `never` says that it
is defined nowhere in the box. `jump` says that it may not be continuous where it is defined. All
three are handed on to what is computed from it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Bound = Any
"""An array (B,), or a number that serves the whole batch."""

Mask = NDArray[np.bool_] | None
"""For each box, whether something holds of it; None where it holds of no box."""

_ULP = 2.0**-52
"""Share of itself by which a bound from + - * / or a root is widened."""

_UNDERFLOW = 1e-300
"""Widening, beside that, of a product or a quotient, which may underflow."""

_LIBM = 2.0**-49
"""Share by which sines, cosines, arc tangents and exponentials are widened."""

_NEAR = 1e-12
"""Relative distance from a sine's extreme within which it counts as reached."""


class Interval(NamedTuple):
    """Bounds on a quantity, for each box of a batch."""

    low: Bound
    high: Bound
    maybe: Mask = None
    """Boxes in which it is undefined, in a part or everywhere."""
    never: Mask = None
    """Boxes in which it is defined nowhere."""
    jump: Mask = None
    """Boxes in which it may jump."""


def constant(value: float) -> Interval:
    """Return a number as an interval; NaN is defined nowhere."""
    if np.isnan(value):
        return Interval(-np.inf, np.inf, *(np.ones(1, bool) for _ in range(3)))
    return Interval(value, value)


def either(a: Mask, b: Mask) -> Mask:
    """Return the boxes of one mask or the other."""
    return b if a is None else a if b is None else a | b


def _marks(*given: Interval) -> tuple[Mask, Mask, Mask]:
    maybe, never, jump = given[0][2:]
    for other in given[1:]:
        maybe, never = either(maybe, other.maybe), either(never, other.never)
        jump = either(jump, other.jump)
    return maybe, never, jump


def _below(x: Bound) -> Bound:
    return x - np.abs(x) * _ULP


def _above(x: Bound) -> Bound:
    return x + np.abs(x) * _ULP


def _well_below(x: Bound, share: float = _ULP) -> Bound:
    return x - (np.abs(x) * share + _UNDERFLOW)


def _well_above(x: Bound, share: float = _ULP) -> Bound:
    return x + (np.abs(x) * share + _UNDERFLOW)


def add(a: Interval, b: Interval) -> Interval:
    """Return a + b."""
    return Interval(_below(a.low + b.low), _above(a.high + b.high), *_marks(a, b))


def subtract(a: Interval, b: Interval) -> Interval:
    """Return a - b."""
    return Interval(_below(a.low - b.high), _above(a.high - b.low), *_marks(a, b))


def negate(a: Interval) -> Interval:
    """Return -a."""
    return Interval(-a.high, -a.low, *a[2:])


def multiply(a: Interval, b: Interval) -> Interval:
    """Return a b."""
    if isinstance(a.low, float) and a.low == a.high:
        a, b = b, a
    if isinstance(b.low, float) and b.low == b.high:
        ends = (a.low, a.high) if b.low >= 0.0 else (a.high, a.low)
        least, most = (_finite_product(end, b.low) for end in ends)
    else:
        products = [x * y for x in a[:2] for y in b[:2]]
        least, most = _least(products), _most(products)
        if np.isnan(np.sum(least)):  # as each is where one of the products is
            products = [_finite_product(x, y) for x in a[:2] for y in b[:2]]
            least, most = _least(products), _most(products)
    return Interval(_well_below(least), _well_above(most), *_marks(a, b))


def _finite_product(x: Bound, y: Bound) -> Bound:
    """Return x y, where zero times an infinite bound, which stands for finite values, is zero."""
    found = x * y
    return np.where((x == 0.0) | (y == 0.0), 0.0, found) if np.isnan(np.sum(found)) else found


def _least(values: list[Bound]) -> Bound:
    return np.minimum(np.minimum(values[0], values[1]), np.minimum(values[2], values[3]))


def _most(values: list[Bound]) -> Bound:
    return np.maximum(np.maximum(values[0], values[1]), np.maximum(values[2], values[3]))


def square(a: Interval) -> Interval:
    """Return a a, which is not negative."""
    size = absolute(a)
    low = np.maximum(_well_below(size.low * size.low), 0.0)
    return Interval(low, _well_above(size.high * size.high), *a[2:])


def divide(a: Interval, b: Interval) -> Interval:
    """Return a / b where b is not zero."""
    zero = np.logical_not((b.low > 0.0) | (b.high < 0.0))
    if not np.any(zero):
        quotients = [x / y for x in a[:2] for y in b[:2]]
        least, most = _least(quotients), _most(quotients)
        return Interval(_well_below(least), _well_above(most), *_marks(a, b))
    # 1 / b is all of one side where b is zero at an end alone; else it may be anything.
    low = np.where(zero & (b.low < 0.0), -np.inf, 1.0 / np.where(b.high == 0.0, np.nan, b.high))
    high = np.where(zero & (b.high > 0.0), np.inf, 1.0 / np.where(b.low == 0.0, np.nan, b.low))
    inverse = Interval(_well_below(low), _well_above(high))
    maybe, never, jump = _marks(a, b)
    nowhere = (b.low == 0.0) & (b.high == 0.0)
    low, high, *_ = multiply(Interval(a.low, a.high), inverse)
    part, none = np.atleast_1d(zero), np.atleast_1d(nowhere)
    return Interval(low, high, either(maybe, part), either(never, none), either(jump, part))


def root(a: Interval) -> Interval:
    """Return the square root of a where a is not negative."""
    low = np.sqrt(np.maximum(a.low, 0.0))
    high = np.sqrt(np.maximum(a.high, 0.0))
    # Of a bound that is NaN nothing is known.
    part, none = ~np.atleast_1d(a.low >= 0.0), np.atleast_1d(a.high < 0.0)
    maybe = either(a.maybe, part if part.any() else None)
    never = either(a.never, none if none.any() else None)
    return Interval(np.maximum(_below(low), 0.0), _above(high), maybe, never, a.jump)


def absolute(a: Interval) -> Interval:
    """Return |a|."""
    low = np.maximum(np.maximum(a.low, -a.high), 0.0)
    return Interval(low, np.maximum(-a.low, a.high), *a[2:])


def _wave(a: Interval, function: Callable[[Bound], Bound], peak: float) -> Interval:
    """Return the sine or the cosine, whose greatest value is at `peak` and 2 pi apart."""
    ends = [function(x) for x in a[:2]]
    least = np.minimum(*ends)
    most = np.maximum(*ends)
    slack = _NEAR * (1.0 + np.abs(a.low) + np.abs(a.high))

    def reached(at: float) -> Bound:
        first = np.floor((a.low - at - slack) / (2.0 * np.pi))
        return first < np.floor((a.high - at + slack) / (2.0 * np.pi))

    wide = ~(a.high - a.low < 6.0)
    low = np.where(wide | reached(peak + np.pi), -1.0, _well_below(least, _LIBM))
    high = np.where(wide | reached(peak), 1.0, _well_above(most, _LIBM))
    return Interval(np.maximum(low, -1.0), np.minimum(high, 1.0), *a[2:])


def exponential(a: Interval) -> Interval:
    """Return exp(a)."""
    low, high = _well_below(np.exp(a.low), _LIBM), _well_above(np.exp(a.high), _LIBM)
    return Interval(np.maximum(low, 0.0), high, *a[2:])


def angle(y: Interval, x: Interval) -> Interval:
    """Return atan2(y, x): in (-pi, pi], with a jump where x is negative and y crosses zero."""
    # A corner at y = -0.0 would count from below.
    angles = [np.arctan2(s + 0.0, c) for s in y[:2] for c in x[:2]]
    crossed = np.atleast_1d((x.low <= 0.0) & (y.low < 0.0) & (y.high >= 0.0))
    around = np.atleast_1d((x.low <= 0.0) & (x.high >= 0.0) & (y.low <= 0.0) & (y.high >= 0.0))
    whole, most = crossed | around, float(np.nextafter(np.pi, 4.0))
    low = np.where(whole, -most, _well_below(_least(angles), _LIBM))
    high = np.where(whole, most, _well_above(_most(angles), _LIBM))
    maybe, never, jump = _marks(y, x)
    return Interval(low, high, maybe, never, either(jump, whole if whole.any() else None))


def _stepwise(function: Callable[[Bound], Bound], a: Interval) -> Interval:
    """Return a function that grows in steps, such as floor or sign, which jumps between them."""
    low, high = function(a.low), function(a.high)
    return Interval(low, high, a.maybe, a.never, either(a.jump, _where(low != high)))


def minimum(a: Interval, b: Interval) -> Interval:
    """Return the lesser."""
    return Interval(np.minimum(a.low, b.low), np.minimum(a.high, b.high), *_marks(a, b))


def maximum(a: Interval, b: Interval) -> Interval:
    """Return the greater."""
    return Interval(np.maximum(a.low, b.low), np.maximum(a.high, b.high), *_marks(a, b))


def _where(mask: Any) -> Mask:
    mask = np.atleast_1d(mask)
    return mask if mask.any() else None


def _truth(surely: Any, surely_not: Any, *given: Interval) -> Interval:
    """Return 1 where a test surely holds, 0 where it surely does not, and between them else."""
    low, high = np.where(surely, 1.0, 0.0), np.where(surely_not, 0.0, 1.0)
    maybe, never, jump = _marks(*given)
    return Interval(low, high, maybe, never, either(jump, _where(low != high)))


def less(a: Interval, b: Interval) -> Interval:
    """Return whether a < b."""
    return _truth(a.high < b.low, a.low >= b.high, a, b)


def less_equal(a: Interval, b: Interval) -> Interval:
    """Return whether a <= b."""
    return _truth(a.high <= b.low, a.low > b.high, a, b)


def equal(a: Interval, b: Interval) -> Interval:
    """Return whether a = b."""
    same = np.logical_and(np.equal(a.low, b.high), np.equal(a.high, b.low))
    return _truth(same, (a.high < b.low) | (a.low > b.high), a, b)


def inverted(a: Interval) -> Interval:
    """Return whether a is zero, of a test."""
    return _truth((a.low == 0.0) & (a.high == 0.0), (a.low > 0.0) | (a.high < 0.0), a)


def holds(a: Interval) -> Interval:
    """Return whether a is not zero, of a test."""
    return inverted(inverted(a))


def select(test: Interval, value: Interval) -> Interval:
    """Return the value where the test holds, else 0."""
    truth = holds(test)
    on, off = np.atleast_1d(truth.low > 0.0), np.atleast_1d(truth.high < 1.0)
    # Where the value is defined nowhere, 0 is all that may be.
    zero = off if value.never is None else off | (value.never & ~on)
    low = np.where(on, value.low, np.where(zero, 0.0, np.minimum(value.low, 0.0)))
    high = np.where(on, value.high, np.where(zero, 0.0, np.maximum(value.high, 0.0)))
    unsure = ~on & ~off
    maybe = None if value.maybe is None else value.maybe & ~off
    never = None if value.never is None else value.never & on
    jump = None if value.jump is None else value.jump & ~off
    return Interval(
        low,
        high,
        either(test.maybe, maybe),
        either(test.never, never),
        either(either(test.jump, jump), _where(unsure)),
    )


RULES: dict[str, Callable[..., Interval]] = {
    "add": add,
    "sub": subtract,
    "mul": multiply,
    "div": divide,
    "neg": negate,
    "sqrt": root,
    "sin": lambda a: _wave(a, np.sin, 0.5 * np.pi),
    "cos": lambda a: _wave(a, np.cos, 0.0),
    "exp": exponential,
    "atan2": angle,
    "fabs": absolute,
    "floor": partial(_stepwise, np.floor),
    "sign": partial(_stepwise, np.sign),
    "fmin": minimum,
    "fmax": maximum,
    "less": less,
    "less_equal": less_equal,
    "equal": equal,
    "unequal": lambda a, b: inverted(equal(a, b)),
    "not": inverted,
    "and": lambda a, b: minimum(holds(a), holds(b)),
    "or": lambda a, b: maximum(holds(a), holds(b)),
    "select": select,
}
"""The rule of each operation of a graph; a product of equal factors is a `square`."""
