"""A body in motion, and the wrench required to move it: CasADi expressions for one state.

Inertial parameters come as rows (1, K) of K columns: one column for the values of a machine, or a
column for each parameter, which turns every force below into the regressor of that force. Rows
against (c', omega) multiply the velocity c' of a leg's platform point and the platform's angular
velocity omega.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from pteron.bodies.inertia import SpatialInertia
from pteron.bodies.spatial import (
    Expression as Expression,
    SpatialMoments,
    SpatialMotion,
    needed_twist_wrench,
    spatial_moments,
    twist_mass_matrix,
)


class PointMotion(NamedTuple):
    """The position, velocity and acceleration of a point, each (3, 1), in the base frame."""

    position: Expression
    velocity: Expression
    acceleration: Expression


def point_rows(rows: Expression) -> Expression:
    """Return derivatives (k, 6) by (c', omega), from those (k, 3) by the velocity c' alone."""
    return ca.horzcat(rows, ca.SX(rows.shape[0], 3))


class HeldPlane(NamedTuple):
    """A plane of the base in which a leg keeps its platform point: normal . (c - point) = 0."""

    normal: Expression
    """Unit vector, (3, 1)."""
    point: Expression
    """(3, 1)."""


class Turn(NamedTuple):
    """A turn about an axis that is fixed in the base frame, to second order."""

    axis: Expression
    """Unit vector, (3, 1)."""
    rate: Expression
    acceleration: Expression

    @property
    def row(self) -> Expression:
        """The derivative (1, 6) of the turn's rate by (c', omega)."""
        return ca.horzcat(ca.SX(1, 3), self.axis.T)


class RotationMotion(NamedTuple):
    """The platform's rotation against its legs, to second order.

    Its angular velocity is the sum of its turns: none of a platform that only translates, one of
    a platform with an axis, three of one that tilts.
    """

    turns: tuple[Turn, ...] = ()
    angle: Expression | None = None
    """phi, of a platform with one axis."""
    hinge: Expression | None = None
    """The point about which it turns against a leg, (3, 1); None: the platform point."""
    axes: Expression | None = None
    """(3, k): the axes now of the k angles by which a platform tilts, in the order of the pose."""

    @property
    def tilts(self) -> bool:
        """Whether the platform turns about more than one axis."""
        return len(self.turns) > 1

    def center(self, point: PointMotion) -> Expression:
        """Return the point (3, 1), m, about which the platform turns at a leg's platform point."""
        return point.position if self.hinge is None else self.hinge


class Moments(NamedTuple):
    """m, m gamma_x, m gamma_y and I of a body, each a row (1, K); zero where the body has none."""

    m: Expression
    hx: Expression
    hy: Expression
    i: Expression


class BodyMotion(NamedTuple):
    """Motion of a slider, a rod, a rigid body in a plane, or one in space.

    A body is its reference point and its axes x and y. A rod has no y, a slider no axes.
    """

    position: Expression
    """The place of the reference point, (3, 1)."""
    velocity_row: Expression
    """(3, 6): d v / d (c', omega)."""
    acceleration: Expression
    """a, of the reference point, (3, 1)."""
    axes: Expression | None = None
    """(3, k): unit vectors at right angles about which it turns: z in a plane, all three for a rod,
    whose angular velocity is perpendicular to x, and for a body in space."""
    rates_row: Expression | None = None
    """(k, 6): d rates / d (c', omega), the rates about the axes."""
    x: Expression | None = None
    """The axes x and y, (3, 1), and their second derivatives with respect to time."""
    y: Expression | None = None
    ddx: Expression | None = None
    ddy: Expression | None = None
    solid: SpatialMotion | None = None
    """Its axes, angular velocity and acceleration, of a body in space with ten parameters."""

    @property
    def turning_row(self) -> Expression:
        """The derivative (3, 6) of the body's angular velocity by (c', omega)."""
        if self.axes is None:
            return ca.SX(3, 6)
        return ca.mtimes(self.axes, self.rates_row)

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of the body's inertial parameters: of "m", "mgx", "mgy" and "I", or all ten."""
        if self.solid is not None:
            return SpatialInertia.kinds
        owners = {"m": self.position, "mgx": self.x, "mgy": self.y, "I": self.x}
        return tuple(kind for kind, owner in owners.items() if owner is not None)


