"""The number of combinations of unknowns that a calibration's measurements can show, exactly.

It is the rank of the residuals' slopes at random poses, in integers modulo random primes.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.calibration.guess import Guess, UnknownBlock
from pteron.calibration.measurements import Measurements
from pteron.calibration.residuals import MachineSlopes
from pteron.equations.variations import slope_matrix
from pteron.kernels import NoSquareRoot, PrimeField, general_program
from pteron.kernels.fields import Evaluation
from pteron.kernels.geometry_slopes import slopes_program
from pteron.kernels.programs import geometry_only
from pteron.reduction.elimination import dependencies
from pteron.reduction.exact import primes_of
from pteron.reduction.exact_directions import rational_unit
from pteron.reduction.exact_geometry import exact_geometry
from pteron.reduction.exact_regressor import is_square

Array = NDArray[np.float64]
Residues = NDArray[Any]
"""Numbers modulo a prime, as Python's integers."""

_SPARE = 4
"""Random rows of each kind beyond the number of columns."""

_PRIMES = 2
"""Primes modulo which the rank is found; the greater of the ranks counts."""

_ATTEMPTS = 20000
"""Random poses tried for one at which the square roots exist modulo the prime."""

_FINE = 10**6
"""Greatest denominator of the fractions that stand for numbers of marks, planes and anchors."""


def exact_rank(
    start: Guess, blocks: Sequence[UnknownBlock], measurements: Measurements, seed: int
) -> tuple[int | None, tuple[int, ...], int]:
    """Return rank, primes and number of rows; rank None if a part has no exact form.

    Rows of measurements matter by their kinds: what was measured, of which mark, from where.
    """
    geometry = exact_geometry(start.robot)
    count = blocks[-1].where.stop
    levels = _row_kinds(measurements)
    rng = random.Random(seed)
    primes = primes_of(geometry, rng)
    best, used, row_count = 0, [], 0
    for _ in range(_PRIMES):
        drawn = _ModularSlopes(start, blocks, measurements, next(primes), rng)
        rows: list[list[int]] = []
        rank, grows = 0, True
        try:
            while grows:  # a leg may need more poses than all rows together
                row_target = max(count, len(rows)) + _SPARE * len(levels)
                while len(rows) < row_target:
                    for i, level in levels.items():
                        rows += drawn.random_rows(i, level)
                previous_rank, rank = rank, len(dependencies(rows, range(count), drawn.prime)[0])
                grows = previous_rank < rank < count
        except ZeroDivisionError:
            return None, (), 0
        best, row_count = max(best, rank), len(rows)
        used.append(drawn.prime)
    return best, tuple(used), row_count


def _row_kinds(measurements: Measurements) -> dict[int, float | None]:
    """Return a row of each kind of measurement, with its height if constant, else None."""
    measured = ~np.isnan(np.column_stack([*measurements.parts.values()]))
    over, origins, planes = measured[:, -2], measurements.origins, np.array(measurements.planes)
    kinds = {
        (
            *measured[i].tolist(),
            measurements.marks[i],
            measurements.planes[i] if over[i] else "",
            measurements.anchors[i] if origins[i] < 0 else None,
            measurements.marks[origins[i]] if origins[i] >= 0 else "",
        ): i
        for i in reversed(range(len(measurements)))
    }
    levels: dict[int, float | None] = {}
    for _, i in sorted(kinds.items(), key=repr):
        heights = measurements.heights[planes == planes[i]]
        level = over[i] and (heights == heights[0]).all()
        levels[i] = float(heights[0]) if level else None
    return levels


