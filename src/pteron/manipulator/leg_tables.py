"""The tables of a machine's legs in its TOML file, and the legs that they build.

Imported only where a file is read or written, since pydantic slows the start.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import lru_cache
from typing import Annotated, Any, Literal

from pydantic import AliasChoices, BeforeValidator, Field, create_model

from pteron.bodies.inertia import PlanarInertia, RodInertia, SpatialInertia
from pteron.bodies.tables import (
    Count,
    Number,
    PlanarBody,
    RodBody,
    Slider,
    SpatialBody,
    Three,
    TomlTable,
    Two,
)
from pteron.errors import ModelError
from pteron.legs import LegKind
from pteron.legs.keys import Key, KeyRole
from pteron.manipulator.tables import PARTS, ConeTable, DriveTable, ReadingTable
from pteron.toml import raise_faults


def _no_truth(sign: Any) -> Any:
    """Return a sign; raise for a bool, which Python counts as an integer."""
    if isinstance(sign, bool):  # Python counts it as 1 or 0
        raise ValueError(f"{sign} given, 1 or -1 expected")
    return sign


_TYPES: dict[KeyRole, Any] = {
    "point": Three,
    "direction": Three,
    "length": Number,
    "number": Number,
    "angle": Number,
    "count": Count,
    "sign": Annotated[Literal[1, -1], BeforeValidator(_no_truth)],
    "limits": Two,
    "cone": ConeTable,
    "slider": Slider,
    "planar": PlanarBody,
    "rod": RodBody,
    "solid": SpatialBody,
    "drive": DriveTable,
    "reading": ReadingTable,
}

_FORMER = {"limits": "slider_limits"}
"""Keys that had another name in files of version 0.1, with that name."""


def alias_of(name: str, key: Key) -> str:
    """Return another name that files may have for a key, such as a former one; '' without one."""
    return key.alias or _FORMER.get(name, "")


@lru_cache(maxsize=16)
def leg_table(kind: type[LegKind]) -> type[TomlTable]:
    """Return the pydantic model of a `[[legs]]` table for a kind of leg."""
    fields: dict[str, Any] = {"type": (str, Field(kind.type, description="the kind of leg"))}
    for key, about in kind.every_key().items():
        field_type, alias = _TYPES[about.role], alias_of(key, about)
        fields[toml_key(key, about)] = (
            field_type | None if about.default is None else field_type,
            Field(
                about.default,
                description=about.help,
                examples=None if about.example is None else [about.example],
                json_schema_extra={"like": about.like} if about.like else None,
                validation_alias=AliasChoices(key, alias) if alias else None,
            ),
        )
    return create_model(f"{kind.type}Table", __base__=TomlTable, **fields)


@lru_cache(maxsize=16)
def part_of(model: type[TomlTable]) -> type[TomlTable]:
    """Return a pydantic model with all keys of `model` optional, None if missing."""
    required: dict[str, Any] = {
        key: (field.rebuild_annotation() | None, None)
        for key, field in model.model_fields.items()
        if field.is_required()
    }
    return create_model(f"PartOf{model.__name__}", __base__=model, **required)


def toml_key(name: str, key: Key) -> str:
    """Return the TOML key of a leg's field: "slider" for a slider's mass, else the field's name."""
    return "slider" if key.role == "slider" else name


_ORDINARY: dict[KeyRole, Any] = {
    "length": 1.0,
    "number": 1.0,
    "angle": 1.0,
    "slider": 1.0,
    "planar": PlanarInertia(1.0, (0.0, 0.0), 1.0),
    "rod": RodInertia(1.0, (0.0,), 1.0),
    "solid": SpatialInertia(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)),
}
"""Substitutes of values with a fault, with which the other parts of the machine are checked."""


def leg_of(
    kind: type[LegKind], table: Any, tilts: bool = False
) -> tuple[LegKind | None, list[str]]:
    """Build a leg from its table, in which required keys may be None; collect its faults.

    `tilts` is whether the leg's platform tilts.

    Returns
    -------
    leg : leg or None
        The leg; if values have faults, one with valid values in their place; None if a direction or
        a point has a fault.
    faults : list of str
        The faults, each beginning with its key; a missing key is not among them.
    """
    keys = kind.every_key()
    raw_fields = {name: getattr(table, toml_key(name, key)) for name, key in keys.items()}
    if tilts:
        tilting_defaults = {n: key.tilting for n, key in keys.items() if key.tilting is not None}
        raw_fields |= {n: v for n, v in tilting_defaults.items() if n not in table.model_fields_set}
    raw_fields = {n: v for n, v in raw_fields.items() if v is not None or keys[n].default is None}
    converted, refused = {}, {}
    for name, raw in raw_fields.items():
        try:
            converted[name] = _field_value(raw, name, keys[name])
        except ModelError as error:
            refused[name] = error.faults
    sound, others = kind.check_fields(converted)
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
            if text := _end_fault(leg, keys[name].body, raw_fields[name]):
                refused[name] = (f"{name}.center_of_mass: {text}",)
    return leg, [*(fault for several in refused.values() for fault in several), *others]


def _field_value(raw: Any, name: str, key: Key) -> Any:
    """Return a leg field's value from that of its TOML key."""
    if key.role == "slider":
        return raw.mass
    if key.body:
        return raw.inertia_of(name)
    return _build_part(PARTS[type(raw)], raw, name) if type(raw) in PARTS else raw


def _build_part(kind: Any, table: TomlTable, key: str) -> Any:
    """Return a dataclass part of a leg from its table; errors name keys with the prefix `key`."""
    faults, raw_fields = (
        list[str](),
        {name: getattr(table, name) for name in type(table).model_fields},
    )
    for name, raw in raw_fields.items():
        try:
            if isinstance(raw, list):
                raw_fields[name] = tuple(
                    _build_part(PARTS[type(list_item)], list_item, f"{key}.{name}[{k}]")
                    if type(list_item) in PARTS
                    else list_item
                    for k, list_item in enumerate(raw, start=1)
                )
            elif type(raw) in PARTS:
                raw_fields[name] = None
                raw_fields[name] = _build_part(PARTS[type(raw)], raw, f"{key}.{name}")
        except ModelError as error:
            faults += error.faults
    try:
        part = kind(**raw_fields)
    except ModelError as error:
        faults += [f"{key}.{fault}" for fault in error.faults]
    raise_faults(faults)
    return part


def _end_fault(leg: LegKind, letter: str, body: Any) -> str | None:
    """Return a message if a body's centre of mass lies beyond the link's ends, else None."""
    if not letter or body.center_of_mass is None or isinstance(body, SpatialBody):
        return None
    if min(body.mass, body.inertia) <= 0.0:
        return None
    text = leg.center_of_mass_warning(letter, body.center_of_mass[0])
    return text and f"{text}; with it no real body has inertia {body.inertia:g} kg m^2"


def leg_items(leg: LegKind) -> Mapping[str, Any]:
    """Return a leg's field values by their TOML keys; bodies remain objects."""
    items: dict[str, Any] = {"type": leg.type}
    for name, key in leg.every_key().items():
        items[toml_key(name, key)] = leg.bodies[key.body] if key.body else getattr(leg, name)
    if leg.drive is not None:
        fields = DriveTable.model_fields
        drive_fields = {name: getattr(leg.drive, name) for name in fields}
        items["drive"] = {k: v for k, v in drive_fields.items() if v and v != fields[k].default}
    if leg.reading is not None:
        items["reading"] = asdict(leg.reading)
    return items
