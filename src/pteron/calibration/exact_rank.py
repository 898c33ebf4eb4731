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

from pteron.bodies.vectors import Vector
from pteron.calibration.guess import Block, Guess, across
from pteron.calibration.measurements import position_axes
from pteron.calibration.variations import slope_matrix, slope_terms
from pteron.kernels import NoSquareRoot, PrimeField, evaluate, general_program
from pteron.kernels.geometry_slopes import slope_columns, slopes_program
from pteron.kernels.programs import bare
from pteron.reduction.elimination import dependencies
from pteron.reduction.exact import primes_of
from pteron.reduction.exact_directions import rational_unit
from pteron.reduction.exact_geometry import exact_geometry
from pteron.reduction.exact_regressor import is_square

Array = NDArray[np.float64]
Residues = NDArray[np.object_]
"""Numbers modulo a prime, as Python's integers."""

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
    geometry = exact_geometry(start.robot)
    count = blocks[-1].where.stop
    rng = random.Random(seed)
    primes = primes_of(geometry, rng)
    best, used, rows = 0, [], 0
    for _ in range(_PRIMES):
        prime = next(primes)
        drawn = _Drawn(start, blocks, prime, rng)
        found: list[list[int]] = []
        rank, grows = 0, True
        try:
            while grows:  # a leg may need more poses than all rows together
                wanted = max(count, len(found)) + _SPARE * len(kinds)
                while len(found) < wanted:
                    for kind in kinds:
                        found += (np.array(drawn.rows(kind)) % prime).tolist()
                before, rank = rank, len(dependencies(found, range(count), prime)[0])
                grows = before < rank < count
        except ZeroDivisionError:
            return None, (), 0
        best, rows = max(best, rank), len(found)
        used.append(prime)
    return best, tuple(used), rows


