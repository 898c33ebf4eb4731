"""Homotopy continuation of poses: closures in Study's coordinates along a path of machines.

A pose is z = (x, y), up to scale: the platform's rotation is the quaternion x, and its point P is
the vector part of 2 y x* / (x.x); the products below are those of quaternions, x.y = 0. A closure
holds a platform point b on a sphere about a with radius r, or on a plane n.c = h. Its residual,
times x.x, is

    e.e - r^2 x.x,  e = 2 y + x b - a x,    or    (n x).(2 y + x b) - h x.x.

So all closures are quadrics. Six spheres meet in 40 poses, in 16 where their platform points
coincide in pairs, three about a point P that stays, y = 0, in 8, and three spheres and three planes
of the same three points in 16, complex poses among them, for all machines but special ones. Along a
straight path between two machines, from one in general complex numbers whose poses are known, poses
neither meet nor vanish (Sommese and Wampler, The numerical solution of systems of polynomials,
2005, chapter 7). `stepped` makes a step along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression


class Closed(NamedTuple):
    """A kind of closures: how many spheres and planes, and whether P moves."""

    spheres: int
    planes: int
    moves: bool
    """Whether P moves; else it is the origin."""

    paired: bool = False
    """Whether the platform points coincide in pairs, the first with the second, and so on."""

    @property
    def equations(self) -> int:
        """The number of equations."""
        return self.spheres + self.planes

    @property
    def numbers(self) -> int:
        """The number of numbers of a machine: a or n, b, and r^2 or h, for each equation."""
        return 7 * self.equations

    @property
    def size(self) -> int:
        """The number of coordinates of z."""
        return 8 if self.moves else 4

    @property
    def on_path(self) -> int:
        """The length of the vector of an `OnPath`: four complex z and three numbers."""
        return 8 * self.size + 3


class Number(NamedTuple):
    """A complex number."""

    re: Expression
    im: Expression

    def __add__(self, other: Number) -> Number:  # type: ignore[override]
        return Number(self.re + other.re, self.im + other.im)

    def __sub__(self, other: Number) -> Number:
        return Number(self.re - other.re, self.im - other.im)

    def __mul__(self, other: Number) -> Number:  # type: ignore[override]
        return Number(
            self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re
        )

    def times(self, factor: Expression | float) -> Number:
        """Return its product with a real number."""
        return Number(factor * self.re, factor * self.im)

    def inverse(self) -> Number:
        """Return 1 over it."""
        square = self.re * self.re + self.im * self.im
        return Number(self.re / square, -self.im / square)


Quaternion = Sequence[Number]
"""Four numbers, the scalar first; a vector is the three others."""


def numbers(re: Expression, im: Expression | None = None) -> list[Number]:
    """Return the complex numbers of vectors (k, 1)."""
    imaginary = ca.SX(re.shape[0], 1) if im is None else im
    return [Number(*pair) for pair in zip(ca.vertsplit(re), ca.vertsplit(imaginary), strict=True)]


_FIRST = 0.02
"""Greatest first step of Newton's, as a share of |z|, of a guess that is near enough."""

_SECOND = 4e-4
"""Greatest second one: what it leaves is its square or so."""

_AIM = 0.004
"""The first step at which the path's next step is not made longer: its fourth power counts."""

_SHORTER, _LONGER = 0.3, 2.5
"""Least and greatest factor from one step of the path to the next."""


class OnPath(NamedTuple):
    """Where a path is: its pose z, |z| = 1, with dz/dt, and the pose before."""

    z: list[Number]
    rate: list[Number]
    before: list[Number]
    rate_before: list[Number]
    gone: Expression
    """t from the pose before."""
    t: Expression
    step: Expression
    """The most that t may grow by."""

    @classmethod
    def of(cls, values: Expression, closed: Closed) -> OnPath:
        """Return what a vector holds: real and imaginary parts of each in turn."""
        d = closed.size
        parts = [
            numbers(values[2 * d * k : 2 * d * k + d], values[2 * d * k + d : 2 * d * (k + 1)])
            for k in range(4)
        ]
        return cls(*parts, *ca.vertsplit(values[8 * d :]))

    def vector(self) -> Expression:
        """Return it as one vector."""
        parts = [part for of in self[:4] for part in ([v.re for v in of], [v.im for v in of])]
        return ca.vertcat(*(value for part in parts for value in part), *self[4:])


