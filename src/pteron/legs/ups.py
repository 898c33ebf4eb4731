"""U-P-S legs, the hexapod's: a ram (P) from a universal joint (U) on the base to a ball joint (S).

The cylinder swings about the base joint, the piston ends at the platform point; both are rods, of
which the spin about their axis has no inertia.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from random import Random
from typing import ClassVar, NamedTuple, Self

import casadi as ca

from pteron.bodies.inertia import RodInertia
from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    Moments,
    PointMotion,
    RotationMotion,
    point_rows,
)
from pteron.bodies.vectors import Vector, dot
from pteron.legs.circles import random_fraction, random_vector
from pteron.legs.cones import Cone, cone_limit
from pteron.legs.keys import ACCOUNTS, keys_of
from pteron.legs.kind import LegQuantity, LegTransfer
from pteron.legs.leg import (
    Joint,
    LegEquations,
    LegMotion,
    Needs,
    Passive,
    Reach,
    SphereLocus,
    force_wrench,
)
from pteron.legs.ram import RamLeg
from pteron.legs.rods import rod_body, universal_joints


@dataclass(frozen=True)
class UniversalRamLeg(RamLeg):
    """The data of a ram that swings about a universal joint on the base."""

    upper: RodInertia
    lower: RodInertia

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The leg's geometric quantities: guide point, first joint axis and elbow."""
        assert self.direction is not None  # the manipulator has given it
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("direction", "normal", self.direction),
            LegQuantity("elbow", "sign", (self.elbow,)),
        )

    @property
    def base_axis(self) -> Vector | None:
        """The first axis of the universal joint on the base, a unit vector."""
        return self.direction

    def transfers(self, gravity: Vector) -> tuple[LegTransfer, ...]:
        """Return how inertial parameters of cylinder and piston transfer to others, and why."""
        return (
            LegTransfer("the cylinder{} turns about a fixed point", {("m", "u"): (1, ())}),
            LegTransfer(
                "cylinder and piston{} turn alike", {("I", "u"): (1, ()), ("I", "l"): (-1, ())}
            ),
        )

    @classmethod
    def draw_closure(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int]:
        """Return a random rational ram vector (3,), and 1 for the elbow's sign."""
        return random_vector(abs(random_fraction(rng)), 3, rng), 1


@dataclass(frozen=True)
class UPS(UniversalRamLeg):
    """A U-P-S leg that carries one point of the platform.

    Its joint coordinate is the length of the ram, from `guide_point` to the platform point.
    """

    base_cone: Cone | None = None
    platform_cone: Cone | None = None
    screw_lead: float | None = None

    type = "UPS"
    base_cones: ClassVar = ("base_cone",)
    account = ACCOUNTS["UPS"]

    keys: ClassVar = keys_of("ram", "universal_ram", "UPS")

    def with_platform_frame(self, frame: Sequence[Vector]) -> Self:
        """Return the leg with a missing `direction` set to the platform's x or y across the ram."""
        if self.direction is not None:
            return self
        way = [a - b for a, b in zip(self.platform_point, self.guide_point, strict=True)]
        x, y, _ = frame
        leans = abs(dot(x, (way[0], way[1], way[2]))) > abs(dot(y, (way[0], way[1], way[2])))
        return replace(self, direction=y if leans else x)

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return three axes: the ball joint leaves every rotation of the platform free."""
        return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the joints at the ram's two ends that have limit cones."""
        (_, way), length = motion.links, self.limits[1]
        assert way is not None
        return [
            *cone_limit("ram at the base", self.base_cone, ca.SX.eye(3), way, length),
            *cone_limit("ram at the platform", self.platform_cone, axes, -way, length),
        ]

    def rod_couple(self, motion: LegMotion) -> Expression:
        """Return a zero couple (3, 1): a ram transmits a force along itself alone."""
        return ca.SX(3, 1)


class _Ram(NamedTuple):
    """The ram in motion: its length L and its direction n, to second order."""

    length: Expression
    rate: Expression
    growth: Expression
    n: Expression
    dn: Expression
    ddn: Expression
    swing: Expression
    """(3, 6): the row of n'."""


