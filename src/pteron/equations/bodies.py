"""A body in planar motion: the force and the moment that it needs at its reference point.

Inertial parameters come as columns: one column for the values of a machine, or a column for each
parameter, which turns every force below into the regressor of that force. Hence one set of
equations serves both.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from pteron.equations.circles import quarter_turn
from pteron.equations.geometry import Expression, Geometry, LegGeometry


class Inertia(NamedTuple):
    """m, m gamma_x, m gamma_y and I of a body, each a row (1, K)."""

    m: Expression
    hx: Expression
    hy: Expression
    i: Expression

    @classmethod
    def rows(cls, block: Expression) -> Inertia:
        """Return the four rows of a block (4, K)."""
        return cls(block[0, :], block[1, :], block[2, :], block[3, :])


class LegInertia(NamedTuple):
    """The inertia of a leg's slider (a row) and of its two links."""

    slider: Expression
    upper: Inertia
    lower: Inertia


def split(parameters: Expression, legs: int) -> tuple[list[LegInertia], Inertia]:
    """Return the legs' inertia and the platform's from P (N, K), in the order of Eq. (16)."""
    bodies = [Inertia.rows(parameters[i : i + 4, :]) for i in range(legs, 9 * legs + 4, 4)]
    sliders = ca.vertsplit(parameters[:legs, :])
    return [LegInertia(sliders[i], bodies[i], bodies[legs + i]) for i in range(legs)], bodies[-1]


def link_moments(
    leg: LegGeometry, vector: Expression, length: Expression, link: Inertia
) -> tuple[Expression, Expression]:
    """Return h and d x h of a link, each (2, K) in the leg's plane, for its vector and length."""
    inverse = 1 / length  # a constant's reciprocal is a constant: products cost less than quotients
    return first_moment(vector, quarter_turn(vector), link.hx * inverse, link.hy * inverse)


def resting_moment(geometry: Geometry, platform: Inertia) -> tuple[Expression, Expression]:
    """Return the platform's h and k x h at phi = 0, over `Geometry.unit`, each (3, K)."""
    inverse = 1 / geometry.unit
    return first_moment(geometry.x0, geometry.y0, platform.hx * inverse, platform.hy * inverse)


def first_moment(
    x: Expression, y: Expression, hx: Expression, hy: Expression
) -> tuple[Expression, Expression]:
    """Return h = x hx + y hy and z x h = y hx - x hy, for the body's axes x and y."""
    return ca.mtimes(x, hx) + ca.mtimes(y, hy), ca.mtimes(y, hx) - ca.mtimes(x, hy)


def turning_force(
    h: Expression, dh: Expression, rate2: Expression, ddtheta: Expression
) -> Expression:
    """Return w' z x h - w^2 h, the force that a first moment h needs to turn about z.

    `h` is perpendicular to z and `dh` is z x h; `rate2` is w^2.
    """
    return ddtheta * dh - rate2 * h


def moment(dh: Expression, i: Expression, a_g: Expression, ddtheta: Expression) -> Expression:
    """Return I w' + z . (h x (a - g)), the moment (1, K) needed about z, at the reference point."""
    return ddtheta * i + ca.mtimes(a_g.T, dh)
