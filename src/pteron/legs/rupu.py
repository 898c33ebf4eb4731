"""R-U-P-U legs: the telescopic shaft that turns the platform, the fourth axis of many Deltas.

A turning joint (R) drives two universal joints (U) with a slide (P) between them. The leg holds no
point of the platform: its joint follows phi, and its two parts swing with the direction from the
base to the platform point. The angle error of universal joints is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from random import Random
from typing import ClassVar, Self

import casadi as ca

from pteron.bodies.inertia import RodInertia
from pteron.bodies.motion import Expression, Moments, PointMotion, RotationMotion, point_rows
from pteron.bodies.vectors import Vector, dot, parallel
from pteron.errors import ModelError
from pteron.legs.circles import perpendicular_to, random_fraction, random_vector
from pteron.legs.cones import joint_limit
from pteron.legs.drive import Drive
from pteron.legs.keys import ACCOUNTS, FieldCondition, keys_of
from pteron.legs.kind import SHAFT, LegKind, LegQuantity, LegTransfer
from pteron.legs.leg import (
    AngleLocus,
    Joint,
    LegEquations,
    LegMotion,
    Needs,
    Passive,
    Reach,
    force_wrench,
)
from pteron.legs.reading import Reading
from pteron.legs.rods import rod_body, universal_joints

_FAST = 10.0
"""Ratio of a shaft's gear from which it is probably that of the motor's gear instead."""


def _check_ratio(ratio: float) -> None:
    """Raise if the shaft's transmission ratio is 0."""
    if ratio == 0.0:
        raise ModelError("ratio: 0 given; the joint would not turn the platform")


def _check_travel(travel: tuple[float, float] | None) -> None:
    """Raise ModelError if the travel's least length, m, is negative."""
    if travel is not None and travel[0] < 0.0:
        raise ModelError(f"travel: {travel[0]:g} m given, but no length is below 0; give 0 or more")


@dataclass(frozen=True)
class RUPU(LegKind):
    """A telescopic shaft that turns the platform about its axis."""

    guide_point: Vector
    platform_point: Vector
    upper: RodInertia
    lower: RodInertia
    ratio: float = 1.0
    elbow: int = 1
    limits: tuple[float, float] | None = None
    fixed_offset: Vector = (0.0, 0.0, 0.0)
    drive: Drive | None = None
    reading: Reading | None = field(default=None, kw_only=True)
    direction: Vector | None = None
    travel: tuple[float, float] | None = None

    type = "RUPU"
    joint = SHAFT
    branches = (1,)
    follows_angle = True
    names: ClassVar = {"u": "upper part of the shaft", "l": "lower part of the shaft"}
    measure_text = "1 everywhere, as a shaft turns the platform in every pose"
    has_constant_measure = True
    account = ACCOUNTS["RUPU"]

    keys: ClassVar = keys_of("RUPU")

    conditions = (
        FieldCondition(("ratio",), _check_ratio),
        FieldCondition(("travel",), _check_travel),
    )

    def with_platform_frame(self, frame: Sequence[Vector]) -> Self:
        """Return the leg with its `direction` checked, or filled in from the platform's axis."""
        axis = frame[2]
        if self.direction is None:
            return replace(self, direction=axis)
        text = f"direction: {list(self.direction)}"
        if not parallel(self.direction, axis):
            raise ModelError(
                f"{text} is not along the platform's axis {list(axis)}, about which a shaft turns "
                "it; leave direction out"
            )
        if dot(self.direction, axis) < 0.0:
            raise ModelError(
                f"{text} is the platform's axis {list(axis)} reversed; leave direction out, and "
                "give a negative ratio where the joint's angle counts the other way"
            )
        return self

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The leg's geometric quantities: base point, axis, ratio and elbow."""
        d = self.joint_axis
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("direction", "direction", d, "d"),
            LegQuantity("plane_axis", "normal", perpendicular_to(d)),
            LegQuantity("ratio", "number", (self.ratio,)),
            LegQuantity("elbow", "sign", (self.elbow,)),
        )

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return three axes: the shaft leaves every platform rotation free except by its drive."""
        return (1, 0, 0), (0, 1, 0), (0, 0, 1)

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the telescope's length in a list, m, if its travel is limited."""
        return joint_limit("shaft", "m", ca.norm_2(motion.links[1]), self.travel, 1.0)

    def unlikely_values(self, axis: Vector | None) -> Iterator[str]:
        """Yield warnings about a ratio far from 1 and centres of mass beyond the shaft's ends."""
        if not 1.0 / _FAST <= abs(self.ratio) <= _FAST:
            yield (
                f"ratio: {self.ratio:g} rad of the joint per rad of phi: is that the motor's gear? "
                "The joint is the shaft's end at the base"
            )
        if self.upper.first_moment[0] < 0.0:
            yield "upper: center_of_mass: x is negative, towards the base joint's other side"
        if self.lower.first_moment[0] > 0.0:
            yield "lower: center_of_mass: x is positive, beyond the platform point"

    @property
    def metres(self) -> dict[str, Sequence[float]]:
        """All lengths of the leg, m, by key, the telescope's travel included."""
        return {**super().metres, **({} if self.travel is None else {"travel": self.travel})}

    @property
    def joint_axis(self) -> Vector:
        """The platform's axis, about which the shaft turns it, a unit vector."""
        assert self.direction is not None  # the manipulator has given it
        return self.direction

    @property
    def reach_text(self) -> str:
        """Why a shaft does not reach a point, as a clause for messages: its ends coincide."""
        return "its shaft has no length"

    def transfers(self, gravity: Vector) -> tuple[LegTransfer, ...]:
        """Return how inertial parameters of the shaft's parts transfer to others, with reasons."""
        swing = {("I", "u"): (1, ()), ("I", "l"): (-1, ())}
        transfer_list = [
            LegTransfer("the shaft{} swings about a fixed point", {("m", "u"): (1, ())}),
            LegTransfer("both parts of the shaft{} swing alike", swing),
        ]
        if not any(gravity):
            transfer_list.append(
                LegTransfer("no gravity acts on the shaft{}", {("mgx", "u"): (1, ())})
            )
        return tuple(transfer_list)

    @classmethod
    def draw_closure(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int]:
        """Return a random rational shaft vector (3,), and 1 for the elbow's sign."""
        return random_vector(abs(random_fraction(rng)), 3, rng), 1


