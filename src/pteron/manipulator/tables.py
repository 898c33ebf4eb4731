"""The tables of a machine's TOML file as pydantic models, with a description of each key.

Imported only where a file is read or written, since pydantic slows the start.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import lru_cache
from typing import Annotated, Any, Literal

from pydantic import AliasChoices, BeforeValidator, Field, create_model

from pteron.bodies.inertia import PlanarInertia, RodInertia
from pteron.bodies.tables import (
    Bar,
    Count,
    Geared,
    Number,
    PlanarBody,
    RodBody,
    Six,
    Slider,
    SpatialBody,
    Table,
    Three,
    Two,
)
from pteron.errors import ModelError
from pteron.legs import LegKind
from pteron.legs.cones import Cone
from pteron.legs.drive import Drive, Stribeck
from pteron.legs.keys import Key, KeyRole
from pteron.legs.reading import Reading
from pteron.manipulator.manipulator import STANDARD_GRAVITY
from pteron.platforms.kinds import TILTING, AngleOrder, Motion
from pteron.toml import told


class ConeTable(Table):
    """`{ axis, angle }`: the cone in which a ball joint holds its rod."""

    axis: Three = Field(description="from the joint along the rod, in the frame of what holds it")
    angle: Number = Field(description="the greatest angle between axis and rod, rad")


class StribeckTable(Table):
    """`{ force, speed }` of what dry friction has more at rest."""

    force: Number = Field(description="what is added at rest, N or N m")
    speed: Number = Field(description="by which most of it is gone, m/s or rad/s")


class DriveTable(Table):
    """The drive of a joint: at the joint, but for what is said to be the motor's."""

    coulomb: Number = Field(0.0, description="dry friction, N or N m")
    viscous: Number = Field(0.0, description="N s/m or N m s")
    offset: Number = Field(0.0, description="a constant force, N or N m")
    rotor_inertia: Number = Field(
        0.0, description="of the motor and what turns with it, kg m^2", examples=[3e-5]
    )
    ratio: Number | None = Field(
        None,
        description="motor angle over the joint's coordinate, rad/m or rad/rad; 1 if left out",
        examples=[392.7],
    )
    rest_speed: Number = Field(
        1e-3, description="within which dry friction changes its sign smoothly, m/s or rad/s"
    )
    stribeck: StribeckTable | None = Field(
        None,
        description="what dry friction has more at rest",
        examples=[{"force": 1.2, "speed": 0.01}],
    )
    rated_torque: Number | None = Field(
        None, description="of the motor, N m: what commands in per cent are of", examples=[0.64]
    )
    max_force: Number | None = Field(
        None, description="what the drive can do, N or N m", examples=[120.0]
    )
    max_speed: Number | None = Field(None, description="m/s or rad/s", examples=[1.5])
    counts_per_turn: Number | None = Field(
        None,
        description="of the motor's encoder in a turn of the motor: what logs in counts are in",
        examples=[131072.0],
    )


class _Motion(Table):
    motion: Motion = Field(
        description='"3T": x, y, z. "3T1R": also phi, about axis. "2T": x, y in the plane across '
        'axis. "2T1R": also phi. Tilting: "3T3R", "3R" and "2R" about center, "1T2R" of a tripod'
    )
    axis: Three = Field(
        (0.0, 0.0, 1.0),
        description="k, which the platform turns about; the normal of a planar machine's plane; "
        "the platform frame's z at angles zero",
    )
    x_axis: Three | None = Field(
        None,
        description="the platform frame's x at angles zero; needed unless axis is base frame's z",
        examples=[[1.0, 0.0, 0.0]],
    )


class PlatformTable(PlanarBody, _Motion):
    """`[platform]`: its body's origin is P, its frame turns with phi."""

    slides: bool = Field(
        False, description="whether phi slides the platform points, m/rad, as an I4's nacelle does"
    )
    limits: Two | None = Field(
        None,
        description="least and greatest phi, rad, where hinges allow no more; may be several turns",
        examples=[[-0.8, 0.8]],
    )
    tool: Three = Field(
        (0.0, 0.0, 0.0), description="the tool's centre point in the platform frame, m"
    )
    bars: list[Bar] = Field(
        [],
        description="parts that move with a hinge of the platform and do not turn",
        examples=[[{"mass": 0.1, "hinge": [0.05, 0.0, 0.0]}]],
    )
    geared: list[Geared] = Field(
        [],
        description="balanced parts, such as a tool, that a gear turns with the platform",
        examples=[[{"inertia": 6e-5, "ratio": 4.0}]],
    )


