"""The platform: which motions it has, about which axis it turns, and its inertia."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pteron.bodies.inertia import PlanarInertia
from pteron.bodies.vectors import (
    Vector,
    cross,
    interval,
    number,
    perpendicular,
    positive,
    unit_vector,
    vector,
)
from pteron.errors import ModelError
from pteron.platforms.coordinates import COORDINATES, Unit, are_angles
from pteron.toml import told

Motion = Literal["3T", "3T1R", "2T", "2T1R"]
"""3T: the platform only translates. 3T1R: it also turns about its axis (Schoenflies motion). 2T and
2T1R: the same in the plane across its axis."""

_COORDINATES: dict[Motion, tuple[str, ...]] = {
    "3T": ("x", "y", "z"),
    "3T1R": ("x", "y", "z", "phi"),
    "2T": ("x", "y"),
    "2T1R": ("x", "y", "phi"),
}

_BASE_Z: Vector = (0.0, 0.0, 1.0)


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
class Geared:
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


@dataclass(frozen=True)
class Platform:
    """The moving platform.

    Parameters
    ----------
    motion : {"3T1R", "3T", "2T", "2T1R"}
        Its freedom: translation, in space or in the plane across `axis`, with or without a rotation
        about `axis`.
    inertia : PlanarInertia
        Mass, first moment in the platform frame and moment of inertia about `axis` through P.
    axis : unit vector
        k, the axis of rotation in the base frame, and the platform frame's z; the normal of the
        plane that a planar machine moves in.
    x_axis : unit vector, optional
        The platform frame's x at phi = 0, in the base frame. It may be left out where `axis` is
        the base frame's z: the frames then coincide at phi = 0.
    slides : bool
        Whether phi slides the platform points, as the two halves of an I4's nacelle do, and turns
        nothing but the tool. Platform points then hold m/rad: c = p + t0 + phi (x_axis s_x + ...).
    limits : (float, float), optional
        Least and greatest phi, rad, where hinges of the platform allow no more.
    tool : vector
        The tool's centre point in the platform frame, m.
    bars : tuple of Bar
        Parts that move with the platform's hinges and do not turn.
    geared : tuple of Geared
        Parts that a gear turns with the platform.
    """

    motion: Motion
    inertia: PlanarInertia
    axis: Vector = _BASE_Z
    x_axis: Vector | None = None
    slides: bool = False
    limits: tuple[float, float] | None = None
    tool: Vector = (0.0, 0.0, 0.0)
    bars: tuple[Bar, ...] = ()
    geared: tuple[Geared, ...] = ()

    def __post_init__(self) -> None:
        if self.motion not in get_args(Motion):
            valid = " or ".join(f'"{m}"' for m in get_args(Motion))
            raise ModelError(f"motion: {self.motion!r} is not {valid}")
        faults: list[str] = []
        for checked in (self._checked_axes, self._checked_limits, self._checked_tool):
            try:
                for name, value in checked().items():
                    object.__setattr__(self, name, value)
            except ModelError as error:
                faults += error.faults
        for name in ("bars", "geared"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if self.slides and self.motion != "3T1R":
            faults.append(f"slides: a {self.motion} platform has no halves that slide; only 3T1R")
        if self.slides and any(bar.hinge[2] != 0.0 for bar in self.bars):
            faults.append("bars: what slides moves across the axis; give 0 as hinge's third number")
        if self.geared and not self.turns:
            faults.append(f"geared: a {self.motion} platform has no angle for a gear to turn")
        if faults:
            raise ModelError(told(faults), faults=faults)

    def _checked_axes(self) -> dict[str, Any]:
        axis = unit_vector(self.axis, "axis")
        if self.x_axis is not None:
            return {"axis": axis, "x_axis": perpendicular(self.x_axis, axis, "x_axis", "axis")}
        if axis == _BASE_Z:
            return {"axis": axis, "x_axis": (1.0, 0.0, 0.0)}
        raise ModelError(
            f"x_axis: missing; axis {list(axis)} is not the base frame's z, so x_axis must say "
            "where the platform frame's x points at phi = 0"
        )

    def _checked_limits(self) -> dict[str, Any]:
        if self.limits is None:
            return {}
        if not self.turns:
            raise ModelError(f"limits: a {self.motion} platform has no angle to limit")
        return {"limits": interval(self.limits, "limits")}

    def _checked_tool(self) -> dict[str, Any]:
        return {"tool": vector(self.tool, "tool")}

    @property
    def frame(self) -> tuple[Vector, Vector, Vector]:
        """The platform frame's x, y and z at phi = 0, in the base frame."""
        x = self.x_axis
        assert x is not None  # set when the platform was made
        return (x, cross(self.axis, x), self.axis)

    @property
    def planar(self) -> bool:
        """Whether the platform stays in the plane across its axis."""
        return self.motion in ("2T", "2T1R")

    @property
    def turns(self) -> bool:
        """Whether the pose has an angle."""
        return self.motion in ("3T1R", "2T1R")

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the pose's coordinates, in order; see `platforms.coordinates`."""
        return _COORDINATES[self.motion]

    @property
    def units(self) -> tuple[Unit, ...]:
        """Their units: "m" or "rad"."""
        return tuple(COORDINATES[name].unit for name in self.coordinates)

    @property
    def angular(self) -> NDArray[np.bool_]:
        """Whether each of them is an angle, (m,)."""
        return are_angles(self.coordinates)

    @property
    def lengths(self) -> tuple[str, ...]:
        """Names of those that are lengths."""
        return tuple(name for name in self.coordinates if COORDINATES[name].unit == "m")

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of those that are angles; none where the platform does not turn."""
        return tuple(name for name in self.coordinates if COORDINATES[name].unit == "rad")

    @property
    def rotation_axes(self) -> tuple[Vector, ...]:
        """Unit vectors that span the axes about which it turns against its legs."""
        return (self.axis,) if self.angles and not self.slides else ()

    @property
    def directions(self) -> NDArray[np.float64]:
        """Unit vectors (k, 3), k = 2 or 3, along which the pose's lengths count."""
        return np.array(self.frame[:2]) if self.planar else np.eye(3)

    def at(self, poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return P (..., 3) and the platform frame's axes (..., 3, 3), one a row, in base frame.

        Of a platform that slides they are the tool's.
        """
        count = len(self.lengths)
        x, y, z = (np.array(axis) for axis in self.frame)
        angle = poses[..., -1:] if self.turns else np.zeros((*poses.shape[:-1], 1))
        cos, sin = np.cos(angle), np.sin(angle)
        axes = [cos * x + sin * y, cos * y - sin * x, np.broadcast_to(z, (*angle.shape[:-1], 3))]
        return poses[..., :count] @ self.directions, np.stack(axes, axis=-2)

    def arms(self, points: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the way (..., k, 3) from P to platform points (k, 3), but for fixed offsets."""
        if self.slides:
            return np.asarray(poses[..., -1:, None] * (points @ np.array(self.frame)))
        return np.asarray(points @ self.at(poses)[1])

    @property
    def joined(self) -> PlanarInertia:
        """The platform's inertia with its bars and geared parts, as the equations take it.

        A bar counts as a point mass at its hinge; a gear of ratio n adds n^2 times the inertia.
        """
        mass, (hx, hy), inertia = self.inertia.mass, self.inertia.first_moment, self.inertia.inertia
        for bar in self.bars:
            x, y, _ = bar.hinge
            mass, hx, hy = mass + bar.mass, hx + bar.mass * x, hy + bar.mass * y
            inertia += bar.mass * (x * x + y * y)
        inertia += sum(part.ratio**2 * part.inertia for part in self.geared)
        return PlanarInertia(mass, (hx, hy), inertia)

    def with_joined(self, inertia: PlanarInertia) -> Platform:
        """Return the same platform with this inertia, of which no part is told apart."""
        return replace(self, inertia=inertia, bars=(), geared=())
