"""A manipulator as a value: legs, platform and gravity, checked by its constructor."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.arguments import checked_arguments
from pteron.bodies.vectors import PARALLEL_TOLERANCE, Vector, complement, dot, parallel, vector
from pteron.errors import ModelError
from pteron.legs import LegKind
from pteron.legs.protocol import breaches
from pteron.manipulator.distribution import (
    Distribution,
    distribution_faults,
    greatest_forces,
    strengths_of,
)
from pteron.manipulator.names import name_faults
from pteron.manipulator.owner_data import OwnerData
from pteron.manipulator.radii import Radii
from pteron.manipulator.template_record import Template
from pteron.manipulator.tool import Tool, tool_faults
from pteron.platforms import Platform
from pteron.platforms.coordinates import Unit
from pteron.platforms.parts import HeldPoint
from pteron.tolerances import ROUNDING
from pteron.toml import raise_faults

STANDARD_GRAVITY: Vector = (0.0, 0.0, -9.81)
"""Default acceleration of gravity, m/s^2."""


@checked_arguments
@dataclass(frozen=True)
class Manipulator:
    """A parallel manipulator whose legs carry points of the platform.

    It is a value: it has no hidden state and is never changed; `dataclasses.replace` makes another.

    Parameters
    ----------
    name : str
        What the machine is called.
    platform : Platform
        The moving platform; its motion fixes how many legs there are at least: one for each
        freedom.
    legs : tuple of legs
        Of any kind in `pteron.legs`, in the order of the joint coordinates.
    gravity : vector
        Acceleration of gravity in the base frame, m/s^2.
    radii : Radii, optional
        How thick its bodies are, for `pteron.workspace.clearance`.
    tools : tuple of Tool
        Tools that the platform can carry; `pteron.motion.with_tool` mounts one.
    home : tuple of float, optional
        The pose, m and rad, where the machine stands; `pteron.workspace.home_pose` finds one.
    distribution : Distribution, optional
        How a machine with more legs than freedoms shares out its drives' forces.
    owner : mapping
        Data of the machine's owner, such as a serial number: kept in its file, without effect, and
        not compared.
    template : Template, optional
        The machine of the catalog that its file was made from, not compared.

    Raises
    ------
    ModelError
        If there are fewer legs than freedoms, or if the legs' constraints leave the platform
        another freedom than `platform.motion` says.
    """

    name: str
    platform: Platform
    legs: tuple[LegKind, ...]
    gravity: Vector = STANDARD_GRAVITY
    radii: Radii | None = None
    tools: tuple[Tool, ...] = ()
    home: tuple[float, ...] | None = None
    distribution: Distribution | None = None
    owner: Mapping[str, Any] = field(default_factory=OwnerData, compare=False, repr=False)
    template: Template | None = field(default=None, compare=False, repr=False)

    def __hash__(self) -> int:
        """Return the machine's hash, computed only once."""
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """The hash of all fields that equality compares, cached."""
        compared = (part.name for part in fields(self) if part.compare)
        return hash(tuple(getattr(self, name) for name in compared))

    def __getstate__(self) -> dict[str, Any]:
        # Texts hash differently in every process.
        return {key: attribute for key, attribute in self.__dict__.items() if key != "_hash"}

    def __post_init__(self) -> None:
        legs = tuple(self.legs)
        others = self.tools, self.home, self.distribution
        raise_faults(faults_of(self.name, self.platform, legs, *others))
        legs = tuple(_placed_leg(self.platform, leg) for leg in legs)
        object.__setattr__(self, "legs", legs)
        object.__setattr__(self, "tools", tuple(self.tools))
        object.__setattr__(self, "owner", OwnerData(self.owner))
        if self.home is not None:
            object.__setattr__(self, "home", tuple(float(coordinate) for coordinate in self.home))
        object.__setattr__(self, "platform", _with_held_points(self.platform, legs))
        object.__setattr__(self, "gravity", vector(self.gravity, "gravity"))

    def __repr__(self) -> str:
        """Return the machine's name, kinds of legs and platform motion in one line."""
        kinds = " + ".join(
            f"{count} {kind}" for kind, count in Counter(leg.type for leg in self.legs).items()
        )
        return f"<Manipulator {self.name!r}: {kinds} under a {self.platform.motion} platform>"

    def _repr_html_(self) -> str:
        """Return the machine's legs as an HTML table, for notebooks."""
        from pteron.manipulator.notebook import machine_table

        return machine_table(self)

    @property
    def freedom(self) -> int:
        """Number of pose coordinates, m."""
        return len(self.coordinates)

    @property
    def joint_count(self) -> int:
        """Number of actuated joints, n, one for each leg."""
        return len(self.legs)

    @property
    def redundancy(self) -> int:
        """Number of legs beyond the freedoms, n - m."""
        return self.joint_count - self.freedom

    @cached_property
    def drive_strengths(self) -> tuple[float, ...]:
        """The strengths (n,) by which drives share forces, relative to the greatest."""
        return strengths_of(self.legs, self.distribution)

    @cached_property
    def greatest_forces(self) -> tuple[float, ...] | None:
        """The limits (n,) within which a redundant machine shares forces, N or N m; or None."""
        return greatest_forces(self.legs, self.distribution)

    @property
    def units(self) -> tuple[Unit, ...]:
        """Units of the pose's coordinates, "m" or "rad"."""
        return self.platform.units

    @property
    def wraps(self) -> NDArray[np.bool_]:
        """Mask (m,) of pose coordinates that are angles whose full turn changes no joint.

        These are all angles of the platform, except phi of an I4, which moves its two halves along
        each other, and except angles that an actuated joint follows turn by turn.
        """
        around = bool(self.platform.rotation_axes)
        return self.platform.angular & (around and not any(leg.follows_angle for leg in self.legs))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the pose's coordinates: x, y, in space z, and phi where the platform turns."""
        return self.platform.coordinates

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joint coordinates: rho1 of a slider, theta1 of a crank."""
        return tuple(f"{leg.joint.coordinate}{i}" for i, leg in enumerate(self.legs, start=1))

    @property
    def force_names(self) -> tuple[str, ...]:
        """Names of the actuator forces: force1 of a slider, torque1 of a crank."""
        return tuple(f"{leg.joint.force}{i}" for i, leg in enumerate(self.legs, start=1))

    @cached_property
    def column_names(self) -> dict[str, tuple[str, ...]]:
        """Names of table columns, by quantity: "pose", "velocity", "joints", "forces" and so on.

        A pose is x y z phi, a velocity dx dy dz dphi, an acceleration ddx ddy ddz ddphi, a wrench
        fx fy fz mk, as far as the machine has them; if its platform tilts, a pose has other angles,
        and a wrench is fx fy fz mx my mz. Joints are rho1 or theta1, their rates drho1 or dtheta1,
        forces force1 or torque1.
        """
        pose, joints = self.coordinates, self.joint_names
        return {
            "pose": pose,
            "velocity": tuple(f"d{name}" for name in pose),
            "acceleration": tuple(f"dd{name}" for name in pose),
            "wrench": self.platform.wrench_columns,
            "joints": joints,
            "joint_rates": tuple(f"d{name}" for name in joints),
            "joint_accelerations": tuple(f"dd{name}" for name in joints),
            "forces": self.force_names,
        }

    @property
    def column_units(self) -> dict[str, str]:
        """Units of the table columns by column name: m, rad, N, N m, and per s or s^2."""
        joints = [leg.joint for leg in self.legs]
        units: dict[str, Sequence[str]] = {
            "pose": self.units,
            "joints": [joint.unit for joint in joints],
            "forces": [joint.force_unit for joint in joints],
            "wrench": [{"f": "N", "m": "N m"}[name[0]] for name in self.platform.wrench_columns],
        }
        rates = {"velocity": "pose", "acceleration": "pose"}
        rates |= {"joint_rates": "joints", "joint_accelerations": "joints"}
        for name, of in rates.items():
            per = "/s^2" if "acceleration" in name else "/s"
            units[name] = [unit + per for unit in units[of]]
        names = self.column_names
        return {n: u for what in names for n, u in zip(names[what], units[what], strict=True)}


def faults_of(
    name: object,
    platform: Platform,
    legs: Sequence[LegKind | None],
    tools: Sequence[Tool] = (),
    home: Sequence[float] | None = None,
    distribution: Distribution | None = None,
) -> list[str]:
    """Return the faults of a machine's parts, one line each; None stands for a faulty leg."""
    faults = [*name_faults(name), *tool_faults(platform, tools), *_home_faults(platform, home)]
    freedom = len(platform.coordinates)
    if len(legs) < freedom:
        faults.append(
            f"legs: {len(legs)} given, but a {platform.motion} platform has {freedom} freedoms and "
            f"needs {freedom} legs or more"
        )
    known_legs = {i: leg for i, leg in enumerate(legs, start=1) if leg is not None}
    faults += [
        f"leg {i}: {fault}" for i, leg in known_legs.items() for fault in _leg_faults(platform, leg)
    ]
    if not faults and len(known_legs) == len(legs):
        shares = list(known_legs.values()), distribution, len(legs) - freedom
        faults += distribution_faults(*shares)
    if faults or len(known_legs) < freedom:
        return faults
    placed_legs = [_placed_leg(platform, leg) for leg in known_legs.values()]
    return (_unheld_tilting if platform.tilts else _unheld_freedoms)(platform, placed_legs)


