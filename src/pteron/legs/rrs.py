"""R-R-S legs (revolute, revolute, spherical), of ball-balancing tables.

A crank and a link move in one upright plane; a ball joint ends the link at the platform.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pteron.bodies.motion import Expression
from pteron.bodies.vectors import Vector
from pteron.legs.ball_end import ball_cone, every_axis, held_plane
from pteron.legs.cones import Cone
from pteron.legs.keys import ACCOUNTS, keys_of
from pteron.legs.leg import LegMotion, Passive
from pteron.legs.rrr import RRR, RRREquations


@dataclass(frozen=True)
class RRS(RRR):
    """An R-R-S leg: it keeps its platform point in the plane through r, normal to `direction`.

    It is an R-R-R leg that ends in a ball joint; r is the guide point.
    """

    platform_cone: Cone | None = None

    type = "RRS"
    account = ACCOUNTS["RRS"]
    keys: ClassVar = {**RRR.keys, **keys_of("ball", "ball_cone")}

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return three axes: the ball joint leaves every rotation of the platform free."""
        return every_axis()

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the joints that have limits: the elbow, and the ball joint at the platform."""
        inherited = super().passive_joints(motion, zero_axes, axes)
        return [*inherited, *ball_cone(self.platform_cone, motion, axes, self.lower_length)]


class RRSEquations(RRREquations):
    """The equations of an R-R-S leg."""

    holds = held_plane


RRS.equations_class = RRSEquations
