"""Rams (a cylinder at the base, a piston, driven between them): data that R-P-R and U-P-S share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

from pteron.bodies.vectors import Vector
from pteron.errors import ModelError
from pteron.legs.drive import Drive
from pteron.legs.keys import FieldCondition
from pteron.legs.kind import ActuatedJoint, LegKind, ReachBound
from pteron.legs.reading import Reading

_CYLINDER = 0.9
"""Length of a cylinder in pictures, as a share of the shortest ram's."""


def _check_limits(limits: tuple[float, float]) -> None:
    """Raise ModelError if the least length of a ram, m, is not above 0."""
    if limits[0] <= 0.0:
        raise ModelError(f"limits: least length {limits[0]:g} m given; a ram is longer than 0")


@dataclass(frozen=True)
class RamLeg(LegKind):
    """The data of a ram; its coordinate is its length, from `guide_point` to the platform point."""

    guide_point: Vector
    platform_point: Vector
    upper: Any
    lower: Any
    limits: tuple[float, float]
    elbow: int = 1
    fixed_offset: Vector = (0.0, 0.0, 0.0)
    drive: Drive | None = None
    reading: Reading | None = field(default=None, kw_only=True)
    direction: Vector | None = None

    joint = ActuatedJoint("ram", "rho", "m", "force", "N", "its length from end to end")
    branches = (1,)
    names: ClassVar = {"u": "cylinder", "l": "piston"}
    measure_text = "1 everywhere, as a ram pushes the platform point in every pose"
    has_constant_measure = True
    conditions = (FieldCondition(("limits",), _check_limits),)

    @property
    def cylinder(self) -> float:
        """The length of the cylinder in pictures, m: a constant share of the ram's least length."""
        return _CYLINDER * self.limits[0]

    @property
    def size(self) -> float:
        """The ram's greatest length, m."""
        return self.limits[1]

    @property
    def reach_bound(self) -> ReachBound:
        """A ball about the guide point, with the ram's greatest length as its radius, m."""
        return ReachBound(self.guide_point, None, self.limits[1])

    @property
    def reach_text(self) -> str:
        """Why a ram does not reach a point, as a clause for messages: its ends coincide."""
        return "its ram has no length"

    @property
    def extents(self) -> dict[str, tuple[str, float, float, str]]:
        """The range of x, m, where cylinder and piston usually have their centres of mass."""
        shortest = self.limits[0]
        return {
            "u": ("upper", 0.0, shortest, "the joint on the base and the shortest ram's end"),
            "l": ("lower", -shortest, 0.0, "the shortest ram's beginning and the platform point"),
        }
