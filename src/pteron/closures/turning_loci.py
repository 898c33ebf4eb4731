"""The closure of any legs under a platform that translates and turns."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure
from pteron.legs.leg import LegEquations
from pteron.platforms.motion import PlatformEquations


class TurningLoci(Closure):
    """Three legs, or four, under a platform that turns, one row at least depending on the pose."""

    modes = 2

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        return "phi" in platform.coordinates

    def poses(self, joints: Expression) -> Expression:
        return ca.SX.nan(len(self.platform.coordinates), 2)