def _home_faults(platform: Platform, home: Sequence[float] | None) -> Iterator[str]:
    """Yield the faults of a home pose that does not fit the platform's coordinates."""
    if home is None:
        return
    names = platform.coordinates
    if len(home) != len(names):
        yield (
            f"home.pose: {len(home)} values given, {len(names)} expected: "
            f"{', '.join(names)} (m and rad)"
        )
    elif not all(map(math.isfinite, home)):
        yield f"home.pose: {list(home)} given, finite numbers expected"


def _placed_leg(platform: Platform, leg: LegKind) -> LegKind:
    """Return a leg with what it takes from its platform's frame, axes and center."""
    placed_leg = leg.with_platform_frame(platform.frame)
    return placed_leg.with_platform_rotation(platform.rotation_axes, platform.fixed_point)


def _leg_faults(platform: Platform, leg: object) -> Iterator[str]:
    """Yield the faults of a leg under a platform, as lines of text."""
    if not isinstance(leg, LegKind):
        yield f"{type(leg).__name__} given, a leg expected"
        return
    if leg.follows_angle and platform.turning_axis is None:
        yield (
            f"a {leg.type} leg turns the platform, but this {platform.motion} platform does not "
            "turn; give it another leg or another motion"
        )
        return
    if platform.slides and leg.platform_point[2] != 0.0:
        yield (
            f"platform_point: {leg.platform_point[2]:g} m/rad along the axis; what slides moves "
            "across it, so give 0"
        )
    try:
        leg = _placed_leg(platform, leg)
    except ModelError as error:
        yield str(error)
        return
    if platform.tilts:
        yield from _tilting_leg_faults(platform, leg)
        return
    yield from breaches(leg, platform.rotation_axes)
    normal = leg.plane_normal
    if normal is not None and len(leg.free_axes(None)) > 1:
        yield (
            f"a {leg.type} leg ends in a ball joint, under which a {platform.motion} platform "
            'tilts; make the platform\'s motion "1T2R", or give it another leg'
        )
    elif normal is not None and platform.plane_normal is None:
        yield (
            f"a {leg.type} leg moves in a plane, which a {platform.motion} platform leaves; make "
            'the platform\'s motion "2T" or "2T1R", or give it another leg'
        )
    elif normal is not None and not parallel(normal, platform.axis):
        yield (
            f"direction {list(normal)} is not along the platform's axis {list(platform.axis)}, the "
            "normal of its plane"
        )
    elif platform.plane_normal is not None and leg.equations_class.row_is_constant:
        row = np.array(ca.evalf(leg.equations().constant_row)).ravel()
        if np.linalg.norm(platform.directions @ row) <= ROUNDING * np.linalg.norm(row):
            yield (
                f"its joint does not move the platform: a {leg.type} leg with these directions "
                f"pushes along the platform's axis {list(platform.axis)} alone, across the plane; "
                "turn its direction"
            )


