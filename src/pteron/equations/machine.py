"""A machine as CasADi expressions: the equations of its legs, platform and closure, and gravity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import accumulate, chain
from typing import Any

import casadi as ca

from pteron.bodies.motion import Expression, moments_of
from pteron.bodies.parameters import PLATFORM, Parameter, parameter_list
from pteron.closures import Closure, kind_for
from pteron.legs.leg import LegEquations, LegMotion
from pteron.manipulator import Manipulator
from pteron.platforms import PlatformEquations
from pteron.platforms.motion import PlatformMoments, PlatformMotion


@dataclass(frozen=True)
class State:
    """The platform and its legs in motion."""

    platform: PlatformMotion
    legs: tuple[LegMotion, ...]


@dataclass(frozen=True)
class Machine:
    """The equations of a machine's parts."""

    robot: Manipulator
    """The machine, or one of the same topology; limits of passive joints are read from it."""
    legs: tuple[LegEquations, ...]
    platform: PlatformEquations
    closure: Closure
    gravity: Expression
    reference: Expression | None = None
    """The drives' forces (n, 1) that those of a redundant machine are nearest to; None for 0."""
    greatest: Expression | None = None
    """The drives' greatest forces (n, 1), if a redundant machine's are to stay within them."""

    @property
    def freedom(self) -> int:
        """Number of pose coordinates m."""
        return len(self.platform.coordinates)

    @property
    def wrench_size(self) -> int:
        """Number of components of a wrench on the platform."""
        return len(self.platform.wrench_columns) or self.freedom

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The machine's inertial parameters, in the paper's order."""
        return parameter_list([leg.kinds for leg in self.legs], self.platform.kinds)

    @classmethod
    @lru_cache(maxsize=64)
    def numeric(cls, robot: Manipulator) -> Machine:
        """Return the equations of a machine with its dimensions as constants."""
        legs = tuple(leg.equations() for leg in robot.legs)
        frame = [ca.SX(list(axis)) for axis in robot.platform.frame]
        points, fixed = (
            [ca.SX(list(getattr(leg, name))) for leg in robot.legs]
            for name in ("platform_point", "fixed_offset")
        )
        quantities = {name: ca.SX(list(v)) for name, v in robot.platform.quantities.items()}
        shares = {name: ca.SX(list(v)) for name, v in distribution_numbers(robot).items()}
        gravity = ca.SX(list(robot.gravity))
        return cls._assemble(robot, legs, frame, points, fixed, quantities, gravity, shares)

    @classmethod
    def symbolic(cls, robot: Manipulator) -> tuple[Machine, Expression]:
        """Return equations with dimensions as symbols, and the vector (G, 1) of these symbols.

        The vector holds the quantities of each leg, its platform point and fixed offset; then x0,
        y0, k, the platform's quantities and gravity; of a redundant machine
        its `distribution_numbers`: the order of `numbers`.
        """
        legs, points, fixed, vectors = [], [], [], []
        for i, leg in enumerate(robot.legs, start=1):
            parts = {q.name: ca.SX.sym(f"{q.name}{i}", len(q.value)) for q in leg.quantities}
            points.append(ca.SX.sym(f"platform_point{i}", 3))
            fixed.append(ca.SX.sym(f"fixed_offset{i}", 3))
            legs.append(leg.equations(parts))
            vectors += [*parts.values(), points[-1], fixed[-1]]
        frame = [ca.SX.sym(name, 3) for name in ("x0", "y0", "k")]
        quantities = {n: ca.SX.sym(n, len(v)) for n, v in robot.platform.quantities.items()}
        gravity = ca.SX.sym("gravity", 3)
        shares = {n: ca.SX.sym(n, len(v)) for n, v in distribution_numbers(robot).items()}
        platform = frame, points, fixed, quantities
        machine = cls._assemble(robot, tuple(legs), *platform, gravity, shares)
        return machine, ca.vertcat(
            *vectors, *frame, *quantities.values(), gravity, *shares.values()
        )

    @classmethod
    def _assemble(
        cls,
        robot: Manipulator,
        legs: tuple[LegEquations, ...],
        frame: list[Expression],
        points: list[Expression],
        fixed: list[Expression],
        quantities: dict[str, Any],
        gravity: Expression,
        shares: dict[str, Expression],
    ) -> Machine:
        """Return a machine's equations from its legs' equations and its platform's geometry.

        `shares` are a redundant machine's `distribution_numbers`.
        """
        quantities = {**quantities, "planes": [leg.holds for leg in legs]}
        platform = robot.platform.kind(frame, points, fixed, quantities)
        closure = kind_for([type(leg) for leg in legs], type(platform))
        assert closure is not None  # the manipulator has checked it
        others = {name: share for name, share in shares.items() if name != "strengths"}
        closed = closure(legs, platform, shares.get("strengths"))
        return cls(robot, legs, platform, closed, gravity, **others)

    def move_to_platform_frame(self, pose: Expression) -> tuple[Machine, Expression] | None:
        """Return the machine in the platform's axes, and these axes (3, 3); None if not cheaper.

        Joint forces are the same; the platform's points become constants, which saves operations.
        The result is None if no operation is saved.
        """
        platform_in_axes = self.platform.change_to_platform_axes(pose)
        if platform_in_axes is None:
            return None
        platform, axes = platform_in_axes
        legs = tuple(
            leg_in_axes
            for leg in self.legs
            if (leg_in_axes := leg.change_frame(axes, pose[:3])) is not None
        )
        if len(legs) < len(self.legs):
            return None
        closure = type(self.closure)(legs, platform, self.closure.strengths)
        gravity = ca.mtimes(axes.T, self.gravity)
        parts = {"legs": legs, "platform": platform, "closure": closure, "gravity": gravity}
        return replace(self, **parts), axes

    def state(
        self,
        pose: Expression,
        velocity: Expression | None = None,
        acceleration: Expression | None = None,
    ) -> State:
        """Return platform and legs in motion at a pose (m, 1), at rest without rates."""
        zero_rates = ca.SX.zeros(self.freedom)
        platform = self.platform.motion(
            pose,
            zero_rates if velocity is None else velocity,
            zero_rates if acceleration is None else acceleration,
        )
        legs_points = zip(self.legs, platform.points, self.platform.fixed, strict=True)
        legs = tuple(leg.motion(c, platform.rotation_at(c, fixed)) for leg, c, fixed in legs_points)
        return State(platform, legs)

    def legs_at(self, platform: PlatformMotion) -> list[LegEquations]:
        """Return the legs' equations at an orientation of the platform."""
        axes = platform.rotation.axes
        return [leg if axes is None else leg.with_axes(axes) for leg in self.legs]

    def moments(self, parameters: Expression) -> tuple[list[dict[str, Any]], PlatformMoments]:
        """Return mass moments of each leg's bodies by letter, and of the platform, from (N, K)."""
        blocks: dict[tuple[str, tuple[int, ...]], list[Expression]] = {}
        for p, row in zip(self.parameters, ca.vertsplit(parameters), strict=True):
            blocks.setdefault((p.body, p.legs), []).append(row)
        legs = [
            {body: moments_of(kinds, blocks[body, (i,)]) for body, kinds in leg.kinds.items()}
            for i, leg in enumerate(self.legs, start=1)
        ]
        return legs, self.platform.moments(blocks[PLATFORM, ()])


