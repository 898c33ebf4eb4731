"""A new kind of leg: P-S-S, a slider with a rod between ball joints; three make a linear Delta.

It is written by `pteron.legs.leg` alone, with q = h - sigma sqrt(ll^2 - w.w + h^2), w = c - r and
h = w.e; b = w - q e is the rod. Differentiated, (b.e) q' = b.c' and (b.e) q'' = b.c'' + b'.b'.
"""

from dataclasses import dataclass
from math import cos, pi, sin
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import casadi as ca
import numpy as np

import pteron
from pteron.bodies.inertia import PlanarInertia, PointMass, RodInertia
from pteron.bodies.motion import BodyMotion, Expression, PointMotion, RotationMotion, point_rows
from pteron.bodies.vectors import Vector
from pteron.legs import KINDS, Drive, Reading
from pteron.legs.keys import Key
from pteron.legs.kind import SLIDER, LegKind, LegQuantity, ReachBound
from pteron.legs.leg import Joint, LegEquations, LegMotion, Reach, SphereLocus
from pteron.legs.rods import rod_body, universal_joints


@dataclass(frozen=True)
class SliderRod(LegKind):
    """Two parallel rods, whose bar keeps its direction, from a slider to a platform point."""

    guide_point: Vector
    slider_direction: Vector
    bar_direction: Vector
    platform_point: Vector
    lower_length: float
    slider_mass: float
    lower: RodInertia
    elbow: int = 1
    limits: tuple[float, float] | None = None
    fixed_offset: Vector = (0.0, 0.0, 0.0)
    drive: Drive | None = None
    reading: Reading | None = None

    type = "SliderRod"
    joint = SLIDER

    keys: ClassVar = {
        "slider_direction": Key("direction", "e, of the guide"),
        "bar_direction": Key("direction", "of the bars at the rods' ends"),
        "lower_length": Key("length", "of the rods, m"),
        "slider_mass": Key("slider", "the slider's mass, kg", "p"),
        "lower": Key("rod", "the rods: origin at the platform point, x along them to there", "l"),
    }

    @property
    def quantities(self) -> tuple[LegQuantity, ...]:
        return (
            LegQuantity("guide_point", "point", self.guide_point),
            LegQuantity("slider_direction", "direction", self.slider_direction, "e"),
            LegQuantity("bar_direction", "direction", self.bar_direction, "d"),
            LegQuantity("lower_length", "length", (self.lower_length,), "ll"),
            LegQuantity("elbow", "sign", (self.elbow,)),
        )

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        return (self.bar_direction,)

    @property
    def joint_axis(self) -> Vector:
        return self.slider_direction

    @property
    def reach_bound(self) -> ReachBound:
        return ReachBound(self.guide_point, self.slider_direction, self.lower_length)

    @property
    def reach_text(self) -> str:
        return f"its rod reaches {self.lower_length:.4g} m from the guide"


class SliderRodEquations(LegEquations):
    """The equations of a P-S-S leg; bar_direction is an axis of its joints, no more."""

    kinds: ClassVar = {"p": PointMass.kinds, "l": RodInertia.kinds}
    rides: ClassVar = ("l",)

    def __init__(
        self,
        guide_point: Expression,
        slider_direction: Expression,
        bar_direction: Expression,
        lower_length: Expression,
        elbow: Expression,
    ) -> None:
        self.r, self.e, self.d = guide_point, slider_direction, bar_direction
        self.ll, self.sigma = lower_length, elbow

    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        c, dc, ddc = point
        w = c - self.r
        h = ca.dot(w, self.e)
        divisor = self.sigma * ca.sqrt(self.reach(c).discriminant)  # b . e
        q = h - divisor
        b = w - q * self.e
        rate = ca.dot(b, dc) / divisor
        db = dc - rate * self.e
        acceleration = (ca.dot(b, ddc) + ca.dot(db, db)) / divisor
        row = point_rows(b.T)

        tip, n = self.r + q * self.e, b / self.ll
        slides = ca.mtimes(self.e, row / divisor)
        swing = (point_rows(ca.SX.eye(3)) - slides) / self.ll  # n' = swing (c', omega)
        dn, ddn = db / self.ll, (ddc - acceleration * self.e) / self.ll
        slider = Joint("P", self.e, self.r, row / divisor, rate, acceleration, "p", driven=True)
        chain = (slider, *universal_joints(self.d, tip, point, swing, (n, dn, ddn), rotation))
        slides = BodyMotion(tip, slides, acceleration * self.e)
        bodies = {"p": slides, "l": rod_body(point, n, ddn, swing)}
        return LegMotion(q, rate, acceleration, row, divisor, bodies, chain, links=(None, b))

    def reach(self, c: Expression) -> Reach:
        w = c - self.r
        h = ca.dot(w, self.e)
        discriminant = self.ll**2 - ca.dot(w, w) + h * h
        margin = self.ll - ca.sqrt(ca.dot(w, w) - h * h)
        return Reach(margin, discriminant, self.ll**2, self.ll)

    def locus(self, q: Expression) -> SphereLocus:
        return SphereLocus(self.r + q * self.e, self.ll)


