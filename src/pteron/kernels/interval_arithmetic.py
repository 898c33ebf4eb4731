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
"""A flag for each box; None if all are False."""

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


def constant(number: float) -> Interval:
    """Return a number as an interval [number, number]; NaN as one that is never defined."""
    if np.isnan(number):
        return Interval(-np.inf, np.inf, *(np.ones(1, bool) for _ in range(3)))
    return Interval(number, number)


def either(a: Mask, b: Mask) -> Mask:
    """Return the union of two masks of boxes; None is an empty mask."""
    return b if a is None else a if b is None else a | b


def _marks(*intervals: Interval) -> tuple[Mask, Mask, Mask]:
    """Return the unions of intervals' masks: maybe undefined, never defined, with a jump."""
    maybe, never, jump = intervals[0][2:]
    for other in intervals[1:]:
        maybe, never = either(maybe, other.maybe), either(never, other.never)
        jump = either(jump, other.jump)
    return maybe, never, jump


def _round_down(x: Bound) -> Bound:
    """Return x lowered by a relative ulp: a lower bound of the exact value."""
    return x - np.abs(x) * _ULP


def _round_up(x: Bound) -> Bound:
    """Return x raised by a relative ulp: an upper bound of the exact value."""
    return x + np.abs(x) * _ULP


def _lower_bound(x: Bound, share: float = _ULP) -> Bound:
    """Return a lower bound of a value known with a relative error `share`, or underflow."""
    return x - (np.abs(x) * share + _UNDERFLOW)


def _upper_bound(x: Bound, share: float = _ULP) -> Bound:
    """Return an upper bound of a value known with a relative error `share`, or underflow."""
    return x + (np.abs(x) * share + _UNDERFLOW)


def add(a: Interval, b: Interval) -> Interval:
    """Return the interval of a + b, rounded outwards."""
    return Interval(_round_down(a.low + b.low), _round_up(a.high + b.high), *_marks(a, b))


def subtract(a: Interval, b: Interval) -> Interval:
    """Return the interval of a - b, rounded outwards."""
    return Interval(_round_down(a.low - b.high), _round_up(a.high - b.low), *_marks(a, b))


def negate(a: Interval) -> Interval:
    """Return the interval of -a."""
    return Interval(-a.high, -a.low, *a[2:])


def multiply(a: Interval, b: Interval) -> Interval:
    """Return the interval of the product a b, rounded outwards."""
    if isinstance(a.low, float) and a.low == a.high:
        a, b = b, a
    if isinstance(b.low, float) and b.low == b.high:
        ends = (a.low, a.high) if b.low >= 0.0 else (a.high, a.low)
        least, most = (_finite_product(end, b.low) for end in ends)
    else:
        products = [x * y for x in a[:2] for y in b[:2]]
        least, most = _least_of(products), _greatest_of(products)
        if np.isnan(np.sum(least)):  # as each is where one of the products is
            products = [_finite_product(x, y) for x in a[:2] for y in b[:2]]
            least, most = _least_of(products), _greatest_of(products)
    return Interval(_lower_bound(least), _upper_bound(most), *_marks(a, b))


def _finite_product(x: Bound, y: Bound) -> Bound:
    """Return the product x y of bounds, where zero times infinity is zero."""
    product = x * y
    return np.where((x == 0.0) | (y == 0.0), 0.0, product) if np.isnan(np.sum(product)) else product


def _least_of(bounds: list[Bound]) -> Bound:
    """Return the least of four bounds, element by element."""
    return np.minimum(np.minimum(bounds[0], bounds[1]), np.minimum(bounds[2], bounds[3]))


def _greatest_of(bounds: list[Bound]) -> Bound:
    """Return the greatest of four bounds, element by element."""
    return np.maximum(np.maximum(bounds[0], bounds[1]), np.maximum(bounds[2], bounds[3]))


def square(a: Interval) -> Interval:
    """Return the interval of the square of a, rounded outwards and not negative."""
    size = absolute(a)
    low = np.maximum(_lower_bound(size.low * size.low), 0.0)
    return Interval(low, _upper_bound(size.high * size.high), *a[2:])


