"""How high the degree of a regressor's entries can be: what a random test's odds hang on."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache

from pteron.kernels import evaluate, general_program
from pteron.manipulator import Manipulator, parameter_data

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
    n = len(parameter_data(topology))
    rows = [entries[i * n : (i + 1) * n] for i in range(topology.freedom)]
    return max(max(num for num, _ in row) + sum(den for _, den in row) for row in rows)
