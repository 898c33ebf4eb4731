"""The closure of three legs of any kind under a 3T platform: planes and spheres that meet.

While its joint is held, a leg keeps its platform point on a plane (P-R-R-R) or on a sphere (a rod's
end). Moved by the points' offsets, the three loci meet at P: the planes, and the differences of the
spheres, are linear, and leave a line that meets one sphere twice.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure, nan_below_zero
from pteron.legs.leg import LegEquations, LegMotion, Locus, Plane, Sphere
from pteron.platforms.motion import PlatformEquations, PlatformMotion

_ROUNDING = 1e-14


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
        loci = [
            _moved(leg.locus(q), offset.a + offset.still)
            for leg, q, offset in zip(
                self.legs, ca.vertsplit(joints), self.platform.offsets, strict=True
            )
        ]
        first, *others = [locus for locus in loci if isinstance(locus, Sphere)]
        # Two planes n . (p - o) = h, o being the centre of the first sphere.
        planes = [
            (locus.normal, locus.offset - ca.dot(locus.normal, first.center))
            for locus in loci
            if isinstance(locus, Plane)
        ]
        for sphere in others:
            apart = sphere.center - first.center
            gap = first.radius * first.radius - sphere.radius * sphere.radius
            planes.append((apart, 0.5 * (gap + ca.dot(apart, apart))))
        (n1, h1), (n2, h2) = planes
        along = ca.cross(n1, n2)
        square = ca.dot(along, along)
        foot = (h1 * ca.cross(n2, along) + h2 * ca.cross(along, n1)) / square
        # Where both poses meet the radicand is all rounding: barely below zero counts as zero.
        radius2, distance2 = first.radius * first.radius, ca.dot(foot, foot)
        rest = radius2 - distance2
        radicand = ca.fmax(rest, ca.fmin(rest + _ROUNDING * (radius2 + distance2), 0))
        step = ca.sqrt(radicand / square)
        beyond = nan_below_zero(radicand)
        return ca.horzcat(*(first.center + foot + side * step * along + beyond for side in (-1, 1)))


def _moved(locus: Locus, offset: Expression) -> Plane | Sphere:
    """Return the locus of P, where that of P + offset is given."""
    if isinstance(locus, Sphere):
        return Sphere(locus.center - offset, locus.radius)
    assert isinstance(locus, Plane)  # others are of platforms that turn, or of planar ones
    return locus._replace(offset=locus.offset - ca.dot(locus.normal, offset))
