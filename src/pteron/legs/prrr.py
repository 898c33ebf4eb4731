"""P-R-R-R legs, the paper's: a slider (P) and two links in a plane across the revolute axes (R).

In a PRRU leg a fourth revolute axis, along the platform's k, meets R3 at the platform point, so
that the platform may turn against the leg.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from random import Random
from typing import Any, ClassVar, NamedTuple

import casadi as ca

from pteron.bodies.inertia import PlanarInertia, PointMass
from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    Moments,
    PointMotion,
    RotationMotion,
    point_rows,
)
from pteron.bodies.vectors import Vector, dot, parallel, shift_point, vertical
from pteron.errors import ModelError
from pteron.legs.circles import (
    edges_of_reach,
    first_moment,
    links_from_triangle,
    perpendicular_to,
    plane_of,
    random_triangle,
    squared_reach,
)
from pteron.legs.cones import angle_between, joint_limit
from pteron.legs.crank import ELBOW
from pteron.legs.drive import Drive
from pteron.legs.keys import ACCOUNTS, FieldCondition, check_elbow, keys_of
from pteron.legs.kind import SLIDER, LegKind, LegQuantity, LegTransfer, ReachBound
from pteron.legs.leg import (
    Joint,
    LegEquations,
    LegMotion,
    Needs,
    Passive,
    PlaneLocus,
    Reach,
    force_wrench,
)
from pteron.legs.planar_links import LinkRotation, last_joints, link_body, lower_link_body
from pteron.legs.reading import Reading
from pteron.legs.two_bar import two_bar_needs

_LEAST_SLIDE = 1e-6
"""Least share of a slide that moves the leg's plane; with less the leg is refused."""


def _check_slide(e: Vector | None, d: Vector) -> None:
    """Raise ModelError if the slider's axis e is perpendicular to the revolute axes d."""
    if e is not None and abs(dot(d, e)) < _LEAST_SLIDE:
        raise ModelError(
            f"slider_direction: {list(e)} is perpendicular to direction {list(d)}, so that the "
            "slider cannot move the leg's plane; tilt one against the other"
        )


