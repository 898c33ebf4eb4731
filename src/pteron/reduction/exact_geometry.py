"""A machine's geometry in exact numbers, with its special relations kept.

Floats blur what the rank of the regressor depends on: right angles, parallel axes, equal lengths.
So the machine is looked at in a frame of its own, chosen so that as many components of its unit
vectors as possible are simple numbers (see `surds`); these are taken for what they stand for. What
is not simple is approximated by rational numbers that keep zeros, parallels and unit lengths exact.
A machine turned in space gives the same numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import permutations
from typing import TypeVar

import casadi as ca
import numpy as np

from pteron.equations.machine import distribution_numbers
from pteron.kernels import Array, Field, evaluate
from pteron.legs.circles import plane_axis, pole
from pteron.manipulator import Manipulator
from pteron.reduction.exact_directions import (
    FINE,
    PARALLEL,
    UNIT,
    ZERO,
    ExactVector,
    Notes,
    describe_near_relations,
    exact_directions,
    lost_right_angles,
    times,
)
from pteron.reduction.surds import Surd, direction_cosine

Element = TypeVar("Element")


@dataclass(frozen=True)
class ExactLeg:
    """A leg's quantities in exact numbers, in the machine's own frame.

    Attributes
    ----------
    values : dict
        By name, in the order of the leg's quantities. A unit vector that need only be perpendicular
        to a direction is empty: no force depends on which one it is, and a field has one.
    direction : vector of Surd
        That direction, the first of the leg.
    lengths : dict
        The lengths by symbol.
    platform_point : vector of Surd
        s0.
    """

    values: dict[str, tuple[Surd, ...]]
    direction: ExactVector
    lengths: dict[str, Surd]
    platform_point: ExactVector

    @property
    def numbers(self) -> list[Surd]:
        """All numbers in one list."""
        return [x for vector in (*self.values.values(), self.platform_point) for x in vector]

    def field_elements(self, field: Field[Element]) -> dict[str, list[Element]]:
        """Return the quantities and the platform point in a field, by name."""
        d = [c.field_element(field) for c in self.direction]
        elements = {}
        for name, quantity in self.values.items():
            if quantity:
                elements[name] = [number.field_element(field) for number in quantity]
            else:
                program = _plane_axis(*pole([float(c) for c in self.direction]))
                elements[name] = evaluate(program, field, [d])[0]
        points = {"platform_point": self.platform_point, "fixed_offset": (ZERO, ZERO, ZERO)}
        return elements | {k: [x.field_element(field) for x in v] for k, v in points.items()}


@dataclass(frozen=True)
class ExactGeometry:
    """A machine's geometry in exact numbers, and how far they are from the floats given.

    Attributes
    ----------
    legs : tuple of ExactLeg
        The legs.
    gravity : vector of Surd
        In the machine's own frame, m/s^2.
    platform : dict
        The platform's quantities by name, in their order.
    axes : tuple of vectors of Surd
        The platform frame's x, y and z at angles zero. Of a platform that takes every orientation,
        or every one that its planes allow, they are the own frame's.
    tilts : bool
        Whether the platform turns about more axes than one.
    frame : array, shape (3, 3)
        The machine's own frame: its rows are the axes, in the base frame. Where the platform turns
        or stays in a plane they are the platform frame's at some phi, where it slides the platform
        frame's own.
    recognised, approximated : tuple of str
        What was taken for a root, and what was approximated, each with the error made.
    shares : int
        How many numbers of a redundant machine's distribution of forces follow gravity; a base set
        does not depend on them.
    lost : tuple of str
        Right angles between directions which the exact numbers do not keep.
    nearly : tuple of str
        Right angles and parallels that are missed by little, and taken as missed.
    """

    legs: tuple[ExactLeg, ...]
    gravity: ExactVector
    platform: dict[str, tuple[Surd, ...]]
    axes: tuple[ExactVector, ...]
    arm_axes: str
    frame: Array
    recognised: tuple[str, ...]
    approximated: tuple[str, ...]
    lost: tuple[str, ...]
    nearly: tuple[str, ...]
    shares: int = 0

    @property
    def radicands(self) -> frozenset[int]:
        """The s > 1 of all numbers q sqrt(s)."""
        numbers = [n for leg in self.legs for n in leg.numbers] + list(self.gravity)
        numbers += [n for quantity in (*self.platform.values(), *self.axes) for n in quantity]
        return frozenset(n.s for n in numbers if n.s != 1)

    def symbols(self) -> dict[str, Surd]:
        """Return the values of the geometric symbols lu1, ll1, s1x, s1y, ... of the transfers."""
        lengths: dict[str, Surd] = {}
        for i, leg in enumerate(self.legs, start=1):
            lengths |= {f"{symbol}{i}": length for symbol, length in leg.lengths.items()}
            for axis, length in zip(self.arm_axes, leg.platform_point, strict=False):
                lengths[f"s{i}{axis}"] = length
        return lengths

    def field_elements(self, field: Field[Element]) -> list[Element]:
        """Return the geometry vector of `Machine.symbolic` in a field."""
        numbers = [
            number
            for leg in self.legs
            for elements in leg.field_elements(field).values()
            for number in elements
        ]
        vectors = (*self.axes, *self.platform.values(), self.gravity)
        numbers += [number.field_element(field) for vector in vectors for number in vector]
        return numbers + [field.number(Fraction(1))] * self.shares


@lru_cache(maxsize=6)
def _plane_axis(i: int, sign: int) -> ca.Function:
    """Return the CasADi function of a leg's plane axis from its direction, cached."""
    d = ca.SX.sym("d", 3)
    return ca.Function("plane_axis", [d], [ca.densify(plane_axis(d, i, sign))])


