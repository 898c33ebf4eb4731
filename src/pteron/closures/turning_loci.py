"""The closure of three or four legs under a platform with one angle, phi.

A held joint keeps a leg's platform point on a locus, a plane or a sphere, or it fixes phi. In that
case the other loci, moved by offsets that are then known, meet at the platform's point P as under a
platform that only translates. Where all loci are planes and phi slides the platform's halves, the
closures are linear. Otherwise one polynomial in tan(phi / 2) or phi is left, which has no roots in
closed form: see `kinematics.assembly`.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure
from pteron.closures.determinants import adjugate
from pteron.closures.loci import meeting_points, moved
from pteron.errors import ModelError
from pteron.legs.leg import LegEquations, Plane, Turned
from pteron.platforms.motion import PlatformEquations


class TurningLoci(Closure):
    """Three legs, or four, under a platform with one angle, where `ConstantRows` does not fit."""

    def __init__(self, legs: Sequence[LegEquations], platform: PlatformEquations) -> None:
        super().__init__(legs, platform)
        held = any(isinstance(leg.locus(ca.SX(0)), Turned) for leg in legs)
        curved = sum(not leg.row_is_constant for leg in legs) - held
        self.closed_form = held or not curved
        self._most = 2 * len(legs)
        if self.closed_form:
            self._most = 2 if curved else 1
        elif platform.slides:
            self._most = 2 * curved
        elif curved == 1:
            self._most = 4

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        return len(platform.angles()) == 1

    @property
    def modes(self) -> int:
        """The degree of what is left of the closures."""
        return self._most

    def poses(self, joints: Expression) -> Expression:
        loci = [leg.locus(q) for leg, q in zip(self.legs, ca.vertsplit(joints), strict=True)]
        offsets = self.platform.offsets
        for held in loci:
            if isinstance(held, Turned):
                c, s = ca.cos(held.angle), ca.sin(held.angle)
                others = [
                    moved(locus, still + a * c + b * s)
                    for locus, (a, b, still) in zip(loci, offsets, strict=True)
                    if locus is not held
                ]
                points, beyond = meeting_points(others, self.platform)
                return ca.vertcat(points, ca.repmat(held.angle + beyond, 1, points.shape[1]))
        rows, heights = [], []
        for locus, (a, _, still) in zip(loci, offsets, strict=True):
            if not isinstance(locus, Plane):
                raise ModelError(
                    "direct_kinematics: these legs have no closed form of it under a platform with "
                    'an angle; "direct_step" follows the pose from one that is near'
                )
            rows.append(ca.horzcat(locus.normal.T, ca.dot(locus.normal, a)))
            heights.append(locus.offset - ca.dot(locus.normal, still))
        across = adjugate(ca.vertcat(*rows))
        return ca.mtimes(across, ca.vertcat(*heights)) / ca.mtimes(rows[0], across[:, 0])
