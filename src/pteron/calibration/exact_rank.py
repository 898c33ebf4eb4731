"""The number of combinations of unknowns that a calibration's measurements can show, exactly.

It is the rank of the residuals' slopes at random poses, in integers modulo random primes.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.calibration.guess import Block, Guess, across
from pteron.calibration.variations import AXIAL, slope_terms
from pteron.kernels import NoSquareRoot, PrimeField, evaluate, general_program
from pteron.kernels.geometry_slopes import slope_columns, slopes_program
from pteron.kernels.programs import bare
from pteron.reduction.elimination import dependencies
from pteron.reduction.exact import primes_of
from pteron.reduction.exact_geometry import exact_geometry
from pteron.reduction.exact_regressor import is_square

Array = NDArray[np.float64]
Matrix = list[list[int]]

_SPARE = 4
"""Random rows of each kind beyond the number of columns."""

_PRIMES = 2
"""Primes modulo which the rank is found; the greater of the ranks counts."""

_ATTEMPTS = 20000
"""Random poses tried for one at which the square roots exist modulo the prime."""

_FINE = 10**6
"""Greatest denominator of the fractions that stand for numbers of marks, planes and anchors."""


class RowKind(NamedTuple):
    """The kind of a row: all but its pose that its slopes depend on."""

    positions: tuple[bool, ...]
    angles: tuple[bool, ...]
    height: bool
    distance: bool
    mark: str
    plane: str
    anchor: str | None
    origin: str
    """The mark of the row that its distance is from."""
    level: float | None = None
    """The height of all rows over the plane, where it is the same: m."""


def exact_rank(
    start: Guess, blocks: Sequence[Block], kinds: Sequence[RowKind], seed: int
) -> tuple[int | None, tuple[int, ...], int]:
    """Return rank, primes and number of rows; None for a rank where something has no exact form."""
    free = [c for block in blocks for c in block.changes]
    if any(change.group in AXIAL for change in free):
        return None, (), 0
    geometry = exact_geometry(start.robot)
    count = blocks[-1].where.stop
    rng = random.Random(seed)
    primes = primes_of(geometry, rng)
    best, used, rows = 0, [], 0
    for _ in range(_PRIMES):
        prime = next(primes)
        drawn = _Drawn(start, blocks, prime, rng)
        found: Matrix = []
        try:
            while len(found) < count + _SPARE * len(kinds):
                for kind in kinds:
                    found += drawn.rows(kind)
        except ZeroDivisionError:
            return None, (), 0
        kept, _ = dependencies(found, range(count), prime)
        best, rows = max(best, len(kept)), len(found)
        used.append(prime)
    return best, tuple(used), rows


class _State(NamedTuple):
    place: list[int]
    turned: Matrix
    twists: Matrix
    """(6, m)."""
    poses: Matrix
    """(m, p): slopes of the pose at given readings."""
    slopes: Matrix
    """(6, p): of the twist."""


class _Drawn:
    """Rows of slopes at random poses modulo a prime."""

    def __init__(
        self, start: Guess, blocks: Sequence[Block], prime: int, rng: random.Random
    ) -> None:
        self.start, self.blocks, self.prime, self.rng = start, blocks, prime, rng
        self.field = PrimeField(prime)
        robot = start.robot
        self.geometry = exact_geometry(robot)
        self.vector = self.geometry.within(self.field)
        self.layout = bare(robot)
        self.count = blocks[-1].where.stop
        self.deltas = general_program(self.layout, "discriminants").function
        whole = slopes_program(robot).function
        self.angular = [leg.joint.unit == "rad" for leg in robot.legs]
        symbols = whole.sx_in()
        outputs = whole.call(symbols)
        joints = [
            ca.SX(0) if round_ else q
            for q, round_ in zip(ca.horzsplit(outputs[0]), self.angular, strict=True)
        ]
        self.program = ca.Function("slopes", symbols, [ca.horzcat(*joints), *outputs[1:]])
        self.columns = slope_columns(self.layout)
        self.changes = next((b.changes for b in blocks if b.kind == "geometry"), ())
        self.steps = self._geometry_slopes()
        axes = self.geometry.axes
        self.frame = [[n.within(self.field) for n in axis] for axis in axes]

    def _geometry_slopes(self) -> list[dict[int, int]]:
        """Return d(geometry)/d(variation): for each variation its entries by number."""
        found: list[dict[int, int]] = [{} for _ in self.changes]
        for term in slope_terms(self.layout, self.changes):
            value = term.sign
            for factor in term.factors:
                value = value * self.vector[factor] % self.prime
            entries = found[term.variation]
            entries[term.row] = (entries.get(term.row, 0) + value) % self.prime
        return found

    def rows(self, kind: RowKind) -> Matrix:
        """Return the rows of a random pose."""
        robot, p = self.start.robot, self.prime
        state = self._state(kind)
        point, moved = self._mark(kind.mark, state)
        found: Matrix = []
        own = self.geometry.frame
        lengths = [name for name in robot.coordinates if name in "xyz"]
        base = np.eye(3) if len(lengths) in (0, 3) else np.array(robot.platform.frame)
        frame = next((b.where for b in self.blocks if b.kind == "frame"), None)
        if any(kind.positions):
            rows = [list(row) for row in moved]
            if frame is not None:
                for k in range(3):
                    rows[k][frame.start + k] -= 1
                for k, row in enumerate(_skew(point)):
                    for j, value in enumerate(row):
                        rows[k][frame.start + 3 + j] += value
            found += [
                self._along(axis, rows)
                for axis, seen in zip(base @ own.T, kind.positions, strict=True)
                if seen
            ]
        if any(kind.angles):
            angular = np.flatnonzero(robot.platform.angular).tolist()
            if frame is None:
                found += [
                    state.poses[k] for k, seen in zip(angular, kind.angles, strict=True) if seen
                ]
            else:
                turning = [list(row) for row in state.slopes[3:]]
                for k in range(3):
                    turning[k][frame.start + 3 + k] -= 1
                for k in angular:
                    weights = [state.twists[3 + j][k] for j in range(3)]
                    found.append(_combined(weights, turning))
        if kind.height:
            plane = self.start.planes[kind.plane]
            row = self._along(own @ plane[:3], moved)
            for block in self.blocks:
                if block.kind == "plane" and block.name == kind.plane:
                    for k, tilt in enumerate(across(plane[:3]).T):
                        weights = self._numbers(own @ tilt)
                        row[block.where.start + k] = sum(
                            a * b for a, b in zip(weights, point, strict=True)
                        )
                    row[block.where.start + 2] = -1
            found.append(row)
        if kind.distance:
            found.append(self._distance(kind, point, moved))
        return [[value % p for value in row] for row in found]

    def _distance(self, kind: RowKind, point: list[int], moved: Matrix) -> list[int]:
        if kind.anchor is None:
            other, shifted = self._mark(kind.origin, self._state())
        else:
            # A random place serves: where an anchor is does not matter to a rank.
            known = self.start.anchors[kind.anchor]
            other = self._numbers(self.geometry.frame @ known)
            shifted = [[0] * self.count for _ in range(3)]
            for block in self.blocks:
                if block.kind == "anchor" and block.name == kind.anchor:
                    for k, row in enumerate(self.geometry.frame):
                        for j, value in enumerate(self._numbers(row)):
                            shifted[k][block.where.start + j] = value
        weights = [a - b for a, b in zip(point, other, strict=True)]
        apart = [
            [a - b for a, b in zip(x, y, strict=True)] for x, y in zip(moved, shifted, strict=True)
        ]
        return _combined(weights, apart)

    def _state(self, kind: RowKind | None = None) -> _State:
        """Return a random state; where the kind's heights are all the same, one at that height."""
        p, rng, robot = self.prime, self.rng, self.start.robot
        for _ in range(_ATTEMPTS):
            pose = [rng.randrange(p) for _ in range(robot.freedom)]
            try:
                if kind is not None and kind.level is not None:
                    pose = self._levelled(pose, kind)
                squares = evaluate(self.deltas, self.field, [self.vector, pose])[0]
                if not all(is_square(delta, p) for delta in squares):
                    continue
                values = evaluate(self.program, self.field, [self.vector, pose])
                return self._solved(pose, values)
            except (NoSquareRoot, ZeroDivisionError):
                continue
        raise ZeroDivisionError

    def _levelled(self, pose: list[int], kind: RowKind) -> list[int]:
        """Return a pose moved along one of its lengths to the height that all rows have."""
        robot, p = self.start.robot, self.prime
        plane = self.start.planes[kind.plane]
        lengths = robot.platform.directions @ plane[:3]
        if not len(lengths):
            return pose
        own = [name in "xyz" for name in robot.coordinates]
        along = self._numbers(lengths)
        at = int(np.abs(lengths).argmax())
        values = evaluate(self.program, self.field, [self.vector, pose])
        place, turned = values[4], [[values[5][3 * i + j] for j in range(3)] for i in range(3)]
        if not robot.platform.tilts:
            _, turned, place = self._turning(pose)
        mark = self._numbers(self.start.marks[kind.mark])
        arm = [sum(a * b for a, b in zip(row, mark, strict=True)) for row in turned]
        normal = self._numbers(self.geometry.frame @ plane[:3])
        point = (a + b for a, b in zip(place, arm, strict=True))
        height = sum(a * b for a, b in zip(normal, point, strict=True))
        (wanted,) = self._numbers(np.array([plane[3] + (kind.level or 0.0)]))
        moved = list(pose)
        number = [k for k, length in enumerate(own) if length][at]
        moved[number] = (pose[number] + (wanted - height) * pow(along[at], -1, p)) % p
        return moved

    def _solved(self, pose: list[int], values: list[list[int]]) -> _State:
        p, robot = self.prime, self.start.robot
        n, m = len(robot.legs), robot.freedom
        joints, jacobian, slopes, twists, place, axes, *shifts = values
        width = len(self.columns[0])
        rates = [[0] * self.count for _ in range(n)]
        for block in self.blocks:
            for k in range(block.where.stop - block.where.start):
                at = block.where.start + k
                if block.kind == "geometry":
                    for i, part in enumerate(self.columns):
                        rates[i][at] = -sum(
                            value * slopes[i * width + row - part.start]
                            for row, value in self.steps[k].items()
                            if row in part
                        )
                elif block.kind == "zeros":
                    rates[block.legs[k]][at] = 1
                elif block.kind == "scales":
                    i = block.legs[k]
                    rates[i][at] = self.rng.randrange(p) if self.angular[i] else joints[i]
        square = [[jacobian[i * m + j] for j in range(m)] for i in range(n)]
        poses = _solve(square, rates, p)
        if robot.platform.tilts:
            rows = [twists[k * m : (k + 1) * m] for k in range(6)]
            turned = [[axes[3 * i + j] for j in range(3)] for i in range(3)]
        else:
            rows, turned, place = self._turning(pose)
        moved = [_combined(row, poses) for row in rows]
        if shifts:
            for k in range(6):
                for j, step in enumerate(self.steps):
                    at = j + next(b.where.start for b in self.blocks if b.kind == "geometry")
                    moved[k][at] += sum(
                        value * shifts[0][k * width + row]
                        for row, value in step.items()
                        if row < width
                    )
        return _State(place, turned, rows, poses, [[v % p for v in row] for row in moved])

    def _turning(self, pose: list[int]) -> tuple[Matrix, Matrix, list[int]]:
        """Return the twist's rows, the rotation and P of a platform that does not tilt."""
        p, robot = self.prime, self.start.robot
        x0, y0, k = self.frame
        along = {"x": x0, "y": y0, "z": k}
        names = [name for name in robot.coordinates if name in "xyz"]
        lengths = [[int(i == j) for j in range(3)] for i in range(3)]
        if len(names) < 3:
            lengths = [along[name] for name in names]
        rows = [[axis[i] for axis in lengths] for i in range(3)] + [[0] * len(lengths)] * 3
        place = [
            sum(c * axis[i] for c, axis in zip(pose, lengths, strict=False)) % p for i in range(3)
        ]
        cos, sin = 1, 0
        if robot.platform.turns:
            rows = [[*row, 0] for row in rows[:3]] + [
                [*row, value] for row, value in zip(rows[3:], k, strict=True)
            ]
            t = pose[-1]
            over = pow(1 + t * t, -1, p)
            cos, sin = (1 - t * t) * over % p, 2 * t * over % p
        x = [(cos * a + sin * b) % p for a, b in zip(x0, y0, strict=True)]
        y = [(cos * b - sin * a) % p for a, b in zip(x0, y0, strict=True)]
        return rows, [[x[i], y[i], k[i]] for i in range(3)], place

    def _mark(self, name: str, state: _State) -> tuple[list[int], Matrix]:
        """Return a mark's place and its slopes (3, p)."""
        p = self.prime
        own = self._numbers(self.start.marks[name])
        arm = [sum(a * b for a, b in zip(row, own, strict=True)) % p for row in state.turned]
        moved = [list(row) for row in state.slopes[:3]]
        for k, weights in enumerate(_skew(arm)):
            lever = _combined(weights, state.slopes[3:])
            moved[k] = [(a - b) % p for a, b in zip(moved[k], lever, strict=True)]
        for block in self.blocks:
            if block.kind == "mark" and block.name == name:
                for k, row in enumerate(state.turned):
                    for j, value in enumerate(row):
                        moved[k][block.where.start + j] += value
        return [(a + b) % p for a, b in zip(state.place, arm, strict=True)], moved

    def _along(self, axis: Array, rows: Matrix) -> list[int]:
        return _combined(self._numbers(axis), rows)

    def _numbers(self, vector: Array) -> list[int]:
        return [self.field.number(Fraction(float(v)).limit_denominator(_FINE)) for v in vector]


def _combined(weights: Sequence[int], rows: Matrix) -> list[int]:
    return [
        sum(w * row[k] for w, row in zip(weights, rows, strict=True)) for k in range(len(rows[0]))
    ]


def _skew(v: Sequence[int]) -> Matrix:
    x, y, z = v
    return [[0, -z, y], [z, 0, -x], [-y, x, 0]]


def _solve(square: Matrix, right: Matrix, prime: int) -> Matrix:
    """Return square^-1 right modulo a prime; ZeroDivisionError where it is singular."""
    n = len(square)
    work = [[*row, *more] for row, more in zip(square, right, strict=True)]
    for k in range(n):
        pivot = next((i for i in range(k, n) if work[i][k] % prime), None)
        if pivot is None:
            raise ZeroDivisionError
        work[k], work[pivot] = work[pivot], work[k]
        inverse = pow(work[k][k], -1, prime)
        work[k] = [value * inverse % prime for value in work[k]]
        for i in range(n):
            if i != k and work[i][k]:
                factor = work[i][k]
                work[i] = [(a - factor * b) % prime for a, b in zip(work[i], work[k], strict=True)]
    return [row[n:] for row in work]
