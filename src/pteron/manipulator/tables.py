"""The tables of a machine's TOML file as pydantic models, with a description of each key.

Imported only where a file is read or written, since pydantic slows the start.
"""

from __future__ import annotations

from dataclasses import MISSING, fields
from functools import reduce
from importlib.resources import files
from operator import or_
from tomllib import loads
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from pydantic import create_model

from pteron.bodies.tables import (
    BarTable,
    GearedTable,
    Number,
    PlanarBody,
    Six,
    SpatialBody,
    Three,
    TomlTable,
    Two,
    key,
)
from pteron.legs.cones import Cone
from pteron.legs.drive import Drive, Elastic, LuGre, Stribeck, Wave, Winding
from pteron.legs.reading import Reading
from pteron.legs.screw import Screw
from pteron.manipulator.manipulator import STANDARD_GRAVITY
from pteron.manipulator.radii import Radii
from pteron.platforms.kinds import AngleOrder, kind_of_motion

_DESCRIPTIONS: dict[str, dict[str, Any]] = loads(
    (files("pteron.manipulator") / "parts.toml").read_text(encoding="utf-8")
)

PARTS: dict[type[TomlTable], Any] = {}
"""The dataclass of each table of a file."""


def _table_of(part: Any) -> type[TomlTable]:
    """Return the pydantic table model of a dataclass, with its fields in file order."""
    hints, defaults = get_type_hints(part), {field.name: field.default for field in fields(part)}
    table_fields: dict[str, Any] = {}
    for name, description in _DESCRIPTIONS[part.__name__].items():
        about, *example = [description] if isinstance(description, str) else description
        default = {MISSING: ..., (): []}.get(defaults[name], defaults[name])
        table_fields[name] = _field_type(hints[name]), key(about, default, *example)
    about = _DESCRIPTIONS["about"][part.__name__]
    table = create_model(f"{part.__name__}Table", __base__=TomlTable, __doc__=about, **table_fields)
    PARTS[table] = part
    return table


def _field_type(hint: Any) -> Any:
    """Return the pydantic type of a table's key for a dataclass field's type hint."""
    tables = {part: table for table, part in PARTS.items()}
    if hint in (float, *tables):
        return tables.get(hint, Number)
    args = get_args(hint)
    if get_origin(hint) is UnionType:
        return reduce(or_, map(_field_type, args))
    if get_origin(hint) is tuple:
        item_types = tuple(_field_type(part_hint) for part_hint in args if part_hint is not ...)
        return (
            list.__class_getitem__(item_types)
            if ... in args
            else tuple.__class_getitem__(item_types)
        )
    return hint


ConeTable, StribeckTable, LuGreTable = map(_table_of, (Cone, Stribeck, LuGre))
ElasticTable, WindingTable, WaveTable = map(_table_of, (Elastic, Winding, Wave))
ScrewTable = _table_of(Screw)
DriveTable, ReadingTable, RadiiTable = map(_table_of, (Drive, Reading, Radii))


class _Motion(TomlTable):
    motion: str = key(
        '"3T": x, y, z. "3T1R": also phi, about axis. "2T": x, y in the plane across '
        'axis. "2T1R": also phi. Tilting: "3T3R", "3T2R", "3R" and "2R" about center, "1T2R" of a '
        "tripod"
    )
    axis: Three = key(
        "k, the axis about which the platform turns; for planar machines the normal of the plane; "
        "for others the platform frame's z at angles zero",
        (0.0, 0.0, 1.0),
    )
    x_axis: Three | None = key(
        "the platform frame's x at angles zero; needed unless axis is base frame's z",
        None,
        [1.0, 0.0, 0.0],
    )


class PlatformTable(PlanarBody, _Motion):
    """`[platform]`: its body's origin is P, its frame turns with phi."""

    slides: bool = key("two halves slide by phi, as in an I4; platform points in m/rad", False)
    limits: Two | None = key(
        "least and greatest phi that the hinges allow, rad; may be several turns",
        None,
        [-0.8, 0.8],
    )
    tool: Three = key("the tool's centre point in the platform frame, m", (0.0, 0.0, 0.0))
    bars: list[BarTable] = key(
        "parts that move with a hinge of the platform and do not turn",
        [],
        [{"mass": 0.1, "hinge": [0.05, 0.0, 0.0]}],
    )
    geared: list[GearedTable] = key(
        "balanced parts, such as a tool, that a gear turns when the platform turns",
        [],
        [{"inertia": 6e-5, "ratio": 4.0}],
    )