class TiltingTable(SpatialBody, _Motion):
    """`[platform]` that tilts: its body's origin is P, its frame turns by the pose's angles."""

    angles: AngleOrder = Field(
        "rpy",
        description='of 3T3R and 3R, "rpy": R = Rz(yaw) Ry(pitch) Rx(roll). "xyz": R = Rx(rx) '
        "Ry(ry) Rz(rz)",
    )
    center: Three | None = Field(
        None,
        description="of 3R and 2R: P, on the joint that the platform turns about, m",
        examples=[[0.0, 0.0, 0.1]],
    )
    second_axis: Three | None = Field(
        None,
        description="of 2R: what beta turns about, at alpha = 0; alpha turns about axis",
        examples=[[0.0, 1.0, 0.0]],
    )
    limits: list[Two] | None = Field(
        None,
        description="least and greatest of each angle, rad",
        examples=[[[-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]]],
    )
    tool: Three = Field(
        (0.0, 0.0, 0.0), description="the tool's centre point in the platform frame, m"
    )


class ReadingTable(Table):
    """`reading`: how a drive counts its joint: coordinate = zero + scale reading."""

    zero: Number = Field(0.0, description="the coordinate where it reads 0, m or rad")
    scale: Number = Field(1.0, description="coordinate per unit of the reading")


def platform_table(motion: Any) -> type[PlatformTable] | type[TiltingTable]:
    """Return what a platform of a motion holds; one that is not known as if it did not tilt."""
    return TiltingTable if motion in TILTING else PlatformTable


class RadiiTable(Table):
    """`radii`: how thick the bodies are, as capsules round their centre lines."""

    guide: Number = Field(0.0, description="of a slider's guide, m")
    upper: Number = Field(0.0, description="of an upper link or a crank, m")
    lower: Number = Field(0.0, description="of a last link or each rod, m")
    platform: Number = Field(0.0, description="of the platform's arms, m")


class ToolTable(Table):
    """`[[tools]]`: a tool that the platform can carry, which --tool and `with_tool` mount."""

    name: str = Field(description="what it is called")
    point: Three = Field((0.0, 0.0, 0.0), description="its centre point in the platform frame, m")
    mass: Number = Field(0.0, description="kg")
    center_of_mass: Three | None = Field(
        None, description="in the platform frame, m; its point if left out", examples=[[0.0] * 3]
    )
    central_inertia: Number | Six = Field(
        0.0,
        description="about its own centre of mass, kg m^2: along axis; where the platform tilts "
        "[Ixx, Ixy, Ixz, Iyy, Iyz, Izz]",
    )


class MachineTable(Table):
    """The whole file; each of `legs` is read by its own kind."""

    name: str = Field(description="what the machine is called")
    gravity: Three = Field(
        STANDARD_GRAVITY, description="acceleration of gravity in the base frame, m/s^2"
    )
    radii: RadiiTable | None = Field(
        None,
        description="how thick the bodies are round their centre lines, m: for clearances",
        examples=[{"guide": 0.01, "upper": 0.01, "lower": 0.008, "platform": 0.01}],
    )
    tools: list[ToolTable] = Field(
        [],
        description="tools that the platform can carry, beside what it is",
        examples=[[{"name": "gripper", "point": [0.0, 0.0, -0.08], "mass": 0.3}]],
    )
    platform: PlatformTable = Field(description="what the legs carry")
    legs: list[Any] = Field(description="one table for each freedom of the platform")


class TiltingMachineTable(MachineTable):
    """The same of a machine whose platform tilts."""

    platform: TiltingTable = Field(description="what the legs carry")  # type: ignore[assignment]


def _no_truth(given: Any) -> Any:
    if isinstance(given, bool):  # which Python takes for 1 or 0
        raise ValueError(f"{given} given, 1 or -1 expected")
    return given


_TYPES: dict[KeyRole, Any] = {
    "point": Three,
    "direction": Three,
    "length": Number,
    "number": Number,
    "count": Count,
    "sign": Annotated[Literal[1, -1], BeforeValidator(_no_truth)],
    "limits": Two,
    "cone": ConeTable,
    "slider": Slider,
    "planar": PlanarBody,
    "rod": RodBody,
    "drive": DriveTable,
    "reading": ReadingTable,
}

FORMER = {"limits": "slider_limits"}
"""Keys by their names in files of version 0.1."""


@lru_cache(maxsize=16)
def leg_table(kind: type[LegKind]) -> type[Table]:
    """Return what a table of `[[legs]]` may hold, for a kind of leg."""
    fields: dict[str, Any] = {"type": (str, Field(kind.type, description="the kind of leg"))}
    for key, about in kind.every_key().items():
        held, former = _TYPES[about.role], FORMER.get(key)
        fields[toml_key(key, about)] = (
            held | None if about.default is None else held,
            Field(
                about.default,
                description=about.help,
                examples=None if about.example is None else [about.example],
                json_schema_extra={"like": about.like} if about.like else None,
                validation_alias=former and AliasChoices(key, former),
            ),
        )
    return create_model(f"{kind.type}Table", __base__=Table, **fields)