def _tilting_leg_faults(platform: Platform, leg: LegKind) -> Iterator[str]:
    """Yield the faults of a leg under a platform that tilts, as lines of text."""
    takes, on_planes = (
        "legs that end in ball joints and hold nothing else",
        platform.keeps_points_in_planes,
    )
    if on_planes:
        takes = "legs that keep their points in planes and end in ball joints"
    withheld = complement(leg.free_axes(None))
    normal, free = leg.plane_normal, len(withheld) == 0
    if platform.kind.hold_rotation and not free:
        free = bool(np.abs(withheld @ np.transpose(platform.rotation_axes)).max() <= ROUNDING)
        takes += ", or but the rotation about the normal of its two axes, as P-R-U-R legs do"
    if any(leg.fixed_offset):
        yield f"fixed_offset: a {platform.motion} platform tilts as one, and has none"
    if not free and getattr(leg, "rods", 1) > 1:
        yield (
            f"rods: {getattr(leg, 'rods', 1)} parallel rods hold an angle, but a {platform.motion} "
            "platform tilts; make it 1"
        )
    elif not free:
        yield (
            f"a {leg.type} leg keeps a platform from tilting, but a {platform.motion} platform "
            f"tilts; it takes {takes}"
        )
    elif (normal is None) == on_planes:
        how = "does not keep its point" if normal is None else "keeps its point"
        yield f"a {leg.type} leg {how} in a plane; a {platform.motion} platform takes {takes}"
    elif normal is not None and abs(dot(normal, platform.axis)) > PARALLEL_TOLERANCE:
        yield (
            f"direction {list(normal)}: the plane across it does not stand upright; make it "
            f"perpendicular to the platform's axis {list(platform.axis)}"
        )
    else:
        yield from breaches(leg, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))


