"""P-R-U-R legs, the Pentapteron's: a slider, a link about a, a universal joint, a link about b.

a is the platform's first axis, fixed in the base, b its second. The slider moves across a or along
it; for any other direction its coordinate is the root of an equation of degree four.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import acos, degrees
from typing import Any, ClassVar, Self

import casadi as ca

from pteron.bodies.inertia import PlanarInertia, PointMass, SpatialInertia
from pteron.bodies.motion import BodyMotion, Expression, PointMotion, RotationMotion
from pteron.bodies.vectors import (
    UNIT_TOLERANCE,
    Vector,
    dot,
    norm,
    perpendicular,
    scale_vector,
    shift_point,
)
from pteron.errors import ModelError
from pteron.legs.drive import Drive
from pteron.legs.jets import Jet
from pteron.legs.keys import ACCOUNTS, keys_of
from pteron.legs.kind import SLIDER, LegQuantity, ReachBound
from pteron.legs.leg import Joint, LegMotion
from pteron.legs.reading import Reading
from pteron.legs.universal_link import (
    TINY,
    HeldClosure,
    LinkState,
    NestedClosure,
    Root,
    UniversalLinkEquations,
    UniversalLinkLeg,
    turn_about,
)


@dataclass(frozen=True)
class PRUR(UniversalLinkLeg):
    """A P-R-U-R leg under a 3T2R platform.

    The upper link leads from the slider to the universal joint, across the platform's first axis a;
    the lower link from there to the platform point, across its second axis b.
    """

    guide_point: Vector
    slider_direction: Vector
    platform_point: Vector
    upper_length: float
    lower_length: float
    slider_mass: float
    upper: PlanarInertia
    lower: SpatialInertia
    elbow: int = 1
    second_elbow: int = 1
    limits: tuple[float, float] | None = None
    fixed_offset: Vector = (0.0, 0.0, 0.0)
    drive: Drive | None = None
    reading: Reading | None = field(default=None, kw_only=True)
    platform_axes: tuple[Vector, ...] = ()
    slides_along_axis: bool = False
    """Whether the slider moves along a, and not across it; the manipulator sets it."""

    type = "PRUR"
    sign_edges: ClassVar = {"elbow": ("upper link",), "second_elbow": ("lower link",)}
    joint = SLIDER
    account = ACCOUNTS["PRUR"]
    measure_text = "the cosine between the slider and the force that its joints transmit"
    singular_text = "the force that its joints transmit is at a right angle to its guide"

    keys: ClassVar = keys_of("slider", "universal_link", "PRUR")

    def with_platform_rotation(self, axes: Sequence[Vector], center: Vector | None) -> Self:
        """Return the leg with its platform's axes, its guide exactly across a or along it."""
        leg = super().with_platform_rotation(axes, center)
        a, e = axes[0], self.slider_direction
        share = dot(a, e)
        normal_part = shift_point(e, a, -share)
        if abs(share) <= UNIT_TOLERANCE:
            exact = perpendicular(e, a, "slider_direction", "axis")
        elif norm(normal_part) <= UNIT_TOLERANCE:
            exact = scale_vector(a, 1.0 if share > 0.0 else -1.0)
        else:
            raise ModelError(
                f"slider_direction: {list(e)} is {degrees(acos(abs(share))):.4g} degrees from the "
                f"platform's axis {list(a)}; a PRUR leg's slider moves across it (90 degrees) or "
                "along it (0)"
            )
        return replace(leg, slider_direction=exact, slides_along_axis=abs(share) > 0.5)

    @property
    def equations_class(self) -> Any:  # type: ignore[override]
        """The equations of a slider along a, or across it."""
        return AlongEquations if self.slides_along_axis else AcrossEquations

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The leg's geometric quantities: point, guide, link lengths and elbows."""
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("slider_direction", "direction", self.slider_direction, "e"),
            LegQuantity("upper_length", "length", (self.upper_length,), "lu"),
            LegQuantity("lower_length", "length", (self.lower_length,), "ll"),
            LegQuantity("elbow", "sign", (self.elbow,)),
            LegQuantity("second_elbow", "sign", (self.second_elbow,)),
        )

    @property
    def joint_axis(self) -> Vector:
        """The unit vector along which the slider moves."""
        return self.slider_direction

    def zero_at(self, zero: float) -> dict[str, Any]:
        """Return the `guide_point` for which the slider's coordinate counts from `zero`, m."""
        return {"guide_point": shift_point(self.guide_point, self.slider_direction, zero)}

    @property
    def reach_bound(self) -> ReachBound:
        """A cylinder about the slider's line that holds all platform points in reach, m."""
        return ReachBound(self.guide_point, self.slider_direction, self.size)

    @property
    def reach_text(self) -> str:
        """The links' lengths, as a clause for messages."""
        return (
            f"its links are {self.upper_length:.4g} m, across the platform's axis, and "
            f"{self.lower_length:.4g} m, across its second axis"
        )

    @property
    def extents(self) -> dict[str, tuple[str, float, float, str]]:
        """The range of x, m, where both links usually have their centres of mass."""
        return {
            "u": ("upper", 0.0, self.upper_length, "the slider and the universal joint"),
            "l": ("lower", -self.lower_length, 0.0, "the universal joint and the platform point"),
        }


