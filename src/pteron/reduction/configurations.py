"""The regressor at configurations drawn at random in a field, where nothing is rounded."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

from pteron.equations.geometry import SYMBOLS_PER_LEG
from pteron.kernels import NoSquareRoot, PrimeField, RationalField, evaluate, general_program
from pteron.reduction.exact_geometry import ExactGeometry

__all__ = ["Topology", "is_square", "modular_rows", "rational_rows"]

_ATTEMPTS = 20000
Element = TypeVar("Element")


@dataclass(frozen=True)
class Topology:
    """What the general program needs to know: how many legs, and whether the platform turns."""

    legs: int
    turns: bool

    @property
    def columns(self) -> int:
        """The number N of inertial parameters."""
        return 9 * self.legs + 4


def modular_rows(
    topology: Topology, geometry: ExactGeometry, prime: int, states: int, rng: random.Random
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
    deltas = general_program(topology.legs, topology.turns, "discriminants").function
    program = general_program(topology.legs, topology.turns, "regressor").function
    rows: list[list[int]] = []
    for _ in range(_ATTEMPTS):
        pose = _draw(topology.legs, prime, rng)
        if not all(is_square(delta, prime) for delta in evaluate(deltas, field, [vector, pose])[0]):
            continue
        motion = _draw(topology.legs, prime, rng), _draw(topology.legs, prime, rng)
        try:
            values = evaluate(program, field, [vector, pose, *motion])[0]
        except (NoSquareRoot, ZeroDivisionError):
            continue
        rows += _split(values, topology)
        if len(rows) >= states * topology.legs:
            return rows
    raise ZeroDivisionError


def rational_rows(
    topology: Topology, geometry: ExactGeometry, states: int, rng: random.Random
) -> list[list[Fraction]]:
    """Return the regressor's rows, as fractions, at random rational configurations.

    Each link's direction is rational through the tangent of its half angle, so that the triangle of
    the links closes without a root; the guide points follow the configuration.
    """
    field = RationalField()
    vector = geometry.within(field)
    points = general_program(topology.legs, topology.turns, "platform_points").function
    program = general_program(topology.legs, topology.turns, "regressor").function
    rows: list[list[Fraction]] = []
    while len(rows) < states * topology.legs:
        pose = [_fraction(rng) for _ in range(topology.legs)]
        flat = evaluate(points, field, [vector, pose])[0]
        placed = list(vector)
        for i in range(topology.legs):
            start = SYMBOLS_PER_LEG * i
            u, sigma = _triangle(placed[start : start + SYMBOLS_PER_LEG], rng)
            c = flat[3 * i : 3 * i + 3]
            placed[start : start + 3] = [a - b for a, b in zip(c, u, strict=True)]
            placed[start + SYMBOLS_PER_LEG - 1] = Fraction(sigma)
        motion = [[_fraction(rng) for _ in range(topology.legs)] for _ in range(2)]
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


def _fraction(rng: random.Random) -> Fraction:
    return Fraction(rng.randint(-400, 400), rng.randint(1, 200))


def _split(values: Sequence[Element], topology: Topology) -> list[list[Element]]:
    """Return the rows of a regressor; the program stores it transposed, by columns."""
    n = topology.columns
    return [list(values[i * n : (i + 1) * n]) for i in range(topology.legs)]


def _triangle(leg: Sequence[Fraction], rng: random.Random) -> tuple[list[Fraction], int]:
    """Return a random u = l_u + l_l in a leg's plane, and the elbow's side sigma.

    sigma = - sign((l_u x l_l) . d), because D = -sigma sqrt(Delta) / 2.
    """
    d, a, lengths = leg[3:6], leg[9:12], leg[15:17]
    b = [d[1] * a[2] - d[2] * a[1], d[2] * a[0] - d[0] * a[2], d[0] * a[1] - d[1] * a[0]]
    links = []
    for size in lengths:
        t = _fraction(rng)
        links.append((size * (1 - t * t) / (1 + t * t), size * 2 * t / (1 + t * t)))
    (ua, ub), (la, lb) = links
    u = [(ua + la) * p + (ub + lb) * q for p, q in zip(a, b, strict=True)]
    return u, -1 if ua * lb - ub * la > 0 else 1