def _unheld_tilting(platform: Platform, legs: Sequence[LegKind]) -> list[str]:
    """Return, in a list or [], the fault that legs leave a tilting platform a free motion."""
    if platform.kind.hold_rotation and not any(
        len(complement(leg.free_axes(None))) for leg in legs
    ):
        return [
            f"legs: none keeps a {platform.motion} platform from turning about the normal of its "
            "two axes; give it a PRUR or RPUR leg, or one with a passive chain of its own"
        ]
    normals = [leg.plane_normal for leg in legs if leg.plane_normal is not None]
    if normals and all(parallel(normals[0], normal) for normal in normals[1:]):
        return [
            f"legs: the planes of all legs are parallel, across {list(normals[0])}, so that the "
            "platform is free to move along them and to turn; turn the direction of one"
        ]
    return []


def _with_held_points(platform: Platform, legs: Sequence[LegKind]) -> Platform:
    """Return a tripod's platform with the planes in which its legs keep its points."""
    if not platform.keeps_points_in_planes:
        return platform
    planes = [
        HeldPoint(leg.plane_normal, leg.guide_point, leg.platform_point)
        for leg in legs
        if leg.plane_normal is not None
    ]
    return replace(platform, planes=tuple(planes))


def unheld_axes(platform: Platform, legs: Sequence[LegKind]) -> NDArray[np.float64]:
    """Return axes (k, 3) about which no leg prevents a non-tilting platform from rotating.

    Such axes are allowed only for a five-bar, whose legs meet in one point: only that point may
    carry anything.
    """
    axis = platform.turning_axis
    # What one leg withholds is perpendicular to the axes about which it lets the platform turn.
    withheld = [complement(leg.free_axes(axis)) for leg in legs]
    return complement(np.vstack([*withheld, *([axis] if axis else [])]))


def _unheld_freedoms(platform: Platform, legs: list[LegKind]) -> list[str]:
    """Return, in a list or [], the fault that legs leave the platform a free motion."""
    turning = [i for i, leg in enumerate(legs, start=1) if leg.follows_angle]
    if len(turning) > 1:
        return [f"{legs_text(turning)}: all turn the platform, which takes one such leg"]
    if platform.plane_normal is not None and all(leg.plane_normal is None for leg in legs):
        return [f"legs: none keeps a {platform.motion} platform in its plane; give it a planar leg"]
    axis = platform.turning_axis
    withheld = [complement(leg.free_axes(axis)) for leg in legs]
    free = unheld_axes(platform, legs)
    if not len(free):
        return []
    if platform.plane_normal is not None and not platform.angles:
        first, *others = (_planar_point(platform, leg) for leg in legs)
        distance = max(math.hypot(*(first - other)) for other in others)
        if distance <= ROUNDING:
            return []
        return [
            f"legs: their platform points are {distance:.4g} m apart, so that the platform is free "
            "to turn about its axis; a 2T platform needs one point for all"
        ]
    single = [
        i
        for i, (leg, rows) in enumerate(zip(legs, withheld, strict=True), start=1)
        if not len(rows) and not leg.follows_angle
    ]
    causes = [f"{legs_text(single)} keep it from no turn, as single rods do"] if single else []
    if len(single) + len(turning) < len(legs):
        whose = "the other directions" if single else "all directions"
        where = "lie in one plane with it and the platform's axis" if axis else "are parallel to it"
        causes.append(f"{whose} {where}")
    axis_direction = free[0] * np.sign(free[0][np.abs(free[0]).argmax()])
    about = [round(float(x), 3) + 0.0 for x in axis_direction] if len(free) == 1 else "several axes"
    return [
        f"legs: the platform is free to {'tilt' if axis else 'turn'} about {about}: "
        f"{', and '.join(causes)}; turn a leg's direction, or the bar of its rods, elsewhere"
        f"{', or make rods double' if single else ''}"
    ]


def legs_text(numbers: Sequence[int]) -> str:
    """Return a phrase for legs by number: "leg 1", "legs 1 and 2", "legs 1, 2 and 3"."""
    *first_legs, last = map(str, numbers)
    return f"legs {', '.join(first_legs)} and {last}" if first_legs else f"leg {last}"


def _planar_point(platform: Platform, leg: LegKind) -> NDArray[np.float64]:
    """Return a leg's platform point in the platform's plane, from P, at phi = 0, (2,), m."""
    point = np.array(platform.frame).T @ leg.platform_point + leg.fixed_offset
    return platform.directions @ point
