"""Jets: quantities of a leg in motion to second order, with the rows of their rates.

Sums and products of jets follow the rules of differentiation, so that a leg's closure, written
once for positions, gives rates, accelerations and Jacobian rows too.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from pteron.bodies.motion import Expression, PointMotion, RotationMotion, point_rows


@dataclass(frozen=True)
class Jet:
    """A number or a vector (k, 1), its first two time derivatives, and the row of the first."""

    value: Expression
    row: Expression
    """(k, 6): d rate / d (c', omega)."""
    rate: Expression
    acceleration: Expression

    def __add__(self, other: Jet) -> Jet:
        return Jet(*(x + y for x, y in zip(self.parts, other.parts, strict=True)))

    def __sub__(self, other: Jet) -> Jet:
        return self + other.transform(-1)

    def __mul__(self, other: Jet) -> Jet:
        """Return the product of a number and a number or a vector."""
        x, y = self, other
        return Jet(
            x.value * y.value,
            ca.mtimes(y.value, x.row) + x.value * y.row,
            y.value * x.rate + x.value * y.rate,
            y.value * x.acceleration + 2 * x.rate * y.rate + x.value * y.acceleration,
        )

    @property
    def parts(self) -> tuple[Expression, Expression, Expression, Expression]:
        """Value, row, rate and acceleration."""
        return self.value, self.row, self.rate, self.acceleration

    def transform(self, matrix: Expression) -> Jet:
        """Return the jet of a constant matrix (j, k), or number, times the quantity."""
        return Jet(*(ca.mtimes(matrix, part) for part in self.parts))

    def multiply(self, vector: Expression) -> Jet:
        """Return the jet of a number times a constant vector (k, 1)."""
        return Jet(*(ca.mtimes(vector, part) for part in self.parts))

    def dot(self, other: Jet) -> Jet:
        """Return the scalar product of two vectors."""
        x, y = self, other
        return Jet(
            ca.dot(x.value, y.value),
            ca.mtimes(x.value.T, y.row) + ca.mtimes(y.value.T, x.row),
            ca.dot(x.value, y.rate) + ca.dot(y.value, x.rate),
            ca.dot(x.value, y.acceleration)
            + 2 * ca.dot(x.rate, y.rate)
            + ca.dot(y.value, x.acceleration),
        )

    def complement(self, length: Expression, sign: Expression) -> Jet:
        """Return sign sqrt(length^2 - x^2), the other leg of a right triangle."""
        x, root = self, sign * ca.sqrt(length * length - self.value * self.value)
        rate = -x.value * x.rate / root
        bend = x.rate * x.rate + x.value * x.acceleration + rate * rate
        return Jet(root, -x.value * x.row / root, rate, -bend / root)


def point_jet(point: PointMotion, origin: Expression) -> Jet:
    """Return the vector from a fixed origin (3, 1) to the platform point."""
    c, dc, ddc = point
    return Jet(c - origin, point_rows(ca.SX.eye(3)), dc, ddc)


def angular_motion(rotation: RotationMotion) -> tuple[Expression, Expression]:
    """Return the platform's angular velocity and acceleration, (3, 1) each."""
    zero = ca.SX(3, 1)
    omega = sum((turn.rate * turn.axis for turn in rotation.turns), zero)
    return omega, sum((turn.acceleration * turn.axis for turn in rotation.turns), zero)


def platform_vector(vector: Expression, rotation: RotationMotion) -> Jet:
    """Return a vector (3, 1) that is fixed to the platform."""
    omega, growth = angular_motion(rotation)
    rate = ca.cross(omega, vector)
    acceleration = ca.cross(growth, vector) + ca.cross(omega, rate)
    return Jet(vector, ca.horzcat(ca.SX(3, 3), -ca.skew(vector)), rate, acceleration)
