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
2005, chapter 7). `advance_path` makes a step along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression


class Closed(NamedTuple):
    """A kind of closures: the numbers of spheres and planes, and whether P moves."""

    spheres: int
    planes: int
    moves: bool
    """Whether P moves; else it is the origin."""

    paired: bool = False
    """Whether the platform points coincide in pairs, the first with the second, and so on."""

    @property
    def equations(self) -> int:
        """The number of closure equations."""
        return self.spheres + self.planes

    @property
    def numbers(self) -> int:
        """The number of numbers that describe a machine: seven for each equation."""
        return 7 * self.equations

    @property
    def size(self) -> int:
        """The number of coordinates of a lifted pose z: 8 if P moves, else 4."""
        return 8 if self.moves else 4

    @property
    def path_state_size(self) -> int:
        """The length of the vector of a `PathState`: four complex z and three numbers."""
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
        """Return the product of this complex number and a real factor."""
        return Number(factor * self.re, factor * self.im)

    def inverse(self) -> Number:
        """Return the reciprocal of this complex number."""
        square = self.re * self.re + self.im * self.im
        return Number(self.re / square, -self.im / square)


Quaternion = Sequence[Number]
"""Four numbers, the scalar first; a vector is the three others."""


def numbers(re: Expression, im: Expression | None = None) -> list[Number]:
    """Return complex numbers from vectors (k, 1) of real and imaginary parts."""
    imaginary = ca.SX(re.shape[0], 1) if im is None else im
    return [Number(*pair) for pair in zip(ca.vertsplit(re), ca.vertsplit(imaginary), strict=True)]


_FIRST = 0.02
"""Tolerance of Newton's first step, relative to |z|: the prediction is accepted."""

_SECOND = 4e-4
"""Tolerance of Newton's second step, whose square is about the remaining error."""

_AIM = 0.004
"""Newton's first step at which the path's step length stays: the error is of fourth order in it."""

_SHORTER, _LONGER = 0.3, 2.5
"""Least and greatest factor from one step of the path to the next."""


class PathState(NamedTuple):
    """State of a path tracker: pose z, |z| = 1, dz/dt, and the previous pose."""

    z: list[Number]
    rate: list[Number]
    before: list[Number]
    rate_before: list[Number]
    interval: Expression
    """t since the previous pose."""
    t: Expression
    step: Expression
    """The most that t may grow by."""

    @classmethod
    def from_vector(cls, vector: Expression, closed: Closed) -> PathState:
        """Return the path state from its vector: real, then imaginary parts of each component."""
        d = closed.size
        parts = [
            numbers(vector[2 * d * k : 2 * d * k + d], vector[2 * d * k + d : 2 * d * (k + 1)])
            for k in range(4)
        ]
        return cls(*parts, *ca.vertsplit(vector[8 * d :]))

    def vector(self) -> Expression:
        """Return the path state as one vector (K, 1), inverse of `from_vector`."""
        parts = [
            part
            for component_numbers in self[:4]
            for part in ([v.re for v in component_numbers], [v.im for v in component_numbers])
        ]
        return ca.vertcat(*(component for part in parts for component in part), *self[4:])