@dataclass(frozen=True)
class PRRR(LegKind):
    """A P-R-R-R leg that carries one point of the platform.

    The slider moves along `slider_direction` through `guide_point`; the revolute axes R1, R2 and R3
    all have `direction`. Vectors are in the base frame, except `platform_point`, which is in the
    platform's frame.
    """

    guide_point: Vector
    direction: Vector
    platform_point: Vector
    upper_length: float
    lower_length: float
    slider_mass: float
    upper: PlanarInertia
    lower: PlanarInertia
    slider_direction: Vector | None = None
    elbow: int = 1
    limits: tuple[float, float] | None = None
    fixed_offset: Vector = (0.0, 0.0, 0.0)
    drive: Drive | None = None
    reading: Reading | None = field(default=None, kw_only=True)
    elbow_limits: tuple[float, float] | None = None

    type = "PRRR"
    joint = SLIDER
    measure_text = "the sine of the angle between its links, seen along d"
    account = ACCOUNTS["PRRR"]

    keys: ClassVar = keys_of("slider", "elbow_limits", "PRRR")

    conditions = (
        FieldCondition(("elbow_limits",), check_elbow),
        FieldCondition(("slider_direction", "direction"), _check_slide),
    )

    @property
    def e(self) -> Vector:
        """The unit vector of the slider; `direction` by default."""
        return self.slider_direction or self.direction

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The leg's geometric quantities: point, directions, link lengths and elbow."""
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("direction", "direction", self.direction, "d"),
            LegQuantity("slider_direction", "direction", self.e, "e"),
            LegQuantity("plane_axis", "normal", perpendicular_to(self.direction)),
            LegQuantity("upper_length", "length", (self.upper_length,), "lu"),
            LegQuantity("lower_length", "length", (self.lower_length,), "ll"),
            LegQuantity("elbow", "sign", (self.elbow,)),
        )

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return the axes of platform rotations that the leg leaves free: R3's and `axis`."""
        return (self.direction,) if axis is None else (self.direction, axis)

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the elbow R2 in a list if it has limits; its value is the links' angle, rad."""
        angle = angle_between(*motion.links)
        return joint_limit("elbow", "rad", angle, self.elbow_limits, self.lower_length)

    @property
    def joint_axis(self) -> Vector:
        """The unit vector along which the slider moves."""
        return self.e

    def zero_at(self, zero: float) -> dict[str, Any]:
        """Return the `guide_point` for which the slider's coordinate counts from `zero`, m."""
        return {"guide_point": shift_point(self.guide_point, self.e, zero)}

    @property
    def reach_bound(self) -> ReachBound:
        """A cylinder about the slider's line that holds all platform points in reach, m."""
        slant = abs(dot(self.direction, self.e))
        return ReachBound(self.guide_point, self.e, self.size / slant)

    @property
    def reach_text(self) -> str:
        """The range that both links span, m, as a clause for messages."""
        shortest = abs(self.upper_length - self.lower_length)
        return f"its links span {shortest:.4g} to {self.size:.4g} m across direction"

    @property
    def extents(self) -> dict[str, tuple[str, float, float, str]]:
        """The range of x, m, where both links usually have their centres of mass."""
        return {
            "u": ("upper", 0.0, self.upper_length, "R1, where it begins, and R2"),
            "l": ("lower", -self.lower_length, 0.0, "R2 and R3, where its x is zero"),
        }

    def transfers(self, gravity: Vector) -> tuple[LegTransfer, ...]:
        """Return how inertial parameters of slider and links transfer to others, with reasons."""
        transfer_list = [
            LegTransfer(
                "slider and upper link{} move as one along the guide",
                {("m", "u"): (1, ()), ("m", "p"): (-1, ())},
            ),
            LegTransfer("both links{} carry the elbow R2", ELBOW),
        ]
        if vertical(self.direction, gravity) and parallel(self.direction, self.e):
            reason = "no gravity and no slider acceleration acts across the upper link{}"
            transfer_list += [
                LegTransfer(reason, {(kind, "u"): (1, ())}) for kind in ("mgx", "mgy")
            ]
        return tuple(transfer_list)

    @classmethod
    def draw_closure(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int]:
        """Return a random rational platform point, the sum of two links, and the elbow's sign."""
        return random_triangle(values, rng)


class _PlanarLinks(NamedTuple):
    """The links in the leg's plane, (2, 1), how they turn, and u''."""

    l_u: Expression
    l_l: Expression
    rows: tuple[Expression, Expression]
    """d theta_u / d u and d theta_l / d u, (2, 1)."""
    upper: LinkRotation
    lower: LinkRotation
    ddu: Expression