class _State(NamedTuple):
    place: Residues
    turned: Residues
    twists: Residues
    """(6, m)."""
    poses: Residues
    """(m, p): slopes of the pose at given readings."""
    slopes: Residues
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
        layout = bare(robot)
        self.count = blocks[-1].where.stop
        self.deltas = general_program(layout, "discriminants").function
        whole = slopes_program(robot).function
        self.angular = [leg.joint.unit == "rad" for leg in robot.legs]
        symbols = whole.sx_in()
        outputs = whole.call(symbols)
        joints = [
            ca.SX(0) if round_ else q
            for q, round_ in zip(ca.horzsplit(outputs[0]), self.angular, strict=True)
        ]
        self.program = ca.Function("slopes", symbols, [ca.horzcat(*joints), *outputs[1:]])
        self.columns = slope_columns(layout)
        changes = next((b.changes for b in blocks if b.kind == "geometry"), ())
        terms, vector = slope_terms(layout, changes), np.array(self.vector, dtype=object)
        radial = [self._radial(leg.guide_point) for leg in robot.legs]
        steps = slope_matrix(layout, changes, terms, vector, radial) % prime
        self.steps: Residues = np.asarray(steps, dtype=object)
        self.frame: Residues = np.array(
            [[n.within(self.field) for n in axis] for axis in self.geometry.axes], dtype=object
        )

    def _radial(self, point: Vector) -> tuple[Residues, Residues]:
        """Return unit vectors from the platform's axis to a point, and across both.

        They are rational ones near the machine's: no relation to the other numbers is meant.
        """
        axis = np.array(self.start.robot.platform.axis)
        outward = np.array(point) - (axis @ point) * axis
        size = np.linalg.norm(outward)
        own = self.geometry.frame
        u, k = (
            np.array([n.within(self.field) for n in rational_unit(own @ v)], dtype=object)
            for v in (outward / size if size > 0.0 else np.eye(3)[0], axis)
        )
        return u, _skew(k) @ u

    def rows(self, kind: RowKind) -> list[Residues]:
        """Return the rows (p,) of a random pose."""
        robot = self.start.robot
        state = self._state(kind)
        point, moved = self._mark(kind.mark, state)
        found: list[Residues] = []
        own = self.geometry.frame
        frame = next((b.where for b in self.blocks if b.kind == "frame"), None)
        if any(kind.positions):
            rows = moved.copy()
            if frame is not None:
                rows[:, frame] += np.hstack([-np.eye(3, dtype=object), _skew(point)])
            axes = self._numbers(position_axes(robot) @ own.T)
            found += list(axes[list(kind.positions)] @ rows)
        if any(kind.angles):
            angular = np.flatnonzero(robot.platform.angular)
            if frame is None:
                found += list(state.poses[angular[list(kind.angles)]])
            else:
                turning = state.slopes[3:].copy()
                turning[:, frame.start + 3 : frame.stop] -= np.eye(3, dtype=object)
                found += list(state.twists[3:, angular].T @ turning)
        if kind.height:
            plane = self.start.planes[kind.plane]
            row = self._numbers(own @ plane[:3]) @ moved
            for block in self.blocks:
                if block.kind == "plane" and block.name == kind.plane:
                    tilts = self._numbers((own @ across(plane[:3])).T)
                    row[block.where] = [*(tilts @ point), -1]
            found.append(row)
        if kind.distance:
            found.append(self._distance(kind, point, moved))
        return found

    def _distance(self, kind: RowKind, point: Residues, moved: Residues) -> Residues:
        if kind.anchor is None:
            other, shifted = self._mark(kind.origin, self._state())
        else:
            # A random place serves: where an anchor is does not matter to a rank.
            own = self.geometry.frame
            other = self._numbers(own @ self.start.anchors[kind.anchor])
            shifted = np.zeros((3, self.count), dtype=object)
            for block in self.blocks:
                if block.kind == "anchor" and block.name == kind.anchor:
                    shifted[:, block.where] = self._numbers(own)
        return np.asarray((point - other) @ (moved - shifted))

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
                return self._solved(pose)
            except (NoSquareRoot, ZeroDivisionError):
                continue
        raise ZeroDivisionError

    def _values(self, pose: list[int]) -> list[Residues]:
        """Return the program's outputs at a pose."""
        values = evaluate(self.program, self.field, [self.vector, pose])
        return [np.array(value, dtype=object) for value in values]

    def _levelled(self, pose: list[int], kind: RowKind) -> list[int]:
        """Return a pose moved along one of its lengths to the height that all rows have."""
        robot, p = self.start.robot, self.prime
        plane = self.start.planes[kind.plane]
        lengths = robot.platform.directions @ plane[:3]
        if not len(lengths):
            return pose
        at = int(np.abs(lengths).argmax())
        along = self._numbers(lengths)[at]
        *_, place, turned = self._values(pose)[:6]
        if not robot.platform.tilts:
            _, turned, place = self._turning(pose)
        arm = turned.reshape(3, 3) @ self._numbers(self.start.marks[kind.mark])
        height = self._numbers(self.geometry.frame @ plane[:3]) @ (place + arm)
        (wanted,) = self._numbers(np.array([plane[3] + (kind.level or 0.0)]))
        moved = list(pose)
        number = [k for k, name in enumerate(robot.coordinates) if name in "xyz"][at]
        moved[number] = (pose[number] + (wanted - height) * pow(along, -1, p)) % p
        return moved

    def _solved(self, pose: list[int]) -> _State:
        p, robot = self.prime, self.start.robot
        n, m = len(robot.legs), robot.freedom
        joints, jacobian, slopes, twists, place, turned, *shifts = self._values(pose)
        against = slopes.reshape(n, -1)
        rates = np.zeros((n, self.count), dtype=object)
        geometry = slice(0, 0)
        for block in self.blocks:
            if block.kind == "geometry":
                geometry = block.where
                for i, part in enumerate(self.columns):
                    rates[i, geometry] = -against[i] @ self.steps[part.start : part.stop]
                continue
            for i, at in zip(block.legs, range(block.where.start, block.where.stop), strict=False):
                if block.kind == "zeros":
                    rates[i, at] = 1
                else:
                    rates[i, at] = self.rng.randrange(p) if self.angular[i] else joints[i]
        poses = _solve(jacobian.reshape(n, m), rates, p)
        rows, turned = twists.reshape(6, -1), turned.reshape(3, -1)
        if not robot.platform.tilts:
            rows, turned, place = self._turning(pose)
        moved = rows @ poses
        for shift in shifts:
            against = shift.reshape(6, -1)
            moved[:, geometry] += against @ self.steps[: against.shape[1]]
        return _State(place, turned, rows, poses, moved % p)

    def _turning(self, pose: list[int]) -> tuple[Residues, Residues, Residues]:
        """Return the twist's rows, the rotation and P of a platform that does not tilt."""
        p, robot = self.prime, self.start.robot
        x0, y0, k = self.frame
        names = [name for name in robot.coordinates if name in "xyz"]
        lengths = np.eye(3, dtype=object)
        if len(names) < 3:
            lengths = self.frame[["xyz".index(name) for name in names]]
        count = len(lengths)
        rows = np.zeros((6, robot.freedom), dtype=object)
        rows[:3, :count] = lengths.T
        cos, sin = 1, 0
        if robot.platform.turns:
            rows[3:, -1] = k
            t = pose[-1]
            over = pow(1 + t * t, -1, p)
            cos, sin = (1 - t * t) * over % p, 2 * t * over % p
        turned = np.stack([cos * x0 + sin * y0, cos * y0 - sin * x0, k], axis=1) % p
        return rows, turned, np.array(pose[:count], dtype=object) @ lengths % p

    def _mark(self, name: str, state: _State) -> tuple[Residues, Residues]:
        """Return a mark's place and its slopes (3, p)."""
        arm = state.turned @ self._numbers(self.start.marks[name]) % self.prime
        moved = (state.slopes[:3] - _skew(arm) @ state.slopes[3:]) % self.prime
        for block in self.blocks:
            if block.kind == "mark" and block.name == name:
                moved[:, block.where] += state.turned
        return (state.place + arm) % self.prime, moved

    def _numbers(self, values: Array) -> Residues:
        found = [self.field.number(Fraction(v).limit_denominator(_FINE)) for v in values.flat]
        return np.array(found, dtype=object).reshape(values.shape)


def _skew(v: Residues) -> Residues:
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=object)


def _solve(square: Residues, right: Residues, prime: int) -> Residues:
    """Return square^-1 right modulo a prime; ZeroDivisionError where it is singular."""
    n, whole = len(square), np.hstack([square, right])
    kept, given = dependencies(whole.tolist(), range(whole.shape[1]), prime)
    if kept != list(range(n)):
        raise ZeroDivisionError
    found = np.zeros(right.shape, dtype=object)
    for column, parts in given.items():
        for k, value in parts.items():
            found[k, column - n] = value
    return found
