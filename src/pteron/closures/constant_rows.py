"""The closed-form closure of legs with constant rows, d_bar . (c - r) = rho, such as P-R-R-R legs.

Here rho is the slider, c the platform point, r the guide point; the rows d_bar make up D. Of four
such legs under a platform that turns (3T1R), J = [ D | j ]. D has one left null vector N (N^T D =
0), so that D^T F = f has the solutions F = P f + lambda N, with D^T P = 1. Nothing is eliminated
numerically: the only denominator is N . j, which depends on the platform's angle phi alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure, nan_below_zero
from pteron.closures.determinants import adjugate, determinant
from pteron.legs.leg import LegEquations, LegMotion, PlaneLocus
from pteron.platforms.motion import PlatformEquations, PlatformMotion
from pteron.platforms.translating import Translating
from pteron.platforms.turning import Turning

_VANISHING = 1e-10
"""Relative size below which the coefficients of det J count as zero: far above their rounding
(1e-16) and far below what any layout meant to work would have."""

_ROUNDING = 1e-14
"""Rounding of the closures' terms, relative to the largest of them."""


class ConstantRows(Closure):
    """Legs with constant rows, under a platform that translates in space and may turn about k."""

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        """Return whether all legs have constant Jacobian rows and the platform moves along z."""
        constant = all(leg.row_is_constant for leg in legs)
        return (
            constant and issubclass(platform, Translating | Turning) and "z" in platform.coordinates
        )

    def __init__(
        self,
        legs: Sequence[LegEquations],
        platform: PlatformEquations,
        strengths: Expression | None = None,
    ) -> None:
        super().__init__(legs, platform, strengths)
        self._has_angle = bool(platform.angles())
        bars: list[Expression] = [leg.constant_row for leg in legs]
        self.rows = ca.horzcat(*bars).T  # D
        if not self._has_angle:
            self.right_inverse = adjugate(self.rows).T / determinant(self.rows)  # P
            return
        normal = ca.mtimes(self.rows.T, self.rows)
        self.right_inverse = ca.mtimes(self.rows, adjugate(normal)) / determinant(normal)
        null = ca.vertcat(*((-1) ** i * determinant(_delete_row(self.rows, i)) for i in range(4)))
        self.null = null / ca.norm_inf(null) if null.is_constant() else null  # N
        # j = cosines cos(phi) + sines sin(phi) is the Jacobian's fourth column.
        pairs = list(zip(bars, platform.offsets, strict=True))
        self.cosines = ca.vertcat(*(ca.dot(d, offset.b) for d, offset in pairs))
        self.sines = ca.vertcat(*(-ca.dot(d, offset.a) for d, offset in pairs))
        # N . j = A cos(phi) + B sin(phi); det J is a constant times it.
        self.orientation = ca.dot(self.null, self.cosines), ca.dot(self.null, self.sines)

    keeps_modes = True

    def vanishes(self) -> bool:
        """Return whether J is singular at every pose of this machine."""
        return self._vanishes

    @cached_property
    def _vanishes(self) -> bool:
        """Whether J is singular at every pose of this machine, up to rounding."""
        sizes = np.linalg.svd(np.array(ca.evalf(self.rows)), compute_uv=False)
        if sizes[-1] <= _VANISHING * sizes[0] or self.orientation is None:
            return bool(sizes[-1] <= _VANISHING * sizes[0])
        # Relative to sizes that cannot vanish by cancellation: rounding has no other scale here.
        null = np.abs(np.array(ca.evalf(self.null))).max()
        bars = np.linalg.norm(np.array(ca.evalf(self.rows)), axis=1).max()
        points = max(float(ca.norm_2(ca.DM(ca.evalf(s)))) for s in self.platform.points)
        a, b = (float(coefficient) for coefficient in self.orientation)
        size = np.hypot(a, b)
        return bool(size <= _VANISHING * null * bars * points)

    @property
    def modes(self) -> int:
        """The number of assembly modes: 2 if the platform has an angle, else 1."""
        return 2 if self._has_angle else 1

    def measure_of(
        self,
        platform: PlatformMotion,
        rows: Sequence[Expression],
        sizes: Sequence[Expression] | None = None,
    ) -> Expression:
        """Return the type-II measure of the legs' rows; 0 for a machine singular everywhere.

        Its sign is that of N . j, as in the columns of `poses`. It is exactly 0 for a machine that
        is singular everywhere, where N . j is mere rounding.
        """
        if self.rows.is_constant() and self.vanishes():
            return ca.SX(0)
        return (-1 if self._has_angle else 1) * super().measure_of(platform, rows, sizes)

    def forces(
        self, wrench: Expression, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> Expression:
        """Return drive forces (n, K) with J^T F = wrench (m, K), from constant inverses."""
        force = wrench[:3, :]
        if self.orientation is None:
            return ca.mtimes(self.right_inverse, force)
        inverse = _sparse_inverse(self.rows) if self.rows.is_constant() else self.right_inverse
        particular, column = ca.mtimes(inverse, force), self._column(platform)
        unbalanced = wrench[3, :] - ca.mtimes(column.T, particular)
        return particular + ca.mtimes(self.null, unbalanced / ca.dot(self.null, column))

    def _column(self, platform: PlatformMotion) -> Expression:
        """Return the Jacobian's fourth column (n, 1), by the angle phi."""
        phi = platform.rotation.angle
        return self.cosines * ca.cos(phi) + self.sines * ca.sin(phi)

    def rates(
        self, joints: Expression, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> Expression:
        """Return pose rates x' (m, K) for joint rates (n, K), from constant inverses."""
        if self.orientation is None:
            return ca.mtimes(self.right_inverse.T, joints)
        column = self._column(platform)
        angle = ca.mtimes(self.null.T, joints) / ca.dot(self.null, column)
        return ca.vertcat(ca.mtimes(self.right_inverse.T, joints - ca.mtimes(column, angle)), angle)

    def poses(self, joints: Expression) -> Expression:
        """Return every pose with joint coordinates (n, 1), as columns (m, 1 or 2); NaN if not real.

        A 3T machine has one pose. For 3T1R the left null vector of the closure equations gives A'
        cos(phi) + B' sin(phi) = C, with two angles, where platform points are taken at phi = 0, in
        base axes. The first column has N . j > 0, the second N . j < 0, so that each column is one
        assembly mode. Poses are NaN if C^2 > A'^2 + B'^2.
        """
        constants, sizes = [], []
        for leg, offset, q in zip(
            self.legs, self.platform.offsets, ca.vertsplit(joints), strict=True
        ):
            locus = leg.locus(q)
            assert isinstance(locus, PlaneLocus)
            constant = offset.constant if self._has_angle else offset.constant + offset.a
            constants.append(locus.offset - ca.dot(locus.normal, constant))
            sizes.append(locus.size)
        right = ca.vertcat(*constants)
        if self.orientation is None:
            return ca.mtimes(self.right_inverse.T, right)
        # The derivative of d_bar . s with respect to phi is j, so that d_bar . s itself is
        # cosines sin(phi) - sines cos(phi); hence A' = -B and B' = A.
        a, b = self.orientation
        total, square = ca.dot(self.null, right), a * a + b * b
        # At a singular orientation both poses meet and the radicand is rounding alone: a radicand
        # barely below zero counts as zero, an error of 1e-7 rad there. N . constants cancels the
        # sizes of its terms, but not their rounding.
        discriminant = square - total * total
        size = ca.dot(ca.fabs(self.null), ca.vertcat(*sizes))
        slack = _ROUNDING * (square + ca.sqrt(square) * size)
        radicand = ca.fmax(discriminant, ca.fmin(discriminant + slack, 0))
        root = ca.sqrt(radicand)
        poses = []
        for branch in (1, -1):
            cosine = (-b * total + branch * a * root) / square
            sine = (a * total + branch * b * root) / square
            p = ca.mtimes(self.right_inverse.T, right - (self.cosines * sine - self.sines * cosine))
            poses.append(ca.vertcat(p, ca.atan2(sine, cosine)) + nan_below_zero(radicand))
        return ca.horzcat(*poses)


def _sparse_inverse(rows: Expression) -> Expression:
    """Return P (4, 3) with D^T P = 1 for D (4, 3), one row zero: forces act on three legs."""
    best = max(range(4), key=lambda i: abs(float(determinant(_delete_row(rows, i)))))
    three_rows = _delete_row(rows, best)
    inverse = ca.vertsplit(adjugate(three_rows).T / determinant(three_rows))
    inverse.insert(best, ca.SX.zeros(1, 3))
    return ca.vertcat(*inverse)


def _delete_row(rows: Expression, i: int) -> Expression:
    """Return a matrix without its row i."""
    return ca.vertcat(*(rows[j, :] for j in range(rows.shape[0]) if j != i))
