"""Data and equations shared by legs with a crank, R-S-S and planar R-R-R.

The crank turns about d through the guide point r; the last link leads from the crank's end to the
platform point. A rod (R-S-S) has its length in space, a planar link (R-R-R) in the crank's plane;
each subclass supplies what depends on this.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Self

import casadi as ca

from pteron.bodies.inertia import PlanarInertia
from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    Moments,
    PointMotion,
    RotationMotion,
    point_rows,
)
from pteron.bodies.vectors import Vector, cross, scale_vector, shift_point, vertical
from pteron.legs.circles import perpendicular_to, plane_of, quarter_turn
from pteron.legs.drive import Drive
from pteron.legs.kind import CRANK, LegKind, LegQuantity, LegTransfer, ReachBound
from pteron.legs.leg import Joint, LegEquations, LegMotion, Needs, Reach, force_wrench
from pteron.legs.reading import Reading

ELBOW: Mapping[tuple[str, str], tuple[int, tuple[str, ...]]] = {
    ("m", "u"): (1, ()),
    ("mgx", "u"): (1, ("lu",)),
    ("I", "u"): (1, ("lu", "lu")),
    ("m", "l"): (-1, ()),
    ("mgx", "l"): (1, ("ll",)),
    ("I", "l"): (-1, ("ll", "ll")),
}
"""A transfer of mass between the links at the joint that both carry: for each parameter its sign
and the lengths that multiply it (`Transfer.entries`)."""


class TurningLeg(LegKind):
    """The data of a leg whose driven body turns about a fixed axis, `direction`."""

    direction: Vector
    zero_direction: Vector

    joint = CRANK

    @property
    def zero_quantities(self) -> tuple[LegQuantity, LegQuantity]:
        """The direction from which the joint's angle counts, and the `middle` angle there.

        The angle is the one nearest to the middle of its limits, else in (-pi, pi].
        """
        low, high = self.limits or (0.0, 0.0)
        inside = -math.pi < low and high <= math.pi
        middle = 0.0 if inside else 0.5 * (low + high)
        zero = self.zero_direction if inside else self._direction_at(middle)
        return (
            LegQuantity("zero_direction", "normal", zero),
            LegQuantity("middle", "number", (middle,)),
        )

    @property
    def joint_axis(self) -> Vector:
        """The unit vector about which the crank turns."""
        return self.direction

    @property
    def crank_at_zero(self) -> Vector:
        """The unit vector along which the crank points at angle 0."""
        return self.zero_direction

    def with_turned_crank(self, turn: Callable[[Vector], Vector]) -> Self:
        """Return the leg with every direction v of its crank replaced by `turn(v)`."""
        return replace(
            self, direction=turn(self.direction), zero_direction=turn(self.zero_direction)
        )

    def zero_at(self, zero: float) -> dict[str, Any]:
        """Return the field `zero_direction` that makes the crank's angle count from `zero`, rad."""
        return {"zero_direction": self._direction_at(zero)}

    def _direction_at(self, angle: float) -> Vector:
        """Return the unit vector of the crank in the base frame at an angle, rad."""
        normal_direction = cross(self.direction, self.zero_direction)
        return shift_point(
            scale_vector(self.zero_direction, math.cos(angle)), normal_direction, math.sin(angle)
        )


