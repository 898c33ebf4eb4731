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
from pteron.closures.loci import meeting_points, shift_locus
from pteron.errors import ModelError
from pteron.legs.leg import AngleLocus, LegEquations, PlaneLocus
from pteron.platforms.motion import PlatformEquations


class TurningLoci(Closure):
    """Three legs, or four, under a platform with one angle, where `ConstantRows` does not fit."""

    def __init__(
        self,
        legs: Sequence[LegEquations],
        platform: PlatformEquations,
        strengths: Expression | None = None,
    ) -> None:
        super().__init__(legs, platform, strengths)
        fixes_angle = any(isinstance(leg.locus(ca.SX(0)), AngleLocus) for leg in legs)
        curved = sum(not leg.row_is_constant for leg in legs) - fixes_angle
        self.closed_form = fixes_angle or not curved
        self._mode_count = 2 * len(legs)
        if self.closed_form:
            self._mode_count = 2 if curved else 1
        elif platform.slides:
            self._mode_count = 2 * curved
        elif curved == 1:
            self._mode_count = 4

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        """Return whether the platform has a single angle, phi."""
        return platform.axis_angle is not None

    @property
    def modes(self) -> int:
        """The greatest number of poses with the same joint coordinates."""
        return self._mode_count

    def poses(self, joints: Expression) -> Expression:
        """Return every pose of joint coordinates as columns (m, k); closed-form layouts only."""
        loci = [leg.locus(q) for leg, q in zip(self.legs, ca.vertsplit(joints), strict=True)]
        offsets = self.platform.offsets
        for angle_locus in loci:
            if isinstance(angle_locus, AngleLocus):
                c, s = ca.cos(angle_locus.angle), ca.sin(angle_locus.angle)
                others = [
                    shift_locus(locus, constant + a * c + b * s)
                    for locus, (a, b, constant) in zip(loci, offsets, strict=True)
                    if locus is not angle_locus
                ]
                points, validity = meeting_points(others, self.platform)
                return ca.vertcat(
                    points, ca.repmat(angle_locus.angle + validity, 1, points.shape[1])
                )
        rows, heights = [], []
        for locus, (a, _, constant) in zip(loci, offsets, strict=True):
            if not isinstance(locus, PlaneLocus):
                raise ModelError(
                    "direct_kinematics: these legs have no closed form of it under a platform with "
                    'an angle; "direct_step" follows the pose from one that is near'
                )
            rows.append(ca.horzcat(locus.normal.T, ca.dot(locus.normal, a)))
            heights.append(locus.offset - ca.dot(locus.normal, constant))
        adj = adjugate(ca.vertcat(*rows))
        return ca.mtimes(adj, ca.vertcat(*heights)) / ca.mtimes(rows[0], adj[:, 0])
