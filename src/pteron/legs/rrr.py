"""R-R-R legs (three revolute joints), of planar machines such as a five-bar: a crank and a link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import ClassVar

import casadi as ca

from pteron.bodies.inertia import PlanarInertia
from pteron.bodies.motion import BodyMotion, Expression, PointMotion, RotationMotion, point_rows
from pteron.bodies.vectors import Vector
from pteron.legs.circles import random_triangle
from pteron.legs.cones import angle_between, joint_limit
from pteron.legs.crank import CrankEquations, CrankLeg, CrankState
from pteron.legs.keys import ACCOUNTS, FieldCondition, check_elbow, keys_of
from pteron.legs.leg import CircleLocus, Joint, LegMotion, Passive
from pteron.legs.planar_links import LinkRotation, last_joints, lower_link_body


@dataclass(frozen=True)
class RRR(CrankLeg):
    """A planar R-R-R leg that carries one point of the platform.

    The crank turns about `direction` through `guide_point`; its angle is zero where it points along
    `zero_direction`, and positive by the right hand about `direction`. Places along `direction` do
    not count: the leg moves in a plane of its own.
    """

    lower: PlanarInertia
    elbow_limits: tuple[float, float] | None = None

    type = "RRR"
    names: ClassVar = {"u": "crank", "l": "lower link"}
    measure_text = "the sine of the angle between crank and lower link"
    account = ACCOUNTS["RRR"]

    keys: ClassVar = keys_of("crank", "elbow_limits", "RRR")

    conditions = (FieldCondition(("elbow_limits",), check_elbow),)

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return (axis,): the leg leaves the platform free to turn about its revolute axis."""
        return (self.direction,)

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the elbow in a list if it has limits; its value is the links' angle, rad."""
        angle = angle_between(*motion.links)
        return joint_limit("elbow", "rad", angle, self.elbow_limits, self.lower_length)

    @property
    def plane_normal(self) -> Vector:
        """The unit normal of the plane in which the links turn."""
        return self.direction

    @property
    def reach_text(self) -> str:
        """The range that both links span, m, as a clause for messages."""
        shortest = abs(self.upper_length - self.lower_length)
        return f"its links span {shortest:.4g} to {self.size:.4g} m"

    @classmethod
    def draw_closure(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int]:
        """Return a random rational platform point, the sum of two links, and the elbow's sign."""
        return random_triangle(values, rng)


class RRREquations(CrankEquations):
    """The equations of an R-R-R leg, whose last link turns in the crank's plane."""

    kinds: ClassVar = {"u": PlanarInertia.kinds, "l": PlanarInertia.kinds}

    def to_link_space(self, v: Expression) -> Expression:
        """Return the components (2, K) of a vector (3, K) in the crank's plane."""
        return ca.mtimes(self.plane.T, v)

    def plane_to_link_space(self, v: Expression) -> Expression:
        """Return the vector (2, K) unchanged: the last link moves in the crank's plane."""
        return v

    def height(self, w: Expression) -> Expression:
        """Return 0: the platform point stays in the crank's plane."""
        return ca.SX(0)

    def last_link(
        self, point: PointMotion, rotation: RotationMotion, at: CrankState, crank: Joint
    ) -> tuple[BodyMotion, list[Joint], tuple[Expression, Expression]]:
        """Return the lower link's motion, the joints after the crank, the link's angular motion.

        With v = u'' + theta_u'^2 l_u + theta_l'^2 b; D = b . g.
        """
        du, ddu = self.to_link_space(point.velocity), self.to_link_space(point.acceleration)
        rate_row = -at.l_u / at.divisor
        rate = ca.dot(rate_row, du)
        v = ddu + at.rate * at.rate * at.l_u + rate * rate * at.b
        row = point_rows(ca.mtimes(self.plane, rate_row).T)
        lower = LinkRotation(row, rate, ca.dot(rate_row, v))
        upper = LinkRotation(crank.row, crank.rate, crank.acceleration)
        body = lower_link_body(point, self.d, self.plane, at.b / self.ll, lower)
        elbow = self.r + ca.mtimes(self.plane, at.l_u)
        knee = Joint("R", self.d, elbow, *lower.relative_to(upper), "l")
        joints = [knee, *last_joints(self.d, point, lower, rotation)]
        return body, joints, (lower.rate, lower.acceleration)

    def locus(self, q: Expression) -> CircleLocus:
        """Return the circle of platform point c while the crank is held at q, rad."""
        return CircleLocus(self.tip(q), self.ll)


RRR.equations_class = RRREquations
