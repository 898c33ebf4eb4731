"""The closure of three legs under a platform that only translates in space (3T).

While its joint is held, a leg keeps its platform point on a plane (P-R-R-R) or on a sphere (a rod's
end). Moved by the platform points' offsets from P, the three loci meet at P: the planes, and the
differences of the spheres, are linear, and leave a line that meets one sphere twice.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure
from pteron.closures.loci import meeting_points, shift_locus
from pteron.legs.leg import LegEquations
from pteron.platforms.motion import PlatformEquations


class ThreeLoci(Closure):
    """Three legs under a 3T platform, where at least one leg's row depends on the pose."""

    modes = 2

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        """Return whether the platform translates in space and does not turn."""
        return platform.coordinates == ("x", "y", "z")

    def poses(self, joints: Expression) -> Expression:
        """Return every position with joint coordinates (3, 1), as columns (3, k)."""
        pairs = zip(self.legs, ca.vertsplit(joints), self.platform.offsets, strict=True)
        loci = [shift_locus(leg.locus(q), offset.a + offset.constant) for leg, q, offset in pairs]
        return meeting_points(loci, self.platform)[0]
