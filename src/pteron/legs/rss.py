"""R-S-S legs, the Delta robot's: a crank whose end carries a rod between two ball joints.

Two parallel rods, which keep the platform from turning, count as one rod with the sum of both. The
joints of a rod are counted as universal ones (R-U-U): a rod's spin about itself moves nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import ClassVar, NamedTuple

import casadi as ca

from pteron.bodies.inertia import PlanarInertia, RodInertia
from pteron.bodies.motion import AngleMotion, BodyMotion, Expression, Moments, PointMotion
from pteron.bodies.vectors import Vector, cross, perpendicular, vertical
from pteron.legs.circles import (
    perpendicular_to,
    plane_of,
    quarter_turn,
    random_direction,
    random_fraction,
)
from pteron.legs.kind import CRANK, Key, LegKind, Quantity, ReachBound, Transfer
from pteron.legs.leg import Joint, LegEquations, LegMotion, Needs, Reach, Sphere
from pteron.legs.prrr import ELBOW
from pteron.legs.rods import rod_body, universal_joints


@dataclass(frozen=True)
class RSS(LegKind):
    """An R-S-S leg that carries one point of the platform.

    The crank turns about `direction` through `guide_point`; its angle is zero where it points along
    `zero_direction`, and positive by the right hand about `direction`.

    Parameters
    ----------
    guide_point : vector
        r, the centre of the crank's circle, m.
    direction : unit vector
        d, of the crank's axis.
    zero_direction : unit vector
        a, where the crank points at q = 0; perpendicular to `direction`.
    platform_point : vector
        s0, from P to the platform point, in the platform frame, m.
    upper_length, lower_length : float
        Lengths of the crank and of the rod, m.
    upper : PlanarInertia
        Inertia of the crank, about the origin on its axis, x towards the rod.
    lower : RodInertia
        Inertia of the rod, or the sum of parallel rods, about the platform end.
    elbow : {1, -1}
        sigma, the side of the elbow.
    limits : (float, float), optional
        Least and greatest crank angle, rad.
    rods : int
        How many parallel rods `lower` is the sum of.
    """

    guide_point: Vector
    direction: Vector
    zero_direction: Vector
    platform_point: Vector
    upper_length: float
    lower_length: float
    upper: PlanarInertia
    lower: RodInertia
    elbow: int = 1
    limits: tuple[float, float] | None = None
    rods: int = 2

    type = "RSS"
    joint = CRANK
    names: ClassVar = {"u": "crank", "l": "rod"}
    account = (
        "A crank turns about d through the guide point r; its angle theta is zero where it points "
        "along the zero direction, and counts by the right hand. A rod between two ball joints "
        "leads from its end to the platform point s0; parallel rods, which keep the platform from "
        "tilting, count as one with the sum of both."
    )

    keys: ClassVar = {
        "direction": Key("direction"),
        "zero_direction": Key("direction"),
        "upper_length": Key("length"),
        "lower_length": Key("length"),
        "rods": Key("count", default=2),
        "upper": Key("planar", "u"),
        "lower": Key("rod", "l"),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        zero = perpendicular(self.zero_direction, self.direction, "zero_direction", "direction")
        object.__setattr__(self, "zero_direction", zero)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        # The crank's angle is the one nearest to the middle of its limits, else in (-pi, pi].
        low, high = self.limits or (0.0, 0.0)
        inside = -math.pi < low and high <= math.pi
        middle = 0.0 if inside else 0.5 * (low + high)
        a, b = self.zero_direction, cross(self.direction, self.zero_direction)
        c, s = math.cos(middle), math.sin(middle)
        return (
            Quantity("guide_point", "point", self.guide_point),
            Quantity("direction", "direction", self.direction, "d"),
            Quantity(
                "zero_direction",
                "normal",
                a if inside else [c * x + s * y for x, y in zip(a, b, strict=True)],
            ),
            Quantity("plane_axis", "normal", perpendicular_to(self.direction)),
            Quantity("upper_length", "length", (self.upper_length,), "lu"),
            Quantity("lower_length", "length", (self.lower_length,), "ll"),
            Quantity("middle", "angle", (middle,)),
            Quantity("elbow", "sign", (self.elbow,)),
        )

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Parallel rods keep the bar at their ends along the crank's axis; one alone does not."""
        return (self.direction,) if self.rods > 1 else ((1, 0, 0), (0, 1, 0), (0, 0, 1))

    @property
    def joint_axis(self) -> Vector:
        return self.direction

    @property
    def lever(self) -> float:
        return self.upper_length

    @property
    def reach_bound(self) -> ReachBound:
        return ReachBound(self.guide_point, None, self.size)

    @property
    def reach_text(self) -> str:
        return (
            f"its rod of {self.lower_length:.4g} m starts from the circle of a crank of "
            f"{self.upper_length:.4g} m"
        )

    @property
    def extents(self) -> dict[str, tuple[str, float, float, str]]:
        return {
            "u": ("upper", 0.0, self.upper_length, "its axis and the rod"),
            "l": ("lower", -self.lower_length, 0.0, "crank and platform, where its x is zero"),
        }

    def transfers(self, gravity: Vector) -> tuple[Transfer, ...]:
        found = [
            Transfer("the crank{} turns about a fixed axis", {("m", "u"): (1, ())}),
            Transfer("crank and rod{} carry the joint between them", ELBOW),
        ]
        if vertical(self.direction, gravity):
            reason = "no gravity acts across the axis of the crank{}"
            found += [Transfer(reason, {(kind, "u"): (1, ())}) for kind in ("mgx", "mgy")]
        return tuple(found)

    @classmethod
    def closing(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int]:
        """Draw the directions of crank and rod: their sum is a platform point."""
        d, a = values["direction"], values["zero_direction"]
        b = cross(d, a)
        x, y = random_direction(values["upper_length"][0], rng)
        s, t = random_fraction(rng), random_fraction(rng)
        scale = values["lower_length"][0] / (1 + s * s + t * t)
        rx, ry, rz = 2 * s * scale, 2 * t * scale, (1 - s * s - t * t) * scale
        w = [(x + rx) * p + (y + ry) * q + rz * r for p, q, r in zip(a, b, d, strict=True)]
        # D = (l_u x b) . d has the sign of -sigma.
        return w, -1 if x * ry - y * rx > 0 else 1


