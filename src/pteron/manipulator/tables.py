"""The tables of a machine's TOML file as pydantic models, each key with what it is.

Imported where a file is read or written, since pydantic would slow the start of those who do not.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Literal

from pydantic import AliasChoices, Field, create_model

from pteron.bodies.tables import (
    Bar,
    Count,
    Geared,
    Number,
    PlanarBody,
    RodBody,
    Slider,
    Table,
    Three,
    Two,
)
from pteron.errors import ModelError
from pteron.legs import LegKind
from pteron.legs.cones import Cone
from pteron.legs.kind import Key, KeyRole
from pteron.manipulator.manipulator import STANDARD_GRAVITY
from pteron.platforms.platform import Motion
from pteron.toml import told


class ConeTable(Table):
    """`{ axis, angle }` of the cone in which a ball joint holds its rod."""

    axis: Three = Field(description="from the joint along the rod, in the frame of what holds it")
    angle: Number = Field(description="the greatest angle between axis and rod, rad")

    def cone_of(self, key: str) -> Cone:
        """Build the cone; `key` goes before what an error names."""
        try:
            return Cone(self.axis, self.angle)
        except ModelError as error:
            raise ModelError(f"{key}.{error}") from None


class _Motion(Table):
    motion: Motion = Field(
        description='"3T": x, y, z. "3T1R": also phi, about axis. "2T": x, y in the plane across '
        'axis. "2T1R": also phi'
    )
    axis: Three = Field(
        (0.0, 0.0, 1.0),
        description="k, which the platform turns about; the normal of a planar machine's plane",
    )
    x_axis: Three | None = Field(
        None,
        description="the platform frame's x at phi = 0; needed unless axis is the base frame's z",
        examples=[[1.0, 0.0, 0.0]],
    )


class PlatformTable(PlanarBody, _Motion):
    """`[platform]`: its body's origin is P, its frame turns with phi."""

    slides: bool = Field(
        False,
        description="whether phi slides the platform points, m/rad, as an I4's nacelle does",
    )
    limits: Two | None = Field(
        None,
        description="least and greatest phi, rad, where hinges of the platform allow no more",
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


class MachineTable(Table):
    """The whole file; each of `legs` is read by its own kind."""

    name: str = Field(description="what the machine is called")
    gravity: Three = Field(
        STANDARD_GRAVITY, description="acceleration of gravity in the base frame, m/s^2"
    )
    platform: PlatformTable = Field(description="what the legs carry")
    legs: list[Any] = Field(description="one table for each freedom of the platform")


_TYPES: dict[KeyRole, Any] = {
    "point": Three,
    "direction": Three,
    "length": Number,
    "number": Number,
    "count": Count,
    "sign": Literal[1, -1],
    "limits": Two,
    "cone": ConeTable,
    "slider": Slider,
    "planar": PlanarBody,
    "rod": RodBody,
}

_FORMER = {"limits": "slider_limits"}
"""What keys were called in files of version 0.1."""


@lru_cache(maxsize=16)
def leg_table(kind: type[LegKind]) -> type[Table]:
    """Return what a table of `[[legs]]` may hold, for a kind of leg."""
    fields: dict[str, Any] = {"type": (str, Field(kind.type, description="the kind of leg"))}
    for key, about in kind.every_key().items():
        held, former = _TYPES[about.role], _FORMER.get(key)
        fields[toml_key(key, about)] = (
            held | None if about.default is None else held,
            Field(
                about.default,
                description=about.help,
                examples=None if about.example is None else [about.example],
                validation_alias=former and AliasChoices(key, former),
            ),
        )
    return create_model(f"{kind.type}Table", __base__=Table, **fields)


def toml_key(name: str, key: Key) -> str:
    """Return how a file calls a field of a leg: a slider is a table with its mass."""
    return "slider" if key.role == "slider" else name


def leg_of(kind: type[LegKind], table: Any) -> LegKind:
    """Build a leg from its table.

    Raises
    ------
    ModelError
        If there is no such leg; with all faults, each of which begins with its key.
    """
    values: dict[str, Any] = {}
    faults: list[str] = []
    for name, key in kind.every_key().items():
        values[name] = given = getattr(table, toml_key(name, key))
        try:
            if key.role == "slider":
                values[name] = given.mass
            elif key.body:
                values[name] = given.unit  # the rest of the leg is looked at, too
                values[name] = given.inertia_of(name)
            elif key.role == "cone" and given is not None:
                values[name] = None
                values[name] = given.cone_of(name)
        except ModelError as error:
            faults += error.faults
    try:
        leg = kind(**values)
    except ModelError as error:
        faults += error.faults
    if faults:
        raise ModelError(told(faults), faults=faults)
    return leg


def leg_items(leg: LegKind) -> Mapping[str, Any]:
    """Return a leg's fields by their keys in a file, bodies as they are."""
    found: dict[str, Any] = {"type": leg.type}
    for name, key in leg.every_key().items():
        found[toml_key(name, key)] = leg.bodies[key.body] if key.body else getattr(leg, name)
    return found
