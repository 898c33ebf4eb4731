"""A rigid body in space: the wrench required to move it, for ten parameters.

All of it is written in the body's own frame, where the inertia tensor is constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca

Expression = Any
"""A CasADi SX matrix; CasADi has no types that a checker could read."""


class SpatialMoments(NamedTuple):
    """The parameters of a body in space, rows (1, K) under each other."""

    m: Expression
    """(1, K): mass."""
    h: Expression
    """(3, K): mass times centre of mass, in the body's frame."""
    i: Expression
    """(6, K): Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the reference point, in the body's frame."""

    def with_points(
        self, points: Sequence[Expression], masses: Sequence[Expression]
    ) -> SpatialMoments:
        """Return the mass moments with point masses (1, K) added at `points` (3, 1)."""
        m, h, i = self
        for s, mass in zip(points, masses, strict=True):
            x, y, z = ca.vertsplit(s)
            square = ca.vertcat(y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y)
            m, h, i = m + mass, h + ca.mtimes(s, mass), i + ca.mtimes(square, mass)
        return SpatialMoments(m, h, i)


def spatial_moments(rows: Sequence[Expression]) -> SpatialMoments:
    """Return a spatial body's mass moments from its ten parameter rows (1, K)."""
    return SpatialMoments(rows[0], ca.vertcat(*rows[1:4]), ca.vertcat(*rows[4:]))


class SpatialMotion(NamedTuple):
    """A body in motion, in the base frame."""

    axes: Expression
    """R (3, 3): its x, y and z."""
    acceleration: Expression
    """The acceleration of its reference point, (3, 1)."""
    turning: Expression
    """Angular velocity omega, (3, 1)."""
    growth: Expression
    """Angular acceleration alpha = omega', (3, 1)."""


def needed_twist_wrench(
    body: SpatialMotion, inertia: SpatialMoments, gravity: Expression
) -> tuple[Expression, Expression]:
    """Return force and moment, (3, K) each, required at a spatial body's reference point.

    With h = R m gamma and I = R I_P R^T: m (a - g) + alpha x h + omega x (omega x h), and I alpha +
    omega x I omega + h x (a - g).
    """
    a_g, w, dw = (
        ca.mtimes(body.axes.T, v) for v in (body.acceleration - gravity, body.turning, body.growth)
    )
    swing = ca.skew(dw) + ca.mtimes(ca.skew(w), ca.skew(w))
    force = ca.mtimes(a_g, inertia.m) + ca.mtimes(swing, inertia.h)
    tensor = _tensor_rows(dw) + ca.mtimes(ca.skew(w), _tensor_rows(w))
    moment = ca.mtimes(tensor, inertia.i) - ca.mtimes(ca.skew(a_g), inertia.h)
    return ca.mtimes(body.axes, force), ca.mtimes(body.axes, moment)


def twist_mass_matrix(axes: Expression, inertia: SpatialMoments) -> Expression:
    """Return the mass matrix (6, 6) of a spatial body in (v, omega)."""
    xx, xy, xz, yy, yz, zz = ca.vertsplit(inertia.i)
    tensor = ca.blockcat([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    h = ca.skew(ca.mtimes(axes, inertia.h))
    turned = ca.mtimes(axes, ca.mtimes(tensor, axes.T))
    return ca.blockcat([[inertia.m * ca.SX.eye(3), -h], [h, turned]])


def _tensor_rows(v: Expression) -> Expression:
    """Return the matrix (3, 6) whose product with (Ixx, Ixy, Ixz, Iyy, Iyz, Izz) is I v."""
    x, y, z = ca.vertsplit(v)
    return ca.blockcat([[x, y, z, 0, 0, 0], [0, x, 0, y, z, 0], [0, 0, x, 0, y, z]])