def divide(a: Interval, b: Interval) -> Interval:
    """Return the interval of a / b where b is not zero, rounded outwards."""
    zero = np.logical_not((b.low > 0.0) | (b.high < 0.0))
    if not np.any(zero):
        quotients = [x / y for x in a[:2] for y in b[:2]]
        least, most = _least_of(quotients), _greatest_of(quotients)
        return Interval(_lower_bound(least), _upper_bound(most), *_marks(a, b))
    # 1 / b is all of one side where b is zero at an end alone; else it may be anything.
    low = np.where(zero & (b.low < 0.0), -np.inf, 1.0 / np.where(b.high == 0.0, np.nan, b.high))
    high = np.where(zero & (b.high > 0.0), np.inf, 1.0 / np.where(b.low == 0.0, np.nan, b.low))
    inverse = Interval(_lower_bound(low), _upper_bound(high))
    maybe, never, jump = _marks(a, b)
    nowhere = (b.low == 0.0) & (b.high == 0.0)
    low, high, *_ = multiply(Interval(a.low, a.high), inverse)
    part, none = np.atleast_1d(zero), np.atleast_1d(nowhere)
    return Interval(low, high, either(maybe, part), either(never, none), either(jump, part))


def root(a: Interval) -> Interval:
    """Return the interval of the square root of a where a >= 0, rounded outwards."""
    low = np.sqrt(np.maximum(a.low, 0.0))
    high = np.sqrt(np.maximum(a.high, 0.0))
    # Of a bound that is NaN nothing is known.
    part, none = ~np.atleast_1d(a.low >= 0.0), np.atleast_1d(a.high < 0.0)
    maybe = either(a.maybe, part if part.any() else None)
    never = either(a.never, none if none.any() else None)
    return Interval(np.maximum(_round_down(low), 0.0), _round_up(high), maybe, never, a.jump)


def absolute(a: Interval) -> Interval:
    """Return the interval of |a|."""
    low = np.maximum(np.maximum(a.low, -a.high), 0.0)
    return Interval(low, np.maximum(-a.low, a.high), *a[2:])


def _wave(a: Interval, function: Callable[[Bound], Bound], peak: float) -> Interval:
    """Return the interval of a sine or cosine, whose maximum is at `peak`."""
    ends = [function(x) for x in a[:2]]
    least = np.minimum(*ends)
    most = np.maximum(*ends)
    slack = _NEAR * (1.0 + np.abs(a.low) + np.abs(a.high))

    def contains_extreme(at: float) -> Bound:
        """Return whether the intervals may contain a point at `at` plus a multiple of 2 pi."""
        first = np.floor((a.low - at - slack) / (2.0 * np.pi))
        return first < np.floor((a.high - at + slack) / (2.0 * np.pi))

    wide = ~(a.high - a.low < 6.0)
    low = np.where(wide | contains_extreme(peak + np.pi), -1.0, _lower_bound(least, _LIBM))
    high = np.where(wide | contains_extreme(peak), 1.0, _upper_bound(most, _LIBM))
    return Interval(np.maximum(low, -1.0), np.minimum(high, 1.0), *a[2:])


def exponential(a: Interval) -> Interval:
    """Return the interval of exp(a), rounded outwards."""
    low, high = _lower_bound(np.exp(a.low), _LIBM), _upper_bound(np.exp(a.high), _LIBM)
    return Interval(np.maximum(low, 0.0), high, *a[2:])


def angle(y: Interval, x: Interval) -> Interval:
    """Return the interval of atan2(y, x) in (-pi, pi], with its jump at y = 0, x < 0."""
    # A corner at y = -0.0 would count from below.
    angles = [np.arctan2(s + 0.0, c) for s in y[:2] for c in x[:2]]
    crossed = np.atleast_1d((x.low <= 0.0) & (y.low < 0.0) & (y.high >= 0.0))
    around = np.atleast_1d((x.low <= 0.0) & (x.high >= 0.0) & (y.low <= 0.0) & (y.high >= 0.0))
    full_range, most = crossed | around, float(np.nextafter(np.pi, 4.0))
    low = np.where(full_range, -most, _lower_bound(_least_of(angles), _LIBM))
    high = np.where(full_range, most, _upper_bound(_greatest_of(angles), _LIBM))
    maybe, never, jump = _marks(y, x)
    return Interval(low, high, maybe, never, either(jump, full_range if full_range.any() else None))