class _Crank(NamedTuple):
    """What a leg does: w = c - r, and crank and rod."""

    l_u: Expression
    """The crank, (2, 1), in its plane; g = d x l_u."""
    g: Expression
    b: Expression
    """The rod, (3, 1)."""
    divisor: Expression
    """b . g."""
    rate: Expression
    acceleration: Expression


class RSSEquations(LegEquations):
    """The equations of an R-S-S leg.

    The crank moves in the plane perpendicular to d, and is written in its axes, as a two-vector;
    `plane` (3, 2) takes it to the base frame.
    """

    kinds: ClassVar = {"u": PlanarInertia.kinds, "l": RodInertia.kinds}
    rides: ClassVar = ("l",)

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
        self.lu, self.ll, self.middle, self.sigma = upper_length, lower_length, middle, elbow
        self.plane = plane_of(direction, plane_axis)
        self.zero = ca.mtimes(self.plane.T, zero_direction)

    def _triangle(self, w: Expression) -> tuple[Expression, Expression, Expression]:
        """Return u, w's part in the plane, h = l_u . w and lu^2 u . u - h^2, a quarter of Delta."""
        # |w - l_u| = ll
        u = ca.mtimes(self.plane.T, w)
        h = 0.5 * ca.dot(w, w) + 0.5 * (self.lu * self.lu - self.ll * self.ll)
        return u, h, self.lu * self.lu * ca.dot(u, u) - h * h

    def _state(self, point: PointMotion) -> _Crank:
        """Return crank and rod and how the crank moves.

        b . c' = (b . g) q'. Differentiated, (b . g) q'' = b . c'' + b' . b' - q'^2 b . g', whose
        last two terms are c' . c' + q' (q' h - 2 g . c').
        """
        w = point.position - self.r
        u, h, quarter = self._triangle(w)
        n2, root = ca.dot(u, u), ca.sqrt(quarter)
        l_u = (h / n2) * u + self.sigma * ((root / n2) * quarter_turn(u))
        g, b = quarter_turn(l_u), w - ca.mtimes(self.plane, l_u)
        divisor = -self.sigma * root  # b . g
        rate = ca.dot(b, point.velocity) / divisor
        du = ca.mtimes(self.plane.T, point.velocity)
        pull = ca.dot(b, point.acceleration) + ca.dot(point.velocity, point.velocity)
        acceleration = (pull + rate * (rate * h - 2 * ca.dot(g, du))) / divisor
        return _Crank(l_u, g, b, divisor, rate, acceleration)

    def motion(self, point: PointMotion, angle: AngleMotion | None) -> LegMotion:
        at = self._state(point)
        l_u, g = (ca.mtimes(self.plane, v) for v in (at.l_u, at.g))
        row, square = ca.horzcat(at.b.T, 0) / at.divisor, at.rate * at.rate
        coordinate = self.middle + ca.atan2(
            ca.dot(at.l_u, quarter_turn(self.zero)), ca.dot(at.l_u, self.zero)
        )
        x, y = l_u / self.lu, g / self.lu
        ddx, ddy = at.acceleration * y - square * x, -at.acceleration * x - square * y
        rest = ca.SX(3, 1)
        crank = BodyMotion(self.r, ca.SX(3, 4), rest, self.d, row, x, y, ddx, ddy)

        rides = ca.horzcat(ca.SX.eye(3), ca.SX(3, 1))
        swing = (rides - ca.mtimes(g, row)) / self.ll
        n = at.b / self.ll
        dn = (point.velocity - at.rate * g) / self.ll
        ddn = (point.acceleration - at.acceleration * g + square * l_u) / self.ll
        c = point.position
        rod = rod_body(point, n, ddn, swing)

        joint = Joint("R", self.d, self.r, row, at.rate, at.acceleration)
        chain = (joint, *universal_joints(self.d, self.r + l_u, c, swing, (n, dn, ddn), joint))
        return LegMotion(
            coordinate,
            at.rate,
            at.acceleration,
            ca.horzcat(at.b.T, 0),
            at.divisor,
            {"u": crank, "l": rod},
            chain,
            (l_u, at.b),
            ((at.rate, at.acceleration), None),
        )

    def named(self, point: PointMotion, angle: AngleMotion | None) -> dict[str, Expression]:
        w, at = point.position - self.r, self._state(point)
        u, h, quarter = self._triangle(w)
        n2, root = ca.dot(u, u), ca.sqrt(quarter)
        crank = {"plane_u": at.l_u, "g": at.g, "along": h / n2, "across": root / n2}
        closing = {"w": w, "u": u, "n2": n2, "h": h, "quarter": quarter, "root": root}
        return {**closing, **crank, "theta_rate2": at.rate * at.rate}

    def reach(self, c: Expression) -> Reach:
        w = c - self.r
        u, _, quarter = self._triangle(w)
        n, height = ca.sqrt(ca.dot(u, u)), ca.dot(w, self.d)
        # The least and greatest distance of c from the crank's circle.
        near, far = (ca.sqrt((n + side * self.lu) ** 2 + height**2) for side in (-1, 1))
        margin = ca.fmin(self.ll - near, far - self.ll)
        return Reach(margin, quarter, (self.lu * self.ll) ** 2, n)

    def locus(self, q: Expression) -> Sphere:
        turn = q - self.middle
        tip = ca.cos(turn) * self.zero + ca.sin(turn) * quarter_turn(self.zero)
        return Sphere(self.r + self.lu * ca.mtimes(self.plane, tip), self.ll)

    def needs(
        self,
        point: PointMotion,
        angle: AngleMotion | None,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces that crank and rod need: the rod's at its ends, the tip's on the crank.

        With eta = m gamma_x / ll, mu = I / ll^2 and alpha = eta + mu of the rod, b its vector and t
        the tip, the tip needs -alpha b'' - eta (t'' - g) and the platform point alpha b'' +
        (m + eta) (c'' - g): a mass m + eta + alpha that rides, and alpha (g - t'').
        """
        at, upper, lower = self._state(point), inertia["u"], inertia["l"]
        lu2, weight = self.lu * self.lu, ca.mtimes(self.plane.T, gravity)
        eta, mu = lower.hx / self.ll, lower.i / (self.ll * self.ll)
        alpha = eta + mu
        # What gravity does to the crank and, through the tip, to the rod: on g = d x l_u.
        along = ca.mtimes(weight, eta - upper.hx / self.lu)
        across = ca.mtimes(quarter_turn(weight), upper.hy / self.lu)
        swing = ca.mtimes(ca.mtimes(self.plane.T, point.acceleration), alpha)
        joint = at.acceleration * (upper.i + mu * lu2) + ca.mtimes(at.g.T, along + across - swing)
        tip = ca.mtimes(at.g, at.acceleration * alpha) - ca.mtimes(at.l_u, at.rate**2 * alpha)
        force = ca.mtimes(gravity, alpha) - ca.mtimes(self.plane, tip)
        return Needs(joint, ca.vertcat(force, ca.SX(1, alpha.shape[1])), lower.m + eta + alpha)


RSS.equations_class = RSSEquations
