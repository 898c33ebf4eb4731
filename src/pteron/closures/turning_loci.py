"""The closure of any legs under a platform that translates and turns.

Where a leg holds the angle phi, the loci of the others, moved by offsets that are then known, meet
at P as they do under a platform that only translates. Otherwise what is left of the closures is one
polynomial in tan(phi / 2), which has no roots in closed form: see `kinematics.assembly`.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure
from pteron.closures.loci import meeting_points, moved
from pteron.errors import ModelError
from pteron.legs.leg import LegEquations, Turned
from pteron.platforms.motion import PlatformEquations


class TurningLoci(Closure):
    """Three legs, or four, under a platform that turns, one row at least depending on the pose."""

    def __init__(self, legs: Sequence[LegEquations], platform: PlatformEquations) -> None:
        super().__init__(legs, platform)
        self.closed_form = any(isinstance(leg.locus(ca.SX(0)), Turned) for leg in legs)

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        return "phi" in platform.coordinates

    @property
    def modes(self) -> int:
        """2, or 1 of planes alone, where a leg holds phi; else the degree of the polynomial."""
        curved = sum(not leg.row_is_constant for leg in self.legs)
        if self.closed_form:
            return 2 if curved > 1 else 1
        return 4 if curved == 1 else 2 * len(self.legs)

    def poses(self, joints: Expression) -> Expression:
        angle, loci = None, []
        for leg, q, offset in zip(
            self.legs, ca.vertsplit(joints), self.platform.offsets, strict=True
        ):
            locus = leg.locus(q)
            if isinstance(locus, Turned):
                angle = locus.angle
            else:
                loci.append((locus, offset))
        if angle is None:
            raise ModelError(
                "direct_kinematics: these legs have no closed form of it under a platform that "
                'turns; "direct_step" follows the pose from one that is near'
            )
        c, s = ca.cos(angle), ca.sin(angle)
        points, beyond = meeting_points(
            [moved(locus, still + a * c + b * s) for locus, (a, b, still) in loci], self.platform
        )
        return ca.vertcat(points, ca.repmat(angle + beyond, 1, points.shape[1]))