@lru_cache(maxsize=16)
def part_of(model: type[Table]) -> type[Table]:
    """Return the same table, in which no key must be given: what is missing is None."""
    required: dict[str, Any] = {
        key: (field.rebuild_annotation() | None, None)
        for key, field in model.model_fields.items()
        if field.is_required()
    }
    return create_model(f"PartOf{model.__name__}", __base__=model, **required)


def toml_key(name: str, key: Key) -> str:
    """Return how a file calls a field of a leg: a slider is a table with its mass."""
    return "slider" if key.role == "slider" else name


_ORDINARY: dict[KeyRole, Any] = {
    "length": 1.0,
    "number": 1.0,
    "slider": 1.0,
    "planar": PlanarInertia(1.0, (0.0, 0.0), 1.0),
    "rod": RodInertia(1.0, (0.0,), 1.0),
}
"""Ordinary values in the place of those with a fault, while the rest of the machine is checked."""


def leg_of(
    kind: type[LegKind], table: Any, tilts: bool = False
) -> tuple[LegKind | None, list[str]]:
    """Build a leg from its table, in which keys that must be given may be None.

    `tilts` tells whether its platform does.

    Returns
    -------
    leg : leg or None
        With faults it is one with ordinary values for those that cannot be, where a direction or a
        point is not among them.
    faults : list of str
        Each begins with its key; what is missing is none of them.
    """
    keys = kind.every_key()
    given = {name: getattr(table, toml_key(name, key)) for name, key in keys.items()}
    if tilts:
        own = {n: key.tilting for n, key in keys.items() if key.tilting is not None}
        given |= {n: v for n, v in own.items() if n not in table.model_fields_set}
    given = {n: v for n, v in given.items() if v is not None or keys[n].default is None}
    values, refused = {}, {}
    for name, value in given.items():
        try:
            values[name] = _held(value, name, keys[name])
        except ModelError as error:
            refused[name] = error.faults
    sound, others = kind.checked(values)
    filled = {
        name: _ORDINARY.get(key.role) if key.default is ... or key.role == "point" else key.default
        for name, key in keys.items()
    }
    try:
        leg = kind(**filled | sound)
    except ModelError:
        leg = None
    if leg is not None and all(n in sound for n, key in keys.items() if key.role == "length"):
        for name in refused:
            if text := _beyond_ends(leg, keys[name].body, given[name]):
                refused[name] = (f"{name}.center_of_mass: {text}",)
    return leg, [*(fault for several in refused.values() for fault in several), *others]


def _held(given: Any, name: str, key: Key) -> Any:
    """Return what a leg holds of what its table does."""
    if key.role == "slider":
        return given.mass
    if key.body:
        return given.inertia_of(name)
    return _built(_PARTS[type(given)], given, name) if type(given) in _PARTS else given


_PARTS: dict[Any, Any] = {
    ConeTable: Cone,
    DriveTable: Drive,
    ReadingTable: Reading,
    StribeckTable: Stribeck,
}
"""Parts of a leg by their tables."""


def _built(kind: Any, table: Table, key: str) -> Any:
    """Return a part of a leg from its table; `key` goes before what an error names."""
    faults, given = list[str](), {name: getattr(table, name) for name in type(table).model_fields}
    for name, value in given.items():
        try:
            if type(value) in _PARTS:
                given[name] = None
                given[name] = _built(_PARTS[type(value)], value, f"{key}.{name}")
        except ModelError as error:
            faults += error.faults
    try:
        made = kind(**given)
    except ModelError as error:
        faults += [f"{key}.{fault}" for fault in error.faults]
    if faults:
        raise ModelError(told(faults), faults=faults)
    return made


def _beyond_ends(leg: LegKind, letter: str, body: Any) -> str | None:
    """Return what is said of a body that cannot be as its centre of mass is beyond its ends."""
    if not letter or body.center_of_mass is None or min(body.mass, body.inertia) <= 0.0:
        return None
    text = leg.beyond_ends(letter, body.center_of_mass[0])
    return text and f"{text}; with it no real body has inertia {body.inertia:g} kg m^2"


def leg_items(leg: LegKind) -> Mapping[str, Any]:
    """Return a leg's fields by their keys in a file, bodies as they are."""
    found: dict[str, Any] = {"type": leg.type}
    for name, key in leg.every_key().items():
        found[toml_key(name, key)] = leg.bodies[key.body] if key.body else getattr(leg, name)
    if leg.drive is not None:
        fields = DriveTable.model_fields
        given = {name: getattr(leg.drive, name) for name in fields}
        found["drive"] = {k: v for k, v in given.items() if v != fields[k].default}
    if leg.reading is not None:
        found["reading"] = asdict(leg.reading)
    return found
