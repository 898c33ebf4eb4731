"""The closure of legs that end in ball joints, under a platform that tilts (two or three angles).

While its joint is held each leg keeps its platform point on a sphere, or, where the leg stays in a
plane, on a circle. The poses have no closed form; `kinematics.tilting_assembly` finds them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import mul

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure, plain_rows, rows_in_quasi_velocities
from pteron.closures.determinants import determinant, determinant_square
from pteron.errors import ModelError
from pteron.legs.leg import LegEquations, LegMotion, force_arm
from pteron.platforms.motion import PlatformEquations, PlatformMotion


class TiltingLoci(Closure):
    """Legs under a platform with several angles, one for each coordinate, or more."""

    closed_form = False

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        """Return whether the platform tilts."""
        return platform.tilts

    @property
    def modes(self) -> int:
        """The greatest number of poses of joint coordinates: 40 (six legs), 16 (tripod) or 8.

        It is 8 where all legs keep their points in planes.
        """
        if all(leg.row_is_constant for leg in self.legs):
            return 8
        if len(self.platform.coordinates) == 6:
            return 40
        return 16 if "z" in self.platform.coordinates else 8

    def poses(self, joints: Expression) -> Expression:
        """Raise ModelError: these machines have no closed-form direct kinematics."""
        raise ModelError(
            "direct_kinematics: these legs have no closed form of it under a platform that tilts; "
            '"direct_step" follows the pose from one that is near'
        )

    def measure_of(
        self,
        platform: PlatformMotion,
        rows: Sequence[Expression],
        sizes: Sequence[Expression] | None = None,
    ) -> Expression:
        """Return the type-II measure, no unit, of the legs' rows (1, 6) and the platform's planes.

        It is the determinant of their rows by the twist (v, omega) of P, or by omega if P is fixed,
        each row a unit force, divided by an upper bound of the determinant of as many unit forces
        on these points. The moments' unit of length is the root of a third of the sum of the
        squared distances of the points from their mean, or from P. `stewart` reaches 0.84 of the
        bound.
        """
        constraint_rows, size = self.platform.plane_wrenches(platform), ca.SX(1)
        if self.is_redundant and sizes:  # whose subsets of rows have products of their own
            rows = [row / divisor for row, divisor in zip(rows, sizes, strict=True)]
        else:
            size = reduce(mul, sizes or [ca.SX(1)])
        if constraint_rows is None:
            bound = self._bound(1, platform, rows) * size
            return determinant(rows_in_quasi_velocities(platform, rows)) / bound
        pairs = zip(rows, platform.point_twists, strict=True)
        all_rows = ca.vertcat(*(ca.mtimes(row, twist) for row, twist in pairs), constraint_rows)
        return determinant(all_rows) / (self._bound(2, platform) * size)

    def measure_squares(
        self, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> list[Expression]:
        """Return equivalent expressions of the squared type-II measure, to choose the cheapest."""
        squares = super().measure_squares(platform, legs)
        if len(legs) == 6 == len(self.platform.coordinates):
            bound = self._bound(1, platform, [leg.row for leg in legs])
            bound = reduce(mul, (leg.wrench_size for leg in legs), bound)
            squares.append(determinant_square(plain_rows(platform, legs)) / (bound * bound))
        return squares

    def _bound(
        self, forces: int, platform: PlatformMotion, rows: Sequence[Expression] = ()
    ) -> Expression:
        """Return an upper bound of the determinant of `forces` unit forces at each point.

        It follows from Fischer's inequality and that of arithmetic and geometric means. A force in
        `rows` (1, 6) that has a moment about its platform point acts at the point nearest to it.
        """
        points, centred = self.platform.points, "z" not in self.platform.coordinates
        if not all(row[3:].is_zero() for row in rows):
            points = [c.position - platform.body.position for c in platform.points]
            for i, row in enumerate(rows):
                arm = force_arm(row)
                points[i] = points[i] if arm is None else points[i] + arm
        center = ca.SX(3, 1) if centred else sum(points) / len(points)
        square = sum(ca.dot(s - center, s - center) for s in points)
        if (distance := self.platform.axis_distance) is not None:
            square = sum((ca.norm_2(s) + distance) ** 2 for s in points)
        lengths, count = 0 if centred else 3, forces * len(self.legs)
        turns = count - forces * (len(self.legs) - len(self.platform.coordinates)) - lengths
        shares = (count / 3) ** (0.5 * lengths)
        return shares * ca.sqrt(forces * square / turns) ** turns
