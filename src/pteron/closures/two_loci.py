"""The closure of two legs under a 2T platform: circles, or a circle and a line, that meet."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure, nan_below_zero
from pteron.legs.circles import quarter_turn
from pteron.legs.leg import LegEquations, Plane, Sphere, Turned
from pteron.platforms.motion import PlatformEquations

_ROUNDING = 1e-14


class TwoLoci(Closure):
    """Two legs under a platform that translates in a plane, one at least a planar leg."""

    modes = 2

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        return platform.coordinates == ("x", "y")

    def poses(self, joints: Expression) -> Expression:
        """Intersect a circle with a line; two circles meet on the line of their difference."""
        circles, lines = [], []
        for leg, q, offset in zip(
            self.legs, ca.vertsplit(joints), self.platform.offsets, strict=True
        ):
            locus, s = leg.locus(q), offset.a + offset.still
            assert not isinstance(locus, Turned)  # the platform does not turn
            if isinstance(locus, Plane):
                normal = ca.mtimes(self.platform.directions.T, locus.normal)
                lines.append((normal, locus.offset - ca.dot(locus.normal, s)))
                continue
            apart = locus.center - s
            square = locus.radius * locus.radius
            if isinstance(locus, Sphere):  # which the plane cuts in a circle
                square = square - ca.dot(self.platform.frame[2], apart) ** 2
            circles.append((ca.mtimes(self.platform.directions.T, apart), square))
        (first, square), *others = circles
        for center, other in others:
            apart = center - first
            lines.append(
                (apart, 0.5 * (square - other + ca.dot(apart, apart)) + ca.dot(apart, first))
            )
        ((normal, offset),) = lines
        n2 = ca.dot(normal, normal)
        foot = ((offset - ca.dot(normal, first)) / n2) * normal
        # Where both poses meet the radicand is all rounding: barely below zero counts as zero.
        distance = ca.dot(foot, foot)
        rest = square - distance
        radicand = ca.fmax(rest, ca.fmin(rest + _ROUNDING * (square + distance), 0))
        step = ca.sqrt(radicand / n2) * quarter_turn(normal)
        beyond = nan_below_zero(radicand)
        return ca.horzcat(*(first + foot + side * step + beyond for side in (-1, 1)))
