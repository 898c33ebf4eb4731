"""The closure of three legs of any kind under a 3T platform: planes and spheres that meet.

While its joint is held, a leg keeps its platform point on a plane (P-R-R-R) or on a sphere (a rod's
end). Moved by the points' offsets, the three loci meet at P: the planes, and the differences of the
spheres, are linear, and leave a line that meets one sphere twice.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure
from pteron.closures.loci import meeting_points, moved
from pteron.legs.leg import LegEquations, LegMotion
from pteron.platforms.motion import PlatformEquations, PlatformMotion


class ThreeLoci(Closure):
    """Three legs, at least one of whose rows depends on the pose, under a 3T platform."""

    modes = 2

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        return platform.coordinates == ("x", "y", "z")

    def forces(
        self, wrench: Expression, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> Expression:
        """Return B A^-T w for J = B^-1 A, by Cramer's rule, each minor computed once."""
        a, b, c = (leg.row[:, :3].T for leg in legs)
        minor, turned = ca.cross(b, c), ca.mtimes(ca.skew(a), wrench)
        shares = (minor.T, wrench), (c.T, turned), (-b.T, turned)
        volume = ca.dot(a, minor)
        return ca.vertcat(
            *(
                leg.divisor * (ca.mtimes(row, column) / volume)
                for leg, (row, column) in zip(legs, shares, strict=True)
            )
        )

    def poses(self, joints: Expression) -> Expression:
        pairs = zip(self.legs, ca.vertsplit(joints), self.platform.offsets, strict=True)
        loci = [moved(leg.locus(q), offset.a + offset.still) for leg, q, offset in pairs]
        return meeting_points(loci, self.platform)[0]
