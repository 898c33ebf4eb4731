"""R-S-S legs, the Delta robot's: a crank whose end carries a rod between two ball joints.

Two parallel rods, which keep the platform from turning, count as one rod with the sum of both. The
joints of a rod are counted as universal ones (R-U-U): a rod's spin about itself moves nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from random import Random
from typing import Any, ClassVar, NamedTuple

import casadi as ca

from pteron.bodies.inertia import Inertia, PlanarInertia, RodInertia
from pteron.bodies.motion import AngleMotion, BodyMotion, Expression, Moments, PointMotion
from pteron.bodies.vectors import (
    Vector,
    cross,
    norm,
    parallel,
    perpendicular,
    positive,
    scaled,
    unit_vector,
    vector,
)
from pteron.legs.circles import random_direction, random_fraction
from pteron.legs.leg import (
    CRANK,
    Joint,
    LegEquations,
    LegKind,
    LegMotion,
    Needs,
    Quantity,
    Reach,
    ReachBound,
    Sphere,
    Transfer,
    checked_elbow,
    checked_limits,
)
from pteron.legs.prrr import ELBOW


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

    def __post_init__(self) -> None:
        direction = unit_vector(self.direction, "direction")
        checked = {
            "guide_point": vector(self.guide_point, "guide_point"),
            "direction": direction,
            "zero_direction": perpendicular(
                unit_vector(self.zero_direction, "zero_direction"),
                direction,
                "zero_direction",
                "direction",
            ),
            "platform_point": vector(self.platform_point, "platform_point"),
            "upper_length": positive(self.upper_length, "upper_length", "m"),
            "lower_length": positive(self.lower_length, "lower_length", "m"),
            "elbow": checked_elbow(self.elbow),
            "limits": checked_limits(self.limits, "rad"),
        }
        for key, value in checked.items():
            object.__setattr__(self, key, value)

    @property
    def bodies(self) -> dict[str, Inertia]:
        return {"u": self.upper, "l": self.lower}

    def with_bodies(self, bodies: Mapping[str, Any]) -> RSS:
        return replace(self, upper=bodies["u"], lower=bodies["l"])

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
            Quantity("direction", "direction", self.direction),
            Quantity(
                "zero_direction",
                "normal",
                a if inside else [c * x + s * y for x, y in zip(a, b, strict=True)],
            ),
            Quantity("upper_length", "length", (self.upper_length,), "lu"),
            Quantity("lower_length", "length", (self.lower_length,), "ll"),
            Quantity("middle", "angle", (middle,)),
            Quantity("elbow", "sign", (self.elbow,)),
        )

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Parallel rods keep the bar at their ends parallel to the crank's axis; one rod nothing."""
        return (self.direction,) if self.rods > 1 else ((1, 0, 0), (0, 1, 0), (0, 0, 1))

    @property
    def reach_bound(self) -> ReachBound:
        return ReachBound(self.guide_point, None, self.size)

    @property
    def reach_text(self) -> str:
        return (
            f"its rod of {self.lower_length:.4g} m starts from the circle of a crank of "
            f"{self.upper_length:.4g} m"
        )

    @classmethod
    def table(cls) -> dict[str, Any]:
        from pteron.bodies import tables

        return {
            "direction": (tables.Three, ...),
            "zero_direction": (tables.Three, ...),
            "upper_length": (tables.Number, ...),
            "lower_length": (tables.Number, ...),
            "rods": (tables.Count, 2),
            "upper": (tables.PlanarBody, ...),
            "lower": (tables.RodBody, ...),
        }

    @classmethod
    def of_table(cls, table: Any) -> RSS:
        return cls(
            guide_point=table.guide_point,
            direction=table.direction,
            zero_direction=table.zero_direction,
            platform_point=table.platform_point,
            upper_length=table.upper_length,
            lower_length=table.lower_length,
            upper=table.upper.inertia_of("upper"),
            lower=table.lower.inertia_of("lower"),
            elbow=table.elbow,
            limits=table.limits,
            rods=table.rods,
        )

    def as_table(self) -> dict[str, Any]:
        return {
            "direction": self.direction,
            "zero_direction": self.zero_direction,
            "upper_length": self.upper_length,
            "lower_length": self.lower_length,
            "rods": self.rods,
            "upper": self.upper,
            "lower": self.lower,
        }

    def transfers(self, gravity: Vector) -> tuple[Transfer, ...]:
        found = [
            Transfer("the crank{} turns about a fixed axis", {("m", "u"): (1, ())}),
            Transfer("crank and rod{} carry the joint between them", ELBOW),
        ]
        size = norm(gravity)
        if size == 0.0 or parallel(self.direction, scaled(gravity, 1.0 / size)):
            reason = "no gravity acts across the axis of the crank{}"
            found += [Transfer(reason, {(kind, "u"): (1, ())}) for kind in ("mgx", "mgy")]
        return tuple(found)

    @classmethod
    def closing(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int]:
        """Draw the directions of crank and rod: their sum is a platform point."""
        d, a = values["direction"], values["zero_direction"]
        b = [d[1] * a[2] - d[2] * a[1], d[2] * a[0] - d[0] * a[2], d[0] * a[1] - d[1] * a[0]]
        x, y = random_direction(values["upper_length"][0], rng)
        s, t = random_fraction(rng), random_fraction(rng)
        scale = values["lower_length"][0] / (1 + s * s + t * t)
        rx, ry, rz = 2 * s * scale, 2 * t * scale, (1 - s * s - t * t) * scale
        w = [(x + rx) * p + (y + ry) * q + rz * r for p, q, r in zip(a, b, d, strict=True)]
        # D = (l_u x b) . d has the sign of -sigma.
        return w, -1 if x * ry - y * rx > 0 else 1


