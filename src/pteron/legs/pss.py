"""P-S-S legs, the linear Delta's: a slider (P) carries a rod between two ball joints (S).

Two parallel rods, which keep the platform from turning, count as one rod with both inertias. The
joints of a rod are counted as universal ones: a rod's spin about itself moves nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import ClassVar

import casadi as ca

from pteron.bodies.inertia import PointMass, RodInertia
from pteron.bodies.motion import BodyMotion, Expression, PointMotion, RotationMotion, point_rows
from pteron.bodies.vectors import Vector
from pteron.legs.circles import perpendicular_to, random_vector
from pteron.legs.keys import ACCOUNTS, keys_of
from pteron.legs.kind import LegQuantity
from pteron.legs.leg import Joint, LegMotion, SphereLocus
from pteron.legs.rods import (
    RodLeg,
    rod_body,
    universal_joints,
)
from pteron.legs.slide import SlideEquations, SlideLeg, SlideState


@dataclass(frozen=True)
class PSS(RodLeg, SlideLeg):
    """A P-S-S leg that carries one point of the platform."""

    type = "PSS"
    names: ClassVar = {"p": "slider", "l": "rod"}
    base_cones: ClassVar = ("tip_cone",)
    measure_text = "the cosine of the angle between rod and guide"
    account = ACCOUNTS["PSS"]

    keys: ClassVar = keys_of("slider", "rod", "PSS")

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The leg's geometric quantities: point, directions, rod length and elbow."""
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("slider_direction", "direction", self.slider_direction, "e"),
            LegQuantity("bar_direction", "normal", self._counting_axis),
            LegQuantity("lower_length", "length", (self.lower_length,), "ll"),
            LegQuantity("elbow", "sign", (self.elbow,)),
        )

    @property
    def _counting_axis(self) -> Vector:
        """The unit vector of the first axis of the rod's universal joints: that of the rods' bar.

        For a single rod the axis is perpendicular to the guide: universal joints about it are
        singular where the rod lies along it, and there the leg is singular anyway (type I).
        """
        if self.bar_direction is not None:
            return self.bar_direction
        return self.slider_direction if self.rods > 1 else perpendicular_to(self.slider_direction)

    @property
    def bar(self) -> Vector | None:
        """The direction from one parallel rod to the other; None for a single rod."""
        return self.bar_direction if self.rods > 1 else None

    def tip_axes(self, motion: LegMotion) -> Expression:
        """Return the axes (3, 3) of the slider, which are the base frame's."""
        return ca.SX.eye(3)

    @classmethod
    def random_link(cls, values: Mapping[str, Sequence[Fraction]], rng: Random) -> list[Fraction]:
        """Return the rod as a random rational vector (3,)."""
        return random_vector(values["lower_length"][0], 3, rng)


class PSSEquations(SlideEquations):
    """The equations of a P-S-S leg, with universal joints about the bar and normal to it."""

    kinds: ClassVar = {"p": PointMass.kinds, "l": RodInertia.kinds}

    def __init__(self, bar_direction: Expression, **slide: Expression) -> None:
        super().__init__(**slide)
        self.bar = bar_direction

    def to_link_space(self, v: Expression) -> Expression:
        """Return the vector (3, K) unchanged: the rod's space is the base frame."""
        return v

    def to_base_frame(self, v: Expression) -> Expression:
        """Return the vector (3, K) unchanged: the rod's space is the base frame."""
        return v

    def link(
        self, point: PointMotion, rotation: RotationMotion, at: SlideState, slider: Joint
    ) -> tuple[BodyMotion, list[Joint], None]:
        """Return the rod's motion, the joints at its ends, and None for a planar angle."""
        rides = point_rows(ca.SX.eye(3))
        swing = (rides - ca.mtimes(self.e, slider.row)) / self.ll
        n = at.b / self.ll
        dn = (point.velocity - at.rate * self.e) / self.ll
        ddn = (point.acceleration - at.acceleration * self.e) / self.ll
        tip = self.r + at.q * self.e
        joints = universal_joints(self.bar, tip, point, swing, (n, dn, ddn), rotation)
        return rod_body(point, n, ddn, swing), joints, None

    def locus(self, q: Expression) -> SphereLocus:
        """Return the sphere of platform point c while the slider is held at q, m."""
        return SphereLocus(self.r + q * self.e, self.ll)


PSS.equations_class = PSSEquations
