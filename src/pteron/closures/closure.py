"""What a closure must supply: read this page before writing another.

The legs' rows [dq/dc | dq/dphi] and the platform's matrices d (c, phi)/dx make up the Jacobian, Eq.
(10): q' = J x'. A closure turns that round: forces through J^-T, rates through J^-1, joint
coordinates into poses, and how far J is from singular. Which closure serves a machine depends on
its legs' rows and on its platform alone. A kind is one file of this folder, named in
`closures.KINDS`; what is solved here by the adjugate it may give in closed form.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import reduce
from operator import mul

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.determinants import adjugate, determinant
from pteron.legs.leg import LegEquations, LegMotion
from pteron.platforms.motion import PlatformEquations, PlatformMotion


class Closure(ABC):
    """The closure of one machine, for one state."""

    def __init__(self, legs: Sequence[LegEquations], platform: PlatformEquations) -> None:
        self.legs, self.platform = legs, platform
        square = sum(ca.dot(offset.a, offset.a) for offset in platform.offsets) / len(legs)
        self.lever = ca.SX(1) if square.is_zero() else ca.sqrt(square)
        """Root mean square distance of the platform points from the axis, m; 1 m if they are on it.
        """

    @classmethod
    @abstractmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        """Say whether this kind of closure serves machines of such legs and platform."""

    @property
    @abstractmethod
    def modes(self) -> int:
        """How many columns `poses` has."""

    def forces(
        self, wrench: Expression, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> Expression:
        """Return F (n, K) with J^T F = wrench (m, K).

        With J = B^-1 A, B being the divisors: F = B A^-T wrench.
        """
        rows = plain_rows(platform, legs)
        across = adjugate(rows)
        divisors = ca.vertcat(*(leg.divisor for leg in legs))
        share = divisors / ca.mtimes(rows[0, :], across[:, 0])
        return ca.repmat(share, 1, wrench.shape[1]) * ca.mtimes(across.T, wrench)

    def rates(
        self, joints: Expression, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> Expression:
        """Return x (m, K) with J x = joints (n, K)."""
        rows = plain_rows(platform, legs)
        across = adjugate(rows)
        right = ca.vertcat(*(leg.divisor * joints[i, :] for i, leg in enumerate(legs)))
        return ca.mtimes(across, right) / ca.mtimes(rows[0, :], across[:, 0])

    @abstractmethod
    def poses(self, joints: Expression) -> Expression:
        """Return every pose that joint coordinates allow, as columns (m, k); NaN if not real."""

    def measure(self, platform: PlatformMotion, legs: Sequence[LegMotion]) -> Expression:
        """Return the type-II measure: 1 in size at best, 0 where J is singular, without unit.

        It is the volume that the rows of A span, J = B^-1 A, each made a unit vector, after phi is
        counted as a length on `lever`: the same for every kind of leg, in any units and frame.
        """
        rows = plain_rows(platform, legs)
        if platform.angle is not None:
            rows = ca.horzcat(rows[:, :-1], rows[:, -1] / self.lever)
        squares = (ca.dot(row, row) for row in ca.vertsplit(rows))
        return determinant(rows) / ca.sqrt(reduce(mul, squares))

    keeps_modes: bool = False
    """Whether each column of `poses` is one assembly mode throughout."""

    def vanishes(self) -> bool | None:
        """Say whether J is singular at every pose, for a machine in numbers; None: not known."""
        return None

    orientation: tuple[Expression, Expression] | None = None
    """(A, B) where det J is a constant times A cos(phi) + B sin(phi), so that whole orientations
    are singular (type II); None where that depends on the position, or never happens."""


def nan_below_zero(value: Expression) -> Expression:
    """Return NaN where a value is below zero, else 0."""
    return ca.if_else(value < 0, ca.SX.nan(), 0)


def plain_rows(platform: PlatformMotion, legs: Sequence[LegMotion]) -> Expression:
    """Return A (n, m), J's rows times their divisors."""
    pairs = zip(legs, platform.matrices, strict=True)
    return ca.vertcat(*(ca.mtimes(leg.row, matrix) for leg, matrix in pairs))