class UPSEquations(LegEquations):
    """The equations of a U-P-S leg: n along the ram, L its length."""

    kinds: ClassVar = {"u": RodInertia.kinds, "l": RodInertia.kinds}
    rides = ("l",)

    def __init__(self, guide_point: Expression, direction: Expression, elbow: Expression) -> None:
        self.r, self.d = guide_point, direction

    def change_frame(self, axes: Expression, origin: Expression) -> UPSEquations:
        """Return the leg's equations in axes, the columns of (3, 3), about an origin (3, 1)."""
        guide = ca.mtimes(axes.T, self.r) - ca.mtimes(axes.T, origin)
        return UPSEquations(guide, ca.mtimes(axes.T, self.d), ca.SX(1))

    def _ram(self, point: PointMotion) -> _Ram:
        """Return the ram's length and unit vector, and their first two time derivatives.

        L' = n.c' and L n' = c' - L' n; differentiated, L'' = n.c'' + L n'.n' and L n'' = c'' - L''
        n - 2 L' n'.
        """
        w = point.position - self.r
        length = ca.sqrt(ca.dot(w, w))
        n = w * (1 / length)
        rate = ca.dot(n, point.velocity)
        dn = (point.velocity - rate * n) / length
        growth = ca.dot(n, point.acceleration) + length * ca.dot(dn, dn)
        ddn = (point.acceleration - growth * n - 2 * rate * dn) / length
        swing = point_rows((ca.SX.eye(3) - ca.mtimes(n, n.T)) / length)
        return _Ram(length, rate, growth, n, dn, ddn, swing)

    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        """Return the motion of cylinder, piston and their joints.

        The coordinate is the length L.
        """
        at = self._ram(point)
        row, unit = point_rows(at.n.T), ca.SX(1)
        turning = ca.mtimes(ca.skew(at.n), at.swing)
        fixed = self.r, ca.SX(3, 6), ca.SX(3, 1)
        bodies = {
            "u": BodyMotion(*fixed, ca.SX.eye(3), turning, at.n, ddx=at.ddn),
            "l": rod_body(point, at.n, at.ddn, at.swing),
        }
        directions = at.n, at.dn, at.ddn
        joints = universal_joints(self.d, self.r, point, at.swing, directions, rotation, body="u")
        ram = Joint("P", at.n, self.r, row, at.rate, at.growth, "l", driven=True)
        chain = (*joints[:2], ram, *joints[2:])
        links = None, point.position - self.r
        return LegMotion(
            at.length, at.rate, at.growth, row, unit, bodies, chain, links, row_size=unit
        )

    def exported_terms(self, point: PointMotion, rotation: RotationMotion) -> dict[str, Expression]:
        """Return intermediate quantities of the ram by name, for exported code."""
        at = self._ram(point)
        return {"w": point.position - self.r, "length": at.length, "n": at.n, "dn": at.dn}

    def reach(self, c: Expression) -> Reach:
        """Return the reach margin: the ram's length, zero only with c at the guide point."""
        w = c - self.r
        square = ca.dot(w, w)
        length = ca.sqrt(square)
        return Reach(length, square, square, length)

    def locus(self, q: Expression) -> SphereLocus:
        """Return the sphere of platform point c while the ram's length is q, m."""
        return SphereLocus(self.r, q)

    def needs(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces that cylinder and piston require, axial ones at the joint.

        With P_n = 1 - n n^T, besides a point mass at the platform point, the force is m gamma_l n''
        + P_n ((I_u + I_l) n'' - m gamma_u g + m gamma_l (c'' - g)) / L. As P_n n'' = P_n (c'' - 2
        L'/L c') / L, it is P_n x - m gamma_l (n'.n') n, where x depends on c'', c' and g alone; the
        ram itself bears the component of x along n.
        """
        w, inverse = point.position - self.r, 1 / ca.norm_2(point.position - self.r)
        upper, lower, n = inertia["u"], inertia["l"], w * inverse
        rate = ca.dot(n, point.velocity)
        swing = (ca.dot(point.velocity, point.velocity) - rate * rate) * inverse * inverse
        growth = (lower.hx + (upper.i + lower.i) * inverse) * inverse
        x = ca.mtimes(point.acceleration, growth + lower.hx * inverse)
        x -= ca.mtimes(point.velocity, (2 * rate * inverse) * growth)
        x -= ca.mtimes(gravity, (upper.hx + lower.hx) * inverse)
        return Needs(-ca.mtimes(n.T, x) - swing * lower.hx, force_wrench(x), lower.m)


UPS.equations_class = UPSEquations
