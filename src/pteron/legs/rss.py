"""R-S-S legs, the Delta robot's: a crank (R) whose end carries a rod between two ball joints (S).

Two parallel rods, which keep the platform from turning, count as one rod with both inertias. The
joints of a rod are counted as universal ones (R-U-U): a rod's spin about itself moves nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import ClassVar

import casadi as ca

from pteron.bodies.inertia import PlanarInertia, RodInertia
from pteron.bodies.motion import BodyMotion, Expression, PointMotion, RotationMotion, point_rows
from pteron.bodies.vectors import Vector, cross, parallel
from pteron.errors import ModelError
from pteron.legs.circles import random_vector
from pteron.legs.crank import CrankEquations, CrankLeg, CrankState
from pteron.legs.keys import ACCOUNTS, FieldCondition, keys_of
from pteron.legs.leg import Joint, LegMotion, SphereLocus
from pteron.legs.rods import (
    RodLeg,
    rod_body,
    universal_joints,
)


def _check_bar(bar: Vector | None, direction: Vector) -> None:
    """Raise ModelError if the rods' bar is not along the crank's axis."""
    if bar is not None and not parallel(bar, direction):
        raise ModelError(
            f"bar_direction: {list(bar)} is not along direction {list(direction)}, so that the "
            "crank turns the bar and with it the platform"
        )


@dataclass(frozen=True)
class RSS(RodLeg, CrankLeg):
    """An R-S-S leg that carries one point of the platform.

    The crank turns about `direction` through `guide_point`; its angle is zero where it points along
    `zero_direction`, and positive by the right hand about `direction`.
    """

    type = "RSS"
    names: ClassVar = {"u": "crank", "l": "rod"}
    measure_text = "the sine of the angle between crank and rod, seen along d"
    account = ACCOUNTS["RSS"]

    keys: ClassVar = keys_of("crank", "rod", "RSS")

    conditions = (FieldCondition(("bar_direction", "direction"), _check_bar),)

    @property
    def bar(self) -> Vector | None:
        """The crank's axis, along which parallel rods are apart; None for a single rod."""
        return self.direction if self.rods > 1 else None

    def tip_axes(self, motion: LegMotion) -> Expression:
        """Return the crank's axes x, y and d as columns (3, 3), in the base frame."""
        crank = motion.bodies["u"]
        return ca.horzcat(crank.x, crank.y, crank.axes)

    @property
    def reach_text(self) -> str:
        """The lengths of rod and crank, as a clause for messages."""
        return (
            f"its rod of {self.lower_length:.4g} m starts from the circle of a crank of "
            f"{self.upper_length:.4g} m"
        )

    @classmethod
    def draw_closure(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int]:
        """Return a random rational platform point, as crank plus rod, and the elbow's sign."""
        d, a = values["direction"], values["zero_direction"]
        b = cross(d, a)
        x, y = random_vector(values["upper_length"][0], 2, rng)
        rx, ry, rz = random_vector(values["lower_length"][0], 3, rng)
        w = [(x + rx) * p + (y + ry) * q + rz * r for p, q, r in zip(a, b, d, strict=True)]
        # D = (l_u x b) . d has the sign of -sigma.
        return w, -1 if x * ry - y * rx > 0 else 1


class RSSEquations(CrankEquations):
    """The equations of an R-S-S leg, whose last link is a rod in space."""

    kinds: ClassVar = {"u": PlanarInertia.kinds, "l": RodInertia.kinds}

    def to_link_space(self, v: Expression) -> Expression:
        """Return the vector (3, K) unchanged: the rod's space is the base frame."""
        return v

    def plane_to_link_space(self, v: Expression) -> Expression:
        """Return a vector (2, K) of the crank's plane in the base frame (3, K)."""
        return ca.mtimes(self.plane, v)

    def height(self, w: Expression) -> Expression:
        """Return the signed distance of platform point c from the crank's plane, m; w = c - r."""
        return ca.dot(w, self.d)

    def last_link(
        self, point: PointMotion, rotation: RotationMotion, at: CrankState, crank: Joint
    ) -> tuple[BodyMotion, list[Joint], None]:
        """Return the rod's motion, the joints at its ends, and None for a planar angle."""
        l_u, g = (ca.mtimes(self.plane, v) for v in (at.l_u, at.g))
        rides, square = point_rows(ca.SX.eye(3)), at.rate * at.rate
        swing = (rides - ca.mtimes(g, crank.row)) / self.ll
        n = at.b / self.ll
        dn = (point.velocity - at.rate * g) / self.ll
        ddn = (point.acceleration - at.acceleration * g + square * l_u) / self.ll
        tip = self.r + l_u
        joints = universal_joints(self.d, tip, point, swing, (n, dn, ddn), rotation, crank)
        return rod_body(point, n, ddn, swing), joints, None

    def locus(self, q: Expression) -> SphereLocus:
        """Return the sphere of platform point c while the crank is held at q, rad."""
        return SphereLocus(self.tip(q), self.ll)


RSS.equations_class = RSSEquations
