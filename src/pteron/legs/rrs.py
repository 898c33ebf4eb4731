"""R-R-S legs (revolute, revolute, spherical), of ball-balancing tables.

A crank and a link move in one upright plane; a ball joint ends the link at the platform.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pteron.bodies.motion import Expression
from pteron.bodies.vectors import Vector
from pteron.legs.ball_end import BALL_KEYS, UPRIGHT, ball_cone, every_axis, held_plane
from pteron.legs.cones import Cone
from pteron.legs.leg import LegMotion, Passive
from pteron.legs.rrr import RRR, RRREquations


@dataclass(frozen=True)
class RRS(RRR):
    """An R-R-S leg: it keeps its platform point in the plane through r, normal to `direction`.

    It is an R-R-R leg that ends in a ball joint; r is the guide point.
    """

    platform_cone: Cone | None = None

    type = "RRS"
    account = (
        "A crank turns about d through the guide point r; its angle theta is zero where it points "
        "along the zero direction, and counts by the right hand. A link leads from the elbow, with "
        "an axis along d too, to a ball joint at the platform point s0, which it keeps in the "
        "plane across d."
    )
    keys: ClassVar = {**RRR.keys, "direction": UPRIGHT, **BALL_KEYS}

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        return every_axis()

    def passive(self, motion: LegMotion, still: Expression, turned: Expression) -> list[Passive]:
        own = super().passive(motion, still, turned)
        return [*own, *ball_cone(self.platform_cone, motion, turned, self.lower_length)]


class RRSEquations(RRREquations):
    """The equations of an R-R-S leg."""

    holds = held_plane


RRS.equations_class = RRSEquations
