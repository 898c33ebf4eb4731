"""P-R-S legs (prismatic, revolute, spherical), of tripods and spindle heads.

A slider and a link move in one upright plane; a ball joint ends the link at the platform.
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
from pteron.legs.prr import PRR, PRREquations


@dataclass(frozen=True)
class PRS(PRR):
    """A P-R-S leg: it keeps its platform point in the plane through r, normal to `direction`.

    It is a P-R-R leg that ends in a ball joint; r is the guide
    point, and the slider's direction e lies in the leg's plane.
    """

    platform_cone: Cone | None = None

    type = "PRS"
    account = ACCOUNTS["PRS"]
    keys: ClassVar = {**PRR.keys, **keys_of("ball", "ball_cone")}

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return three axes: the ball joint leaves every rotation of the platform free."""
        return every_axis()

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the joints with limits: that of slider and link, and the ball joint."""
        inherited = super().passive_joints(motion, zero_axes, axes)
        return [*inherited, *ball_cone(self.platform_cone, motion, axes, self.lower_length)]


class PRSEquations(PRREquations):
    """The equations of a P-R-S leg."""

    holds = held_plane


PRS.equations_class = PRSEquations