def advance_path(
    closed: Closed, start: Sequence[Number], target: Sequence[Number], at: PathState
) -> tuple[PathState, Expression]:
    """Return a path's state after a predictor-corrector step, and the last correction's size.

    `start` and `target` are the machines at t = 0 and 1: for each equation a or n, b and r^2 or h,
    seven numbers. If the cubic through the last two poses and their rates predicts too badly, the
    step is rejected: the state is unchanged except for a shorter step.
    """
    slope = [there - here for here, there in zip(start, target, strict=True)]
    t = ca.if_else(at.step < 1 - at.t, at.t + at.step, 1)
    interval = t - at.t
    now = [here + rate.times(t) for here, rate in zip(start, slope, strict=True)]
    patch = [Number(v.re, -v.im) for v in at.z]
    guess = _predict_pose(at, patch, interval)
    first, _ = _newton(closed, now, None, guess, patch)
    corrected = [a + b for a, b in zip(guess, first, strict=True)]
    second, rate = _newton(closed, now, slope, corrected, patch)
    size = ca.sqrt(_square(corrected))
    prediction_error, correction = ca.sqrt(_square(first)) / size, ca.sqrt(_square(second)) / size
    # Products of truths: gcc vectorises no loop in which `and` joins them, six times as slow.
    is_accepted = (prediction_error < _FIRST) * (correction < _SECOND)
    pose = [(a + b).times(1 / size) for a, b in zip(corrected, second, strict=True)]
    scale = 1 / ca.sqrt(_square(pose))
    pose = [v.times(scale) for v in pose]
    rate = [v.times(scale / size) for v in rate]
    rate_along_pose = _dot([Number(v.re, -v.im) for v in pose], rate)
    rate = [v - rate_along_pose * u for v, u in zip(rate, pose, strict=True)]
    factor = 0.9 * ca.sqrt(ca.sqrt(_AIM / (prediction_error + 1e-12)))
    factor = ca.fmin(ca.fmax(factor, _SHORTER), ca.if_else(is_accepted, _LONGER, 0.5))
    factor = ca.if_else(prediction_error < 1e6, factor, _SHORTER)
    after = PathState(
        _select(is_accepted, pose, at.z),
        _select(is_accepted, rate, at.rate),
        _select(is_accepted, at.z, at.before),
        _select(is_accepted, at.rate, at.rate_before),
        ca.if_else(is_accepted * (interval > 0), interval, at.interval),
        ca.if_else(is_accepted, t, at.t),
        ca.if_else(interval > 0, interval, at.step) * factor,
    )
    return after, correction


def _predict_pose(at: PathState, patch: Sequence[Number], interval: Expression) -> list[Number]:
    """Return the pose that a cubic through the last two poses and rates predicts."""
    scale = _dot(patch, at.before).inverse()
    previous = [v * scale for v in at.before]
    rates = [v * scale for v in at.rate_before]
    rate_along_patch = _dot(patch, rates)
    inverse_interval = 1 / at.interval
    guess = []
    for z, v, p, rate in zip(at.z, at.rate, previous, rates, strict=True):
        chord = ((p - z).times(inverse_interval) + v).times(inverse_interval)
        bend = (rate - rate_along_patch * p - v).times(inverse_interval)
        third = (bend + chord.times(2)).times(inverse_interval)
        second = chord + third.times(at.interval)
        guess.append(z + (v + (second + third.times(interval)).times(interval)).times(interval))
    return guess


def _select(
    is_accepted: Expression, accepted: list[Number], rejected: list[Number]
) -> list[Number]:
    """Return the numbers of `accepted` if the step is accepted, else those of `rejected`."""
    return [
        Number(ca.if_else(is_accepted, a.re, b.re), ca.if_else(is_accepted, a.im, b.im))
        for a, b in zip(accepted, rejected, strict=True)
    ]


def _square(v: Sequence[Number]) -> Expression:
    """Return the squared norm of a complex vector."""
    total = ca.SX(0)
    for part in v:
        total = total + part.re * part.re + part.im * part.im
    return total


def rows(
    closed: Closed, machine: Sequence[Number], z: Sequence[Number]
) -> tuple[Expression, Expression]:
    """Return the closure equations' Jacobian (k, size) and residuals (k, 1) at a real z.

    If P moves, x.y = 0 is the first closure equation.
    """
    closures = _closures(closed, machine, None, z)
    slopes = ca.vertcat(*(ca.horzcat(*(v.re for v in row[:-1])) for row in closures))
    return slopes, -ca.vertcat(*(row[-1].re for row in closures))


def _newton(
    closed: Closed,
    now: Sequence[Number],
    slope: Sequence[Number] | None,
    z: Sequence[Number],
    patch: Sequence[Number],
) -> tuple[list[Number], list[Number]]:
    """Return Newton's step (size,) and, if the machine's slope is given, dz/dt."""
    unit, none = Number(ca.SX(1), ca.SX(0)), Number(ca.SX(0), ca.SX(0))
    system = [[*patch, unit - _dot(patch, z), *([none] if slope else [])]]
    solutions = _solve_by_elimination(system + _closures(closed, now, slope, z), closed.size)
    return solutions[0], solutions[1] if slope else []


