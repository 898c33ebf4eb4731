"""Parts of a platform beside its body: bars, geared parts, points that legs keep in planes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from pteron.bodies.vectors import Vector, number, positive, vector


@dataclass(frozen=True)
class Bar:
    """A part of an articulated platform that moves with a hinge of it and does not turn.

    Parameters
    ----------
    mass : float
        kg.
    hinge : vector
        Its hinge on the part that turns, in the platform frame, m.
    """

    mass: float
    hinge: Vector

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", positive(self.mass, "mass", "kg"))
        object.__setattr__(self, "hinge", vector(self.hinge, "hinge"))


@dataclass(frozen=True)
class GearedPart:
    """A balanced part of the platform, such as a tool, that a gear turns faster than the platform.

    Parameters
    ----------
    inertia : float
        Its moment of inertia about its own axis, which is parallel to the platform's, kg m^2.
    ratio : float
        Its angle over phi.
    """

    inertia: float
    ratio: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "inertia", positive(self.inertia, "inertia", "kg m^2"))
        object.__setattr__(self, "ratio", number(self.ratio, "ratio"))


class HeldPoint(NamedTuple):
    """A platform point that its leg keeps in a plane of the base."""

    normal: Vector
    """Unit vector."""
    point: Vector
    """A point of the plane, m."""
    platform_point: Vector
    """In the platform frame, m."""