SliderRod.equations_class = SliderRodEquations
KINDS[SliderRod.type] = SliderRod  # that is all: files may name it now


def linear_delta() -> pteron.Manipulator:
    """Return a machine with three vertical guides, 0.3 m from its axis."""
    legs = []
    for azimuth in (0.0, 2 * pi / 3, 4 * pi / 3):
        x, y = cos(azimuth), sin(azimuth)  # outwards
        leg = SliderRod(
            guide_point=(0.3 * x, 0.3 * y, 0.0),
            slider_direction=(0.0, 0.0, 1.0),
            bar_direction=(-y, x, 0.0),
            platform_point=(0.05 * x, 0.05 * y, 0.0),
            lower_length=0.4,
            slider_mass=0.8,
            lower=RodInertia.of_body(0.2, (-0.2,), 0.0107),
            elbow=-1,
        )
        legs.append(leg)
    platform = pteron.platforms.Platform("3T", PlanarInertia.of_body(0.5, (0.0, 0.0), 1e-3))
    return pteron.Manipulator("linear delta", platform, tuple(legs))


def main() -> None:
    """Check the machine against itself and print its base parameters."""
    robot = linear_delta()
    with TemporaryDirectory() as folder:
        assert pteron.load(pteron.save(robot, Path(folder) / "linear-delta.toml")) == robot

    rng = np.random.default_rng(0)
    pose = pteron.random_poses(robot, 50, type_i=0.5, type_ii=0.3)
    velocity, acceleration = rng.normal(size=(2, *pose.shape))
    joints = pteron.inverse_kinematics(robot, pose)
    back = pteron.direct_kinematics(robot, joints)
    closed = np.nanmin(np.abs(back - pose[:, None]).max(axis=-1), axis=-1).max()
    print(f"direct kinematics gives the pose back within {closed:.0e} m")

    # The actuators' power is the rate of the bodies' energy, by differences of fourth order.
    def energy(t: float) -> Any:
        x, dx = pose + t * velocity + t**2 / 2 * acceleration, velocity + t * acceleration
        return pteron.kinetic_energy(robot, x, dx) + pteron.potential_energy(robot, x)

    dt = 4e-5
    rate = (8 * (energy(dt) - energy(-dt)) - (energy(2 * dt) - energy(-2 * dt))) / (12 * dt)
    forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
    power = (forces * pteron.kinematics.joint_rates(robot, pose, velocity).actuated).sum(axis=-1)
    off = np.abs(power - rate).max() / np.abs(power).max()
    print(f"inverse dynamics balances the energy within {off:.0e} of the largest power")
    assert closed < 1e-12
    assert off < 1e-8

    base = pteron.base_parameters(robot)
    print(f"{base.rank} base parameters of {len(pteron.parameters(robot))}:")
    print(*(f"    {line}" for line in base.expressions()), sep="\n")
    assert base.rank == pteron.base_parameters(robot, "svd").rank == 7


if __name__ == "__main__":
    main()
