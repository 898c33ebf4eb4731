"""What a closure must supply: read this page before writing another.

The legs' rows [dq/dc | dq/dphi] and the platform's matrices d (c, phi)/dx make up the Jacobian, Eq.
(10): q' = J x'. A closure turns that round: forces through J^-T, rates through J^-1, joint
coordinates into poses, and how far J is from singular. Which closure serves a machine depends on
its legs' rows and on its platform alone. A kind is one file of this folder, named in
`closures.KINDS`; its closed forms are tested against the plain J.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.legs.leg import LegEquations, LegMotion
from pteron.platforms.motion import PlatformEquations, PlatformMotion


class Closure(ABC):
    """The closure of one machine, for one state."""

    def __init__(self, legs: Sequence[LegEquations], platform: PlatformEquations) -> None:
        self.legs, self.platform = legs, platform

    @classmethod
    @abstractmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        """Say whether this kind of closure serves machines of such legs and platform."""

    @property
    @abstractmethod
    def modes(self) -> int:
        """How many columns `poses` has."""

    @abstractmethod
    def forces(
        self, wrench: Expression, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> Expression:
        """Return F (n, K) with J^T F = wrench (m, K)."""

    @abstractmethod
    def rates(
        self, joints: Expression, platform: PlatformMotion, legs: Sequence[LegMotion]
    ) -> Expression:
        """Return x (m, K) with J x = joints (n, K)."""

    @abstractmethod
    def poses(self, joints: Expression) -> Expression:
        """Return every pose that joint coordinates allow, as columns (m, k); NaN if not real."""

    @abstractmethod
    def measure(self, platform: PlatformMotion, legs: Sequence[LegMotion]) -> Expression:
        """Return the type-II measure: 1 in size at best, 0 where J is singular, without unit."""

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


def det3(m: Expression) -> Expression:
    """Return the determinant of a 3x3 matrix."""
    return ca.dot(m[0, :].T, ca.cross(m[1, :].T, m[2, :].T))


def adjugate3(m: Expression) -> Expression:
    """Return the adjugate of a 3x3 matrix: its columns are the cross products of its rows."""
    a, b, c = m[0, :].T, m[1, :].T, m[2, :].T
    return ca.horzcat(ca.cross(b, c), ca.cross(c, a), ca.cross(a, b))
