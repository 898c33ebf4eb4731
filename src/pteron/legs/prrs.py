"""P-R-R-S legs of the Hexapteron: a slider, two links in a plane, a ball joint at the platform.

The plane moves with the slider, so that the leg holds its platform point in no plane of the base.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pteron.bodies.motion import Expression
from pteron.bodies.vectors import Vector
from pteron.legs.ball_end import ball_cone, every_axis
from pteron.legs.cones import Cone
from pteron.legs.keys import ACCOUNTS, keys_of
from pteron.legs.leg import LegMotion, Passive
from pteron.legs.prrr import PRRR, PRRREquations


@dataclass(frozen=True)
class PRRS(PRRR):
    """A P-R-R-S leg: a P-R-R-R leg that ends in a ball joint, under a platform that tilts."""

    platform_cone: Cone | None = None

    type = "PRRS"
    account = ACCOUNTS["PRRS"]
    keys: ClassVar = {**PRRR.keys, **keys_of("ball_cone")}

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return three axes: the ball joint leaves every rotation of the platform free."""
        return every_axis()

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the joints that have limits: the elbow, and the ball joint at the platform."""
        inherited = super().passive_joints(motion, zero_axes, axes)
        return [*inherited, *ball_cone(self.platform_cone, motion, axes, self.lower_length)]


class PRRSEquations(PRRREquations):
    """The equations of a P-R-R-S leg, those of a P-R-R-R leg."""


PRRS.equations_class = PRRSEquations
