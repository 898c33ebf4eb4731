"""The tables of a machine's legs in its TOML file, and the legs that they build.

Imported only where a file is read or written, since pydantic slows the start.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import lru_cache
from typing import Annotated, Any, Literal

from pydantic import AliasChoices, BeforeValidator, Field, create_model

from pteron.bodies.inertia import PlanarInertia, RodInertia
from pteron.bodies.tables import Count, Number, PlanarBody, RodBody, Slider, Table, Three, Two
from pteron.errors import ModelError
from pteron.legs import LegKind
from pteron.legs.keys import Key, KeyRole
from pteron.manipulator.tables import PARTS, ConeTable, DriveTable, ReadingTable
from pteron.toml import refuse


def _no_truth(given: Any) -> Any:
    if isinstance(given, bool):  # Python counts it as 1 or 0
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
"""Keys that had another name in files of version 0.1, with that name."""


@lru_cache(maxsize=16)
def leg_table(kind: type[LegKind]) -> type[Table]:
    """Return the pydantic model of a table of `[[legs]]` for a kind of leg."""
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
    """Return the model with all keys optional: a missing one is None."""
    required: dict[str, Any] = {
        key: (field.rebuild_annotation() | None, None)
        for key, field in model.model_fields.items()
        if field.is_required()
    }
    return create_model(f"PartOf{model.__name__}", __base__=model, **required)


def toml_key(name: str, key: Key) -> str:
    """Return the key in a file of a leg's field: that of a slider's mass is `slider`, a table."""
    return "slider" if key.role == "slider" else name


_ORDINARY: dict[KeyRole, Any] = {
    "length": 1.0,
    "number": 1.0,
    "slider": 1.0,
    "planar": PlanarInertia(1.0, (0.0, 0.0), 1.0),
    "rod": RodInertia(1.0, (0.0,), 1.0),
}
"""Valid values that replace those with a fault while the rest of the machine is checked."""


def leg_of(
    kind: type[LegKind], table: Any, tilts: bool = False
) -> tuple[LegKind | None, list[str]]:
    """Build a leg from its table, in which required keys may be None; collect its faults.

    `tilts` tells whether its platform tilts.

    Returns
    -------
    leg : leg or None
        The leg; if values have faults, one with valid values in their place; None if a direction or
        a point has a fault.
    faults : list of str
        The faults, each beginning with its key; a missing key is not among them.
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
    """Return the value of a leg's field from that of its table."""
    if key.role == "slider":
        return given.mass
    if key.body:
        return given.inertia_of(name)
    return _built(PARTS[type(given)], given, name) if type(given) in PARTS else given


def _built(kind: Any, table: Table, key: str) -> Any:
    """Return a part of a leg from its table; errors name its keys with `key` before them."""
    faults, given = list[str](), {name: getattr(table, name) for name in type(table).model_fields}
    for name, value in given.items():
        try:
            if isinstance(value, list):
                given[name] = tuple(
                    _built(PARTS[type(one)], one, f"{key}.{name}[{k}]")
                    if type(one) in PARTS
                    else one
                    for k, one in enumerate(value, start=1)
                )
            elif type(value) in PARTS:
                given[name] = None
                given[name] = _built(PARTS[type(value)], value, f"{key}.{name}")
        except ModelError as error:
            faults += error.faults
    try:
        made = kind(**given)
    except ModelError as error:
        faults += [f"{key}.{fault}" for fault in error.faults]
    refuse(faults)
    return made


def _beyond_ends(leg: LegKind, letter: str, body: Any) -> str | None:
    """Return the fault of a body whose centre of mass is beyond its ends, or None."""
    if not letter or body.center_of_mass is None or min(body.mass, body.inertia) <= 0.0:
        return None
    text = leg.beyond_ends(letter, body.center_of_mass[0])
    return text and f"{text}; with it no real body has inertia {body.inertia:g} kg m^2"


def leg_items(leg: LegKind) -> Mapping[str, Any]:
    """Return a leg's fields by their keys in a file; bodies stay objects."""
    found: dict[str, Any] = {"type": leg.type}
    for name, key in leg.every_key().items():
        found[toml_key(name, key)] = leg.bodies[key.body] if key.body else getattr(leg, name)
    if leg.drive is not None:
        fields = DriveTable.model_fields
        given = {name: getattr(leg.drive, name) for name in fields}
        found["drive"] = {k: v for k, v in given.items() if v and v != fields[k].default}
    if leg.reading is not None:
        found["reading"] = asdict(leg.reading)
    return found
