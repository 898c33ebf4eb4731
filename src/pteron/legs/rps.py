"""R-P-S legs, of tripods: a hinge (R) at the base, a ram (P), a ball joint (S) at the platform.

The ram stays in the plane across the hinge's axis, which holds the axis of the level platform.
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
from pteron.legs.rpr import RPR, RPREquations


@dataclass(frozen=True)
class RPS(RPR):
    """An R-P-S leg: it keeps its platform point in the plane through r, across `direction`.

    It is an R-P-R leg that ends in a ball joint; r is the guide point, the hinge's place.
    """

    platform_cone: Cone | None = None

    type = "RPS"
    account = ACCOUNTS["RPS"]
    keys: ClassVar = {**RPR.keys, **keys_of("ball", "ball_cone")}

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return three axes: the ball joint leaves every rotation of the platform free."""
        return every_axis()

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the ball joint at the platform in a list if it has a limit cone."""
        return ball_cone(self.platform_cone, motion, axes, self.limits[1])


class RPSEquations(RPREquations):
    """The equations of an R-P-S leg."""

    holds = held_plane


RPS.equations_class = RPSEquations