def closure_of(robot: Manipulator) -> Closure:
    """Return the closure equations of a machine, its dimensions as constants."""
    return Machine.numeric(robot).closure


def numbers(robot: Manipulator) -> list[float]:
    """Return the geometric numbers (G,) of a machine, in the order of `Machine.symbolic`."""
    geometry: list[float] = []
    for leg in robot.legs:
        for quantity in leg.quantities:
            geometry += map(float, quantity.value)
        geometry += (*leg.platform_point, *leg.fixed_offset)
    for vector in (*robot.platform.frame, *robot.platform.quantities.values(), robot.gravity):
        geometry += vector
    return [*geometry, *chain.from_iterable(distribution_numbers(robot).values())]


def distribution_numbers(robot: Manipulator) -> dict[str, tuple[float, ...]]:
    """Return by name what a redundant machine shares forces by, (n,) each; {} if it is not one.

    These are the drives' strengths and, where it has them, reference and greatest forces.
    """
    if not robot.redundancy:
        return {}
    reference = robot.distribution and robot.distribution.reference
    numbers = {"reference": reference, "greatest": robot.greatest_forces}
    return {"strengths": robot.drive_strengths} | {n: v for n, v in numbers.items() if v}


def number_places(robot: Manipulator) -> list[dict[str, int]]:
    """Return the first index of each quantity in the vector of `numbers`: by leg, then platform."""
    sizes = [{q.name: len(q.value) for q in leg.quantities} for leg in robot.legs]
    owned = [owner_sizes | {"platform_point": 3, "fixed_offset": 3} for owner_sizes in sizes]
    quantities = robot.platform.quantities.items()
    owned.append({"frame": 9} | {name: len(vector) for name, vector in quantities})
    starts = accumulate(
        chain.from_iterable(owner_sizes.values() for owner_sizes in owned), initial=0
    )
    return [{name: next(starts) for name in owner_sizes} for owner_sizes in owned]
