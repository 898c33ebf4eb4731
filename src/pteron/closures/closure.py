"""The base class of closures, which solve a machine's closed loops for forces, rates and poses.

The platform's matrices d(c, omega)/dx take the pose's rates x' to (c', omega), the velocity of a
leg's platform point and the platform's angular velocity; a leg's row takes these to its joint rate.
Together they make up the Jacobian J: q' = J x'. A closure applies J^-T to wrenches and
J^-1 to rates, finds poses from joint coordinates, and measures how far J is from singular.
A kind of closure is a subclass in this folder, entered in `closures.KINDS`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import reduce
from operator import mul

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.determinants import determinant, solve, solve_transposed
from pteron.errors import ModelError
from pteron.legs.leg import AngleLocus, LegEquations, LegMotion, PlaneLocus
from pteron.platforms.motion import PlatformEquations, PlatformMotion
from pteron.tolerances import ROUNDING


class Closure(ABC):
    """The closure of one machine, for one state, from its legs and platform."""

    def __init__(
        self,
        legs: Sequence[LegEquations],
        platform: PlatformEquations,
        strengths: Expression | None = None,
    ) -> None:
        if len(legs) < len(platform.coordinates):
            raise ModelError(
                f"legs: {len(legs)} given, {len(platform.coordinates)} or more expected, one for "
                f"each coordinate of the platform: {', '.join(platform.coordinates)}"
            )
        self.legs, self.platform = legs, platform
        self.strengths = ca.SX.ones(len(legs)) if strengths is None else strengths

    @property
    def is_redundant(self) -> bool:
        """Whether there are more legs than coordinates of the platform."""
        return len(self.legs) > len(self.platform.coordinates)

    @classmethod
    @abstractmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        """Return whether this class of closure fits machines with these legs and platform."""

    @property
    @abstractmethod
    def modes(self) -> int:
        """The greatest number of poses with the same joint coordinates."""

    def forces(
        self, wrench: Expression, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> Expression:
        """Return drive forces F (n, K) with J^T F = wrench (m, K) along the quasi-velocities.

        With J = B^-1 A, B being the divisors: F = B A^-T wrench. Of a redundant machine's forces
        these have the least sum of (F / strength)^2.
        """
        if self.is_redundant:
            shares, _ = solve_transposed(self._strong_rows(platform, legs), wrench)
            return ca.mtimes(ca.diag(self.strengths), shares)
        shares, volume = solve_transposed(plain_rows(platform, legs), wrench)
        rows = zip(legs, ca.vertsplit(shares), strict=True)
        return ca.vertcat(*(leg.divisor / volume * share for leg, share in rows))

    def rates(
        self, joints: Expression, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> Expression:
        """Return pose rates x (m, K) with J x = joints (n, K).

        For a redundant machine this is the least of the sum of (strength (J x - joints))^2.
        """
        if self.is_redundant:
            right = ca.mtimes(ca.diag(self.strengths), joints)
            return platform.pose_rates(solve(self._strong_rows(platform, legs), right)[0])
        right = ca.vertcat(*(leg.divisor * joints[i, :] for i, leg in enumerate(legs)))
        quasi, volume = solve(plain_rows(platform, legs), right)
        return platform.pose_rates(quasi / volume)

    def _strong_rows(self, platform: PlatformMotion, legs: Sequence[LegMotion]) -> Expression:
        """Return J's rows (n, m) in quasi-velocities, times the drives' strengths."""
        scales = self.strengths / ca.vertcat(*(leg.divisor for leg in legs))
        return ca.mtimes(ca.diag(scales), plain_rows(platform, legs))

    @abstractmethod
    def poses(self, joints: Expression) -> Expression:
        """Return every pose with joint coordinates (n, 1), as columns (m, k); NaN if not real."""

    closed_form: bool = True
    """Whether `poses` is a closed form; if not, `kinematics.assembly` computes the poses."""

    def measure(self, platform: PlatformMotion, legs: Sequence[LegMotion]) -> Expression:
        """Return the type-II measure, no unit: at most 1 in size, 0 where J is singular.

        It is det A of J = B^-1 A, or sqrt(det(A^T A)) of a redundant machine, with each leg's force
        on its platform point, or moment on the platform, scaled to unit size, divided by Hadamard's
        bound of the determinant of as many unit forces on these points. Its size is 1 only if the
        forces are isotropic and their moments balanced, which the points may not allow: a
        Quadrupteron with the platform points of Table 1 reaches 27/32. So it does not depend on
        units, frame or kind of leg; a force across a planar machine counts only with its component
        in the plane.
        """
        if any(leg.row.is_zero() for leg in legs):
            return ca.SX(0)  # a leg that moves nothing
        sizes = [leg.wrench_size for leg in legs]
        return self.measure_of(platform, [leg.row for leg in legs], sizes)

    def measure_of(
        self,
        platform: PlatformMotion,
        rows: Sequence[Expression],
        sizes: Sequence[Expression] | None = None,
    ) -> Expression:
        """Return the type-II measure of Jacobian rows (1, 6) of the legs, no unit.

        `sizes` are the norms of the legs' forces in space, or of their moments. Without them the
        rows are those of the legs' loci: unit forces on spheres and circles, unit moments, and the
        planes' normals unscaled.
        """
        lengths = self.platform.directions.shape[1]
        loci = [leg.locus(ca.SX(0)) for leg in self.legs]
        if sizes is None:
            sizes = [ca.norm_2(x.normal) if isinstance(x, PlaneLocus) else ca.SX(1) for x in loci]
        forces = sum(not isinstance(locus, AngleLocus) for locus in loci)
        bound = (forces / lengths) ** (lengths / 2)
        if forces == len(self.legs) and self.platform.angles():
            if self._points_are_collinear:  # no force has a moment
                return ca.SX(0)
            bound = bound * self._moment_bound
        elif self.is_redundant and self.platform.angles():
            moments = len(self.legs) - forces
            bound = bound * ca.sqrt(self._moment_bound**2 + moments)
        if self.is_redundant:  # whose subsets of rows have products of their own
            rows = [row / size for row, size in zip(rows, sizes, strict=True)]
            return determinant(rows_in_quasi_velocities(platform, rows)) / bound
        return determinant(rows_in_quasi_velocities(platform, rows)) / (bound * reduce(mul, sizes))

    def measure_squares(
        self, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> list[Expression]:
        """Return equivalent expressions of the squared type-II measure, to choose the cheapest.

        Which one is the cheapest depends on the other outputs of a program.
        """
        measure = self.measure(platform, legs)
        return [measure * measure]

    @property
    def _moment_bound(self) -> Expression:
        """An upper bound, m, of the norm of the moments of unit forces on the platform points.

        It is the root of the sum of the squared distances of the platform points from the axis
        along k through their mean.
        """
        # From the first point, so that points that coincide do so to the last bit.
        first = self.platform.offsets[0].a
        points = [offset.a - first for offset in self.platform.offsets]
        center = sum(points) / len(points)
        return ca.sqrt(sum(ca.dot(point - center, point - center) for point in points))

    @property
    def _points_are_collinear(self) -> bool:
        """Whether all platform points are numbers and, up to rounding, on one line along k."""
        size = sum(ca.norm_2(offset.a) for offset in self.platform.offsets)
        if not size.is_constant():
            return False
        return bool(float(self._moment_bound) <= ROUNDING * float(size))

    keeps_modes: bool = False
    """Whether each column of `poses` belongs to one assembly mode for all joint coordinates."""

    def vanishes(self) -> bool | None:
        """Return whether J is singular at every pose of this machine; None if unknown."""
        return None

    orientation: tuple[Expression, Expression] | None = None
    """(A, B) where det J is a constant times A cos(phi) + B sin(phi), so that whole orientations
    are singular (type II); None where that depends on the position, or never happens."""


def nan_below_zero(radicand: Expression) -> Expression:
    """Return NaN where the radicand is below zero, else 0."""
    return ca.if_else(radicand < 0, ca.SX.nan(), 0)


def plain_rows(platform: PlatformMotion, legs: Sequence[LegMotion]) -> Expression:
    """Return A (n, m): J's rows in quasi-velocities, times their divisors."""
    return rows_in_quasi_velocities(platform, [leg.row for leg in legs])


def rows_in_quasi_velocities(platform: PlatformMotion, rows: Sequence[Expression]) -> Expression:
    """Return the legs' Jacobian rows (n, m) by quasi-velocities, from those by (c', omega)."""
    return ca.vertcat(*(ca.mtimes(*pair) for pair in zip(rows, platform.matrices, strict=True)))
