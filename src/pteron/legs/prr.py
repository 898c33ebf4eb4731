"""P-R-R legs (prismatic, revolute, revolute), of planar machines: slider and link in one plane."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from random import Random
from typing import ClassVar, Self

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
from pteron.bodies.vectors import Vector, cross, perpendicular
from pteron.legs.circles import perpendicular_to, plane_of, quarter_turn, random_vector
from pteron.legs.cones import joint_limit
from pteron.legs.keys import ACCOUNTS, FieldCondition, check_elbow, keys_of
from pteron.legs.kind import LegQuantity
from pteron.legs.leg import CircleLocus, Joint, LegMotion, Needs, Passive
from pteron.legs.planar_links import LinkRotation, last_joints, lower_link_body
from pteron.legs.slide import SlideEquations, SlideLeg, SlideState


def _check_elbow(limits: tuple[float, float] | None) -> None:
    """Raise ModelError if limits of the elbow's angle exceed -pi/2 to pi/2."""
    check_elbow(limits, -0.5 * math.pi, 0.5 * math.pi)


@dataclass(frozen=True)
class PRR(SlideLeg):
    """A planar P-R-R leg that carries one point of the platform.

    Coordinates along `direction` do not count: the leg moves in a plane of its own.
    """

    lower: PlanarInertia
    direction: Vector | None = None
    elbow_limits: tuple[float, float] | None = None

    type = "PRR"
    names: ClassVar = {"p": "slider", "l": "link"}
    measure_text = "the cosine of the angle between link and guide"
    account = ACCOUNTS["PRR"]

    keys: ClassVar = keys_of("slider", "PRR")

    conditions = (FieldCondition(("elbow_limits",), _check_elbow),)

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the joint of slider and link in a list if it has limits, with its angle in rad."""
        # The branch keeps the link ahead of the slider along sigma e.
        ahead, link = self.elbow * ca.SX(ca.vertcat(*self.slider_direction)), motion.links[1]
        sideways = ca.cross(ca.SX(ca.vertcat(*self.plane_normal)), ahead)
        angle = ca.atan2(ca.dot(link, sideways), ca.dot(link, ahead))
        return joint_limit("link", "rad", angle, self.elbow_limits, self.lower_length)

    def with_platform_frame(self, frame: Sequence[Vector]) -> Self:
        """Return the leg with a missing `direction`, its plane's normal: the platform's z."""
        if self.direction is not None:
            return self
        axis = frame[2]
        perpendicular(self.slider_direction, axis, "slider_direction", "the plane's normal")
        return replace(self, direction=axis)

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The leg's geometric quantities: point, directions, link length and elbow."""
        d = self.plane_normal
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("direction", "direction", d, "d"),
            LegQuantity("slider_direction", "direction", self.slider_direction, "e"),
            LegQuantity("plane_axis", "normal", perpendicular_to(d)),
            LegQuantity("lower_length", "length", (self.lower_length,), "ll"),
            LegQuantity("elbow", "sign", (self.elbow,)),
        )

    @property
    def plane_normal(self) -> Vector:
        """The unit normal of the plane in which the leg moves."""
        assert self.direction is not None  # the manipulator has given it
        return self.direction

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return (normal,): the leg leaves the platform free to turn about its plane's normal."""
        return (self.plane_normal,)

    @classmethod
    def random_link(cls, values: Mapping[str, Sequence[Fraction]], rng: Random) -> list[Fraction]:
        """Return the link as a random rational vector (3,) in the leg's plane."""
        a, (x, y) = values["plane_axis"], random_vector(values["lower_length"][0], 2, rng)
        return [x * p + y * q for p, q in zip(a, cross(values["direction"], a), strict=True)]


class PRREquations(SlideEquations):
    """The equations of a P-R-R leg, whose link turns in its plane."""

    kinds: ClassVar = {"p": PointMass.kinds, "l": PlanarInertia.kinds}

    def __init__(self, direction: Expression, plane_axis: Expression, **slide: Expression) -> None:
        super().__init__(**slide)
        self.d = direction
        self.plane = plane_of(direction, plane_axis)

    def to_link_space(self, v: Expression) -> Expression:
        """Return the components (2, K) of a vector (3, K) in the leg's plane."""
        return ca.mtimes(self.plane.T, v)

    def to_base_frame(self, v: Expression) -> Expression:
        """Return a vector (2, K) of the leg's plane in the base frame (3, K)."""
        return ca.mtimes(self.plane, v)

    def link(
        self, point: PointMotion, rotation: RotationMotion, at: SlideState, slider: Joint
    ) -> tuple[BodyMotion, list[Joint], tuple[Expression, Expression]]:
        """Return the link's motion, the joints after the slider, the link's angular motion."""
        rate_row = quarter_turn(self.to_link_space(self.e)) / at.divisor
        row = point_rows(self.to_base_frame(rate_row).T)
        rate = ca.dot(rate_row, self.to_link_space(point.velocity))
        pull = self.to_link_space(point.acceleration) + rate * rate * at.b
        turning = LinkRotation(row, rate, ca.dot(rate_row, pull))
        body = lower_link_body(point, self.d, self.plane, at.b / self.ll, turning)
        tip = self.r + at.q * self.e
        joints = [
            Joint("R", self.d, tip, *turning, "l"),
            *last_joints(self.d, point, turning, rotation),
        ]
        return body, joints, (turning.rate, turning.acceleration)

    def locus(self, q: Expression) -> CircleLocus:
        """Return the circle of the platform point c while the slider is held at q, m."""
        return CircleLocus(self.r + q * self.e, self.ll)

    def needs(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces that slider and link require at joint and platform point.

        With nu = m gamma_y / ll: nu d x (c'' - g) at the tip t, -nu d x (t'' - g) at the platform.
        """
        needs_of_rod = super().needs(point, rotation, gravity, inertia)
        at, nu = self.state(point), inertia["l"].hy / self.ll
        e, ddc, weight = (self.to_link_space(v) for v in (self.e, point.acceleration, gravity))
        joint = needs_of_rod.joint + ca.dot(e, quarter_turn(ddc - weight)) * nu
        turned = quarter_turn(at.acceleration * e - weight)
        force = needs_of_rod.point[:3, :] - self.to_base_frame(ca.mtimes(turned, nu))
        return Needs(joint, ca.vertcat(force, needs_of_rod.point[3:, :]), needs_of_rod.mass)


PRR.equations_class = PRREquations
