"""Spherical R-R-R legs, of the Agile Eye and of wrists: three revolute axes meet at the centre.

The crank leads by an arc from its axis u to w, the link by another to v, which the platform
carries: w . u = cos(crank_arc), w . v = cos(link_arc). As a force across v at the platform point
the leg's row is cos(link_arc) v - w; about the centre it is the moment w x v.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import acos, hypot, pi, sin, tan
from typing import ClassVar, NamedTuple, Self

import casadi as ca

from pteron.bodies.inertia import PlanarInertia, SpatialInertia
from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    PointMotion,
    RotationMotion,
    point_rows,
    solid_body,
)
from pteron.bodies.vectors import UNIT_TOLERANCE, Vector, dot
from pteron.errors import ModelError
from pteron.legs.ball_end import every_axis
from pteron.legs.circles import plane_of
from pteron.legs.crank import TurningLeg
from pteron.legs.drive import Drive
from pteron.legs.jets import angular_motion
from pteron.legs.keys import ACCOUNTS, FieldCondition, keys_of
from pteron.legs.kind import LegQuantity, LegTransfer, ReachBound
from pteron.legs.leg import CoordinateLocus, Joint, LegEquations, LegMotion, PlaneLocus, Reach
from pteron.legs.reading import Reading

_RIGHT = 1e-15
"""Rounding of the tangent of a quarter turn's half, which is 1."""


def _check_arc(name: str) -> FieldCondition:
    """Return the condition that an arc is between 0 and half a turn."""

    def check(arc: float) -> None:
        """Raise ModelError if the arc, rad, is not between 0 and pi."""
        if not 0.0 < arc < pi:
            raise ModelError(
                f"{name}: {arc:g} rad given, one between 0 and pi expected; are these degrees?"
            )

    return FieldCondition((name,), check)


def _check_point(point: Vector) -> None:
    """Raise ModelError if the platform point is P."""
    if not any(point):
        raise ModelError("platform_point: zero has no direction; give one along the last axis")


@dataclass(frozen=True)
class SRRR(TurningLeg):
    """A spherical R-R-R leg under a platform that turns about its centre.

    `platform_point` is on the axis of the joint at the platform.
    """

    direction: Vector
    zero_direction: Vector
    platform_point: Vector
    crank_arc: float
    link_arc: float
    upper: PlanarInertia
    lower: SpatialInertia
    elbow: int = 1
    limits: tuple[float, float] | None = None
    fixed_offset: Vector = (0.0, 0.0, 0.0)
    drive: Drive | None = None
    reading: Reading | None = field(default=None, kw_only=True)
    guide_point: Vector = None  # type: ignore[assignment]

    type = "SRRR"
    names: ClassVar = {"u": "crank", "l": "link"}
    account = ACCOUNTS["SRRR"]
    measure_text = "the sine of the angle between the planes of crank and link"

    keys: ClassVar = keys_of("SRRR")

    conditions = (
        _check_arc("crank_arc"),
        _check_arc("link_arc"),
        FieldCondition(("platform_point",), _check_point),
    )

    def with_platform_rotation(self, axes: Sequence[Vector], center: Vector | None) -> Self:
        """Return the leg with the platform's center; raise if it has none, or another one."""
        if center is None or not axes:
            raise ModelError(
                'an SRRR leg turns its platform about a point that stays; make its motion "3R", or '
                "give it another leg"
            )
        stated = self.guide_point or center
        if (
            hypot(*(a - b for a, b in zip(stated, center, strict=True)))
            > UNIT_TOLERANCE * self.size
        ):
            raise ModelError(
                f"guide_point: {list(stated)} is not the platform's center "
                f"{list(center)}, where all axes of an SRRR leg meet; leave it out"
            )
        return replace(self, guide_point=center)

    def with_platform_frame(self, frame: Sequence[Vector]) -> Self:
        """Return the leg; raise if its arcs do not close at angles zero."""
        s0, length = self.platform_point, self.size
        x, y, z = (sum(s * axis[i] for s, axis in zip(s0, frame, strict=True)) for i in range(3))
        angle = acos(max(-1.0, min(1.0, dot(self.direction, (x, y, z)) / length)))
        a, b = self.crank_arc, self.link_arc
        least, most = abs(a - b), min(a + b, 2.0 * pi - a - b)
        if not least <= angle <= most:
            raise ModelError(
                f"crank_arc, link_arc: {a:g} and {b:g} rad do not close at angles zero: they span "
                f"{least:.4g} to {most:.4g} rad, but direction and platform_point are "
                f"{angle:.4g} rad apart"
            )
        return self

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The leg's geometric quantities: centre, axes, arcs, `middle` angle and elbow."""
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("direction", "direction", self.direction, "d"),
            *self.zero_quantities,
            LegQuantity("crank_tangent", "number", (_half_tangent(self.crank_arc),)),
            LegQuantity("link_tangent", "number", (_half_tangent(self.link_arc),)),
            LegQuantity("distance", "number", (self.size,)),
            LegQuantity("elbow", "sign", (self.elbow,)),
        )

    @property
    def platform_center(self) -> Vector | None:
        """The point where all axes meet."""
        return self.guide_point

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return three axes: its joints leave the platform free to turn about any axis."""
        return every_axis()

    @property
    def size(self) -> float:
        """The distance of the joints in pictures from the centre, m."""
        return hypot(*self.platform_point)

    @property
    def lever(self) -> float:
        """Metres that the crank's end moves per rad."""
        return self.size * sin(self.crank_arc)

    @property
    def reach_bound(self) -> ReachBound:
        """The ball about the centre that holds the platform point, m."""
        return ReachBound(self.guide_point, None, self.size)

    @property
    def reach_text(self) -> str:
        """The arcs, as a clause for messages."""
        return f"its arcs of {self.crank_arc:.4g} and {self.link_arc:.4g} rad do not close"

    def transfers(self, gravity: Vector) -> tuple[LegTransfer, ...]:
        """Return which inertial parameters have no effect, and why."""
        return (
            LegTransfer("the crank{} turns about a fixed axis", {("m", "u"): (1, ())}),
            LegTransfer("the link{} turns about a fixed point", {("m", "l"): (1, ())}),
        )