def stepped(
    closed: Closed, start: Sequence[Number], target: Sequence[Number], at: OnPath
) -> tuple[OnPath, Expression]:
    """Return where a path is after a step, and the last of Newton's steps onto it.

    `start` and `target` are the machines at t = 0 and 1: for each equation a or n, b and r^2 or h,
    seven numbers. Where the cubic through the last two poses and their rates leads too far astray
    the path stays where it is, to take a shorter step.
    """
    slope = [there - here for here, there in zip(start, target, strict=True)]
    t = ca.if_else(at.step < 1 - at.t, at.t + at.step, 1)
    gone = t - at.t
    now = [here + rate.times(t) for here, rate in zip(start, slope, strict=True)]
    patch = [Number(v.re, -v.im) for v in at.z]
    guess = _guessed(at, patch, gone)
    first, _ = _newton(closed, now, None, guess, patch)
    better = [a + b for a, b in zip(guess, first, strict=True)]
    second, rate = _newton(closed, now, slope, better, patch)
    size = ca.sqrt(_square(better))
    astray, left = ca.sqrt(_square(first)) / size, ca.sqrt(_square(second)) / size
    # Products of truths: gcc vectorises no loop in which `and` joins them, six times as slow.
    good = (astray < _FIRST) * (left < _SECOND)
    found = [(a + b).times(1 / size) for a, b in zip(better, second, strict=True)]
    scale = 1 / ca.sqrt(_square(found))
    found = [v.times(scale) for v in found]
    rate = [v.times(scale / size) for v in rate]
    along = _dot([Number(v.re, -v.im) for v in found], rate)
    rate = [v - along * u for v, u in zip(rate, found, strict=True)]
    factor = 0.9 * ca.sqrt(ca.sqrt(_AIM / (astray + 1e-12)))
    factor = ca.fmin(ca.fmax(factor, _SHORTER), ca.if_else(good, _LONGER, 0.5))
    factor = ca.if_else(astray < 1e6, factor, _SHORTER)
    after = OnPath(
        _chosen(good, found, at.z),
        _chosen(good, rate, at.rate),
        _chosen(good, at.z, at.before),
        _chosen(good, at.rate, at.rate_before),
        ca.if_else(good * (gone > 0), gone, at.gone),
        ca.if_else(good, t, at.t),
        ca.if_else(gone > 0, gone, at.step) * factor,
    )
    return after, left


def _guessed(at: OnPath, patch: Sequence[Number], gone: Expression) -> list[Number]:
    """Return the cubic through the last two poses and their rates, in the patch of the last."""
    scale = _dot(patch, at.before).inverse()
    before = [v * scale for v in at.before]
    rates = [v * scale for v in at.rate_before]
    along = _dot(patch, rates)
    back = 1 / at.gone
    guess = []
    for z, v, p, rate in zip(at.z, at.rate, before, rates, strict=True):
        chord = ((p - z).times(back) + v).times(back)
        bend = (rate - along * p - v).times(back)
        third = (bend + chord.times(2)).times(back)
        second = chord + third.times(at.gone)
        guess.append(z + (v + (second + third.times(gone)).times(gone)).times(gone))
    return guess


def _chosen(good: Expression, one: list[Number], other: list[Number]) -> list[Number]:
    return [
        Number(ca.if_else(good, a.re, b.re), ca.if_else(good, a.im, b.im))
        for a, b in zip(one, other, strict=True)
    ]


def _square(v: Sequence[Number]) -> Expression:
    total = ca.SX(0)
    for part in v:
        total = total + part.re * part.re + part.im * part.im
    return total


def rows(
    closed: Closed, machine: Sequence[Number], z: Sequence[Number]
) -> tuple[Expression, Expression]:
    """Return the closures' derivatives (k, size) by a real z, and what it misses them by (k, 1).

    x.y = 0 is the first of them where P moves.
    """
    found = _closures(closed, machine, None, z)
    slopes = ca.vertcat(*(ca.horzcat(*(v.re for v in row[:-1])) for row in found))
    return slopes, -ca.vertcat(*(row[-1].re for row in found))


