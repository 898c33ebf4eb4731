"""R-P-U-R legs of five-axis machines: a ram about a, a universal joint, a link about b.

a is the platform's first axis, fixed in the base, b its second. The ram is across a.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import casadi as ca

from pteron.bodies.inertia import PlanarInertia, SpatialInertia
from pteron.bodies.motion import BodyMotion, Expression, PointMotion, RotationMotion
from pteron.bodies.vectors import Vector
from pteron.legs.drive import Drive
from pteron.legs.keys import ACCOUNTS, keys_of
from pteron.legs.kind import LegQuantity, ReachBound
from pteron.legs.leg import Joint, LegMotion
from pteron.legs.planar_links import LinkRotation
from pteron.legs.ram import RamLeg
from pteron.legs.reading import Reading
from pteron.legs.universal_link import (
    TINY,
    NestedClosure,
    Root,
    UniversalLinkEquations,
    UniversalLinkLeg,
)


@dataclass(frozen=True)
class RPUR(UniversalLinkLeg, RamLeg):
    """An R-P-U-R leg under a 3T2R platform.

    Its joint coordinate is the length of the ram, from `guide_point` to the universal joint, from
    which the lower link leads to the platform point, across the platform's second axis b.
    """

    guide_point: Vector
    platform_point: Vector
    upper: PlanarInertia
    lower: SpatialInertia
    limits: tuple[float, float]
    lower_length: float = field(kw_only=True)
    piston: PlanarInertia = field(kw_only=True)
    elbow: int = 1
    fixed_offset: Vector = (0.0, 0.0, 0.0)
    drive: Drive | None = None
    reading: Reading | None = field(default=None, kw_only=True)
    direction: None = field(default=None, init=False)
    second_elbow: int = field(default=1, kw_only=True)
    platform_axes: tuple[Vector, ...] = field(default=(), kw_only=True)

    type = "RPUR"
    sign_edges: ClassVar = {"second_elbow": ("lower link",)}
    account = ACCOUNTS["RPUR"]
    names: ClassVar = {"u": "cylinder", "t": "piston", "l": "lower link"}
    measure_text = "the cosine between the ram and the force that its joints transmit"
    singular_text = "the force that its joints transmit is at a right angle to its ram"

    keys: ClassVar = keys_of("ram", "universal_link", "RPUR")

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The leg's geometric quantities: point, link length and elbows."""
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("lower_length", "length", (self.lower_length,), "ll"),
            LegQuantity("elbow", "sign", (self.elbow,)),
            LegQuantity("second_elbow", "sign", (self.second_elbow,)),
        )

    @property
    def base_axis(self) -> Vector:
        """The axis a of the joint on the base, a unit vector."""
        return self.platform_axes[0]

    @property
    def size(self) -> float:
        """The greatest length of ram and lower link together, m."""
        return self.limits[1] + self.lower_length

    @property
    def reach_bound(self) -> ReachBound:
        """A ball about the guide point that holds all platform points in reach, m."""
        return ReachBound(self.guide_point, None, self.size)

    @property
    def reach_text(self) -> str:
        """The lower link's length, as a clause for messages."""
        return (
            f"its lower link of {self.lower_length:.4g} m does not reach the plane of its ram, or "
            "its ram has no length"
        )

    @property
    def extents(self) -> dict[str, tuple[str, float, float, str]]:
        """The range of x, m, where cylinder, piston and link usually have their centres of mass."""
        ram, ends = super().extents, "the universal joint and the platform point"
        _, low, high, _ = ram["l"]
        piston = "piston", low, high, "the shortest ram's beginning and the universal joint"
        return {"u": ram["u"], "t": piston, "l": ("lower", -self.lower_length, 0.0, ends)}


class RPUREquations(UniversalLinkEquations):
    """The equations of an R-P-U-R leg."""

    kinds: ClassVar = {
        "u": PlanarInertia.kinds,
        "t": PlanarInertia.kinds,
        "l": SpatialInertia.kinds,
    }

    def first_end(self, q: Expression) -> tuple[Expression, Expression]:
        """Return where the ram begins (3, 1), and its length."""
        return self.r, q

    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        """Return the motion of cylinder, piston, link and joints."""
        leg = self.with_rotation(rotation)
        w, _, n = leg.vectors(point, rotation)
        at = leg.link_across(w, n)
        v = w - at.link
        q = ca.sqrt(ca.dot(v.value, v.value))
        x = v.value / q
        y = ca.cross(leg.a, x)
        rate, swing = ca.dot(x, v.rate), ca.dot(y, v.rate) / q
        growth = ca.dot(x, v.acceleration) + q * swing * swing
        spin = (ca.dot(y, v.acceleration) - 2 * rate * swing) / q
        turning = LinkRotation(ca.mtimes(y.T, v.row) / q, swing, spin)
        f, row = leg.force(v.value, at.link.value)
        divisor = ca.dot(f, x)
        joint_row = row / divisor
        axes = x, y, spin * y - swing * swing * x, -spin * x - swing * swing * y
        center = self.r + v.value
        lower, joints = leg.last_parts(point, rotation, at, turning)
        bodies = {
            "u": BodyMotion(self.r, ca.SX(3, 6), ca.SX(3, 1), leg.a, turning.row, *axes),
            "t": BodyMotion(center, v.row, v.acceleration, leg.a, turning.row, *axes),
            "l": lower,
        }
        chain = (
            Joint("R", leg.a, self.r, *turning, "u"),
            Joint("P", x, self.r, joint_row, rate, growth, "t", driven=True),
            *joints,
        )
        turns = ((swing, spin), None)
        links = v.value, at.link.value
        return LegMotion(q, rate, growth, row, divisor, bodies, chain, links, turns)

    def closure(self, c: Expression, root: Root) -> NestedClosure:
        """Return what the reach of c (3, 1) depends on; `root` returns a number's square root."""
        w, n = c - self.r, ca.cross(self.a, self.b)
        h = ca.dot(self.a, w)
        inner = self.ll * self.ll - h * h
        m = self.kappa * root(inner)
        v = w - h * self.a - m * n
        outer = ca.dot(v, v)
        share = m * m * outer
        margin = ca.fmin(self.ll - ca.fabs(h), root(outer))
        size = ca.fmax((h * ca.dot(v, n)) ** 2 + share, TINY)
        return NestedClosure((inner, outer), margin, share / size)


RPUR.equations_class = RPUREquations