def _stepwise(function: Callable[[Bound], Bound], a: Interval) -> Interval:
    """Return the interval of a step function (floor, sign) of a, with its jumps."""
    low, high = function(a.low), function(a.high)
    return Interval(low, high, a.maybe, a.never, either(a.jump, _mask_or_none(low != high)))


def minimum(a: Interval, b: Interval) -> Interval:
    """Return the interval of the lesser of a and b."""
    return Interval(np.minimum(a.low, b.low), np.minimum(a.high, b.high), *_marks(a, b))


def maximum(a: Interval, b: Interval) -> Interval:
    """Return the interval of the greater of a and b."""
    return Interval(np.maximum(a.low, b.low), np.maximum(a.high, b.high), *_marks(a, b))


def _mask_or_none(mask: Any) -> Mask:
    """Return a mask of boxes as an array (K,); None if it marks none."""
    mask = np.atleast_1d(mask)
    return mask if mask.any() else None


def _truth(certain: Any, impossible: Any, *intervals: Interval) -> Interval:
    """Return 1 where a test is certain, 0 where it is impossible, else [0, 1]."""
    low, high = np.where(certain, 1.0, 0.0), np.where(impossible, 0.0, 1.0)
    maybe, never, jump = _marks(*intervals)
    return Interval(low, high, maybe, never, either(jump, _mask_or_none(low != high)))


def is_less(a: Interval, b: Interval) -> Interval:
    """Return a < b as an interval: 1 surely true, 0 surely false, else [0, 1]."""
    return _truth(a.high < b.low, a.low >= b.high, a, b)


def is_less_equal(a: Interval, b: Interval) -> Interval:
    """Return a <= b as an interval: 1 surely true, 0 surely false, else [0, 1]."""
    return _truth(a.high <= b.low, a.low > b.high, a, b)


def is_equal(a: Interval, b: Interval) -> Interval:
    """Return a = b as an interval: 1 surely true, 0 surely false, else [0, 1]."""
    same = np.logical_and(np.equal(a.low, b.high), np.equal(a.high, b.low))
    return _truth(same, (a.high < b.low) | (a.low > b.high), a, b)


def is_zero(a: Interval) -> Interval:
    """Return a = 0 as an interval: 1 surely true, 0 surely false, else [0, 1]."""
    return _truth((a.low == 0.0) & (a.high == 0.0), (a.low > 0.0) | (a.high < 0.0), a)


def is_nonzero(a: Interval) -> Interval:
    """Return a != 0 as an interval: 1 surely true, 0 surely false, else [0, 1]."""
    return is_zero(is_zero(a))


def select(test: Interval, chosen: Interval) -> Interval:
    """Return the interval of `chosen` where `test` is nonzero, else 0."""
    truth = is_nonzero(test)
    on, off = np.atleast_1d(truth.low > 0.0), np.atleast_1d(truth.high < 1.0)
    # Where the value is defined nowhere, 0 is all that may be.
    zero = off if chosen.never is None else off | (chosen.never & ~on)
    low = np.where(on, chosen.low, np.where(zero, 0.0, np.minimum(chosen.low, 0.0)))
    high = np.where(on, chosen.high, np.where(zero, 0.0, np.maximum(chosen.high, 0.0)))
    unsure = ~on & ~off
    maybe = None if chosen.maybe is None else chosen.maybe & ~off
    never = None if chosen.never is None else chosen.never & on
    jump = None if chosen.jump is None else chosen.jump & ~off
    return Interval(
        low,
        high,
        either(test.maybe, maybe),
        either(test.never, never),
        either(either(test.jump, jump), _mask_or_none(unsure)),
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
    "less": is_less,
    "less_equal": is_less_equal,
    "equal": is_equal,
    "unequal": lambda a, b: is_zero(is_equal(a, b)),
    "not": is_zero,
    "and": lambda a, b: minimum(is_nonzero(a), is_nonzero(b)),
    "or": lambda a, b: maximum(is_nonzero(a), is_nonzero(b)),
    "select": select,
}
"""The rule of each operation of a graph; a product of equal factors is a `square`."""