def exact_geometry(robot: Manipulator) -> ExactGeometry:
    """Return a machine's geometry in exact numbers."""
    unit: dict[str, Array] = {}
    for i, leg in enumerate(robot.legs, start=1):
        for q in leg.quantities:
            if q.role == "direction":
                unit[f"{q.symbol}{i}"] = np.array(q.value)
    platform = robot.platform
    unit |= {n: np.array(v) for n, v in platform.quantities.items() if n.endswith("axis")}
    size = float(np.linalg.norm(robot.gravity))
    if size > 0.0:
        unit["gravity"] = np.array(robot.gravity) / size
    frame = _best_frame(robot, list(unit.values()))
    notes = Notes([], [])
    exact = exact_directions({name: frame @ v for name, v in unit.items()}, notes)
    legs = tuple(_exact_leg(robot, i, frame, exact, notes) for i in range(len(robot.legs)))
    gravity: ExactVector = (ZERO, ZERO, ZERO)
    if size > 0.0:
        scale = Fraction(size).limit_denominator(10**6) or Fraction(size)
        gravity = times(exact["gravity"], scale)
    distinct = {
        name: vector
        for name, vector in unit.items()
        if not any(n[1:] == name[1:] and n < name and (unit[n] == vector).all() for n in unit)
    }
    platform_values: dict[str, tuple[Surd, ...]] = {"center": (ZERO,) * 3}
    platform_values |= {
        n: (Surd(Fraction(v[0])),) for n, v in platform.quantities.items() if len(v) == 1
    }
    # The whole machine but its platform's frame turns with a joint that has axes of its own.
    axes = _rational_rotation(frame) if "second_axis" in platform.quantities else UNIT
    if platform.axis_offset is not None:
        offset = frame @ np.array(platform.axis_offset)
        platform_values["axis_offset"] = tuple(_fraction(float(c)) for c in offset)
    quantities = {name: (platform_values | exact)[name] for name in platform.quantities}
    missed = lost_right_angles(distinct, exact), describe_near_relations(distinct)
    lost, nearly = (tuple(texts) for texts in missed)
    remarks = tuple(notes.recognised), tuple(notes.approximated), lost, nearly
    parts = legs, gravity, quantities, axes, platform.arm_axes, frame
    shares = sum(map(len, distribution_numbers(robot).values()))
    return ExactGeometry(*parts, *remarks, shares)


