"""R-P-R legs, of planar machines: a ram (P) between two revolute joints (R), driven in its middle.

The cylinder swings about the base joint, the piston ends at the platform point; both turn alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from random import Random
from typing import ClassVar, NamedTuple, Self

import casadi as ca

from pteron.bodies.inertia import PlanarInertia
from pteron.bodies.motion import Expression, Moments, PointMotion, RotationMotion, point_rows
from pteron.bodies.vectors import Vector, cross, vertical
from pteron.legs.circles import (
    first_moment,
    perpendicular_to,
    plane_of,
    quarter_turn,
    random_fraction,
    random_vector,
)
from pteron.legs.keys import ACCOUNTS, keys_of
from pteron.legs.kind import LegQuantity, LegTransfer
from pteron.legs.leg import CircleLocus, Joint, LegEquations, LegMotion, Needs, Reach, force_wrench
from pteron.legs.planar_links import LinkRotation, last_joints, link_body, lower_link_body
from pteron.legs.ram import RamLeg


@dataclass(frozen=True)
class RPR(RamLeg):
    """A planar R-P-R leg that carries one point of the platform.

    Its joint coordinate is the length of the ram, from `guide_point` to the platform point. The
    coordinates along `direction` do not count: the leg moves in a plane of its own.
    """

    upper: PlanarInertia
    lower: PlanarInertia

    type = "RPR"
    account = ACCOUNTS["RPR"]

    keys: ClassVar = keys_of("ram", "RPR")

    def with_platform_frame(self, frame: Sequence[Vector]) -> Self:
        """Return the leg with a missing `direction`, its plane's normal: the platform's z."""
        return self if self.direction is not None else replace(self, direction=frame[2])

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The leg's geometric quantities: point, plane directions and elbow."""
        d = self.plane_normal
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("direction", "direction", d, "d"),
            LegQuantity("plane_axis", "normal", perpendicular_to(d)),
            LegQuantity("elbow", "sign", (self.elbow,)),
        )

    @property
    def plane_normal(self) -> Vector:
        """The unit normal of the plane in which the ram turns."""
        assert self.direction is not None  # the manipulator has given it
        return self.direction

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return (normal,): the leg leaves the platform free to turn about its plane's normal."""
        return (self.plane_normal,)

    def transfers(self, gravity: Vector) -> tuple[LegTransfer, ...]:
        """Return how inertial parameters of cylinder and piston transfer to others, and why."""
        transfer_list = [
            LegTransfer("the cylinder{} turns about a fixed axis", {("m", "u"): (1, ())}),
            LegTransfer(
                "cylinder and piston{} turn alike", {("I", "u"): (1, ()), ("I", "l"): (-1, ())}
            ),
        ]
        if vertical(self.plane_normal, gravity):
            reason = "no gravity acts across the axis of the cylinder{}"
            transfer_list += [
                LegTransfer(reason, {(kind, "u"): (1, ())}) for kind in ("mgx", "mgy")
            ]
        return tuple(transfer_list)

    @classmethod
    def draw_closure(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int]:
        """Return a random rational ram vector (3,) in the leg's plane; 1 for the elbow's sign."""
        a, (x, y) = values["plane_axis"], random_vector(abs(random_fraction(rng)), 2, rng)
        b = cross(values["direction"], a)
        return [x * p + y * q for p, q in zip(a, b, strict=True)], 1


class _Ram(NamedTuple):
    """The ram in its plane."""

    w: Expression
    """c - r, (2, 1)."""
    length: Expression
    n: Expression
    """Its direction, (2, 1)."""
    rate: Expression
    """L'."""
    turning: LinkRotation
    growth: Expression
    """L''."""


