"""The platform: which motions it has, about which axis it turns, and its inertia."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from pteron.bodies.inertia import PlanarInertia
from pteron.bodies.vectors import Vector, cross, perpendicular, unit_vector
from pteron.errors import ModelError

Motion = Literal["3T", "3T1R"]
"""3T: the platform only translates. 3T1R: it also turns about its axis (Schoenflies motion)."""

_BASE_Z: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Platform:
    """The moving platform.

    Parameters
    ----------
    motion : {"3T1R", "3T"}
        Its freedom: translation, with or without a rotation about `axis`.
    inertia : PlanarInertia
        Mass, first moment in the platform frame and moment of inertia about `axis` through P.
    axis : unit vector
        k, the axis of rotation in the base frame, and the platform frame's z.
    x_axis : unit vector, optional
        The platform frame's x at phi = 0, in the base frame. It may be left out where `axis` is
        the base frame's z: the frames then coincide at phi = 0.
    """

    motion: Motion
    inertia: PlanarInertia
    axis: Vector = _BASE_Z
    x_axis: Vector | None = None

    def __post_init__(self) -> None:
        if self.motion not in get_args(Motion):
            valid = " or ".join(f'"{m}"' for m in get_args(Motion))
            raise ModelError(f"motion: {self.motion!r} is not {valid}")
        axis = unit_vector(self.axis, "axis")
        if self.x_axis is not None:
            x = unit_vector(self.x_axis, "x_axis")
            x = perpendicular(x, axis, "x_axis", "axis")
        elif axis == _BASE_Z:
            x = (1.0, 0.0, 0.0)
        else:
            raise ModelError(
                f"x_axis: missing; axis {list(axis)} is not the base frame's z, so x_axis must say "
                "where the platform frame's x points at phi = 0"
            )
        object.__setattr__(self, "axis", axis)
        object.__setattr__(self, "x_axis", x)

    @property
    def frame(self) -> tuple[Vector, Vector, Vector]:
        """The platform frame's x, y and z at phi = 0, in the base frame."""
        x = self.x_axis
        assert x is not None  # set when the platform was made
        return (x, cross(self.axis, x), self.axis)

    @property
    def turns(self) -> bool:
        """Whether the pose has an angle."""
        return self.motion == "3T1R"

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the pose's coordinates, in order."""
        return ("x", "y", "z", "phi") if self.turns else ("x", "y", "z")