class RUPUEquations(LegEquations):
    """The equations of a telescopic shaft, with n = w / L from its base to the platform point."""

    kinds: ClassVar = {"u": RodInertia.kinds, "l": RodInertia.kinds}
    rides = ("l",)

    def __init__(
        self,
        guide_point: Expression,
        direction: Expression,
        plane_axis: Expression,
        ratio: Expression,
        elbow: Expression,
    ) -> None:
        self.r, self.d, self.hinge, self.ratio = guide_point, direction, plane_axis, ratio

    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        """Return the motion of shaft and joints; the joint coordinate is ratio times phi."""
        (turn,) = rotation.turns  # the manipulator has asked for one
        w = point.position - self.r
        length = ca.sqrt(ca.dot(w, w))
        n = w / length
        rate = ca.dot(n, point.velocity)
        dn = (point.velocity - rate * n) / length
        growth = ca.dot(n, point.acceleration) + length * ca.dot(dn, dn)
        ddn = (point.acceleration - growth * n - 2 * rate * dn) / length
        axial_row, rides = point_rows(n.T), point_rows(ca.SX.eye(3))
        swing = (rides - ca.mtimes(n, axial_row)) / length

        row = self.ratio * turn.row
        joint_motion = self.ratio * turn.rate, self.ratio * turn.acceleration
        upper = rod_body(PointMotion(self.r, ca.SX(3, 1), ca.SX(3, 1)), n, ddn, swing)
        bodies = {"u": upper._replace(velocity_row=ca.SX(3, 6))}
        bodies["l"] = rod_body(point, n, ddn, swing)

        # The shaft turns at its base; the axis about which it turns the platform is at P.
        joint = Joint(
            "R",
            self.d,
            rotation.center(point),
            row,
            *joint_motion,
            driven=True,
            gear=self.ratio,
            seat=self.r,
        )
        direction = (n, dn, ddn)
        *hinges, last = universal_joints(
            self.hinge, self.r, point, swing, direction, rotation, body="u"
        )
        telescope = Joint("P", n, self.r, axial_row, rate, growth, "l")
        gear = (last.row - row, last.rate - joint.rate, last.acceleration - joint.acceleration)
        chain = (joint, *hinges[:2], telescope, *hinges[2:], Joint("R", self.d, last.point, *gear))
        return LegMotion(
            self.ratio * rotation.angle,
            *joint_motion,
            row,
            ca.SX(1),
            bodies,
            chain,
            links=(None, w),
        )

    def needs(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces that both parts of the shaft require, all at the platform point.

        With mu = (I_u + I_l) / L^2, eta = m gamma_x / L of the lower part and nu that of the upper,
        kappa = L' / L and P = 1 - n n^T, the force is P v - 2 kappa (mu + eta) P c' - eta (n'.n')
        w, with v = (mu + 2 eta) c'' - (eta + nu) g, besides a point mass at the platform point.
        """
        dc, ddc, w = point.velocity, point.acceleration, point.position - self.r
        square, forward = ca.dot(w, w), ca.dot(w, dc)
        length, kappa = ca.sqrt(square), forward / square
        mu = (inertia["u"].i + inertia["l"].i) / square
        eta, nu = inertia["l"].hx / length, inertia["u"].hx / length
        swing = mu + eta
        v = ca.mtimes(ddc, swing + eta) - ca.mtimes(gravity, eta + nu)
        turning = ca.dot(dc, dc) - kappa * forward  # L^2 n'.n'
        axial_share = (ca.mtimes(w.T, v) + turning * eta) / square - 2 * kappa * kappa * swing
        force = v - ca.mtimes(w, axial_share) - ca.mtimes(dc, 2 * kappa * swing)
        return Needs(ca.SX(1, swing.shape[1]), force_wrench(force), inertia["l"].m)

    def reach(self, c: Expression) -> Reach:
        """Return the reach margin: the shaft's length, zero only with c at the guide point."""
        w = c - self.r
        square = ca.dot(w, w)
        length = ca.sqrt(square)
        return Reach(length, square, square, length)

    def lever(self, length: Expression) -> Expression:
        """Return the platform's characteristic length over |ratio|, m per rad of the joint."""
        return length / ca.fabs(self.ratio)

    def locus(self, q: Expression) -> AngleLocus:
        """Return the platform's angle q / ratio, rad, while the joint is held at q."""
        return AngleLocus(q / self.ratio)


RUPU.equations_class = RUPUEquations