class RPREquations(LegEquations):
    """The equations of an R-P-R leg: n along the ram, y = d x n, L its length."""

    kinds: ClassVar = {"u": PlanarInertia.kinds, "l": PlanarInertia.kinds}
    rides = ("l",)

    def __init__(
        self,
        guide_point: Expression,
        direction: Expression,
        plane_axis: Expression,
        elbow: Expression,
    ) -> None:
        self.r, self.d = guide_point, direction
        self.plane = plane_of(direction, plane_axis)

    def _ram(self, point: PointMotion) -> _Ram:
        """Return the ram's vector, length, rate, rotation and length acceleration at a motion.

        L' = n.c' and L theta' = y.c'. Differentiated, L'' = n.c'' + L theta'^2 and L theta'' =
        y.c'' - 2 L' theta'.
        """
        w = ca.mtimes(self.plane.T, point.position - self.r)
        dw, ddw = (ca.mtimes(self.plane.T, v) for v in (point.velocity, point.acceleration))
        length = ca.sqrt(ca.dot(w, w))
        n = w / length
        y = quarter_turn(n)
        rate, swing = ca.dot(n, dw), ca.dot(y, dw) / length
        row = point_rows(ca.mtimes(self.plane, y / length).T)
        turning = LinkRotation(row, swing, (ca.dot(y, ddw) - 2 * rate * swing) / length)
        return _Ram(w, length, n, rate, turning, ca.dot(n, ddw) + length * swing * swing)

    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        """Return the motion of cylinder, piston and their joints.

        The coordinate is the length L.
        """
        at = self._ram(point)
        n = ca.mtimes(self.plane, at.n)
        row, fixed = point_rows(n.T), (self.r, ca.SX(3, 6), ca.SX(3, 1))
        bodies = {
            "u": link_body(fixed, self.d, self.plane, at.n, at.turning),
            "l": lower_link_body(point, self.d, self.plane, at.n, at.turning),
        }
        chain = (
            Joint("R", self.d, self.r, *at.turning, "u"),
            Joint("P", n, self.r, row, at.rate, at.growth, "l", driven=True),
            *last_joints(self.d, point, at.turning, rotation),
        )
        links = None, ca.mtimes(self.plane, at.w)
        turns = ((at.turning.rate, at.turning.acceleration),) * 2
        unit = ca.SX(1)
        return LegMotion(
            at.length, at.rate, at.growth, row, unit, bodies, chain, links, turns, row_size=unit
        )

    def exported_terms(self, point: PointMotion, rotation: RotationMotion) -> dict[str, Expression]:
        """Return intermediate quantities of the ram by name, for exported code."""
        at = self._ram(point)
        return {"w": at.w, "length": at.length, "n": at.n, "theta_rate": at.turning.rate}

    def reach(self, c: Expression) -> Reach:
        """Return the reach margin: the ram's length, zero only with c at the guide point."""
        w = ca.mtimes(self.plane.T, c - self.r)
        square = ca.dot(w, w)
        length = ca.sqrt(square)
        return Reach(length, square, square, length)

    def locus(self, q: Expression) -> CircleLocus:
        """Return the circle of platform point c while the ram's length is q, m."""
        return CircleLocus(self.r, q)

    def needs(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces that cylinder and piston require, all at the platform point.

        With h and dh = d x h their first moments, the force is h_l'' of the piston plus y / L times
        (I_u + I_l) theta'' - g.dh_u + (c'' - g).dh_l, besides a point mass at the platform point.
        """
        at, upper, lower = self._ram(point), inertia["u"], inertia["l"]
        ddc, weight = (ca.mtimes(self.plane.T, v) for v in (point.acceleration, gravity))
        swing, growth = at.turning.rate, at.turning.acceleration
        _, dh_upper = first_moment(at.n, upper.hx, upper.hy)
        h, dh = first_moment(at.n, lower.hx, lower.hy)
        moment = growth * (upper.i + lower.i) - ca.mtimes(weight.T, dh_upper)
        moment += ca.mtimes((ddc - weight).T, dh)
        force = growth * dh - swing * swing * h + ca.mtimes(quarter_turn(at.n) / at.length, moment)
        return Needs(ca.SX(1, force.shape[1]), force_wrench(ca.mtimes(self.plane, force)), lower.m)


RPR.equations_class = RPREquations
