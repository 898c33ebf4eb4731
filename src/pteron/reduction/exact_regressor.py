"""The regressor in exact arithmetic: its rows at random states, and bounds on its entries' degrees.

Rows are computed modulo a prime, or as fractions, so that a rank found from them has no rounding. A
sum of columns that is zero at random states might still be another polynomial than zero; the bounds
on degrees, and on how many roots a state takes, say how unlikely that is (Schwartz and Zippel).
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

from pteron.equations.machine import number_places
from pteron.equations.topology import topology_of
from pteron.kernels import NoSquareRoot, PrimeField, RationalField, evaluate, general_program
from pteron.kernels.fields import Evaluation
from pteron.kernels.graph import graph_of
from pteron.kernels.program_cache import cached_result
from pteron.legs.circles import random_fraction
from pteron.manipulator import Manipulator, parameter_data
from pteron.reduction.exact_geometry import ExactGeometry

_ATTEMPTS = 20000
"""Poses tried after the last usable one before it is concluded that there is no other: with two
roots in each of five legs all 20000 fail for a probability of 3e-9."""

Element = TypeVar("Element")


def modular_rows(
    topology: Manipulator, geometry: ExactGeometry, prime: int, states: int, rng: random.Random
) -> list[list[int]]:
    """Return the regressor's rows at random states modulo a prime, guide points exact.

    A pose can be used if every leg's discriminant Delta is a square, as for one pose in 2^n, or in
    4^n where each leg has two roots; velocity and acceleration are free.

    Raises
    ------
    ZeroDivisionError
        If no pose can be used, as for a machine that is singular everywhere.
    """
    vector = tuple(geometry.field_elements(PrimeField(prime)))
    rows, state = _cached_rows(topology, vector, prime, states, rng.getstate())
    rng.setstate(state)
    return rows


@lru_cache(maxsize=16)
def _cached_rows(
    topology: Manipulator, vector: tuple[int, ...], prime: int, states: int, state: Any
) -> tuple[list[list[int]], Any]:
    """Return the rows, and the random generator's state after them.

    Groupings of one machine in several orders of its columns take the same rows.
    """
    field, rng = PrimeField(prime), random.Random()
    rng.setstate(state)
    deltas = Evaluation(general_program(topology, "radicands").function, field, [vector])
    program = Evaluation(
        general_program(topology, _regressor_name(topology)).function, field, [vector]
    )
    rows: list[list[int]] = []
    attempts = 0
    while (attempts := attempts + 1) <= _ATTEMPTS:
        pose = _draw(topology.freedom, prime, rng)
        try:
            if not all(is_square(delta, prime) for delta in deltas.elements(pose)):
                continue
            motion = _draw(topology.freedom, prime, rng), _draw(topology.freedom, prime, rng)
            entries = program(pose, *motion)[0]
        except (NoSquareRoot, ZeroDivisionError):
            continue
        attempts = 0
        rows += _split_rows(entries, topology)
        if len(rows) >= states * topology.freedom:
            return rows, rng.getstate()
    raise ZeroDivisionError


def rational_rows(
    topology: Manipulator, geometry: ExactGeometry, states: int, rng: random.Random
) -> list[list[Fraction]]:
    """Return the regressor's rows, as fractions, at random rational configurations.

    Each leg is closed in a random configuration without a root, from which its guide point follows.
    No rows are returned where a kind of leg has no such closing, or planes hold the platform, whose
    poses have a root.
    """
    if topology.platform.planes:
        return []
    field = RationalField()
    vector = geometry.field_elements(field)
    points = Evaluation(general_program(topology, "platform_points").function, field, [vector])
    program = Evaluation(general_program(topology, _regressor_name(topology)).function, field)
    places = number_places(topology)
    rows: list[list[Fraction]] = []
    while len(rows) < states * topology.freedom:
        pose = [random_fraction(rng) for _ in range(topology.freedom)]
        flat = points(pose)[0]
        placed = list(vector)
        for i, (leg, at) in enumerate(zip(topology.legs, places, strict=False)):
            sizes = {q.name: len(q.value) for q in leg.quantities}
            leg_values = {name: vector[at[name] : at[name] + size] for name, size in sizes.items()}
            closed = leg.draw_closure(leg_values, rng)
            if closed is None:
                return []
            w, sigma = closed
            for k, c in enumerate(flat[3 * i : 3 * i + 3]):
                placed[at["guide_point"] + k] = c - w[k]
            placed[at["elbow"]] = Fraction(sigma)
        motion = [[random_fraction(rng) for _ in range(topology.freedom)] for _ in range(2)]
        try:
            entries = program(placed, pose, *motion)[0]
        except ZeroDivisionError:
            continue
        rows += _split_rows(entries, topology)
    return rows


def is_square(residue: int, prime: int) -> bool:
    """Return whether a residue is a square (Euler's criterion)."""
    return pow(residue, (prime - 1) // 2, prime) <= 1


def _draw(count: int, prime: int, rng: random.Random) -> list[int]:
    """Return random residues modulo a prime."""
    return [rng.randrange(prime) for _ in range(count)]


def _split_rows(entries: Sequence[Element], topology: Manipulator) -> list[list[Element]]:
    """Return a regressor's entries as rows; the program gives them by columns."""
    n = len(parameter_data(topology))
    return [list(entries[i * n : (i + 1) * n]) for i in range(topology.freedom)]


def _regressor_name(topology: Manipulator) -> str:
    """Return the function that has the base set of a topology's regressor and fewest roots.

    Of a redundant machine it is the regressor of the platform's load, whose forces have roots.
    """
    return "load_regressor" if topology.redundancy else "regressor"


class _Degree(NamedTuple):
    """A bound on the degree of a value: a numerator over powers of earlier divisors."""

    numerator: int
    powers: dict[int, int]
    """The power of each divisor in the denominator, by the divisor's number."""
    name: int
    """A number that is equal for values computed by the same operations."""


class _DegreeField:
    """Arithmetic on bounds of degrees in place of numbers; a square root halves the degree.

    A sum of fractions has the least common denominator of those that its terms are written with.
    """

    def __init__(self) -> None:
        self.degrees: list[int] = []
        self.names: dict[Any, int] = {}

    def make_degree(self, numerator: int, powers: dict[int, int], *operation: Any) -> _Degree:
        """Return a degree's bound, numerator over powers of divisors, named by its operation."""
        return _Degree(numerator, powers, self.names.setdefault(operation, len(self.names)))

    def degree_over(self, powers: Mapping[int, int], a: _Degree) -> int:
        """Return the degree of a value's numerator over a multiple of its denominator."""
        missing = (n - a.powers.get(k, 0) for k, n in powers.items())
        pairs = zip(powers, missing, strict=True)
        return a.numerator + sum(self.degrees[k] * n for k, n in pairs)

    def number(self, constant: Fraction | int) -> _Degree:
        """Return a constant, of degree 0."""
        return self.make_degree(0, {}, constant)

    def variable(self, name: str) -> _Degree:
        """Return a variable, of degree 1."""
        return self.make_degree(1, {}, name)

    def add(self, a: _Degree, b: _Degree) -> _Degree:
        """Return a bound for a sum: the greatest degree over the common denominator."""
        powers = common_powers((a, b))
        degree = max(self.degree_over(powers, a), self.degree_over(powers, b))
        return self.make_degree(degree, powers, "add", a.name, b.name)

    def subtract(self, a: _Degree, b: _Degree) -> _Degree:
        """Return the bound for a difference, that of the sum."""
        return self.add(a, b)._replace(
            name=self.make_degree(0, {}, "subtract", a.name, b.name).name
        )

    def multiply(self, a: _Degree, b: _Degree) -> _Degree:
        """Return a bound for a product: the sum of degrees and of powers of divisors."""
        powers = {k: a.powers.get(k, 0) + b.powers.get(k, 0) for k in {**a.powers, **b.powers}}
        return self.make_degree(a.numerator + b.numerator, powers, "multiply", a.name, b.name)

    def divide(self, a: _Degree, b: _Degree) -> _Degree:
        """Return a bound for a quotient; b's numerator becomes a divisor of later values."""
        inverse = self.make_degree(b.numerator, {}, "numerator", b.name).name
        self.degrees += [0] * (inverse + 1 - len(self.degrees))
        self.degrees[inverse] = b.numerator
        powers = {k: n - b.powers.get(k, 0) for k, n in a.powers.items()}
        surplus = {k: n for k, n in b.powers.items() if n > a.powers.get(k, 0)}
        numerator = a.numerator + sum(
            self.degrees[k] * (n - a.powers.get(k, 0)) for k, n in surplus.items()
        )
        powers = {k: n for k, n in powers.items() if n > 0}
        powers[inverse] = powers.get(inverse, 0) + 1
        return self.make_degree(numerator, powers, "divide", a.name, b.name)

    def square_root(self, a: _Degree) -> _Degree:
        """Return a bound for a square root: half the degree and powers, rounded up."""
        powers = {k: -(-n // 2) for k, n in a.powers.items()}
        twice = self.degree_over({k: 2 * n for k, n in powers.items()}, a)
        return self.make_degree(-(-twice // 2), powers, "root", a.name)


def common_powers(degrees: Iterable[_Degree]) -> dict[int, int]:
    """Return the least common denominator of some values, as powers of divisors."""
    powers: dict[int, int] = {}
    for degree in degrees:
        for k, n in degree.powers.items():
            powers[k] = max(n, powers.get(k, 0))
    return powers


@lru_cache(maxsize=8)
def degree_bound(topology: Manipulator) -> int:
    """Return a bound on the degree of any combination of a regressor row's entries.

    The variables are the pose (angles by the tangents of their halves), velocity and acceleration;
    the geometry is constant.
    """
    key = "degree bound", topology_of(topology)
    return cached_result(key, ("reduction",), lambda: _degree_bound(topology))


def _degree_bound(topology: Manipulator) -> int:
    """Return the degree bound of a topology's regressor, by evaluating it on degrees."""
    program = general_program(topology, _regressor_name(topology)).function
    field = _DegreeField()
    constants = [field.number(Fraction(0))] * program.size1_in(0)
    constants = [c._replace(name=-1 - k) for k, c in enumerate(constants)]
    states = [
        [field.variable(f"{name}{k}") for k in range(topology.freedom)]
        for name in ("pose", "velocity", "acceleration")
    ]
    entries = evaluate(program, field, [constants, *states])[0]
    return max(
        max(field.degree_over(common_powers(row), degree) for degree in row)
        for row in _split_rows(entries, topology)
    )


def roots(topology: Manipulator) -> int:
    """Return the number of square roots in the regressor's program."""
    graph = graph_of(general_program(topology, _regressor_name(topology)).function)
    return sum(node.operation == "sqrt" for node in graph.nodes)