class RSSEquations(LegEquations):
    """The equations of an R-S-S leg, in the base frame."""

    kinds: ClassVar = {"u": PlanarInertia.kinds, "l": RodInertia.kinds}

    def __init__(
        self,
        guide_point: Expression,
        direction: Expression,
        zero_direction: Expression,
        upper_length: Expression,
        lower_length: Expression,
        middle: Expression,
        elbow: Expression,
    ) -> None:
        self.r, self.d, self.a = guide_point, direction, zero_direction
        self.lu, self.ll, self.middle, self.sigma = upper_length, lower_length, middle, elbow

    def _crank(self, c: Expression) -> tuple[Expression, Expression, Expression]:
        """Return w = c - r, the crank l_u, and the root of Delta: Lemma 1 across the crank's axis.

        l_u = [A w_p + sigma sqrt(Delta) d x w] / (2 n^2) with A = w.w + lu^2 - ll^2 = 2 w.l_u,
        Delta = 4 n^2 lu^2 - A^2 and w_p the part of w across d, n = |w_p|.
        """
        w = c - self.r
        height, w2 = ca.dot(w, self.d), ca.dot(w, w)
        n2 = w2 - height * height
        twice = w2 + (self.lu * self.lu - self.ll * self.ll)
        root = ca.sqrt(self._discriminant(w))
        l_u = (twice * (w - height * self.d) + self.sigma * root * ca.cross(self.d, w)) / (2 * n2)
        return w, l_u, root

    def _discriminant(self, w: Expression) -> Expression:
        height, w2 = ca.dot(w, self.d), ca.dot(w, w)
        twice = w2 + (self.lu * self.lu - self.ll * self.ll)
        return 4 * (self.lu * self.lu) * (w2 - height * height) - twice * twice

    def _state(self, point: PointMotion) -> _Crank:
        """Return crank and rod and their motion.

        b.c'  = (b.g) q' with g = d x l_u; differentiated, (b.g) q'' = b.c'' + b'.b' + q'^2 b.l_u.
        """
        w, l_u, root = self._crank(point.position)
        g, b = ca.cross(self.d, l_u), w - l_u
        divisor = -0.5 * self.sigma * root  # b.g
        rate = ca.dot(b, point.velocity) / divisor
        db = point.velocity - rate * g
        pull = ca.dot(b, point.acceleration) + ca.dot(db, db) + rate * rate * ca.dot(b, l_u)
        acceleration = pull / divisor
        ddb = point.acceleration - (acceleration * g - (rate * rate) * l_u)
        return _Crank(l_u, g, b, divisor, rate, acceleration, db, ddb)

    def motion(self, point: PointMotion, angle: AngleMotion | None) -> LegMotion:
        at = self._state(point)
        c = point.position
        row = ca.horzcat(at.b.T, 0)
        swing = ca.horzcat(ca.SX.eye(3), ca.SX(3, 1)) - ca.mtimes(at.g, row / at.divisor)
        coordinate = self.middle + ca.atan2(ca.dot(at.l_u, ca.cross(self.d, self.a)), ca.dot(at.l_u, self.a))
        square = at.rate * at.rate
        x, y = at.l_u / self.lu, at.g / self.lu
        n, dn, ddn = at.b / self.ll, at.db / self.ll, at.ddb / self.ll
        bodies = {
            "u": BodyMotion(
                self.r,
                ca.SX(3, 4),
                ca.SX(3, 1),
                ca.mtimes(self.d, row / at.divisor),
                x,
                y,
                at.acceleration * y - square * x,
                -at.acceleration * x - square * y,
            ),
            "l": BodyMotion(
                c,
                ca.horzcat(ca.SX.eye(3), ca.SX(3, 1)),
                point.acceleration,
                ca.mtimes(ca.skew(n), swing / self.ll),
                n,
                ddx=ddn,
                rides=True,
            ),
        }
        crank = Joint("R", self.d, self.r, row / at.divisor, at.rate, at.acceleration)
        chain = (crank, *self._universal(crank, at, c, swing / self.ll, (n, dn, ddn)))
        upper = (at.rate, at.acceleration)
        return LegMotion(
            coordinate,
            at.rate,
            at.acceleration,
            row,
            at.divisor,
            bodies,
            chain,
            (at.l_u, at.b),
            (upper, None),
        )

    def _universal(
        self,
        crank: Joint,
        at: _Crank,
        c: Expression,
        swing: Expression,
        direction: tuple[Expression, Expression, Expression],
    ) -> list[Joint]:
        """Return the universal joints at the rod's ends: about d, and about d x n across it.

        With n' = omega x n and omega = alpha' d + beta' e, e = d x n / |d x n|: alpha' = n'.(d x n)
        / |d x n|^2 and beta' = - n'.d / |d x n|. The bar at the platform does not turn.
        """
        n, dn, ddn = direction
        across, turning = ca.cross(self.d, n), ca.cross(self.d, dn)
        square = ca.dot(across, across)
        size, growth = ca.sqrt(square), ca.dot(across, turning) / square
        alpha, beta = ca.dot(dn, across) / square, -ca.dot(dn, self.d) / size
        about_d = (
            ca.mtimes(across.T, swing) / square,
            alpha,
            ca.dot(ddn, across) / square - 2 * alpha * growth,
        )
        about_e = (
            -ca.mtimes(self.d.T, swing) / size,
            beta,
            -ca.dot(ddn, self.d) / size - beta * growth,
        )
        tip, axis = self.r + at.l_u, across / size
        knee = tuple(a - b for a, b in zip(about_d, crank[3:], strict=True))
        return [
            Joint("R", self.d, tip, *knee),
            Joint("R", axis, tip, *about_e),
            Joint("R", axis, c, *(-a for a in about_e)),
            Joint("R", self.d, c, *(-a for a in about_d)),
        ]

    def reach(self, c: Expression) -> Reach:
        w = c - self.r
        height = ca.dot(w, self.d)
        n = ca.sqrt(ca.dot(w, w) - height * height)
        # The least and greatest distance of c from the crank's circle.
        near, far = (ca.sqrt((n + side * self.lu) ** 2 + height**2) for side in (-1, 1))
        delta = self._discriminant(w)
        margin = ca.fmin(self.ll - near, far - self.ll)
        return Reach(margin, delta, (2 * self.lu * self.ll) ** 2, n)

    def locus(self, q: Expression) -> Sphere:
        turn = q - self.middle
        across = ca.cross(self.d, self.a)
        return Sphere(
            self.r + self.lu * (ca.cos(turn) * self.a + ca.sin(turn) * across), self.ll
        )

    def needs(
        self,
        point: PointMotion,
        angle: AngleMotion | None,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces that crank and rod need: the rod's at its ends, the tip's on the crank.

        With eta = m gamma_x / ll and mu = I / ll^2 of the rod and b its vector, the platform point
        needs m (c'' - g) + eta (c'' - g + b'') + mu b'', the tip -eta (c'' - g) - mu b''.
        """
        at, upper, lower = self._state(point), inertia["u"], inertia["l"]
        eta, mu = lower.hx / self.ll, lower.i / (self.ll * self.ll)
        a_g = point.acceleration - gravity
        swing = ca.mtimes(at.ddb, mu) + ca.mtimes(a_g, eta)
        on_point = ca.mtimes(a_g, lower.m) + swing + ca.mtimes(at.ddb, eta)
        weight = ca.cross(gravity, self.d) / self.lu
        torque = (
            at.acceleration * upper.i
            - ca.dot(at.l_u, weight) * upper.hx
            - ca.dot(at.g, weight) * upper.hy
        )
        joint = torque - ca.mtimes(at.g.T, swing)
        return Needs(joint, ca.vertcat(on_point, ca.SX(1, upper.m.shape[1])))


class _Crank(NamedTuple):
    """The crank l_u, g = d x l_u, the rod b, b.g; q', q'', b' and b''."""

    l_u: Expression
    g: Expression
    b: Expression
    divisor: Expression
    rate: Expression
    acceleration: Expression
    db: Expression
    ddb: Expression


RSS.equations_class = RSSEquations