class TiltingTable(SpatialBody, _Motion):
    """`[platform]` that tilts: its body's origin is P, its frame turns by the pose's angles."""

    angles: AngleOrder = key(
        'for 3T3R and 3R, "rpy": R = Rz(yaw) Ry(pitch) Rx(roll). "xyz": R = Rx(rx) Ry(ry) Rz(rz)',
        "rpy",
    )
    center: Three | None = key(
        "for 3R and 2R: P, at the joint about which the platform turns, m", None, [0.0, 0.0, 0.1]
    )
    second_axis: Three | None = key(
        "for 2R and 3T2R: the axis of beta at alpha = 0; the axis of alpha is axis",
        None,
        [0.0, 1.0, 0.0],
    )
    axis_offset: Three | None = key(
        "for 2R whose axes do not meet: from center, on the first axis, to P on the second one, at "
        "angles zero, m",
        None,
        [0.0, 0.0, 0.02],
    )
    limits: list[Two] | None = key(
        "least and greatest value of each angle, rad", None, [[-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]]
    )
    tool: Three = key("the tool's centre point in the platform frame, m", (0.0, 0.0, 0.0))


def platform_table(motion: Any) -> type[PlatformTable] | type[TiltingTable]:
    """Return the table model for platforms of this motion; `PlatformTable` if it is unknown."""
    kind = kind_of_motion(motion)
    return TiltingTable if kind is not None and kind.tilts else PlatformTable


class ToolTable(TomlTable):
    """`[[tools]]`: a tool that the platform can carry, which --tool and `with_tool` mount."""

    name: str = key("name of the tool")
    point: Three = key("centre point of the tool in the platform frame, m", (0.0, 0.0, 0.0))
    mass: Number = key("mass, kg", 0.0)
    center_of_mass: Three | None = key(
        "centre of mass in the platform frame, m; if omitted, point", None, [0.0] * 3
    )
    central_inertia: Number | Six = key(
        "moment of inertia about its own centre of mass, kg m^2: along axis; for platforms that "
        "tilt [Ixx, Ixy, Ixz, Iyy, Iyz, Izz]",
        0.0,
    )


class HomeTable(TomlTable):
    """`[home]`: where the machine stands before it moves."""

    pose: list[Number] = key("coordinates of the pose in their order, m and rad")


class DistributionTable(TomlTable):
    """`[distribution]`: how a machine with more legs than freedoms shares out its forces."""

    limits: bool = key("whether each force stays within its drive's max_force", False)
    reference: list[Number] | None = key(
        "each drive's force along +q that forces are nearest to, N or N m; 0 if omitted",
        None,
        [10.0, 10.0, 10.0],
    )
    strengths: list[Number] | None = key(
        "each drive's strength, N or N m, by which forces are shared; max_force or the rated force "
        "if omitted",
        None,
        [100.0, 100.0, 50.0],
    )


class TemplateTable(TomlTable):
    """`[template]`: the machine of the catalog that the file was made from."""

    kind: str = key("name of the machine in the catalog")
    confirmed: list[str] = key(
        "keys of values that are meant to be as in the template: pteron check lists the others", []
    )
    rider: list[float] = key(
        "mass (kg), x, y, z (m) of the point mass that the platform's mass and inertia contain", []
    )


class MachineTable(TomlTable):
    """The whole file; each of `legs` is read by its own kind."""

    name: str = key("name of the machine")
    gravity: Three = key("acceleration of gravity in the base frame, m/s^2", STANDARD_GRAVITY)
    radii: RadiiTable | None = key(  # type: ignore[valid-type]
        "radii of the bodies around their centre lines, m: for clearances",
        None,
        {"guide": 0.01, "upper": 0.01, "lower": 0.008, "platform": 0.01},
    )
    tools: list[ToolTable] = key(
        "exchangeable tools that the platform can carry",
        [],
        [{"name": "gripper", "point": [0.0, 0.0, -0.08], "mass": 0.3}],
    )
    home: HomeTable | None = key(
        "pose where motions begin; chosen by Pteron if omitted: see home_pose", None
    )
    distribution: DistributionTable | None = key(
        "how more legs than freedoms share out their forces", None
    )
    template: TemplateTable | None = key("machine of the catalog that the file was made from", None)
    owner: dict[str, Any] = key("data of the owner: kept, without effect", {}, {"serial": "Q-07"})
    platform: PlatformTable = key("the platform, which the legs carry")
    legs: list[Any] = key("the legs: one table for each degree of freedom of the platform, or more")


class TiltingMachineTable(MachineTable):
    """The same of a machine whose platform tilts."""

    platform: TiltingTable = key("the platform, which the legs carry")  # type: ignore[assignment]
