"""`load` reads a manipulator from a TOML file or the catalog, and reports all faults at once."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import lru_cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from pteron.bodies.vectors import unit_vector, vector
from pteron.errors import ModelError, shorten, warn_unlikely
from pteron.legs import LegKind
from pteron.legs.circles import perpendicular_to
from pteron.legs.installed import kind_named, kind_names
from pteron.manipulator.distribution import Distribution
from pteron.manipulator.machine_warnings import machine_warnings
from pteron.manipulator.manipulator import Manipulator, faults_of
from pteron.manipulator.radii import Radii
from pteron.manipulator.template_record import Template
from pteron.manipulator.tool import Tool
from pteron.platforms import Bar, GearedPart, Platform
from pteron.toml import fault_lines, joined_faults, parsed_toml, toml_bytes

_Built = TypeVar("_Built")

DEFAULT_KIND = "PRRR"
"""The kind of a leg without `type`."""


def catalog() -> tuple[str, ...]:
    """Return the names of the machines in Pteron's catalog."""
    return _names()


@lru_cache(maxsize=1)
def _names() -> tuple[str, ...]:
    """Return the names of the catalog's machines, sorted."""
    folder = files("pteron.manipulator") / "catalog"
    return tuple(sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".toml")))


@lru_cache(maxsize=1)
def descriptions() -> dict[str, str]:
    """Return a short description of each machine of the catalog: its file's first phrase."""
    folder = files("pteron.manipulator") / "catalog"
    opening = re.compile(r"# (?:An? |The )?(.*?)(?: \(|[.,:;]\s)", re.DOTALL)
    texts = {name: opening.match((folder / f"{name}.toml").read_text("utf-8")) for name in _names()}
    return {name: match[1].replace("\n# ", " ") for name, match in texts.items() if match}


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

    Warns
    -----
    UnlikelyValue
        For each value of a file that is possible but unlikely, most often in another unit, as
        ``pteron check`` does. Masses and inertias are left out in files with first moments, which
        Pteron itself writes.

    Examples
    --------
    >>> import pteron
    >>> pteron.load("tripteron").coordinates
    ('x', 'y', 'z')
    """
    source = str(name_or_path)
    return _warned(*read_machine(*contents(name_or_path), source), source)


@lru_cache(maxsize=64)
def read_machine(
    content: bytes, source: str, source_name: str
) -> tuple[Manipulator, tuple[str, ...]]:
    """Return the machine described by a TOML file's bytes, and its warnings (cached)."""
    return _machine_and_warnings(parsed_toml(content, source, ModelError), source_name)


def loads(text: str) -> Manipulator:
    """Read a manipulator from the text of a TOML file.

    Parameters
    ----------
    text : str
        What a robot file holds.

    Returns
    -------
    Manipulator
        The machine, checked.

    Raises
    ------
    ModelError
        As `load`.

    Warns
    -----
    UnlikelyValue
        As `load`.

    Examples
    --------
    >>> from pteron.manipulator import dumps, load, loads
    >>> robot = load("delta")
    >>> loads(dumps(robot)) == robot
    True
    """
    return _warned(*read_machine(text.encode(), "the text", "the text"), "the text")


def from_dict(tables: Mapping[str, Any]) -> Manipulator:
    """Return the manipulator that the tables of a robot file describe.

    Parameters
    ----------
    tables : mapping
        The keys of a robot file, as `to_dict` returns and `tomllib` or `json` reads them.

    Returns
    -------
    Manipulator
        The machine, checked.

    Raises
    ------
    ModelError
        As `load`.

    Warns
    -----
    UnlikelyValue
        As `load`.

    Examples
    --------
    >>> from pteron.manipulator import from_dict, to_dict
    >>> tables = to_dict("delta")
    >>> tables["legs"][0]["upper_length"] = 0.25
    >>> from_dict(tables).legs[0].upper_length
    0.25
    """
    document = dict(tables)
    return _warned(*_machine_and_warnings(document, "the tables"), "the tables")


def _warned(robot: Manipulator, unlikely: Sequence[str], source: str) -> Manipulator:
    """Issue the warnings about unlikely values, then return the machine unchanged."""
    for text in unlikely:
        warn_unlikely(f"{source}: {text}")
    return robot


def _machine_and_warnings(
    document: dict[str, Any], source: str
) -> tuple[Manipulator, tuple[str, ...]]:
    """Return the machine described by a file's tables, and its warnings."""
    robot = _machine(document, source)
    # Pteron writes first moments, people centres of mass: an identified value of a single body is
    # one of many equivalent ones, and need not be likely.
    return robot, machine_warnings(robot, bodies=not _has_first_moments(document))