def _closures(
    closed: Closed,
    now: Sequence[Number],
    slope: Sequence[Number] | None,
    z: Sequence[Number],
) -> list[list[Number]]:
    """Return a row for each closure equation: its derivatives by z, negated value, d/dt."""
    x, y = z[:4], z[4:]
    square, none = _dot(x, x), Number(ca.SX(0), ca.SX(0))
    closures = []
    if closed.moves:
        closures.append([*y, *x, none - _dot(x, y), *([none] if slope else [])])
    for k in range(closed.equations):
        a, b, r = now[7 * k : 7 * k + 3], now[7 * k + 3 : 7 * k + 6], now[7 * k + 6]
        arm = _times_vector(x, b)
        if y:
            arm = _plus(arm, [v.times(2) for v in y])
        a_x = _vector_times(a, x)
        sphere = k < closed.spheres
        if sphere:
            e = _minus(arm, a_x)
            by_x = _minus(_minus(_vector_times(a, e), _times_vector(e, b)), [r * v for v in x])
            by_y = [v.times(2) for v in e]
            miss = (_dot(e, e) - r * square).times(0.5)
        else:
            back = _plus(_vector_times(a, arm), _times_vector(a_x, b))
            by_x = [v.times(-1) - (r * u).times(2) for v, u in zip(back, x, strict=True)]
            by_y = [v.times(2) for v in a_x]
            miss = _dot(a_x, arm) - r * square
        row = [*by_x, *(by_y if y else []), none - miss]
        if slope:
            da, db, dr = slope[7 * k : 7 * k + 3], slope[7 * k + 3 : 7 * k + 6], slope[7 * k + 6]
            if sphere:
                de = _minus(_times_vector(x, db), _vector_times(da, x))
                row.append((dr * square).times(0.5) - _dot(e, de))
            else:
                rate = _dot(_vector_times(da, x), arm) + _dot(a_x, _times_vector(x, db))
                row.append(dr * square - rate)
        closures.append(row)
    return closures


def _solve_by_elimination(rows: list[list[Number]], size: int) -> list[list[Number]]:
    """Return the solution of a linear system for each right-hand column, without pivoting.

    The frames are rotated at random, so that no pivot vanishes.
    """
    rows = [list(row) for row in rows]
    inverses = []
    for k in range(size):
        inverses.append(rows[k][k].inverse())
        for row in rows[k + 1 :]:
            factor = row[k] * inverses[k]
            for j in range(k + 1, len(row)):
                row[j] = row[j] - factor * rows[k][j]
    solutions = []
    for column in range(size, len(rows[0])):
        solution: list[Number] = []
        for k in reversed(range(size)):
            remainder = rows[k][column]
            for j, known in zip(range(size - 1, k, -1), solution, strict=True):
                remainder = remainder - rows[k][j] * known
            solution.append(remainder * inverses[k])
        solutions.append(solution[::-1])
    return solutions


def _plus(p: Quaternion, q: Quaternion) -> list[Number]:
    """Return the sum of two quaternions or vectors of complex numbers."""
    return [a + b for a, b in zip(p, q, strict=True)]


def _minus(p: Quaternion, q: Quaternion) -> list[Number]:
    """Return the difference of two quaternions or vectors of complex numbers."""
    return [a - b for a, b in zip(p, q, strict=True)]


def _dot(u: Sequence[Number], v: Sequence[Number]) -> Number:
    """Return the sum of products of two complex vectors, without conjugation."""
    first, *products = (a * b for a, b in zip(u, v, strict=True))
    for term in products:
        first = first + term
    return first


def _vector_times(v: Sequence[Number], x: Quaternion) -> list[Number]:
    """Return the quaternion product v x of a vector v (3) and a quaternion x (4)."""
    (a, b, c), (w, i, j, k) = v, x
    return [
        (a * i + b * j + c * k).times(-1),
        a * w + b * k - c * j,
        b * w + c * i - a * k,
        c * w + a * j - b * i,
    ]


def _times_vector(x: Quaternion, v: Sequence[Number]) -> list[Number]:
    """Return the quaternion product x v of a quaternion x (4) and a vector v (3)."""
    (a, b, c), (w, i, j, k) = v, x
    return [
        (a * i + b * j + c * k).times(-1),
        a * w - b * k + c * j,
        b * w - c * i + a * k,
        c * w - a * j + b * i,
    ]