def _newton(
    closed: Closed,
    now: Sequence[Number],
    slope: Sequence[Number] | None,
    z: Sequence[Number],
    patch: Sequence[Number],
) -> tuple[list[Number], list[Number]]:
    """Return Newton's step and, of a slope of the machine, dz/dt."""
    one, none = Number(ca.SX(1), ca.SX(0)), Number(ca.SX(0), ca.SX(0))
    found = [[*patch, one - _dot(patch, z), *([none] if slope else [])]]
    solved = _eliminated(found + _closures(closed, now, slope, z), closed.size)
    return solved[0], solved[1] if slope else []


def _closures(
    closed: Closed,
    now: Sequence[Number],
    slope: Sequence[Number] | None,
    z: Sequence[Number],
) -> list[list[Number]]:
    """Return a row for each closure: its derivatives by z, minus its value, minus that by t."""
    x, y = z[:4], z[4:]
    square, none = _dot(x, x), Number(ca.SX(0), ca.SX(0))
    found = []
    if closed.moves:
        found.append([*y, *x, none - _dot(x, y), *([none] if slope else [])])
    for k in range(closed.equations):
        a, b, r = now[7 * k : 7 * k + 3], now[7 * k + 3 : 7 * k + 6], now[7 * k + 6]
        arm = _by_vector(x, b)
        if y:
            arm = _plus(arm, [v.times(2) for v in y])
        turned = _vector_by(a, x)
        sphere = k < closed.spheres
        if sphere:
            e = _minus(arm, turned)
            along = _minus(_minus(_vector_by(a, e), _by_vector(e, b)), [r * v for v in x])
            across = [v.times(2) for v in e]
            miss = (_dot(e, e) - r * square).times(0.5)
        else:
            back = _plus(_vector_by(a, arm), _by_vector(turned, b))
            along = [v.times(-1) - (r * u).times(2) for v, u in zip(back, x, strict=True)]
            across = [v.times(2) for v in turned]
            miss = _dot(turned, arm) - r * square
        row = [*along, *(across if y else []), none - miss]
        if slope:
            da, db, dr = slope[7 * k : 7 * k + 3], slope[7 * k + 3 : 7 * k + 6], slope[7 * k + 6]
            if sphere:
                de = _minus(_by_vector(x, db), _vector_by(da, x))
                row.append((dr * square).times(0.5) - _dot(e, de))
            else:
                moved = _dot(_vector_by(da, x), arm) + _dot(turned, _by_vector(x, db))
                row.append(dr * square - moved)
        found.append(row)
    return found


def _eliminated(rows: list[list[Number]], size: int) -> list[list[Number]]:
    """Return the solutions, for each column beyond the first ones, by Gauss without a pivot.

    The frames are turned at random, so that none vanishes.
    """
    rows = [list(row) for row in rows]
    inverses = []
    for k in range(size):
        inverses.append(rows[k][k].inverse())
        for row in rows[k + 1 :]:
            factor = row[k] * inverses[k]
            for j in range(k + 1, len(row)):
                row[j] = row[j] - factor * rows[k][j]
    found = []
    for column in range(size, len(rows[0])):
        solution: list[Number] = []
        for k in reversed(range(size)):
            value = rows[k][column]
            for j, known in zip(range(size - 1, k, -1), solution, strict=True):
                value = value - rows[k][j] * known
            solution.append(value * inverses[k])
        found.append(solution[::-1])
    return found


def _plus(one: Quaternion, other: Quaternion) -> list[Number]:
    return [a + b for a, b in zip(one, other, strict=True)]


def _minus(one: Quaternion, other: Quaternion) -> list[Number]:
    return [a - b for a, b in zip(one, other, strict=True)]


def _dot(one: Sequence[Number], other: Sequence[Number]) -> Number:
    first, *more = (a * b for a, b in zip(one, other, strict=True))
    for term in more:
        first = first + term
    return first


def _vector_by(v: Sequence[Number], x: Quaternion) -> list[Number]:
    """Return v x."""
    (a, b, c), (w, i, j, k) = v, x
    return [
        (a * i + b * j + c * k).times(-1),
        a * w + b * k - c * j,
        b * w + c * i - a * k,
        c * w + a * j - b * i,
    ]


def _by_vector(x: Quaternion, v: Sequence[Number]) -> list[Number]:
    """Return x v."""
    (a, b, c), (w, i, j, k) = v, x
    return [
        (a * i + b * j + c * k).times(-1),
        a * w - b * k + c * j,
        b * w - c * i + a * k,
        c * w - a * j + b * i,
    ]