@dataclass(frozen=True)
class CrankLeg(TurningLeg):
    """The data of a leg with a crank; its subclasses define the last link."""

    guide_point: Vector
    direction: Vector
    zero_direction: Vector
    platform_point: Vector
    upper_length: float
    lower_length: float
    upper: PlanarInertia
    lower: Any
    elbow: int = 1
    limits: tuple[float, float] | None = None
    fixed_offset: Vector = (0.0, 0.0, 0.0)
    drive: Drive | None = None
    reading: Reading | None = field(default=None, kw_only=True)

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The leg's geometric quantities: points, directions, lengths, `middle` angle and elbow."""
        zero_direction, middle = self.zero_quantities
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("direction", "direction", self.direction, "d"),
            zero_direction,
            LegQuantity("plane_axis", "normal", perpendicular_to(self.direction)),
            LegQuantity("upper_length", "length", (self.upper_length,), "lu"),
            LegQuantity("lower_length", "length", (self.lower_length,), "ll"),
            middle,
            LegQuantity("elbow", "sign", (self.elbow,)),
        )

    @property
    def lever(self) -> float:
        """The crank's length, m: the metres that its end moves per rad."""
        return self.upper_length

    @property
    def reach_bound(self) -> ReachBound:
        """A ball about the guide point, with the sum of the links' lengths as its radius, m."""
        return ReachBound(self.guide_point, None, self.size)

    @property
    def extents(self) -> dict[str, tuple[str, float, float, str]]:
        """The range of x, m, where crank and last link usually have their centres of mass."""
        last = self.names["l"]
        return {
            "u": ("upper", 0.0, self.upper_length, f"its axis and the {last}"),
            "l": ("lower", -self.lower_length, 0.0, "crank and platform, where its x is zero"),
        }

    def transfers(self, gravity: Vector) -> tuple[LegTransfer, ...]:
        """Return which inertial parameters of crank and last link transfer to others, and why."""
        last = self.names["l"]
        transfer_list = [
            LegTransfer("the crank{} turns about a fixed axis", {("m", "u"): (1, ())}),
            LegTransfer(f"crank and {last}{{}} carry the joint between them", ELBOW),
        ]
        if vertical(self.direction, gravity):
            reason = "no gravity acts across the axis of the crank{}"
            transfer_list += [
                LegTransfer(reason, {(kind, "u"): (1, ())}) for kind in ("mgx", "mgy")
            ]
        return tuple(transfer_list)


class CrankState(NamedTuple):
    """Crank and last link in motion."""

    l_u: Expression
    """The crank, (2, 1), in its plane; g = d x l_u."""
    g: Expression
    b: Expression
    """The last link: (3, 1), or (2, 1) in the plane."""
    divisor: Expression
    """b . g."""
    rate: Expression
    acceleration: Expression


