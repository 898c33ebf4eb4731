"""`Platform`, the moving platform of a machine: its freedom, axes, parts, inertia, limits and tool.

Its constructor checks it; `placement` and `tool_motion` give the positions of platform and tool.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.bodies.inertia import PlanarInertia, SpatialInertia
from pteron.bodies.motion import HeldPlane
from pteron.bodies.vectors import (
    Vector,
    cross,
)
from pteron.errors import ModelError, shorten
from pteron.platforms.checked_fields import BASE_Z, checked_fields
from pteron.platforms.coordinates import COORDINATES, Unit, are_angles
from pteron.platforms.kinds import (
    XYZ,
    AngleOrder,
    equations_class,
    kind_of_motion,
    motion_names,
)
from pteron.platforms.motion import PlatformEquations, PlatformMotion
from pteron.platforms.parts import Bar, GearedPart, HeldPoint
from pteron.renamed import former_attribute
from pteron.tolerances import ROUNDING
from pteron.toml import raise_faults

Limits = tuple[float, float]

_TILT = 0.5
"""Largest angle of random poses of a platform with several, rad, where the file has no limits."""


@dataclass(frozen=True)
class Platform:
    """The moving platform.

    Parameters
    ----------
    motion : {"3T", "3T1R", "2T", "2T1R", "3T3R", "3T2R", "3R", "2R", "1T2R"} or str
        Its freedom. 3T: it only translates. 3T1R: it also turns about `axis` (Schoenflies motion).
        2T and 2T1R: the same in the plane across `axis`. 3T3R: it moves freely. 3T2R: it translates
        and turns about `axis` and `second_axis`. 3R and 2R: it turns about `center`, on a ball
        joint or a universal joint. 1T2R: a tripod's. Installed packages may have others.
    inertia : PlanarInertia or SpatialInertia
        Mass, first moment in the platform frame and moment of inertia about `axis` through P; of a
        platform that tilts its inertia tensor about P.
    axis : unit vector
        k, the axis of rotation in the base frame, and the platform frame's z at angles zero; the
        normal of the plane that a planar machine moves in; of a 2R or 3T2R platform the first axis
        that it turns about.
    x_axis : unit vector, optional
        The platform frame's x at angles zero, in the base frame. It may be left out where `axis` is
        the base frame's z, the frames then coincide at angles zero, and of a 2R or 3T2R platform,
        where they always do.
    slides : bool
        Whether phi slides the platform points, as the two halves of an I4's nacelle do, and turns
        nothing but the tool. Platform points then hold m/rad: c = p + t0 + phi (x_axis s_x + ...).
    limits : (float, float) or tuple of them, optional
        Least and greatest phi, rad, where hinges of the platform allow no more; of a platform that
        tilts one pair for each angle.
    tool : vector
        The tool's centre point in the platform frame, m.
    bars : tuple of Bar
        Parts that move with the platform's hinges and do not turn.
    geared : tuple of GearedPart
        Parts that a gear turns with the platform.
    angle_order : {"rpy", "xyz"}
        Which angles a 3T3R or 3R platform has: roll, pitch and yaw, or rx, ry and rz.
    center : vector, optional
        P of a 3R or 2R platform, on its joint with the base, m; with `axis_offset` a point on the
        first axis.
    second_axis : unit vector, optional
        What a 2R or 3T2R platform turns about by beta, at alpha = 0; of a 3T2R platform
        perpendicular to `axis`.
    axis_offset : vector, optional
        Of a 2R platform whose axes do not meet: from `center`, on the first axis, to P on the
        second one, at angles zero, m. P then moves as the platform turns about the first axis.
    planes : tuple of HeldPoint
        Of a 1T2R platform the planes in which its legs keep its points: the manipulator sets them.
    """

    motion: str
    inertia: PlanarInertia | SpatialInertia
    axis: Vector = BASE_Z
    x_axis: Vector | None = None
    slides: bool = False
    limits: Limits | tuple[Limits, ...] | None = None
    tool: Vector = (0.0, 0.0, 0.0)
    bars: tuple[Bar, ...] = ()
    geared: tuple[GearedPart, ...] = ()
    angle_order: AngleOrder = "rpy"
    center: Vector | None = None
    second_axis: Vector | None = None
    planes: tuple[HeldPoint, ...] = ()
    axis_offset: Vector | None = None

    def __post_init__(self) -> None:
        if kind_of_motion(self.motion) is None:
            *names, last = map(repr, motion_names())
            raise ModelError(
                f"motion: {shorten(self.motion)} given, {', '.join(names)} or {last} expected"
            )
        sound, faults = checked_fields(self)
        raise_faults(faults)
        for name, field_value in sound.items():
            object.__setattr__(self, name, field_value)

    @property
    def frame(self) -> tuple[Vector, Vector, Vector]:
        """The platform's x, y and z axes at angles zero, in the base frame."""
        x = self.x_axis
        if x is None:  # of a platform with a second axis
            return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), BASE_Z
        return (x, cross(self.axis, x), self.axis)

    @property
    def planar(self) -> bool:
        """Whether the platform stays in the plane perpendicular to its axis."""
        return self.plane_normal is not None

    @property
    def turns(self) -> bool:
        """Whether the pose has the angle phi, which turns the platform or slides its halves."""
        return self.axis_angle is not None

    @property
    def keeps_points_in_planes(self) -> bool:
        """Whether legs keep platform points in planes, which fix the other coordinates."""
        return self.kind.keeps_points_in_planes

    @property
    def tilts(self) -> bool:
        """Whether the platform turns about more than one axis."""
        return self.kind.tilts

    @property
    def kind(self) -> type[PlatformEquations]:
        """The class of the platform's equations."""
        return equations_class(self.motion, self.angle_order, self.slides)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the pose's coordinates, in order: "x", "y", "phi" and so on."""
        return self.kind.coordinates

    @property
    def units(self) -> tuple[Unit, ...]:
        """Units of the pose's coordinates, "m" or "rad"."""
        return tuple(COORDINATES[name].unit for name in self.coordinates)

    @property
    def angular(self) -> NDArray[np.bool_]:
        """Mask (m,) of the pose coordinates that are angles."""
        return are_angles(self.coordinates)

    @property
    def lengths(self) -> tuple[str, ...]:
        """Names of the pose coordinates that are lengths."""
        return tuple(name for name in self.coordinates if COORDINATES[name].unit == "m")

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of the pose coordinates that are angles; none where the platform does not turn."""
        return tuple(name for name in self.coordinates if COORDINATES[name].unit == "rad")

    @property
    def angle_limits(self) -> dict[str, Limits]:
        """Least and greatest value of each angle that is limited, by name, rad."""
        if self.limits is None:
            return {}
        pairs = self.limits if self.tilts else (self.limits,)
        return dict(zip(self.angles, pairs, strict=True))  # type: ignore[arg-type]

    @property
    def wrench_columns(self) -> tuple[str, ...]:
        """Names of the components of a wrench at P: forces and moments, all six if it tilts."""
        columns = self.kind.wrench_columns
        return columns or tuple(COORDINATES[name].wrench for name in self.coordinates)

    @property
    def wrench_in_base_axes(self) -> bool:
        """Whether a wrench is a force and a moment in base axes; else it is along coordinates."""
        return bool(self.kind.wrench_columns)

    def wrench_of(
        self, force: NDArray[np.float64], moment: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the wrench (w,), as `wrench_columns` name it, of a force and a moment at P."""
        if self.wrench_in_base_axes:
            return np.concatenate([force, moment])
        turning = [np.array(self.axis) @ moment] * len(self.angles)
        return np.array([*(self.directions @ force), *turning])

    def force_and_moment(
        self, wrench: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return force and moment at P, (..., 3) each, in base axes, of wrenches (..., w)."""
        if self.wrench_in_base_axes:
            return wrench[..., :3], wrench[..., 3:]
        force = wrench[..., : len(self.lengths)] @ self.directions
        if not self.rotation_axes:
            return force, np.zeros(3)
        return force, wrench[..., self.angular] @ np.array(self.rotation_axes)

    @property
    def inertia_names(self) -> tuple[str, ...]:
        """Names of a platform body's moments of inertia: "I" about k, or six, "Ixx" and so on."""
        return tuple(name for name in self.kind.kinds if name.startswith("I"))

    @property
    def payload_axes(self) -> str:
        """Platform axes, such as "xy", along which a payload's centre of mass changes forces.

        The text is empty if the platform does not turn, or if payloads count as on its axis, as on
        a platform that slides.
        """
        return self.arm_axes if self.rotation_axes else ""

    @property
    def carries_on_axis(self) -> bool:
        """Whether a payload counts as on the axis: the pose has an angle, no arm turns with it."""
        return bool(self.angles) and not self.payload_axes

    @property
    def arm_axes(self) -> str:
        """Platform axes, such as "xy", whose parts of a vector from P change with the angles."""
        return self.kind.arm_axes

    @property
    def angle_range(self) -> float:
        """Largest absolute angle, rad, within which every orientation occurs."""
        return self.kind.angle_range

    @property
    def angle_box(self) -> dict[str, Limits]:
        """The range of each angle, by name, rad, from which random poses are drawn."""
        if self.tilts:
            return dict.fromkeys(self.angles, (-_TILT, _TILT)) | self.angle_limits
        # Beyond half a turn phi counts where the platform's shaft makes several.
        turn = max((np.pi, *(abs(end) for pair in self.angle_limits.values() for end in pair)))
        return dict.fromkeys(self.angles, (-turn, turn))

    @property
    def plane_normal(self) -> Vector | None:
        """The normal of the plane in which the platform moves; None where it moves in space."""
        return self.axis if self.lengths == ("x", "y") else None

    @property
    def turning_axis(self) -> Vector | None:
        """The single axis about which the platform turns; None without one, or with several."""
        axes = self.rotation_axes
        return axes[0] if len(axes) == 1 else None

    @property
    def axis_angle(self) -> str | None:
        """The name of the single angle, "phi", about or along the axis.

        It is None for other platforms.
        """
        return self.kind.axis_angle

    @property
    def spin_angle(self) -> str | None:
        """The angle that turns the platform about its axis if all others are 0; None without."""
        return self.kind.spin_angle

    @property
    def spin_axis(self) -> Vector | None:
        """The axis about which `spin_angle` turns the platform at every pose, or None.

        It is None if the axis is not fixed to the base.
        """
        return self.axis if self.spin_angle in ("phi", "yaw") else None

    @property
    def has_angle_order(self) -> bool:
        """Whether the platform's angles can have several orders, named by `angle_order`."""
        return self.motion in XYZ

    @property
    def moves_freely(self) -> bool:
        """Whether the platform has all six degrees of freedom."""
        return len(self.coordinates) == 6

    def has_points_in_line(self, points: NDArray[np.float64]) -> bool:
        """Return whether the platform turns about a line that has all points (k, 3)."""
        size = ROUNDING * max(float(np.abs(points).max()), ROUNDING)
        if not self.tilts:
            return bool(np.ptp(points[:, :2], axis=0).max() <= size)
        if len(self.angles) < 3:
            return False
        centred = points if self.center else points - points.mean(axis=0)
        return bool(np.linalg.svd(centred, compute_uv=False)[1] <= size)

    @property
    def fixed_point(self) -> Vector | None:
        """The point P of a platform that only turns about it, m; None where P moves."""
        return self.center if self.axis_offset is None else None

    @property
    def rotation_axes(self) -> tuple[Vector, ...]:
        """Unit vectors that span the axes about which the platform turns."""
        if self.second_axis is not None:
            return self.axis, self.second_axis
        if self.tilts:
            return self.frame
        return (self.axis,) if self.angles and not self.slides else ()

    @property
    def directions(self) -> NDArray[np.float64]:
        """Unit vectors (l, 3) of the pose's length coordinates, in the base frame."""
        x, y, k = self.frame
        frame_axes = {"x": x, "y": y, "z": k}
        unit_vectors = np.array([frame_axes[name] for name in self.lengths]).reshape(-1, 3)
        return np.eye(3) if len(unit_vectors) == 3 else unit_vectors

    @property
    def axes_by_angle(self) -> dict[str, NDArray[np.float64]]:
        """The unit vector (3,) that each angle turns the platform about, by angle name."""
        axes = _numeric_equations(self).axes_by_angle()
        return {name: np.array(ca.DM(axis)).ravel() for name, axis in axes.items()}

    def placement(
        self, poses: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return P (..., 3), m, and the platform's axes (..., 3, 3), one a row, in the base frame.

        For a platform with sliding halves the axes are the tool's.
        """
        if self.tilts:
            return self._place_tilting(poses)
        count = len(self.lengths)
        x, y, z = (np.array(axis) for axis in self.frame)
        angle = poses[..., -1:] if self.turns else np.zeros((*poses.shape[:-1], 1))
        cos, sin = np.cos(angle), np.sin(angle)
        axes = [cos * x + sin * y, cos * y - sin * x, np.broadcast_to(z, (*angle.shape[:-1], 3))]
        return poses[..., :count] @ self.directions, np.stack(axes, axis=-2)

    def angle_measures(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a measure (...) of poses' angles, no unit: 1 at best, 0 in gimbal lock.

        They are singular where the second of three rotations aligns the third axis with the first.
        """
        middle = {"rpy": "pitch", "xyz": "ry"}[self.angle_order]
        if len(self.angles) < 3:
            return np.ones(poses.shape[:-1])
        return np.abs(np.cos(poses[..., self.coordinates.index(middle)]))

    def _place_tilting(
        self, poses: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return P (..., 3), m, and axes (..., 3, 3), one a row, of a platform that tilts."""
        shape = poses.shape[:-1]
        if not poses.size:
            return np.empty((*shape, 3)), np.empty((*shape, 3, 3))
        rows = np.asarray(poses, dtype=float).reshape(-1, poses.shape[-1])
        place, axes = (np.asarray(part) for part in _placement_function(self)(rows.T))
        # Each (3, 3) is stored column by column.
        return place.T.reshape(*shape, 3), axes.T.reshape(*shape, 3, 3)

    def tool_motion(
        self,
        poses: NDArray[np.float64],
        velocities: NDArray[np.float64],
        accelerations: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return position, velocity, acceleration (..., 3) of the tool point in a motion."""
        parts = poses, velocities, accelerations
        rows = [np.asarray(part, dtype=float).reshape(-1, part.shape[-1]).T for part in parts]
        place, first, second = (
            np.asarray(column).T.reshape(*poses.shape[:-1], 3)
            for column in _tool_function(self)(*rows)
        )
        return place, first, second

    @property
    def quantities(self) -> dict[str, tuple[float, ...]]:
        """The vectors and numbers that the equations need besides frame and points, by name.

        Names that end in "axis" denote unit vectors.
        """
        if self.keeps_points_in_planes:
            return {"side": (self._side,)}
        quantities: dict[str, tuple[float, ...]] = {}
        if self.center is not None:
            quantities["center"] = self.center
        if self.axis_offset is not None:
            quantities["axis_offset"] = self.axis_offset
        if self.second_axis is not None:
            quantities |= {"first_axis": self.axis, "second_axis": self.second_axis}
        return quantities

    @property
    def turning_keys(self) -> tuple[str, ...]:
        """Names of the points and directions about which the platform turns, if legs fix none.

        For a planar platform the legs determine the axis.
        """
        center = tuple(
            name for name in ("center", "axis_offset") if getattr(self, name) is not None
        )
        if self.second_axis is not None:
            return (*center, "axis", "second_axis")
        if self.center is not None:
            return center
        return ("axis",) if self.turns and not self.slides and not self.planar else ()

    def expressions(self) -> dict[str, Any]:
        """Return the `quantities` by name, and planes that hold points, as CasADi expressions."""
        quantities: dict[str, Any] = {name: _column(v) for name, v in self.quantities.items()}
        planes = [HeldPlane(_column(n), _column(r)) for n, r, _ in self.planes]
        return {**quantities, "planes": planes} if planes else quantities

    @property
    def _side(self) -> float:
        """The sign, 1 or -1, of the yaw solution that is nearest to 0 for a level tripod."""
        normals = np.array([plane.normal for plane in self.planes])
        arms = np.array([plane.platform_point for plane in self.planes]) @ np.array(self.frame)
        k = np.array(self.axis)
        weights = np.cross(np.roll(normals, -1, axis=0), np.roll(normals, -2, axis=0)) @ k
        return float(np.copysign(1.0, -(weights * (np.cross(normals, arms) @ k)).sum()))

    def arms(self, points: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return vectors (..., k, 3), m, from P to points (k, 3) at poses, in the base frame."""
        if self.slides:
            return np.asarray(poses[..., -1:, None] * (points @ np.array(self.frame)))
        return np.asarray(points @ self.placement(poses)[1])

    def map_vectors(self, turn: Callable[[Vector], Vector]) -> Platform:
        """Return the platform with every base-frame vector v replaced by `turn(v)`.

        The frame of a platform with a second axis is the base frame at angles zero: its tool,
        inertia and points are converted to the new frame.
        """
        x, _, axis = self.frame
        center = self.center and turn(self.center)
        if self.second_axis is None:
            return replace(self, axis=turn(axis), x_axis=turn(x), center=center)
        assert isinstance(self.inertia, SpatialInertia)
        return replace(
            self,
            axis=turn(self.axis),
            second_axis=turn(self.second_axis),
            center=center,
            axis_offset=self.axis_offset and turn(self.axis_offset),
            tool=turn(self.tool),
            inertia=self.inertia.turned(np.array([turn(v) for v in self.frame]).T),
        )

    @property
    def total_inertia(self) -> PlanarInertia | SpatialInertia:
        """The platform's inertia with its bars and geared parts, for the equations.

        A bar counts as a point mass at its hinge; a gear of ratio n adds n^2 times the inertia.
        """
        if isinstance(self.inertia, SpatialInertia):
            return self.inertia
        mass, (hx, hy), inertia = self.inertia.mass, self.inertia.first_moment, self.inertia.inertia
        for bar in self.bars:
            x, y, _ = bar.hinge
            mass, hx, hy = mass + bar.mass, hx + bar.mass * x, hy + bar.mass * y
            inertia += bar.mass * (x * x + y * y)
        inertia += sum(part.ratio**2 * part.inertia for part in self.geared)
        return PlanarInertia(mass, (hx, hy), inertia)

    def with_total_inertia(self, inertia: PlanarInertia | SpatialInertia) -> Platform:
        """Return the platform with `inertia` for all of it, without bars and geared parts."""
        return replace(self, inertia=inertia, bars=(), geared=())

    at = former_attribute("at", "placement")
    turned = former_attribute("turned", "map_vectors")
    joined = former_attribute("joined", "total_inertia")
    with_joined = former_attribute("with_joined", "with_total_inertia")
    on_planes = former_attribute("on_planes", "keeps_points_in_planes")


@lru_cache(maxsize=64)
def _placement_function(platform: Platform) -> ca.Function:
    """Return the CasADi function from a tilting platform's pose to P (3,) and axes (3, 3)."""
    pose = ca.SX.sym("pose", len(platform.coordinates))
    motion = _rest_motion(platform, pose)
    return ca.Function("placing", [pose], [motion.body.position, ca.vec(ca.densify(motion.axes))])


@lru_cache(maxsize=64)
def _tool_function(platform: Platform) -> ca.Function:
    """Return the CasADi function from a pose and two derivatives to the tool point's."""
    pose, rate, growth = (ca.SX.sym(name, len(platform.coordinates)) for name in "xva")
    motion = _rest_motion(platform, pose)
    place = motion.body.position + ca.mtimes(motion.axes, _column(platform.tool))
    velocity = ca.jtimes(place, pose, rate)
    acceleration = ca.jtimes(velocity, pose, rate) + ca.jtimes(place, pose, growth)
    outputs = [ca.densify(part) for part in (place, velocity, acceleration)]
    return ca.Function("tool", [pose, rate, growth], outputs)


def _rest_motion(platform: Platform, pose: ca.SX) -> PlatformMotion:
    """Return the motion of a platform at rest at a pose."""
    zero_rates = ca.SX.zeros(len(platform.coordinates))
    return _numeric_equations(platform).motion(pose, zero_rates, zero_rates)


def _numeric_equations(platform: Platform) -> PlatformEquations:
    """Return the platform's equations with its geometry as constants."""
    points = [_column(plane.platform_point) for plane in platform.planes]
    frame = [_column(axis) for axis in platform.frame]
    return platform.kind(frame, points, [ca.SX(3, 1)] * len(points), platform.expressions())


def _column(vector: Sequence[float]) -> ca.SX:
    """Return a vector as a constant column (n, 1)."""
    return ca.SX(ca.DM(list(vector)))