def _has_first_moments(table: Any) -> bool:
    """Return whether any body in a file's tables has a first moment."""
    if isinstance(table, list):
        return any(map(_has_first_moments, table))
    if not isinstance(table, dict):
        return False
    return "first_moment" in table or any(map(_has_first_moments, table.values()))


def document(name_or_path: str | Path) -> dict[str, Any]:
    """Return a machine file's tables as read from TOML, unchecked."""
    return parsed_toml(*contents(name_or_path), ModelError)


def contents(name_or_path: str | Path) -> tuple[bytes, str]:
    """Return the bytes of a machine's file, and the name that messages give it."""
    name = str(name_or_path)
    if name in catalog():
        resource = files("pteron.manipulator") / "catalog" / f"{name}.toml"
        return resource.read_bytes(), name
    names = " or ".join(
        f'"{similar}"' for similar in [*_similar_files(Path(name)), *_similar_machines(name)]
    )
    guess = f"; did you mean {names}?" if names else f" ({', '.join(catalog())})"
    absent = f"neither a file nor a machine of the catalog{guess}"
    return toml_bytes(name_or_path, ModelError, absent)


def _similar_files(path: Path) -> list[str]:
    """Return, in a list or [], the file in the folder whose name is most like a missing one's."""
    with suppress(OSError, ValueError):  # no such folder, one that may not be read, or no path
        if not path.exists():
            names = [file.name for file in path.parent.iterdir() if file.suffix == ".toml"]
            similar = get_close_matches(path.name, names, n=1, cutoff=0.75)
            return [shorten(str(path.parent / name), bare=True, longest=1000) for name in similar]
    return []


def _similar_machines(name: str) -> list[str]:
    """Return the catalog machines that a mistyped name may mean, by name or description."""
    word = Path(name).stem.lower()
    by_description = [
        machine for machine, text in descriptions().items() if word in text.lower().split()
    ]
    by_name = get_close_matches(word, catalog(), n=1, cutoff=0.85) or by_description
    return by_name or get_close_matches(word, catalog(), n=1)


def _machine(document: dict[str, Any], source: str) -> Manipulator:
    """Return the machine of a TOML document; a `ModelError` lists all its faults."""
    from pteron.manipulator.tables import (
        MachineTable,
        TiltingMachineTable,
        TiltingTable,
        platform_table,
    )

    raw_platform = document.get("platform")
    motion = raw_platform.get("motion") if isinstance(raw_platform, dict) else None
    tilts = issubclass(platform_table(motion), TiltingTable)
    reading = _FileReader(tilts=tilts)
    machine = reading.table(TiltingMachineTable if tilts else MachineTable, document, "")
    table = machine.platform or reading.valid_part(platform_table(motion), raw_platform)
    platform = table and reading.platform(table)
    radii = machine.radii and reading.build_or_note(
        "radii.", lambda: Radii(**machine.radii.model_dump())
    )
    tools = reading.parts("tools", machine.tools or [], Tool)
    raw_legs = document.get("legs")
    legs = raw_legs if isinstance(raw_legs, list) else []
    built: list[Any] = [reading.leg(i, leg) for i, leg in enumerate(legs, start=1)]
    if platform is not None:
        # Faults that are reported already are not repeated.
        name = "?" if machine.name is None else machine.name
        legs_built = built if machine.legs is not None else [None] * len(platform.coordinates)
        home = None if machine.home is None else tuple(machine.home.pose or ())
        shares = machine.distribution
        distribution = None if shares is None else Distribution(**shares.model_dump())
        reading.faults += faults_of(name, platform, legs_built, tools, home, distribution)
        if not reading.faults:
            return Manipulator(
                name,
                platform,
                tuple(built),
                machine.gravity,
                radii,
                tuple(tools),
                home,
                distribution,
                machine.owner or {},
                machine.template and Template(**machine.template.model_dump()),
            )
    subject = shorten(source, bare=True, longest=1000)
    raise ModelError(joined_faults(reading.faults), subject=subject, faults=reading.faults)


