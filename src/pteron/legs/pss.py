"""P-S-S legs, the linear Delta's: a slider (P) carries a rod between two ball joints (S).

Two parallel rods, which keep the platform from turning, count as one rod with both inertias. The
joints of a rod are counted as universal ones: a rod's spin about itself moves nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import ClassVar

import casadi as ca

from pteron.bodies.inertia import PointMass, RodInertia
from pteron.bodies.motion import BodyMotion, Expression, PointMotion, RotationMotion, point_rows
from pteron.bodies.vectors import Vector
from pteron.legs.circles import random_vector
from pteron.legs.cones import Cone
from pteron.legs.keys import Key
from pteron.legs.kind import Quantity
from pteron.legs.leg import Joint, LegMotion, Passive, Sphere
from pteron.legs.rods import (
    ROD_KEYS,
    cones,
    couples,
    free_axes,
    hinge_doubts,
    rod_body,
    rod_couple,
    universal_joints,
)
from pteron.legs.slide import SLIDER_KEYS, SlideEquations, SlideLeg, SlideState


@dataclass(frozen=True)
class PSS(SlideLeg):
    """A P-S-S leg that carries one point of the platform."""

    lower: RodInertia
    rods: int = 2
    bar_direction: Vector | None = None
    tip_cone: Cone | None = None
    platform_cone: Cone | None = None
    bar_length: float | None = None

    type = "PSS"
    names: ClassVar = {"p": "slider", "l": "rod"}
    base_cones: ClassVar = ("tip_cone",)
    measure_text = "the cosine of the angle between rod and guide"
    account = (
        "A slider moves along e through the guide point r; its coordinate rho is zero there. A rod "
        "between two ball joints leads from it to the platform point s0; parallel rods, which keep "
        "the platform from tilting, count as one with the sum of both."
    )

    keys: ClassVar = {
        **SLIDER_KEYS,
        **ROD_KEYS,
        "bar_direction": Key(
            "direction",
            "of the bars at the ends of parallel rods; where given, the bars are checked to keep "
            "the platform from tilting",
            default=None,
            example=[0.0, 1.0, 0.0],
        ),
        "tip_cone": Key(
            "cone",
            "how far the rod may lean at the slider; axis in the base frame",
            default=None,
            example={"axis": [0.0, 0.0, -1.0], "angle": 0.8},
        ),
    }

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        return (
            Quantity("guide_point", "point", self.guide_point),
            Quantity("slider_direction", "direction", self.slider_direction, "e"),
            Quantity("bar_direction", "normal", self.bar_direction or self.slider_direction),
            Quantity("lower_length", "length", (self.lower_length,), "ll"),
            Quantity("elbow", "sign", (self.elbow,)),
        )

    @property
    def bar(self) -> Vector | None:
        return self.bar_direction if self.rods > 1 else None

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        return free_axes(self.rods, self.bar_direction, axis)

    def couples(self, motion: LegMotion, axis: Vector | None) -> Sequence[Expression] | None:
        return couples(self, motion)

    def passive(self, motion: LegMotion, still: Expression, turned: Expression) -> list[Passive]:
        return cones(self, motion, ca.SX.eye(3), still, turned)

    def rod_couple(self, motion: LegMotion) -> Expression:
        return rod_couple(self, motion)

    def doubts(self, axis: Vector | None) -> Iterator[str]:
        return hinge_doubts(self, axis)

    @classmethod
    def random_link(cls, values: Mapping[str, Sequence[Fraction]], rng: Random) -> list[Fraction]:
        return random_vector(values["lower_length"][0], 3, rng)


class PSSEquations(SlideEquations):
    """The equations of a P-S-S leg; its joints are counted about the bar and across it."""

    kinds: ClassVar = {"p": PointMass.kinds, "l": RodInertia.kinds}

    def __init__(
        self,
        guide_point: Expression,
        slider_direction: Expression,
        bar_direction: Expression,
        lower_length: Expression,
        elbow: Expression,
    ) -> None:
        super().__init__(guide_point, slider_direction, lower_length, elbow)
        self.bar = bar_direction

    def counted(self, v: Expression) -> Expression:
        return v

    def in_space(self, v: Expression) -> Expression:
        return v

    def link(
        self, point: PointMotion, rotation: RotationMotion, at: SlideState, slider: Joint
    ) -> tuple[BodyMotion, list[Joint], None]:
        rides = point_rows(ca.SX.eye(3))
        swing = (rides - ca.mtimes(self.e, slider.row)) / self.ll
        n = at.b / self.ll
        dn = (point.velocity - at.rate * self.e) / self.ll
        ddn = (point.acceleration - at.acceleration * self.e) / self.ll
        tip = self.r + at.q * self.e
        joints = universal_joints(self.bar, tip, point, swing, (n, dn, ddn), rotation)
        return rod_body(point, n, ddn, swing), joints, None

    def locus(self, q: Expression) -> Sphere:
        return Sphere(self.r + q * self.e, self.ll)


PSS.equations_class = PSSEquations