class PRRREquations(LegEquations):
    """The equations of a P-R-R-R leg.

    The links move in the plane perpendicular to d. Vectors of that plane are written in its axes a
    and d x a, as two-vectors, wherever that is enough.
    """

    kinds: ClassVar = {"p": PointMass.kinds, "u": PlanarInertia.kinds, "l": PlanarInertia.kinds}
    rides: ClassVar = ("l",)
    row_is_constant = True

    def __init__(
        self,
        guide_point: Expression,
        direction: Expression,
        slider_direction: Expression,
        plane_axis: Expression,
        upper_length: Expression,
        lower_length: Expression,
        elbow: Expression,
    ) -> None:
        self.r, self.d, self.e = guide_point, direction, slider_direction
        self.lu, self.ll, self.sigma = upper_length, lower_length, elbow
        self.plane = plane_of(direction, plane_axis)
        self.aligned = bool((slider_direction - direction).is_zero())
        """Whether the slider moves along d, so that the leg's plane does not accelerate."""
        if self.aligned:
            self.d_bar, self.e_plane = direction, ca.SX.zeros(2)
        else:
            self.d_bar = direction / ca.dot(direction, slider_direction)
            self.e_plane = ca.mtimes(self.plane.T, slider_direction)
        self.constant_row = self.d_bar
        # u = projection (c - r) is the part of c - r - rho e in the plane: r + rho e + u = c.
        self.projection = self.plane.T - ca.mtimes(self.e_plane, self.d_bar.T)  # Eq. (3)

    def _state(self, point: PointMotion) -> _PlanarLinks:
        """Return both links, their angle rates and accelerations, in the leg's plane.

        theta_u' = l_l . u' / D and theta_l' = -l_u . u' / D. Differentiated, and with l_l . l_l =
        ll^2, theta_u'' = l_l . v / D and theta_l'' = -l_u . v / D, v = u'' + theta_u'^2 l_u +
        theta_l'^2 l_l.
        """
        u = ca.mtimes(self.projection, point.position - self.r)  # Eq. (5)
        du, ddu = (ca.mtimes(self.projection, v) for v in (point.velocity, point.acceleration))
        l_u, l_l, inverse_d = links_from_triangle(self.lu, self.ll, self.sigma, u)  # Eqs. (6), (7)
        upper_row, lower_row = l_l * inverse_d, -(l_u * inverse_d)
        upper_rate, lower_rate = ca.dot(upper_row, du), ca.dot(lower_row, du)
        v = ddu + (upper_rate * upper_rate) * l_u + (lower_rate * lower_rate) * l_l
        rows = upper_row, lower_row
        upper, lower = (
            LinkRotation(point_rows(ca.mtimes(row.T, self.projection)), rate, ca.dot(row, v))
            for row, rate in zip(rows, (upper_rate, lower_rate), strict=True)
        )
        return _PlanarLinks(l_u, l_l, rows, upper, lower, ddu)

    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        """Return the motion of slider, links and joints; the Jacobian row is constant."""
        at = self._state(point)
        rho = ca.dot(self.d_bar, point.position - self.r)  # Eq. (4)
        rate, sliding = (ca.dot(self.d_bar, v) for v in (point.velocity, point.acceleration))
        row = point_rows(self.d_bar.T)  # Eq. (10), the row of one leg
        r1 = self.r + rho * self.e  # Fig. 1(b)
        slides = r1, ca.mtimes(self.e, row), sliding * self.e
        bodies = {
            "p": BodyMotion(*slides),
            "u": link_body(slides, self.d, self.plane, at.l_u / self.lu, at.upper),  # Eq. (11)
            "l": lower_link_body(point, self.d, self.plane, at.l_l / self.ll, at.lower),  # Eq. (12)
        }
        links = ca.mtimes(self.plane, at.l_u), ca.mtimes(self.plane, at.l_l)
        chain = (  # Eq. (9): the joints' screws times these rates
            Joint("P", self.e, self.r, row, rate, sliding, "p", driven=True),
            Joint("R", self.d, r1, *at.upper, "u"),
            Joint("R", self.d, r1 + links[0], *at.lower.relative_to(at.upper), "l"),
            *last_joints(self.d, point, at.lower, rotation),  # Fig. 2, its R3 and R4
        )
        angles = tuple((link.rate, link.acceleration) for link in (at.upper, at.lower))
        return LegMotion(rho, rate, sliding, row, ca.SX(1), bodies, chain, links, angles)

    def exported_terms(self, point: PointMotion, rotation: RotationMotion) -> dict[str, Expression]:
        """Return intermediate quantities of the leg's equations by name, for exported code."""
        at = self._state(point)
        u = at.l_u + at.l_l
        delta = squared_reach(self.lu, self.ll, ca.dot(u, u))
        root = ca.sqrt(delta)
        terms = {"u": u, "n2": ca.dot(u, u), "delta": delta, "root": root, "ddu": at.ddu}
        terms |= {"inverse_d": -2 * self.sigma / root, "links_dot": ca.dot(at.l_u, at.l_l)}
        v = at.ddu
        links = (("u", at.l_u, at.rows[0], at.upper), ("l", at.l_l, at.rows[1], at.lower))
        for letter, l_b, row, link in links:
            terms |= {f"theta_{letter}_row": row, f"theta_{letter}_rate": link.rate}
            terms[f"theta_{letter}_acceleration"] = link.acceleration
            terms[f"theta_{letter}_rate2"] = square = link.rate * link.rate
            terms[f"along_{letter}"] = ca.dot(l_b, at.ddu + square * l_b)
            terms[f"plane_{letter}"] = l_b
            v = v + square * l_b
        return {**terms, "v": v}

    def reach(self, c: Expression) -> Reach:
        """Return the reach margins of platform point c: the links span |lu - ll| to lu + ll, m."""
        u = ca.mtimes(self.projection, c - self.r)
        n, delta = ca.sqrt(ca.dot(u, u)), squared_reach(self.lu, self.ll, ca.dot(u, u))
        margin = ca.fmin(self.lu + self.ll - n, n - ca.fabs(self.lu - self.ll))
        return Reach(margin, delta, (2 * self.lu * self.ll) ** 2, n)

    def edges(self, c: Expression) -> dict[str, Expression]:
        """Return squared-length margins of the links, by name; zero where stretched or folded."""
        u = ca.mtimes(self.projection, c - self.r)
        stretched, folded = edges_of_reach(self.lu, self.ll, ca.dot(u, u))
        return {"stretched": stretched, "folded": folded}

    def locus(self, q: Expression) -> PlaneLocus:
        """Return the plane of platform point c while the slider is held at q, m."""
        size = ca.fabs(q) + ca.dot(ca.fabs(self.d_bar), ca.fabs(self.r))
        return PlaneLocus(self.d_bar, q + ca.dot(self.d_bar, self.r), size)

    def needs(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces that slider and links require at joint and platform point.

        The moments of the links act through theta_u and theta_l, whose rows with respect to u turn
        them into a force tau; as u' is the part of c' - e rho' in the plane, tau acts on the point
        and -e . tau on the slider.
        """
        slider, upper, lower = (inertia[letter] for letter in self.kinds)
        sliding = ca.dot(self.d_bar, point.acceleration)
        weight = ca.mtimes(self.plane.T, gravity)
        masses = (slider.m + upper.m) * (sliding - ca.dot(self.e, gravity))  # Eq. (14), negated
        if lower.hx.is_zero():
            u = [ca.mtimes(self.projection, v) for v in (point.position - self.r, *point[1:])]
            slider_force, plane_force = two_bar_needs(self, u, sliding, weight, (upper, lower))
        else:
            at, on_r1 = self._state(point), sliding * self.e_plane - weight
            slider_force, plane_force = self._link_needs(at, on_r1, upper, lower)
        return Needs(
            masses + slider_force, force_wrench(ca.mtimes(self.plane, plane_force)), lower.m
        )

    def point_mass_needs(self, point: PointMotion, gravity: Expression, mass: Expression) -> Needs:
        """Return the force required to move masses (1, K) at the platform point.

        The slider exerts the component along d.
        """
        a_g = point.acceleration - gravity
        slope = 1 if self.aligned else ca.dot(self.d, self.e)
        plane_force = ca.mtimes(self.plane, ca.mtimes(ca.mtimes(self.plane.T, a_g), mass))
        none = ca.SX(1, mass.shape[1])
        return Needs(slope * ca.dot(self.d, a_g) * mass, force_wrench(plane_force), none)

    def _link_needs(
        self, at: _PlanarLinks, on_r1: Expression, upper: Moments, lower: Moments
    ) -> tuple[Expression, Expression]:
        """Return the links' required forces along the slider, (1, K), and at joint R3, (2, K).

        `on_r1` is the acceleration a - g of R1 in the leg's plane; that of R3 is larger by u''.
        """
        h, dh = first_moment(at.l_u, upper.hx / self.lu, upper.hy / self.lu)
        upper_force = at.upper.acceleration * dh - at.upper.rate**2 * h  # h'' of a turning vector
        upper_moment = at.upper.acceleration * upper.i + ca.mtimes(on_r1.T, dh)
        h, dh = first_moment(at.l_l, lower.hx / self.ll, lower.hy / self.ll)
        lower_force = at.lower.acceleration * dh - at.lower.rate**2 * h
        lower_moment = at.lower.acceleration * lower.i + ca.mtimes((on_r1 + at.ddu).T, dh)
        tau = ca.mtimes(at.rows[0], upper_moment) + ca.mtimes(at.rows[1], lower_moment)
        return ca.mtimes(self.e_plane.T, upper_force - tau), tau + lower_force


PRRR.equations_class = PRRREquations