@dataclass
class _FileReader:
    """A reader of a machine's tables, which collects their faults."""

    faults: list[str] = field(default_factory=list)
    tilts: bool = False
    """Whether the machine's platform tilts."""
    listed: set[tuple[str, ...]] = field(default_factory=set)
    """The lists of valid keys that messages have named."""

    def table(self, model: Any, raw_table: object, prefix: str) -> Any:
        """Return a table validated as `model`; on faults record them and return the valid part."""
        from pydantic import ValidationError

        try:
            return model.model_validate(raw_table)
        except ValidationError as error:
            self.faults += [prefix + line for line in fault_lines(error, model, self.listed)]
            return self.valid_part(model, raw_table)

    def valid_part(self, model: Any, raw_table: object) -> Any:
        """Return the valid entries of a table as a model; invalid and missing ones are None."""
        from pydantic import ValidationError

        from pteron.manipulator.leg_tables import part_of

        part, entries = part_of(model), raw_table if isinstance(raw_table, dict) else {}
        try:
            return part.model_validate(entries)
        except ValidationError as error:
            wrong = {str(fault["loc"][0]) for fault in error.errors()}
            valid = part.model_validate({k: v for k, v in entries.items() if k not in wrong})
            return valid.model_copy(update=dict.fromkeys(wrong.intersection(part.model_fields)))

    def build_or_note(self, prefix: str, build: Callable[[], _Built]) -> _Built | None:
        """Return the result of `build`; if it raises, record its faults and return None."""
        try:
            return build()
        except ModelError as error:
            self.faults += [f"{prefix}{fault}" for fault in error.faults]
            return None

    def parts(self, key: str, tables: Sequence[Any], kind: Callable[..., _Built]) -> list[_Built]:
        """Return objects built from a list of tables; record the faults of those that fail."""
        parts_or_none = [
            self.build_or_note(f"{key}, item {i}: ", partial(kind, **dict(part)))
            for i, part in enumerate(tables, start=1)
        ]
        return [part for part in parts_or_none if part is not None]

    def platform(self, table: Any) -> Platform | None:
        """Return the platform of a table; on faults a substitute for further checks, or None."""
        from pteron.manipulator.tables import PlatformTable, TiltingTable

        inertia = table.unit
        body = table.mass, table.inertia, table.center_of_mass or table.first_moment
        if type(table) in (PlatformTable, TiltingTable) or None not in body:
            inertia = self.build_or_note("platform.", lambda: table.inertia_of("")) or inertia
        required: dict[str, Any] = {"axis": table.axis, "x_axis": table.x_axis}
        optional = {"limits": table.limits, "tool": table.tool or (0.0, 0.0, 0.0)}
        if self.tilts:
            required |= {
                "axis": table.axis or (0.0, 0.0, 1.0),
                "angle_order": table.angles or "rpy",
            }
            required |= {"center": table.center, "second_axis": table.second_axis}
            optional["axis_offset"] = table.axis_offset
        else:
            optional["bars"] = tuple(self.parts("platform.bars", table.bars or [], Bar))
            optional["geared"] = tuple(
                self.parts("platform.geared", table.geared or [], GearedPart)
            )
            required["slides"] = bool(table.slides)
            if table.motion is None or table.axis is None:
                return None
        complete = self.build_or_note(
            "platform.", lambda: Platform(table.motion, inertia, **required, **optional)
        )
        if complete is not None:
            return complete
        with suppress(ModelError):
            if not self.tilts:
                axis = unit_vector(table.axis, "axis")
                required |= {"axis": axis, "x_axis": vector(perpendicular_to(axis), "x_axis")}
                required["slides"] &= table.motion == "3T1R"
            return Platform(table.motion, inertia, **required)
        return None

    def leg(self, i: int, raw_table: object) -> LegKind | None:
        """Return leg i, from 1, of a table; on faults a substitute for further checks, or None."""
        from pteron.manipulator.leg_tables import alias_of, leg_of, leg_table

        prefix = f"leg {i}: "
        if not isinstance(raw_table, dict):
            self.faults.append(f"{prefix}{shorten(raw_table)} given, a table [[legs]] expected")
            return None
        name = raw_table.get("type", DEFAULT_KIND)
        try:
            kind = kind_named(name) if isinstance(name, str) else None
        except ModelError as error:
            self.faults.append(f"{prefix}type: {shorten(name)} cannot be loaded: {error}")
            return None
        if kind is None:
            valid = ", ".join(kind_names())
            self.faults.append(f"{prefix}type: {shorten(name)} is not one of {valid}")
            return None
        for key, about in kind.every_key().items():
            if (alias := alias_of(key, about)) in raw_table and key in raw_table:
                what = "another" if about.alias else "the former"
                self.faults.append(
                    f"{prefix}{alias}: {what} name of {key}, which is given too; give one"
                )
                raw_table = {k: v for k, v in raw_table.items() if k != alias}
        leg, faults = leg_of(kind, self.table(leg_table(kind), raw_table, prefix), self.tilts)
        for key, about in kind.every_key().items():
            if about.alias and about.alias in raw_table:  # the file's own name of the key
                faults = [fault.replace(key, about.alias) for fault in faults]
        self.faults += [prefix + fault for fault in faults]
        return leg