class PRUREquations(UniversalLinkEquations):
    """The equations of a P-R-U-R leg, whose slider is across a or along it."""

    second_link = "upper link"
    kinds: ClassVar = {"p": PointMass.kinds, "u": PlanarInertia.kinds, "l": SpatialInertia.kinds}

    def __init__(
        self, slider_direction: Expression, upper_length: Expression, **others: Expression
    ) -> None:
        super().__init__(**others)
        self.e, self.lu = slider_direction, upper_length

    def first_end(self, q: Expression) -> tuple[Expression, Expression]:
        """Return the slider's end of the upper link (3, 1), and the link's length."""
        return self.r + q * self.e, self.lu

    @abstractmethod
    def links(self, w: Jet, b: Jet, n: Jet) -> tuple[Jet, Jet, LinkState]:
        """Return the coordinate q, the upper link l_u and the lower link in motion."""

    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        """Return the motion of slider, links and joints."""
        leg = self.with_rotation(rotation)
        q, upper, at = leg.links(*leg.vectors(point, rotation))
        f, row = leg.force(upper.value, at.link.value)
        divisor = ca.dot(f, self.e)
        joint_row = row / divisor
        tip, slide = self.r + q.value * self.e, q.acceleration * self.e
        turning = turn_about(leg.a, upper, self.lu * self.lu)
        x = upper.value / self.lu
        y, square = ca.cross(leg.a, x), turning.rate * turning.rate
        slider = tip, ca.mtimes(self.e, joint_row), slide
        ddx, ddy = turning.acceleration * y - square * x, -turning.acceleration * x - square * y
        lower, joints = leg.last_parts(point, rotation, at, turning)
        chain = (
            Joint("P", self.e, self.r, joint_row, q.rate, q.acceleration, "p", driven=True),
            Joint("R", leg.a, tip, *turning, "u"),
            *joints,
        )
        bodies = {
            "p": BodyMotion(*slider),
            "u": BodyMotion(*slider, leg.a, turning.row, x, y, ddx, ddy),
            "l": lower,
        }
        links = upper.value, at.link.value
        return LegMotion(
            q.value, q.rate, q.acceleration, row, divisor, bodies, chain, links, (turning[1:], None)
        )


class AcrossEquations(PRUREquations):
    """The equations of a leg whose slider moves across a: it fixes l_l first, then l_u."""

    def links(self, w: Jet, b: Jet, n: Jet) -> tuple[Jet, Jet, LinkState]:
        """Return the coordinate q, the upper link l_u and the lower link in motion."""
        at = self.link_across(w, n)
        v = w - at.link
        ahead = v.transform(self.e.T)
        aside = v.transform(ca.cross(self.a, self.e).T)  # v is across a
        root = aside.complement(self.lu, self.sigma)
        q = ahead - root
        return q, v - q.multiply(self.e), at

    def closure(self, c: Expression, root: Root) -> NestedClosure:
        """Return what the reach of c (3, 1) depends on; `root` returns a number's square root."""
        w, n, side = c - self.r, ca.cross(self.a, self.b), ca.cross(self.a, self.e)
        h = ca.dot(self.a, w)
        inner = self.ll * self.ll - h * h
        m = self.kappa * root(inner)
        v = w - h * self.a - m * n
        aside = ca.dot(v, side)
        outer = self.lu * self.lu - aside * aside
        ahead = self.sigma * root(outer)
        normal_part = ahead * ca.dot(self.e, n) + aside * ca.dot(side, n)
        share = m * m * ahead * ahead
        size = ca.fmax((h * normal_part) ** 2 + m * m * self.lu * self.lu, TINY)
        margin = ca.fmin(self.ll - ca.fabs(h), self.lu - ca.fabs(aside))
        return NestedClosure((inner, outer), margin, share / size)


class AlongEquations(PRUREquations):
    """The equations of a leg whose slider moves along a: it fixes l_u first, then l_l."""

    def links(self, w: Jet, b: Jet, n: Jet) -> tuple[Jet, Jet, LinkState]:
        """Return the coordinate q, the upper link l_u and the lower link in motion."""
        along_b = w.dot(b)
        upper = along_b * b + along_b.complement(self.lu, self.sigma) * n
        m = n.dot(w - upper)
        h = m.complement(self.ll, self.kappa)
        link = m * n + h.multiply(self.a)
        return (w - link).transform(self.e.T), upper, LinkState(link, h, m)

    first_link, second_link = "upper link", "lower link"

    def held_closure(self, u: Expression, length: Expression) -> HeldClosure:
        """Return what u = l_u + l_l satisfies: the upper link's part along n has the root."""
        h, along_b = ca.dot(self.a, u), ca.dot(self.b, u)
        return HeldClosure(self.sigma, length**2 - along_b * along_b, h * h - self.ll * self.ll)

    def closure(self, c: Expression, root: Root) -> NestedClosure:
        """Return what the reach of c (3, 1) depends on; `root` returns a number's square root."""
        w, n = c - self.r, ca.cross(self.a, self.b)
        along_b = ca.dot(self.b, w)
        inner = self.lu * self.lu - along_b * along_b
        first = root(inner)
        m = ca.dot(n, w) - self.sigma * first
        outer = self.ll * self.ll - m * m
        share = (first * root(outer)) ** 2
        margin = ca.fmin(self.lu - ca.fabs(along_b), self.ll - ca.fabs(m))
        square = share / ca.fmax(m * m * self.lu * self.lu + share, TINY)
        return NestedClosure((inner, outer), margin, square)