def solid_body(
    reference: tuple[Expression, Expression, Expression],
    axes: tuple[Expression, Expression],
    turning_row: Expression,
    turning: Expression,
    growth: Expression,
) -> BodyMotion:
    """Return the motion of a body in space from its reference point and its axes x and y (3, 1).

    `reference` is the point's position, velocity row (3, 6) and acceleration; `turning_row` (3, 6)
    is that of the angular velocity `turning`, `growth` the angular acceleration, (3, 1) each.
    """
    x, y = axes
    ddx, ddy = (ca.cross(growth, v) + ca.cross(turning, ca.cross(turning, v)) for v in axes)
    frame = ca.horzcat(x, y, ca.cross(x, y))
    solid = SpatialMotion(frame, reference[2], turning, growth)
    return BodyMotion(*reference, ca.SX.eye(3), turning_row, x, y, ddx, ddy, solid)


def moments_of(kinds: tuple[str, ...], rows: list[Expression]) -> Any:
    """Return a body's mass moments from rows (1, K) of its parameters, in the order of `kinds`.

    They are `Moments`, or `SpatialMoments` of a body in space.
    """
    if kinds == SpatialInertia.kinds:
        return spatial_moments(rows)
    by_kind = dict(zip(kinds, rows, strict=True))
    zero = ca.SX(1, rows[0].shape[1])
    return Moments(*(by_kind.get(kind, zero) for kind in ("m", "mgx", "mgy", "I")))


def needed_wrench(
    body: BodyMotion, inertia: Moments | SpatialMoments, gravity: Expression
) -> tuple[Expression, Expression]:
    """Return force and moment, (3, K) each, required at a body's reference point.

    With h = hx x + hy y, the force is m (a - g) + h'' and the moment h x (a - g) + I x x x''; for a
    planar body the last term is I theta'' z. The paper's F acts on the body and is the negative of
    this.
    """
    if isinstance(inertia, SpatialMoments):
        assert body.solid is not None
        return needed_twist_wrench(body.solid, inertia, gravity)
    a_g = body.acceleration - gravity
    force = ca.mtimes(a_g, inertia.m)
    moment = ca.SX(3, inertia.m.shape[1])
    if body.x is not None:
        force = force + ca.mtimes(body.ddx, inertia.hx)
        moment = ca.mtimes(ca.cross(body.x, a_g), inertia.hx)
        moment = moment + ca.mtimes(ca.cross(body.x, body.ddx), inertia.i)
    if body.y is not None:
        force = force + ca.mtimes(body.ddy, inertia.hy)
        moment = moment + ca.mtimes(ca.cross(body.y, a_g), inertia.hy)
    return force, moment


def wrench_matrix(body: BodyMotion, gravity: Expression) -> Expression:
    """Return Om (6, k) of Eq. (15): the wrench on a body per unit of each parameter."""
    unit = ca.SX.eye(len(body.kinds))
    inertia = moments_of(body.kinds, ca.vertsplit(unit))
    return -ca.vertcat(*needed_wrench(body, inertia, gravity))  # Eq. (15), Omega of one body


def mass_matrix(body: BodyMotion, inertia: Moments | SpatialMoments) -> Expression:
    """Return the mass matrix (6, 6) of a body in (c', omega).

    T = m v.v / 2 + v.h' + I omega.omega / 2, omega being perpendicular to x.
    """
    v, rates = body.velocity_row, body.rates_row
    if isinstance(inertia, SpatialMoments):
        assert body.solid is not None
        rows = ca.vertcat(v, body.turning_row)
        return ca.mtimes(rows.T, ca.mtimes(twist_mass_matrix(body.solid.axes, inertia), rows))
    total = inertia.m * ca.mtimes(v.T, v)
    if rates is None:
        return total
    if body.y is not None:
        turned = ca.mtimes(body.y, inertia.hx) - ca.mtimes(body.x, inertia.hy)  # d h / d theta
        coupling = ca.mtimes(ca.mtimes(v.T, turned), rates)
    else:
        coupling = inertia.hx * ca.mtimes(v.T, ca.mtimes(-ca.skew(body.x), body.turning_row))
    return total + coupling + coupling.T + inertia.i * ca.mtimes(rates.T, rates)


def mass_moment(body: BodyMotion, inertia: Moments | SpatialMoments) -> Expression:
    """Return mass times centre of mass, (3, K), in the base frame: m r + h."""
    total = ca.mtimes(body.position, inertia.m)
    if isinstance(inertia, SpatialMoments):
        assert body.solid is not None
        return total + ca.mtimes(body.solid.axes, inertia.h)
    if body.x is not None:
        total = total + ca.mtimes(body.x, inertia.hx)
    if body.y is not None:
        total = total + ca.mtimes(body.y, inertia.hy)
    return total