def _exact_leg(
    robot: Manipulator, i: int, frame: Array, exact: dict[str, ExactVector], notes: Notes
) -> ExactLeg:
    """Return leg i's geometry, from 0, in exact numbers; notes tell of approximations."""
    leg = robot.legs[i]
    # What does not turn only shifts what the leg is fixed to.
    shift = np.array(leg.fixed_offset)
    if robot.platform.angles:
        shift = shift + np.array(robot.platform.center or (0.0, 0.0, 0.0))
        x, y = notes.plane_vector(f"s{i + 1}", *leg.platform_point[:2])
        s0 = (x, y, notes.length(f"s{i + 1}.z", leg.platform_point[2]))
        if leg.platform_center is not None:  # of its platform point the direction alone counts
            way = np.array(leg.platform_point) / np.linalg.norm(leg.platform_point)
            s0 = exact_directions({f"s{i + 1}": way}, notes)[f"s{i + 1}"]
    else:
        shift = shift + np.array(robot.platform.frame).T @ np.array(leg.platform_point)
        s0 = (ZERO, ZERO, ZERO)
    quantities: dict[str, tuple[Surd, ...]] = {}
    lengths: dict[str, Surd] = {}
    directions: list[ExactVector] = []
    for q in leg.quantities:
        if q.role == "point":
            # It enters the regressor only through c - r: no rank hangs on its last digits.
            at = frame @ (np.array(q.value) - shift)
            quantities[q.name] = tuple(_fraction(float(c)) for c in at)
            if robot.platform.planes and abs(at @ frame @ leg.plane_normal) < PARALLEL:
                # Planes of legs that meet in one line do so exactly.
                x, y, _ = exact[f"d{i + 1}"]
                distance = _fraction(float(at[1] * float(x) - at[0] * float(y))).q
                quantities[q.name] = y.times(-distance), x.times(distance), quantities[q.name][2]
        elif q.role == "direction":
            directions.append(exact[f"{q.symbol}{i + 1}"])
            quantities[q.name] = directions[-1]
        elif q.role == "length":
            lengths[q.symbol] = notes.length(f"{q.symbol}{i + 1}", q.value[0])
            quantities[q.name] = (lengths[q.symbol],)
        else:
            plain = () if q.role == "normal" else q.value
            quantities[q.name] = tuple(Surd(Fraction(v)) for v in plain)
    # A leg without one has no axis that a force depends on.
    return ExactLeg(quantities, (directions or [UNIT[2]])[0], lengths, s0)


def _fraction(number: float) -> Surd:
    """Return a number as a surd, its fraction with a denominator of at most 1e9."""
    return Surd(Fraction(number).limit_denominator(10**9))


def _best_frame(robot: Manipulator, vectors: list[Array]) -> Array:
    """Return the frame, as rows, in which most components of the vectors are simple."""
    frames = []
    platform = robot.platform
    if platform.axis_angle or platform.plane_normal is not None or platform.planes:
        x0, _, k = (np.array(axis) for axis in robot.platform.frame)
        firsts = [x0]
        if not robot.platform.slides:
            firsts += [v - (v @ k) * k for v in vectors]
        frames = [(v / np.linalg.norm(v), k) for v in firsts if np.linalg.norm(v) > 1e-6]
        candidates = [np.array([x, np.cross(k, x), k]) for x, k in frames]
    else:
        candidates = [np.eye(3), np.array(robot.platform.frame)]
        for a, b in permutations(vectors, 2):
            n = np.cross(a, b)
            if np.linalg.norm(n) > 1e-6:
                n = n / np.linalg.norm(n)
                candidates.append(np.array([a, np.cross(n, a), n]))
    return max(candidates, key=lambda frame: _simplicity(frame, vectors))


def _rational_rotation(frame: Array) -> tuple[ExactVector, ...]:
    """Return the columns of a rotation near a frame, in fractions: Cayley's, of three numbers.

    Two rows of a frame that is far from 1 change their signs first.
    """
    signs = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    sign = signs[np.argmax([np.trace(frame * s[:, None]) for s in signs])]
    q = frame * sign[:, None]
    axial = np.array([q[2, 1] - q[1, 2], q[0, 2] - q[2, 0], q[1, 0] - q[0, 1]]) / (1 + np.trace(q))
    x, y, z = (
        Fraction(0) if abs(v) < PARALLEL else Fraction(float(v)).limit_denominator(FINE)
        for v in axial
    )
    square = 1 + x * x + y * y + z * z
    rows = (
        (1 + x * x - y * y - z * z, 2 * (x * y - z), 2 * (x * z + y)),
        (2 * (x * y + z), 1 - x * x + y * y - z * z, 2 * (y * z - x)),
        (2 * (x * z - y), 2 * (y * z + x), 1 - x * x - y * y + z * z),
    )
    turned = [[Surd(int(s) * v / square) for v in row] for s, row in zip(sign, rows, strict=True)]
    return tuple((x, y, z) for x, y, z in zip(*turned, strict=True))


def _simplicity(frame: Array, vectors: list[Array]) -> int:
    """Return the score of vectors in a frame: 3 for each zero, 2 a rational, 1 a root."""
    components = (direction_cosine(float(c)) for vector in vectors for c in frame @ vector)
    return sum(3 if c.q == 0 else 2 if c.s == 1 else 1 for c in components if c is not None)
