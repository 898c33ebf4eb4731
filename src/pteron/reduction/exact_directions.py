"""Lengths and unit vectors in exact numbers, for exact ranks: square roots of fractions (surds).

A float is recognised where it is near a simple surd, such as sqrt(3)/2, else approximated by a
fraction. Parallel directions stay parallel; right angles that approximations lose are reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations

import numpy as np

from pteron.kernels import Array
from pteron.reduction.surds import Surd, direction_cosine, length

ExactVector = tuple[Surd, Surd, Surd]
"""Components along x, y and z."""

PARALLEL = 1e-9
"""rad within which directions count as parallel or at a right angle, and components as zero."""

FINE = 10**12
"""Largest denominator of an approximation, whose error is then below 1e-12."""

_NOISE = 1e-14
"""Greatest difference of a recognised direction from its floats that counts as rounding."""

_NEARLY = 1e-5
"""Angle, rad, within which a relation that does not hold was perhaps meant to hold."""

ZERO = Surd(Fraction(0))

_ONE = Surd(Fraction(1))

UNIT: tuple[ExactVector, ...] = (_ONE, ZERO, ZERO), (ZERO, _ONE, ZERO), (ZERO, ZERO, _ONE)


@dataclass(frozen=True)
class Notes:
    """A conversion to exact numbers, with notes on what is recognised and what approximated."""

    recognised: list[str]
    approximated: list[str]

    def length(self, name: str, metres: float) -> Surd:
        """Return a length in exact numbers."""
        exact = length(metres)
        if exact is None:
            exact = Surd(Fraction(metres).limit_denominator(FINE))
            self._note_approximated(name, metres, exact)
        elif exact.s != 1:
            self._note_recognised(name, metres, exact)
        return exact

    def direction(self, name: str, vector: Array) -> ExactVector:
        """Return a unit vector in exact numbers, of unit length exactly."""
        simple = [direction_cosine(float(c)) for c in vector]
        known = [c for c in simple if c is not None]
        if len(known) == 3 and sum(c.square for c in known) == 1:
            for axis, component, exact in zip("xyz", vector, known, strict=True):
                if exact.s != 1 or abs(float(exact) - float(component)) > _NOISE:
                    self._note_recognised(f"{name}.{axis}", float(component), exact)
            return (known[0], known[1], known[2])
        unit = rational_unit(vector)
        for axis, component, exact in zip("xyz", vector, unit, strict=True):
            self._note_approximated(f"{name}.{axis}", float(component), exact)
        return unit

    def plane_vector(self, name: str, x: float, y: float) -> tuple[Surd, Surd]:
        """Return a vector in the platform's plane; its exact length is kept where it is simple."""
        simple = length(x), length(y)
        radius = length(float(np.hypot(x, y)))
        if None in simple and radius is not None and radius.q != 0:
            ux, uy, _ = rational_unit(np.array([x, y, 0.0]) / np.hypot(x, y))
            polar = Surd(ux.q * radius.q, radius.s), Surd(uy.q * radius.q, radius.s)
            for axis, component, exact in zip("xy", (x, y), polar, strict=True):
                self._note_approximated(f"{name}.{axis}", component, exact)
            return polar
        return self.length(f"{name}.x", x), self.length(f"{name}.y", y)

    def _note_recognised(self, name: str, number: float, exact: Surd) -> None:
        """Note that a value is recognised as an exact number, with its difference."""
        error = abs(float(exact) - number)
        difference = f"off by {error:.0e}" if error else "to the last digit"
        self.recognised.append(f"{name} = {exact} ({difference})")

    def _note_approximated(self, name: str, number: float, exact: Surd) -> None:
        """Note that a value is approximated by an exact number, unless it is equal."""
        error = abs(float(exact) - number)
        if error:
            self.approximated.append(f"{name} (off by {error:.0e})")


def exact_directions(vectors: dict[str, Array], notes: Notes) -> dict[str, ExactVector]:
    """Return unit vectors in exact numbers; one parallel to another becomes plus or minus it."""
    exact: dict[str, ExactVector] = {}
    for name, vector in vectors.items():
        for earlier, parallel in exact.items():
            if np.linalg.norm(np.cross(vector, vectors[earlier])) < PARALLEL:
                sense = Fraction(round(float(vector @ vectors[earlier])))
                exact[name] = times(parallel, sense)
                error = float(np.linalg.norm(vector - float(sense) * vectors[earlier]))
                if error > _NOISE:
                    notes.recognised.append(f"{name} parallel to {earlier} (off by {error:.0e})")
                break
        else:
            exact[name] = notes.direction(name, vector)
    return exact


def times(vector: ExactVector, factor: Fraction) -> ExactVector:
    """Return the product of an exact vector and a fraction."""
    x, y, z = vector
    return x.times(factor), y.times(factor), z.times(factor)


def rational_unit(vector: Array) -> ExactVector:
    """Return a rational unit vector near one given; components that are zero stay zero.

    It is projected from the pole opposite to its largest component, rounded, and projected back.
    """
    pole = int(np.argmax(np.abs(vector)))
    sign = Fraction(1 if vector[pole] > 0 else -1)
    others = [i for i in range(3) if i != pole]
    plane: list[Fraction] = []
    for i in others:
        t = float(vector[i]) / (1.0 + abs(float(vector[pole])))
        plane.append(Fraction(0) if abs(t) < PARALLEL else Fraction(t).limit_denominator(FINE))
    square: Fraction = sum((t * t for t in plane), Fraction(0))
    components = [Fraction(0)] * 3
    components[pole] = sign * (1 - square) / (1 + square)
    for i, tangent in zip(others, plane, strict=True):
        components[i] = 2 * tangent / (1 + square)
    return (Surd(components[0]), Surd(components[1]), Surd(components[2]))


def lost_right_angles(vectors: dict[str, Array], exact: dict[str, ExactVector]) -> list[str]:
    """Return in words the right angles between directions that their exact numbers lost."""
    return [
        f"{a} at a right angle to {b}"
        for (a, u), (b, v) in combinations(vectors.items(), 2)
        if abs(float(u @ v)) < PARALLEL and not _perpendicular(exact[a], exact[b])
    ]


def describe_near_relations(vectors: dict[str, Array]) -> list[str]:
    """Return in words the pairs of directions that are nearly parallel or at right angles."""
    relations = []
    for (a, u), (b, v) in combinations(vectors.items(), 2):
        for relation, angle in (
            ("at a right angle", abs(float(u @ v))),
            ("parallel", float(np.linalg.norm(np.cross(u, v)))),
        ):
            if PARALLEL <= angle < _NEARLY:
                relations.append(f"{a} and {b} are not {relation}, by {angle:.0e} rad")
    return relations


def _perpendicular(a: ExactVector, b: ExactVector) -> bool:
    """Return whether a . b = 0 exactly: for each radicand its terms must sum to zero."""
    sums: dict[int, Fraction] = {}
    for x, y in zip(a, b, strict=True):
        term = Surd.root(Fraction(x.s * y.s), 1.0)
        sums[term.s] = sums.get(term.s, Fraction(0)) + x.q * y.q * term.q
    return not any(sums.values())