class _ModularSlopes(MachineSlopes):
    """Slopes at random poses in integers modulo a prime, in the machine's own frame."""

    def __init__(
        self,
        start: Guess,
        blocks: Sequence[UnknownBlock],
        measurements: Measurements,
        prime: int,
        rng: random.Random,
    ) -> None:
        robot = start.robot
        super().__init__(robot, blocks)
        # Where an unknown frame stands does not matter to a rank.
        self.start = replace(start, turn=np.eye(3), shift=np.zeros(3))
        self.prime, self.rng, self.field = prime, rng, PrimeField(prime)
        geometry = exact_geometry(robot)
        self.frame, self.vector = geometry.frame, geometry.field_elements(self.field)
        deltas = general_program(geometry_only(robot), "radicands").function
        self.deltas = Evaluation(deltas, self.field, [self.vector])
        self.turning_joints = [leg.joint.unit == "rad" for leg in robot.legs]
        full_program = slopes_program(robot).function
        symbols = full_program.sx_in()
        outputs = full_program.call(symbols)
        joints = [
            ca.SX(0) if turns else q
            for q, turns in zip(ca.horzsplit(outputs[0]), self.turning_joints, strict=True)
        ]
        program = ca.Function("slopes", symbols, [ca.horzcat(*joints), *outputs[1:]])
        self.program = Evaluation(program, self.field, [self.vector])
        vector = np.array(self.vector, dtype=object)
        radial = [self._radial(np.array(leg.guide_point)) for leg in robot.legs]
        steps = slope_matrix(robot, self._changes, self._terms, vector, radial) % prime
        self.steps: Residues = np.asarray(steps, dtype=object)
        self.measurements = measurements
        self.places: Residues = np.empty((len(measurements), robot.freedom), dtype=object)
        self.known: dict[tuple[int, ...], list[Residues]] = {}

    def random_rows(self, i: int, level: float | None) -> list[list[int]]:
        """Return a row's slopes (K, p) modulo the prime, at a random pose or one at a level."""
        measurements, origin = self.measurements, self.measurements.origins[i]
        measured = ~np.isnan(np.hstack([part[[i]] for part in measurements.parts.values()]))
        self.known.clear()
        self.places[i] = self._draw_pose(i, level)
        if measured[0, -1] and origin >= 0:
            self.places[origin] = self._draw_pose(origin, None)
        slopes = self.slopes(self.start, measurements, self.places, np.array([i]), measured)[2]
        rows: list[list[int]] = (slopes[0, measured[0], : self.count] % self.prime).tolist()
        return rows

    def _draw_pose(self, i: int, level: float | None) -> list[int]:
        """Return a pose at which the square roots exist."""
        p, rng = self.prime, self.rng
        for _ in range(_ATTEMPTS):
            pose = [rng.randrange(p) for _ in range(self.start.robot.freedom)]
            try:
                if level is not None:
                    pose = self._move_to_height(pose, i, level)
                if all(is_square(delta, p) for delta in self.deltas.elements(pose)):
                    self.known[tuple(pose)] = self._evaluate(pose)
                    return pose
            except (NoSquareRoot, ZeroDivisionError):
                continue
        raise ZeroDivisionError

    def _evaluate(self, pose: list[int]) -> list[Residues]:
        """Return the program's outputs at a pose."""
        robot = self.start.robot
        outputs = self.program(pose)
        n, m = len(robot.legs), robot.freedom
        shapes = [(n,), (n, m), (n, -1), (6, m), (3,), (3, 3), (6, -1)]
        both = zip(outputs, shapes, strict=False)
        return [np.array(numbers, dtype=object).reshape(shape) for numbers, shape in both]

    def _move_to_height(self, pose: list[int], i: int, level: float) -> list[int]:
        """Return a pose moved along one of its lengths to a height."""
        robot, p = self.start.robot, self.prime
        plane = self.start.planes[self.measurements.planes[i]]
        lengths = robot.platform.directions @ plane[:3]
        if not len(lengths):
            return pose
        at = int(np.abs(lengths).argmax())
        slope = self._numbers(lengths)[at]
        place, turned = self._evaluate(pose)[4:6]
        arm = turned @ self._numbers(self.start.marks[self.measurements.marks[i]])
        height = self._base_vectors(plane[:3]) @ (place + arm)
        (target,) = self._numbers(np.array([plane[3] + level]))
        moved = list(pose)
        number = [k for k, name in enumerate(robot.coordinates) if name in "xyz"][at]
        moved[number] = (pose[number] + (target - height) * pow(slope, -1, p)) % p
        return moved

    def _radial(self, point: Array) -> tuple[Residues, Residues]:
        """Return unit vectors radial and tangential to the platform's axis at a point.

        They are rational ones near the machine's: no relation to the other numbers is meant.
        """
        axis = np.array(self.start.robot.platform.axis)
        outward = point - (axis @ point) * axis
        size = np.linalg.norm(outward)
        u, k = (
            np.array(
                [n.field_element(self.field) for n in rational_unit(self.frame @ v)], dtype=object
            )
            for v in (outward / size if size > 0.0 else np.eye(3)[0], axis)
        )
        return u, np.cross(k, u)

    def _outputs(self, guess: Guess, poses: Residues) -> list[Residues]:
        """Return the program's outputs at poses, looked up by pose."""
        columns = zip(*(self.known[tuple(pose)] for pose in poses), strict=True)
        return [np.stack(residues) for residues in columns]

    def _square_jacobian(self, jacobian: Residues) -> Residues:
        """Return Jacobians (N, n, m) with random columns that make them square.

        The rank is that with columns across: both choices change a row by multiples of closures'.
        """
        rows, n, m = jacobian.shape
        outside = [self.rng.randrange(self.prime) for _ in range(rows * n * (n - m))]
        columns = np.array(outside, dtype=object).reshape(rows, n, n - m)
        return np.concatenate([jacobian, columns], axis=-1)

    def _matrix(self, guess: Guess) -> Residues:
        """Return the slopes of the geometry's numbers against its variations."""
        return self.steps

    def _readings(self, readings: Array, joints: Residues) -> Residues:
        """Return random residues for joints that turn, and the coordinates of other joints."""
        random_ = [self.rng.randrange(self.prime) if turns else 0 for turns in self.turning_joints]
        return np.where(self.turning_joints, np.array(random_, dtype=object), joints)

    def _base_vectors(self, vectors: Array) -> Residues:
        """Return vectors (..., 3) of the base frame as residues in the machine's frame."""
        return self._numbers(vectors @ self.frame.T)

    def _numbers(self, array: Array) -> Residues:
        """Return numbers as residues modulo the prime, by rational approximations."""
        residues = [self.field.number(Fraction(v).limit_denominator(_FINE)) for v in array.flat]
        return np.array(residues, dtype=object).reshape(array.shape)

    def _unit(self, vectors: Residues) -> Residues:
        """Return the vectors unchanged, as a row's length does not affect the rank."""
        return vectors  # a row's length does not matter to a rank

    def _solve_stack(self, matrix: Residues, right: Residues) -> Residues:
        """Return matrix^-1 right of a stack, modulo the prime."""
        return np.stack([_solve(*pair, self.prime) for pair in zip(matrix, right, strict=True)])


def _solve(square: Residues, right: Residues, prime: int) -> Residues:
    """Return square^-1 right modulo a prime; ZeroDivisionError where it is singular."""
    n, augmented = len(square), np.hstack([square, right])
    pivots, combinations = dependencies(augmented.tolist(), range(augmented.shape[1]), prime)
    if pivots != list(range(n)):
        raise ZeroDivisionError
    solution = np.zeros(right.shape, dtype=object)
    for column, parts in combinations.items():
        for k, share in parts.items():
            solution[k, column - n] = share
    return solution
