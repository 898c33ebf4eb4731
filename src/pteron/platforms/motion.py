"""The protocol of platforms: read this page before writing another kind.

A platform maps its pose x and its derivatives to the motion of the points that the legs carry, and
says what it needs itself. A kind is one file of this folder: a class under `PlatformEquations`,
which `platforms.equations_class` finds by the file's keys.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import casadi as ca
import numpy as np

from pteron.bodies.inertia import PlanarInertia
from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    Moments,
    PointMotion,
    RotationMotion,
    mass_moment,
    moments_of,
    needed_wrench,
)
from pteron.platforms.coordinates import are_angles


class Offset(NamedTuple):
    """s = a cos(phi) + b sin(phi) + still, from P to a platform point; each (3, 1).

    `still` is along k, and what of the platform does not turn.
    """

    a: Expression
    b: Expression
    still: Expression


class PlatformMotion(NamedTuple):
    """The platform's state: its legs' points, their matrices, its rotation and its own body."""

    points: tuple[PointMotion, ...]
    matrices: tuple[Expression, ...]
    """(6, m), one a leg: (c', omega) = matrix x'."""
    rotation: RotationMotion
    axes: Expression
    """(3, 3): x, y and z of the platform's frame, as the joints of its legs see them."""
    body: BodyMotion
    """The platform itself, its rows against (p', omega)."""
    matrix: Expression
    """(6, m): (p', omega) = matrix x'."""

    def rotation_at(self, point: PointMotion, fixed: Expression) -> RotationMotion:
        """Return the rotation as the leg at a point sees it, whose fixed offset is given."""
        return self.rotation._replace(hinge=point.position - fixed)


class PlatformEquations(ABC):
    """The equations of a platform, for one state."""

    coordinates: ClassVar[tuple[str, ...]]
    """The pose's coordinates, in order."""
    kinds: ClassVar[tuple[str, ...]] = PlanarInertia.kinds
    """The kinds of its inertial parameters."""
    slides: ClassVar[bool] = False
    """Whether phi slides what the legs carry, and does not turn it."""

    def __init__(
        self,
        frame: Sequence[Expression],
        platform_points: Sequence[Expression],
        fixed_offsets: Sequence[Expression],
    ) -> None:
        self.frame, self.points, self.fixed = frame, platform_points, fixed_offsets
        x0, y0, k = frame
        self.offsets = [
            Offset(x0 * s[0] + y0 * s[1], y0 * s[0] - x0 * s[1], k * s[2] + t)
            for s, t in zip(platform_points, fixed_offsets, strict=True)
        ]
        self.directions = ca.SX.eye(3) if "z" in self.coordinates else ca.horzcat(x0, y0)
        """(3, 2) or (3, 3): along which the pose's lengths count; p = directions (x, y, ...)."""

    @classmethod
    def angles(cls) -> list[int]:
        """Return where the pose's angles stand."""
        return np.flatnonzero(are_angles(cls.coordinates)).tolist()

    def moments(self, rows: Sequence[Expression]) -> Moments:
        """Return the platform's inertia from the rows (1, K) of its parameters."""
        return moments_of(self.kinds, list(rows))

    @abstractmethod
    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion of the platform and of its points."""

    @abstractmethod
    def needs(self, motion: PlatformMotion, gravity: Expression, inertia: Moments) -> Expression:
        """Return the wrench (m, K) that the platform itself needs at P, -F_e."""

    def needed_wrench(
        self, motion: PlatformMotion, gravity: Expression, inertia: Moments
    ) -> tuple[Expression, Expression]:
        """Return the force and the moment about P, each (3, K), that the platform needs."""
        return needed_wrench(motion.body, inertia, gravity)

    def wrench_matrix(self, motion: PlatformMotion, gravity: Expression) -> Expression:
        """Return Om_e (m, k) of Eq. (15): what acts on it, per unit of each of its parameters."""
        return -self.needs(motion, gravity, self.moments(ca.vertsplit(ca.SX.eye(len(self.kinds)))))

    @abstractmethod
    def mass_matrix(self, motion: PlatformMotion, inertia: Moments) -> Expression:
        """Return its mass matrix (m, m) with respect to the pose."""

    def mass_moment(self, motion: PlatformMotion, inertia: Moments) -> Expression:
        """Return mass times centre of mass, (3, K), in the base frame."""
        return mass_moment(motion.body, inertia)

    def carrying(self, inertia: Moments, masses: Sequence[Expression]) -> Moments:
        """Return the platform's inertia with masses (1, K), one a leg, on its points."""
        m, hx, hy, i = inertia
        for s, mass in zip(self.points, masses, strict=True):
            m, hx, hy = m + mass, hx + s[0] * mass, hy + s[1] * mass
            i = i + (s[0] * s[0] + s[1] * s[1]) * mass
        return Moments(m, hx, hy, i)