class _State(NamedTuple):
    """The axes of a leg in space, unit vectors (3, 1)."""

    w: Expression
    v: Expression
    k: Expression
    """Where the crank's end leans, across u."""
    divisor: Expression
    """u . (w x v)."""


class SRRREquations(LegEquations):
    """The equations of a spherical R-R-R leg."""

    kinds: ClassVar = {"u": PlanarInertia.kinds, "l": SpatialInertia.kinds}

    def __init__(
        self,
        guide_point: Expression,
        direction: Expression,
        zero_direction: Expression,
        middle: Expression,
        crank_tangent: Expression,
        link_tangent: Expression,
        distance: Expression,
        elbow: Expression,
    ) -> None:
        self.distance = distance
        self.r, self.u, self.middle, self.sigma = guide_point, direction, middle, elbow
        self.plane = plane_of(direction, zero_direction)
        self.tangents = crank_tangent, link_tangent
        self.crank, self.link = (_cosine_and_sine(t) for t in self.tangents)

    def _closure(self, c: Expression) -> tuple[Expression, Expression, Expression, Expression]:
        """Return v, its part across u (2, 1), what k . v must be, and the discriminant."""
        arm = c - self.r
        v = arm / ca.sqrt(ca.dot(arm, arm))
        plane_part, (cosine, sine) = ca.mtimes(self.plane.T, v), self.crank
        height = (self.link[0] - cosine * ca.dot(self.u, v)) / sine
        return v, plane_part, height, ca.dot(plane_part, plane_part) - height * height

    def _state(self, c: Expression) -> _State:
        """Return the axes of the leg's joints."""
        v, plane_part, height, square = self._closure(c)
        root, (cosine, sine) = self.sigma * ca.sqrt(square), self.crank
        turned = ca.vertcat(-plane_part[1], plane_part[0])
        k = ca.mtimes(self.plane, height * plane_part + root * turned) / ca.dot(
            plane_part, plane_part
        )
        return _State(cosine * self.u + sine * k, v, k, -sine * root)

    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        """Return the motion of crank, link and joints.

        With D = u.(w x v): D q' = -w.v' and D q'' = -w.v'' - 2 q' (u x w).v' - q'^2 (u x (u x
        w)).v.
        """
        w, v, k, divisor = self._state(point.position)
        u, arm = self.u, point.position - self.r
        length = ca.sqrt(ca.dot(arm, arm))
        dv, ddv = point.velocity / length, point.acceleration / length
        side = ca.cross(u, w)
        rate = -ca.dot(w, dv) / divisor
        pull = 2 * rate * ca.dot(side, dv) + rate * rate * ca.dot(ca.cross(u, side), v)
        acceleration = -(ca.dot(w, ddv) + pull) / divisor
        cosine, sine = self.link
        row = point_rows((cosine * v - w).T)
        joint_row = row / (divisor * length)
        # omega = q' u + p' w + s' v.
        omega, growth = angular_motion(rotation)
        spins = [ca.cross(v, u).T / divisor, side.T / divisor]
        rates = [ca.mtimes(spin, omega) for spin in spins]
        swing = rates[0] * rate * side
        remainder = growth - swing - rates[1] * ca.cross(omega, v)
        none = ca.SX(1, 3)
        second, third = (
            (ca.horzcat(none, spin), spin_rate, ca.mtimes(spin, remainder))
            for spin, spin_rate in zip(spins, rates, strict=True)
        )
        y, square = ca.cross(u, k), rate * rate
        ddk, ddy = acceleration * y - square * k, -acceleration * k - square * y
        fixed = self.r, ca.SX(3, 6), ca.SX(3, 1)
        crank = BodyMotion(*fixed, u, joint_row, k, y, ddk, ddy)
        link_row = ca.mtimes(u, joint_row) + ca.mtimes(w, second[0])
        turning = rate * u + rates[0] * w
        growing = acceleration * u + second[2] * w + swing
        link = solid_body(fixed, (w, (v - cosine * w) / sine), link_row, turning, growing)
        start, knee = self.r + length * u, self.r + length * w
        chain = (
            Joint("R", u, start, joint_row, rate, acceleration, "u", driven=True),
            Joint("R", w, knee, *second, "l"),
            Joint("R", v, point.position, *third),
        )
        coordinate = self.middle + ca.atan2(
            ca.dot(k, self.plane[:, 1]), ca.dot(k, self.plane[:, 0])
        )
        return LegMotion(
            coordinate,
            rate,
            acceleration,
            row,
            divisor * length,
            {"u": crank, "l": link},
            chain,
            (knee - start, point.position - knee),
            ((rate, acceleration), None),
            sine,
            v - cosine * w,
        )

    def reach(self, c: Expression) -> Reach:
        """Return the reach margin: the arcs' range less the angle between u and v, in m at c."""
        v, plane_part, _, discriminant = self._closure(c)
        arm = c - self.r
        length = ca.sqrt(ca.dot(arm, arm))
        a, b = (2 * ca.atan2(t, 1) for t in self.tangents)
        spread = ca.sqrt(ca.dot(plane_part, plane_part))
        angle = ca.atan2(spread, ca.dot(self.u, v))
        most = ca.fmin(a + b, 2 * ca.pi - a - b)
        margin = ca.fmin(angle - ca.fabs(a - b), most - angle)
        return Reach(length * margin, discriminant, self.link[1] ** 2, length * spread)

    def radicands(self, c: Expression) -> tuple[Expression, ...]:
        """Return the squared distance of c from the centre, and the discriminant."""
        arm = c - self.r
        return ca.dot(arm, arm), self._closure(c)[3]

    def lever(self, length: Expression) -> Expression:
        """Return the platform's characteristic length, m per rad: the crank turns about P."""
        return length

    def locus(self, q: Expression) -> CoordinateLocus:
        """Return the locus of c, a circle about w on the sphere about the centre."""
        turn, (cosine, sine) = q - self.middle, self.crank
        k = ca.mtimes(self.plane, ca.vertcat(ca.cos(turn), ca.sin(turn)))
        w = cosine * self.u + sine * k
        offset = self.distance * self.link[0] + ca.dot(w, self.r)
        return CoordinateLocus(q, PlaneLocus(w, offset, self.distance))


def _half_tangent(arc: float) -> float:
    """Return tan(arc / 2), exactly 1 for a quarter turn."""
    tangent = tan(0.5 * arc)
    return 1.0 if abs(tangent - 1.0) < _RIGHT else tangent


def _cosine_and_sine(tangent: Expression) -> tuple[Expression, Expression]:
    """Return cosine and sine of an arc, from the tangent of its half."""
    square = tangent * tangent
    return (1 - square) / (1 + square), 2 * tangent / (1 + square)


SRRR.equations_class = SRRREquations
