"""The closure of two legs under a platform that translates in a plane (2T).

A held joint keeps the platform's point on a circle or a line; the two meet in at most two points.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure
from pteron.closures.loci import meeting_points, shift_locus
from pteron.legs.leg import LegEquations
from pteron.platforms.motion import PlatformEquations


class TwoLoci(Closure):
    """Two legs under a 2T platform: two assembly modes, the two common points of their loci."""

    modes = 2

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        """Return whether the platform translates in a plane and does not turn."""
        return platform.coordinates == ("x", "y")

    def poses(self, joints: Expression) -> Expression:
        """Return every position with joint coordinates (2, 1), as columns (2, 2)."""
        pairs = zip(self.legs, ca.vertsplit(joints), self.platform.offsets, strict=True)
        loci = [shift_locus(leg.locus(q), offset.a + offset.constant) for leg, q, offset in pairs]
        return meeting_points(loci, self.platform)[0]
