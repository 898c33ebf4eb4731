"""R-U-P-U legs: the telescopic shaft that turns the platform, the fourth axis of many Deltas.

It holds no point of the platform: its joint follows phi, and its two parts swing with the direction
from the base to the platform point. The cardan error of its joints is left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import casadi as ca

from pteron.bodies.inertia import RodInertia
from pteron.bodies.motion import AngleMotion, Expression, PointMotion
from pteron.bodies.vectors import Vector
from pteron.errors import ModelError
from pteron.legs.circles import perpendicular_to
from pteron.legs.kind import SHAFT, Key, LegKind, Quantity, Transfer
from pteron.legs.leg import Joint, LegEquations, LegMotion, Reach, Turned
from pteron.legs.rods import rod_body, universal_joints


@dataclass(frozen=True)
class RUPU(LegKind):
    """A telescopic shaft that turns the platform about its axis.

    Parameters
    ----------
    guide_point : vector
        r, where the shaft begins: its lower universal joint on the base, m.
    platform_point : vector
        s0, from P to where the shaft ends, in the platform frame, m.
    upper : RodInertia
        Inertia of the part at the base, about `guide_point`, x towards the platform point.
    lower : RodInertia
        Inertia of the part at the platform, about the platform point, x pointing there.
    ratio : float
        The joint's angle over phi.
    elbow : {1}
        A shaft has but one branch.
    limits : (float, float), optional
        Least and greatest joint angle, rad.
    fixed_offset : vector
        t0, the part of the platform point that does not turn with phi, in the base frame, m.
    direction : unit vector, optional
        Of the joint's axis: the platform's, which is its default.
    """

    guide_point: Vector
    platform_point: Vector
    upper: RodInertia
    lower: RodInertia
    ratio: float = 1.0
    elbow: int = 1
    limits: tuple[float, float] | None = None
    fixed_offset: Vector = (0.0, 0.0, 0.0)
    direction: Vector | None = None

    type = "RUPU"
    joint = SHAFT
    branches = (1,)
    follows_angle = True
    names: ClassVar = {"u": "upper part of the shaft", "l": "lower part of the shaft"}
    measure_text = "1 everywhere, as a shaft turns the platform in every pose"
    account = (
        "A telescopic shaft leads from the guide point r, between two universal joints, to the "
        "platform point s0 and turns the platform: its joint angle theta is the ratio times phi. "
        "The spin of its parts about their axis counts as the platform's; their universal joints "
        "are taken to turn alike."
    )

    keys: ClassVar = {
        "direction": Key("direction", default=None),
        "ratio": Key("number", default=1.0),
        "upper": Key("rod", "u"),
        "lower": Key("rod", "l"),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ratio == 0.0:
            raise ModelError("ratio: 0 given; the joint would not turn the platform")

    def under(self, axis: Vector) -> Self:
        return replace(self, direction=axis) if self.direction is None else self

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        d = self.joint_axis
        return (
            Quantity("guide_point", "point", self.guide_point),
            Quantity("direction", "direction", d, "d"),
            Quantity("plane_axis", "normal", perpendicular_to(d)),
            Quantity("ratio", "number", (self.ratio,)),
            Quantity("elbow", "sign", (self.elbow,)),
        )

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        return (1, 0, 0), (0, 1, 0), (0, 0, 1)

    @property
    def joint_axis(self) -> Vector:
        assert self.direction is not None  # the manipulator has given it
        return self.direction

    @property
    def reach_text(self) -> str:
        return "its shaft has no length"

    def transfers(self, gravity: Vector) -> tuple[Transfer, ...]:
        swing = {("I", "u"): (1, ()), ("I", "l"): (-1, ())}
        return (
            Transfer("the shaft{} swings about a fixed point", {("m", "u"): (1, ())}),
            Transfer("both parts of the shaft{} swing alike", swing),
        )


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

    def motion(self, point: PointMotion, angle: AngleMotion | None) -> LegMotion:
        assert angle is not None  # the manipulator has asked
        w = point.position - self.r
        length = ca.sqrt(ca.dot(w, w))
        n = w / length
        rate = ca.dot(n, point.velocity)
        dn = (point.velocity - rate * n) / length
        growth = ca.dot(n, point.acceleration) + length * ca.dot(dn, dn)
        ddn = (point.acceleration - growth * n - 2 * rate * dn) / length
        along = ca.horzcat(n.T, 0)
        rides = ca.horzcat(ca.SX.eye(3), ca.SX(3, 1))
        swing = (rides - ca.mtimes(n, along)) / length

        row = ca.horzcat(ca.SX(1, 3), self.ratio)
        turned = self.ratio * angle.rate, self.ratio * angle.acceleration
        upper = rod_body(PointMotion(self.r, ca.SX(3, 1), ca.SX(3, 1)), n, ddn, swing)
        bodies = {"u": upper._replace(velocity_row=ca.SX(3, 4))}
        bodies["l"] = rod_body(point, n, ddn, swing)

        # The shaft turns at its base; what turns the platform has its axis at the platform's end.
        joint = Joint("R", self.d, angle.axis_point(point), row, *turned)
        swung = (n, dn, ddn)
        *hinges, last = universal_joints(self.hinge, self.r, point, swing, swung, angle)
        telescope = Joint("P", n, self.r, along, rate, growth)
        gear = (last.row - row, last.rate - joint.rate, last.acceleration - joint.acceleration)
        chain = (joint, *hinges[:2], telescope, *hinges[2:], Joint("R", self.d, last.point, *gear))
        return LegMotion(
            self.ratio * angle.angle, *turned, row, ca.SX(1), bodies, chain, links=(None, w)
        )

    def reach(self, c: Expression) -> Reach:
        w = c - self.r
        square = ca.dot(w, w)
        length = ca.sqrt(square)
        return Reach(length, square, square, length)

    def locus(self, q: Expression) -> Turned:
        return Turned(q / self.ratio)


RUPU.equations_class = RUPUEquations