class CrankEquations(LegEquations):
    """The equations of a leg with a crank, whose plane's axes `plane` (3, 2) holds."""

    rides = ("l",)

    def __init__(
        self,
        guide_point: Expression,
        direction: Expression,
        zero_direction: Expression,
        plane_axis: Expression,
        upper_length: Expression,
        lower_length: Expression,
        middle: Expression,
        elbow: Expression,
    ) -> None:
        self.r, self.d = guide_point, direction
        self.lu, self.ll, self.sigma = upper_length, lower_length, elbow
        self.plane = plane_of(direction, plane_axis)
        self.zero = ca.mtimes(self.plane.T, zero_direction)
        self.middle = middle

    @abstractmethod
    def to_link_space(self, v: Expression) -> Expression:
        """Return a vector (3, K) as the link's space has it: as it is, or (2, K) in a plane."""

    @abstractmethod
    def plane_to_link_space(self, v: Expression) -> Expression:
        """Return a vector (2, K) of the crank's plane as (2, K) or (3, K) of the link's space."""

    @abstractmethod
    def height(self, w: Expression) -> Expression:
        """Return the distance of c from the crank's plane, m, 0 for a planar link; w = c - r."""

    @abstractmethod
    def last_link(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        at: CrankState,
        crank: Joint,
    ) -> tuple[BodyMotion, list[Joint], tuple[Expression, Expression] | None]:
        """Return the last link's motion, the joints after the crank, the link's angular motion."""

    def _triangle(self, w: Expression) -> tuple[Expression, Expression, Expression]:
        """Return u, h and lu^2 u.u - h^2 of the triangle of crank and last link, for w = c - r.

        The length of the last link is |w - l_u| = ll, so that u . l_u = h, u being in the plane.
        """
        u, link_space_w = ca.mtimes(self.plane.T, w), self.to_link_space(w)
        h = 0.5 * ca.dot(link_space_w, link_space_w) + 0.5 * (self.lu * self.lu - self.ll * self.ll)
        return u, h, self.lu * self.lu * ca.dot(u, u) - h * h

    def state(self, point: PointMotion) -> CrankState:
        """Return the vectors of crank and last link, and the crank's angular rate and acceleration.

        b . c' = (b . g) q'. Differentiated, (b . g) q'' = b . c'' + b' . b' - q'^2 b . g', whose
        last two terms are c' . c' + q' (q' h - 2 g . c').
        """
        w = point.position - self.r
        dw, ddw = self.to_link_space(point.velocity), self.to_link_space(point.acceleration)
        u, h, quarter = self._triangle(w)
        n2, root = ca.dot(u, u), ca.sqrt(quarter)
        l_u = (h / n2) * u + self.sigma * ((root / n2) * quarter_turn(u))
        g, b = quarter_turn(l_u), self.to_link_space(w) - self.plane_to_link_space(l_u)
        divisor = -self.sigma * root  # b . g
        rate = ca.dot(b, dw) / divisor
        du = ca.mtimes(self.plane.T, point.velocity)
        pull = ca.dot(b, ddw) + ca.dot(dw, dw)
        acceleration = (pull + rate * (rate * h - 2 * ca.dot(g, du))) / divisor
        return CrankState(l_u, g, b, divisor, rate, acceleration)

    def to_base_frame(self, v: Expression) -> Expression:
        """Return a vector of the last link's space in the base frame, (3, K)."""
        return v if v.shape[0] == 3 else ca.mtimes(self.plane, v)

    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        """Return the leg's motion, from the motion of its platform point and the rotation."""
        at = self.state(point)
        l_u, g, b = (self.to_base_frame(v) for v in (at.l_u, at.g, at.b))
        full, square = point_rows(b.T), at.rate * at.rate
        coordinate = self.middle + ca.atan2(
            ca.dot(at.l_u, quarter_turn(self.zero)), ca.dot(at.l_u, self.zero)
        )
        row = full / at.divisor
        x, y = l_u / self.lu, g / self.lu
        ddx, ddy = at.acceleration * y - square * x, -at.acceleration * x - square * y
        zero = ca.SX(3, 1)
        crank = BodyMotion(self.r, ca.SX(3, 6), zero, self.d, row, x, y, ddx, ddy)
        joint = Joint("R", self.d, self.r, row, at.rate, at.acceleration, "u", driven=True)
        last, joints, turning = self.last_link(point, rotation, at, joint)
        return LegMotion(
            coordinate,
            at.rate,
            at.acceleration,
            full,
            at.divisor,
            {"u": crank, "l": last},
            (joint, *joints),
            (l_u, b),
            ((at.rate, at.acceleration), turning),
            self.ll,
        )

    def exported_terms(self, point: PointMotion, rotation: RotationMotion) -> dict[str, Expression]:
        """Return intermediate quantities of the leg's equations by name, for exported code."""
        w, at = point.position - self.r, self.state(point)
        u, h, quarter = self._triangle(w)
        n2, root = ca.dot(u, u), ca.sqrt(quarter)
        crank = {"plane_u": at.l_u, "g": at.g, "along": h / n2, "across": root / n2}
        closing = {"w": w, "u": u, "n2": n2, "h": h, "quarter": quarter, "root": root}
        return {**closing, **crank, "theta_rate2": at.rate * at.rate}

    def reach(self, c: Expression) -> Reach:
        """Return the leg's reach margins from the distance of c to the crank's circle."""
        w = c - self.r
        u, _, quarter = self._triangle(w)
        near, far = (ca.sqrt(square) for square in self._distances(w))
        margin = ca.fmin(self.ll - near, far - self.ll)
        return Reach(margin, quarter, (self.lu * self.ll) ** 2, ca.sqrt(ca.dot(u, u)))

    def _distances(self, w: Expression) -> tuple[Expression, Expression]:
        """Return the squared least and greatest distance, m^2, of c from the crank's circle."""
        u, height = ca.mtimes(self.plane.T, w), self.height(w)
        n = ca.sqrt(ca.dot(u, u))
        return (n - self.lu) ** 2 + height**2, (n + self.lu) ** 2 + height**2

    def edges(self, c: Expression) -> dict[str, Expression]:
        """Return margins, m^2, by name: ll^2 to squared distances of c from the crank's circle."""
        near, far = self._distances(c - self.r)
        longest = self.ll * self.ll
        return {"stretched": longest - near, "folded": far - longest}

    def limit_margins(
        self, c: Expression, q: Expression, low: float, high: float
    ) -> dict[str, Expression]:
        """Return margins of the crank's limits, by name, not negative within; low, high in rad.

        They avoid the angle, which jumps at half a turn. Limits more than half a turn apart are one
        condition: the crank's distance from their middle.
        """
        w = c - self.r
        u, h, quarter = self._triangle(w)
        # n^2 l_u, without its division by n^2.
        crank = h * u + (self.sigma * ca.sqrt(quarter)) * quarter_turn(u)
        if high - low >= 2.0 * math.pi:
            return {}
        if high - low > math.pi:
            projection = ca.dot(crank, self._plane_direction_at(0.5 * (low + high)))
            least = self.lu * math.cos(0.5 * (high - low))
            return {"limits": projection - least * ca.dot(u, u)}
        return {
            "least": ca.dot(crank, quarter_turn(self._plane_direction_at(low))),
            "most": -ca.dot(crank, quarter_turn(self._plane_direction_at(high))),
        }

    def _plane_direction_at(self, q: Expression) -> Expression:
        """Return the crank's direction (2, 1) in its plane at an angle q, rad."""
        turn = q - self.middle
        return ca.cos(turn) * self.zero + ca.sin(turn) * quarter_turn(self.zero)

    def lever(self, length: Expression) -> Expression:
        """Return the crank's length, m per rad; `length` is ignored."""
        return self.lu

    def tip(self, q: Expression) -> Expression:
        """Return the position of the crank's end (3, 1), m, at an angle q, rad."""
        return self.r + self.lu * ca.mtimes(self.plane, self._plane_direction_at(q))

    def needs(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces that crank and last link require at joint and platform point.

        With eta = m gamma_x / ll, nu = m gamma_y / ll and mu = I / ll^2 of the last link, alpha =
        eta + mu, t the tip and z = d, the tip needs mu t'' - alpha c'' + eta g + nu z x (c'' - g);
        the platform point needs alpha (g - t'') - nu z x (t'' - g), besides a point mass m + eta +
        alpha. A rod has no m gamma_y.
        """
        at, upper, lower = self.state(point), inertia["u"], inertia["l"]
        lu2, weight = self.lu * self.lu, ca.mtimes(self.plane.T, gravity)
        eta, nu, mu = lower.hx / self.ll, lower.hy / self.ll, lower.i / (self.ll * self.ll)
        alpha = eta + mu
        ddu = ca.mtimes(self.plane.T, point.acceleration)
        # Gravity on the crank and, through the tip, on the last link: its moments on g = d x l_u.
        weight_along = ca.mtimes(weight, eta - upper.hx / self.lu)
        weight_across = ca.mtimes(quarter_turn(weight), upper.hy / self.lu)
        swing = ca.mtimes(ddu, alpha) - ca.mtimes(quarter_turn(ddu - weight), nu)
        joint = at.acceleration * (upper.i + mu * lu2) + ca.mtimes(
            at.g.T, weight_along + weight_across - swing
        )
        tip = ca.mtimes(at.g, at.acceleration * alpha) - ca.mtimes(at.l_u, at.rate**2 * alpha)
        force = ca.mtimes(self.to_link_space(gravity), alpha) - self.plane_to_link_space(tip)
        turned = quarter_turn(at.g * at.acceleration - at.l_u * at.rate**2 - weight)
        force = self.to_base_frame(force - self.plane_to_link_space(ca.mtimes(turned, nu)))
        return Needs(joint, force_wrench(force), lower.m + eta + alpha)
