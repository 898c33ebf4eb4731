"""The TOML keys of a leg, which are its dataclass' fields: roles, help, defaults and checks."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from textwrap import fill
from tomllib import loads
from typing import Any, Literal, NamedTuple

from pteron.bodies.vectors import interval, number, perpendicular, positive, unit_vector, vector
from pteron.errors import ModelError
from pteron.legs.drive import Drive
from pteron.legs.reading import Reading

KeyRole = Literal[
    "point",
    "direction",
    "length",
    "number",
    "angle",
    "count",
    "sign",
    "limits",
    "cone",
    "slider",
    "planar",
    "rod",
    "solid",
    "drive",
    "reading",
]
"""The content of a key: a vector, a unit vector, a length, a number, an angle, a whole number, +1
or -1, two limits, a ball joint's cone, a slider's mass (TOML key `slider`), a body in a plane, a
rod, a body in space, a drive, how the drive counts. Files and pages give a leg's keys in this
order."""


_TYPES: dict[KeyRole, str] = {
    "point": "vector",
    "direction": "unit vector",
    "length": "float",
    "number": "float",
    "angle": "float",
    "count": "int",
    "sign": "int",
    "limits": "(float, float)",
    "cone": "Cone",
    "slider": "float",
    "planar": "PlanarInertia",
    "rod": "RodInertia",
    "solid": "SpatialInertia",
    "drive": "Drive",
    "reading": "Reading",
}
"""The type of a field, by its role, as docstrings have it."""


class Key(NamedTuple):
    """A field of a leg, which is a TOML key of its table."""

    role: KeyRole
    help: str
    """Its meaning in a line, with letter, frame and unit: for files and pages."""
    body: str = ""
    """The letter of the body whose inertia it is: "p", "u" or "l"."""
    default: Any = ...
    """Its value where a file does not give it; `...` where a file must."""
    example: Any = None
    """A usual value, where the default is None."""
    like: str = ""
    """The key whose value is an example, where the file gives it."""
    across: str = ""
    """The direction to which it is perpendicular, by its key."""
    alias: str = ""
    """Another name that files may have for it."""
    tilting: Any = None
    """Its value where a file of a platform that tilts does not give it; None: as of any other."""


_GROUPS: dict[str, dict[str, Any]] = loads(
    (files("pteron.legs") / "keys.toml").read_text(encoding="utf-8")
)

ACCOUNTS: dict[str, str] = _GROUPS.pop("accounts")
"""The construction of each kind in a few sentences, see `LegKind.account`."""


def keys_of(*groups: str) -> dict[str, Key]:
    """Return the file keys of legs in groups of `keys.toml`; later groups override earlier ones."""
    return {name: _key(**about) for group in groups for name, about in _GROUPS[group].items()}


def _key(*, default: Any = ..., optional: bool = False, **about: Any) -> Key:
    """Return the `Key` of an entry in `keys.toml`; the default of an optional key is None."""
    default_value = tuple(default) if isinstance(default, list) else default
    return Key(**about, default=None if optional else default_value)


COMMON = keys_of("common")
"""The keys that every kind of leg has; a kind may override them."""


def parameters_section(keys: Mapping[str, Key]) -> str:
    """Return the text of the Parameters section of a leg class's docstring."""
    lines = ["", "", "    Parameters", "    ----------"]
    for name, key in keys.items():
        optional = "" if key.default is ... else ", optional"
        lines.append(f"    {name} : {_TYPES[key.role]}{optional}")
        lines.append(fill(f"{key.help}.", 96, initial_indent=8 * " ", subsequent_indent=8 * " "))
    return "\n".join([*lines, "    "])


class FieldCondition(NamedTuple):
    """A condition between fields that are valid by themselves."""

    names: tuple[str, ...]
    check: Callable[..., None]
    """It takes their values and raises a `ModelError` if it does not hold."""


def sound_fields(
    fields: Mapping[str, Any],
    keys: Mapping[str, Key],
    conditions: Sequence[FieldCondition],
    branches: Sequence[int],
) -> tuple[dict[str, Any], list[str]]:
    """Return the valid fields, converted, and the faults of the others, one line each.

    Fields and conditions that depend on an invalid or missing field are not checked. `branches` are
    the values that `elbow` may have.
    """
    sound: dict[str, Any] = {}
    faults: list[str] = []
    for name in sorted(fields, key=lambda name: bool(keys[name].across)):
        key, value = keys[name], fields[name]
        try:
            signs = branches if name == "elbow" else (1, -1)
            if key.role == "sign" and (isinstance(value, bool) or value not in signs):
                valid = "neither 1 nor -1" if len(signs) > 1 else "not 1, its only branch"
                raise ModelError(f"{name}: {value!r} is {valid}")
            if value is None and key.default is None:
                sound[name] = None
            elif axis := sound.get(key.across):
                sound[name] = perpendicular(value, axis, name, key.across)
            else:
                sound[name] = _check_value(value, name, key.role)
        except ModelError as error:
            faults += error.faults
    for names, check in conditions:
        if all(name in sound for name in names):
            try:
                check(*(sound[name] for name in names))
            except ModelError as error:
                faults += error.faults
    return sound, faults


def _check_value(value: Any, name: str, role: KeyRole) -> Any:
    """Return a leg field's value, converted by its role; raise where it is invalid."""
    if role == "point":
        return vector(value, name)
    if role == "direction":
        return unit_vector(value, name)
    if role == "length":
        return positive(value, name, "m")
    if role in ("number", "angle"):
        return number(value, name)
    if role == "count" and (type(value) is not int or value < 1):
        raise ModelError(f"{name}: {value!r} is not a whole number of at least 1")
    if role == "slider":
        return positive(value, "slider.mass", "kg")
    if role == "sign":
        return int(value)
    if role == "limits":
        return interval(value, name)
    if role == "drive" and not isinstance(value, Drive):
        raise ModelError(f"{name}: {type(value).__name__} given, a Drive expected")
    if role == "reading" and not isinstance(value, Reading):
        raise ModelError(f"{name}: {type(value).__name__} given, a Reading expected")
    return value


def check_elbow(
    limits: tuple[float, float] | None, least: float = 0.0, most: float = math.pi
) -> None:
    """Raise if an elbow's limits, rad, exceed the range of its angle, `least` to `most`."""
    if limits is not None and not least <= limits[0] < limits[1] <= most:
        raise ModelError(
            f"elbow_limits: {list(limits)} rad reaches beyond {least:.4g} to {most:.4g}, where the "
            "angle always is; are these degrees?"
        )
