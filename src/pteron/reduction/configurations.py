"""The regressor at random states in exact arithmetic: modulo a prime, or in fractions."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TypeVar

from pteron.kernels import NoSquareRoot, PrimeField, RationalField, evaluate, general_program
from pteron.legs.circles import random_fraction
from pteron.manipulator import Manipulator, parameter_data
from pteron.reduction.exact_geometry import ExactGeometry

_ATTEMPTS = 20000
"""Poses tried before it is concluded that none serves."""
Element = TypeVar("Element")


def modular_rows(
    topology: Manipulator, geometry: ExactGeometry, prime: int, states: int, rng: random.Random
) -> list[list[int]]:
    """Return the regressor's rows at random states modulo a prime, for the machine's own guides.

    A pose is taken if every leg's Delta is a square, as it is for one pose in 2^n; velocity and
    acceleration are free.

    Raises
    ------
    ZeroDivisionError
        If no pose serves, as for a machine that is singular everywhere.
    """
    field = PrimeField(prime)
    vector = geometry.within(field)
    deltas = general_program(topology, "discriminants").function
    program = general_program(topology, "regressor").function
    rows: list[list[int]] = []
    for _ in range(_ATTEMPTS):
        pose = _draw(topology.freedom, prime, rng)
        if not all(is_square(delta, prime) for delta in evaluate(deltas, field, [vector, pose])[0]):
            continue
        motion = _draw(topology.freedom, prime, rng), _draw(topology.freedom, prime, rng)
        try:
            values = evaluate(program, field, [vector, pose, *motion])[0]
        except (NoSquareRoot, ZeroDivisionError):
            continue
        rows += _split(values, topology)
        if len(rows) >= states * topology.freedom:
            return rows
    raise ZeroDivisionError


def rational_rows(
    topology: Manipulator, geometry: ExactGeometry, states: int, rng: random.Random
) -> list[list[Fraction]]:
    """Return the regressor's rows, as fractions, at random rational configurations.

    Each leg is closed without a root, in a random pose of its own; the guide points follow. None
    where a kind of leg does not say how.
    """
    field = RationalField()
    vector = geometry.within(field)
    points = general_program(topology, "platform_points").function
    program = general_program(topology, "regressor").function
    places = geometry.places
    rows: list[list[Fraction]] = []
    while len(rows) < states * topology.freedom:
        pose = [random_fraction(rng) for _ in range(topology.freedom)]
        flat = evaluate(points, field, [vector, pose])[0]
        placed = list(vector)
        for i, leg in enumerate(topology.legs):
            closed = leg.closing({name: vector[part] for name, part in places[i].items()}, rng)
            if closed is None:
                return []
            w, sigma = closed
            c = flat[3 * i : 3 * i + 3]
            placed[places[i]["guide_point"]] = [a - b for a, b in zip(c, w, strict=True)]
            placed[places[i]["elbow"]] = [Fraction(sigma)]
        motion = [[random_fraction(rng) for _ in range(topology.freedom)] for _ in range(2)]
        try:
            values = evaluate(program, field, [placed, pose, *motion])[0]
        except ZeroDivisionError:
            continue
        rows += _split(values, topology)
    return rows


def is_square(value: int, prime: int) -> bool:
    """Say whether a residue is a square (Euler's criterion)."""
    return pow(value, (prime - 1) // 2, prime) <= 1


def _draw(count: int, prime: int, rng: random.Random) -> list[int]:
    return [rng.randrange(prime) for _ in range(count)]


def _split(values: Sequence[Element], topology: Manipulator) -> list[list[Element]]:
    """Return the rows of a regressor; the program stores it transposed, by columns."""
    n = len(parameter_data(topology))
    return [list(values[i * n : (i + 1) * n]) for i in range(topology.freedom)]


Degree = tuple[int, int]
"""Bounds on the degrees of numerator and denominator."""


class _DegreeField:
    """Degrees in place of numbers; a root of Delta counts half of Delta's degree."""

    def number(self, value: Fraction | int) -> Degree:
        return (0, 0)

    def add(self, a: Degree, b: Degree) -> Degree:
        return (max(a[0] + b[1], b[0] + a[1]), a[1] + b[1])

    subtract = add

    def multiply(self, a: Degree, b: Degree) -> Degree:
        return (a[0] + b[0], a[1] + b[1])

    def divide(self, a: Degree, b: Degree) -> Degree:
        return (a[0] + b[1], a[1] + b[0])

    def square_root(self, a: Degree) -> Degree:
        return (-(-a[0] // 2), -(-a[1] // 2))


@lru_cache(maxsize=8)
def degree_bound(topology: Manipulator) -> int:
    """Return a bound on the degree of any combination of a regressor row's entries.

    In the pose (phi through the tangent of its half), velocity and acceleration, the geometry
    being constants. Every entry is brought to a denominator of its own, hence generously.
    """
    program = general_program(topology, "regressor").function
    constants: list[Degree] = [(0, 0)] * program.size1_in(0)
    state: list[Degree] = [(1, 0)] * topology.freedom
    entries = evaluate(program, _DegreeField(), [constants, state, state, state])[0]
    return max(
        max(num for num, _ in row) + sum(den for _, den in row) for row in _split(entries, topology)
    )
