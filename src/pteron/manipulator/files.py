"""Manipulators in TOML files: `load` reads one, by catalog name or path, and `save` writes one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from difflib import get_close_matches
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, TypeVar

from pteron.atomic import write_text
from pteron.bodies.inertia import PointMass
from pteron.errors import ModelError, shown
from pteron.legs import KINDS
from pteron.manipulator.manipulator import STANDARD_GRAVITY, Manipulator
from pteron.platforms import Bar, Geared, Platform
from pteron.platforms.platform import Motion
from pteron.toml import fault_lines, parsed_toml, read_toml, told

_Built = TypeVar("_Built")

_DEFAULT_KIND = "PRRR"


def catalog() -> tuple[str, ...]:
    """Return the names of the machines that come with Pteron."""
    folder = files("pteron.manipulator") / "catalog"
    return tuple(sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".toml")))


def load(name_or_path: str | Path) -> Manipulator:
    """Read a manipulator from the catalog or from a TOML file.

    Parameters
    ----------
    name_or_path : str or path
        A catalog name (``"quadrupteron"``, ``"delta"``, ...) or the path of a file.

    Returns
    -------
    Manipulator
        The machine, checked.

    Raises
    ------
    ModelError
        If there is no such name or file, or if the file is not TOML, lacks keys, has unknown ones,
        or describes a machine that cannot be; the message names every fault, by its key.

    Examples
    --------
    >>> import pteron
    >>> pteron.load("tripteron").coordinates
    ('x', 'y', 'z')
    """
    name = str(name_or_path)
    if name in catalog():
        resource = files("pteron.manipulator") / "catalog" / f"{name}.toml"
        return _machine(parsed_toml(resource.read_bytes(), name, ModelError), name)
    close = get_close_matches(name, catalog(), n=1)
    guess = f'; did you mean "{close[0]}"?' if close else ""
    names = ", ".join(catalog())
    absent = f"neither a file nor a machine of the catalog ({names}){guess}"
    return _machine(read_toml(name_or_path, ModelError, absent), name)


def _machine(document: dict[str, Any], source: str) -> Manipulator:
    source, reading = shown(source, bare=True, longest=1000), _Reading()
    machine = reading.table(_machine_table(), document, "")
    platform = machine and reading.built("platform.", lambda: _platform(machine.platform))
    given = document.get("legs")
    legs = [
        reading.leg(i, leg)
        for i, leg in enumerate(given if isinstance(given, list) else [], start=1)
    ]
    if not reading.faults and machine is not None and platform is not None:
        robot = reading.built(
            "", lambda: Manipulator(machine.name, platform, tuple(legs), machine.gravity)
        )
        if robot is not None:
            return robot
    faults = tuple(f"{source}: {fault}" for fault in reading.faults)
    raise ModelError(told(source, reading.faults), faults=faults)


@dataclass
class _Reading:
    """The faults that were found so far: a file is told all of them at once."""

    faults: list[str] = field(default_factory=list)

    def table(self, model: Any, given: object, prefix: str) -> Any:
        """Return a table as its model holds it, or None with the faults noted."""
        from pydantic import ValidationError

        try:
            return model.model_validate(given)
        except ValidationError as error:
            self.faults += [prefix + line for line in fault_lines(error, model)]
            return None

    def built(self, prefix: str, build: Callable[[], _Built]) -> _Built | None:
        """Return what `build` makes, or None with its fault noted under the key it names."""
        try:
            return build()
        except ModelError as error:
            self.faults.append(f"{prefix}{error}")
            return None

    def leg(self, i: int, given: object) -> Any:
        """Return leg i, from 1, or None."""
        prefix = f"leg {i}: "
        if not isinstance(given, dict):
            self.faults.append(f"{prefix}{shown(given)} given, a table [[legs]] expected")
            return None
        name = given.get("type", _DEFAULT_KIND)
        kind = KINDS.get(name) if isinstance(name, str) else None
        if kind is None:
            self.faults.append(f"{prefix}type: {shown(name)} is not one of {', '.join(KINDS)}")
            return None
        table = self.table(_leg_table(kind.type), given, prefix)
        return table and self.built(prefix, lambda: kind.of_table(table))


@lru_cache(maxsize=1)
def _machine_table() -> Any:
    """Return what a file may hold; each of `legs` is read by its own kind."""
    from pydantic import create_model

    from pteron.bodies import tables

    platform = create_model(
        "PlatformTable",
        __base__=tables.PlanarBody,
        motion=(Motion, ...),
        axis=(tables.Three, (0.0, 0.0, 1.0)),
        x_axis=(tables.Three | None, None),
        slides=(bool, False),
        tool=(tables.Three, (0.0, 0.0, 0.0)),
        bars=(list[tables.Bar], []),
        geared=(list[tables.Geared], []),
    )
    return create_model(
        "MachineTable",
        __base__=tables.Table,
        name=(str, ...),
        gravity=(tables.Three, STANDARD_GRAVITY),
        platform=(platform, ...),
        legs=(list[Any], ...),
    )


@lru_cache(maxsize=16)
def _leg_table(kind: str) -> Any:
    """Return what a table of `[[legs]]` may hold, for a kind of leg."""
    from pydantic import AliasChoices, Field, create_model

    from pteron.bodies import tables

    limits = Field(None, validation_alias=AliasChoices("limits", "slider_limits"))
    keys: dict[str, Any] = {
        "type": (str, kind),
        "guide_point": (tables.Three, ...),
        "platform_point": (tables.Three, ...),
        "fixed_offset": (tables.Three, (0.0, 0.0, 0.0)),
        "elbow": (Literal[1, -1], 1),
        "limits": (tables.Two | None, limits),
    }
    return create_model(f"{kind}Table", __base__=tables.Table, **keys, **KINDS[kind].table())


def _platform(table: Any) -> Platform:
    return Platform(
        table.motion,
        table.inertia_of(""),
        axis=table.axis,
        x_axis=table.x_axis,
        slides=table.slides,
        tool=table.tool,
        bars=tuple(Bar(bar.mass, bar.hinge) for bar in table.bars),
        geared=tuple(Geared(part.inertia, part.ratio) for part in table.geared),
    )


def save(robot: Manipulator, path: str | Path) -> Path:
    """Write a manipulator to a TOML file that `load` reads back without loss.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    path : str or path
        The file; it is replaced whole, or not at all.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    import tomlkit

    document = tomlkit.document()
    document.add(
        tomlkit.comment("A parallel manipulator for Pteron. SI units: m, kg, kg m, kg m^2, m/s^2.")
    )
    document.add("name", tomlkit.item(robot.name))
    document.add("gravity", tomlkit.item(list(robot.gravity)))
    x, _, axis = robot.platform.frame
    platform: dict[str, Any] = {"motion": robot.platform.motion, "axis": axis, "x_axis": x}
    platform |= {"slides": robot.platform.slides or None, "tool": robot.platform.tool}
    platform |= _body(robot.platform.inertia)
    table = _table(platform)
    for name in ("bars", "geared"):
        if parts := getattr(robot.platform, name):
            table.add(name, tomlkit.aot())
            for part in parts:
                table[name].append(_table(asdict(part)))
    document.add("platform", table)
    legs = tomlkit.aot()
    for leg in robot.legs:
        common: dict[str, Any] = {"type": leg.type}
        names = ("guide_point", "platform_point", "fixed_offset", "elbow", "limits")
        common |= {name: getattr(leg, name) for name in names}
        legs.append(_table(common | leg.as_table()))
    document.add("legs", legs)
    return write_text(path, tomlkit.dumps(document))


def _table(items: dict[str, Any]) -> Any:
    """Return a TOML table; what is None is left out, a body becomes an inline table."""
    import tomlkit

    table = tomlkit.table()
    for key, value in items.items():
        if isinstance(value, PointMass) or hasattr(value, "first_moment"):
            inline = tomlkit.inline_table()
            inline.update(_body(value))
            table.add(key, inline)
        elif isinstance(value, Sequence) and not isinstance(value, str):
            table.add(key, list(value))
        elif value is not None:
            table.add(key, value)
    return table


def _body(body: Any) -> dict[str, Any]:
    if isinstance(body, PointMass):
        return {"mass": body.mass}
    return {"mass": body.mass, "first_moment": list(body.first_moment), "inertia": body.inertia}
