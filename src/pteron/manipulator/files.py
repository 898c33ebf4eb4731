"""`load` reads a manipulator from a TOML file or the catalog, and tells all its faults at once."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import lru_cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from pteron.bodies.vectors import unit_vector, vector
from pteron.errors import ModelError, shown, warn_unlikely
from pteron.legs import LegKind
from pteron.legs.circles import perpendicular_to
from pteron.legs.installed import kind_named, kind_names
from pteron.manipulator.machine_warnings import machine_warnings
from pteron.manipulator.manipulator import Manipulator, faults_of
from pteron.manipulator.radii import Radii
from pteron.manipulator.tool import Tool
from pteron.platforms import Bar, Geared, Platform
from pteron.platforms.kinds import TILTING
from pteron.toml import fault_lines, parsed_toml, told, toml_bytes

_Built = TypeVar("_Built")

DEFAULT_KIND = "PRRR"
"""The kind of a leg whose file says none."""


def catalog() -> tuple[str, ...]:
    """Return the names of the machines that come with Pteron."""
    return _names()


@lru_cache(maxsize=1)
def _names() -> tuple[str, ...]:
    folder = files("pteron.manipulator") / "catalog"
    return tuple(sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".toml")))


@lru_cache(maxsize=1)
def descriptions() -> dict[str, str]:
    """Return what each machine of the catalog is: the first words of its file, to a stop."""
    folder = files("pteron.manipulator") / "catalog"
    opening = re.compile(r"# (?:An? |The )?(.*?)(?: \(|[.,:;]\s)", re.DOTALL)
    texts = {name: opening.match((folder / f"{name}.toml").read_text("utf-8")) for name in _names()}
    return {name: found[1].replace("\n# ", " ") for name, found in texts.items() if found}


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
    robot, unlikely = read_machine(*contents(name_or_path), str(name_or_path))
    for text in unlikely:
        warn_unlikely(f"{name_or_path}: {text}")
    return robot


@lru_cache(maxsize=64)
def read_machine(data: bytes, source: str, given: str) -> tuple[Manipulator, tuple[str, ...]]:
    """Return the machine of a file's contents, and warnings; what was read once is kept."""
    document = parsed_toml(data, source, ModelError)
    robot = _machine(document, given)
    # Pteron writes first moments, persons centres of mass: what identification finds for a body
    # alone is one of many equivalent values, and need not be likely.
    return robot, machine_warnings(robot, bodies=not _has_first_moments(document))


def _has_first_moments(table: Any) -> bool:
    """Return whether a body of a file has a first moment."""
    if isinstance(table, list):
        return any(map(_has_first_moments, table))
    if not isinstance(table, dict):
        return False
    return "first_moment" in table or any(map(_has_first_moments, table.values()))


def document(name_or_path: str | Path) -> dict[str, Any]:
    """Return what the file of a machine holds, unchecked."""
    return parsed_toml(*contents(name_or_path), ModelError)


def contents(name_or_path: str | Path) -> tuple[bytes, str]:
    """Return the bytes of a machine's file, and what messages call it."""
    name = str(name_or_path)
    if name in catalog():
        resource = files("pteron.manipulator") / "catalog" / f"{name}.toml"
        return resource.read_bytes(), name
    names = " or ".join(f'"{near}"' for near in [*_near_files(Path(name)), *_near_machines(name)])
    guess = f"; did you mean {names}?" if names else f" ({', '.join(catalog())})"
    absent = f"neither a file nor a machine of the catalog{guess}"
    return toml_bytes(name_or_path, ModelError, absent)


def _near_files(path: Path) -> list[str]:
    """Return the file in a missing file's folder whose name is nearest, if one is near."""
    with suppress(OSError, ValueError):  # no such folder, one that may not be read, or no path
        if not path.exists():
            beside = [file.name for file in path.parent.iterdir() if file.suffix == ".toml"]
            near = get_close_matches(path.name, beside, n=1, cutoff=0.75)
            return [shown(str(path.parent / name), bare=True, longest=1000) for name in near]
    return []


def _near_machines(name: str) -> list[str]:
    """Return the machines of the catalog that a name may mean, by their names or what they are."""
    word = Path(name).stem.lower()
    said = [own for own, text in descriptions().items() if word in text.lower().split()]
    close = get_close_matches(word, catalog(), n=1, cutoff=0.85) or said
    return close or get_close_matches(word, catalog(), n=1)


def _machine(document: dict[str, Any], source: str) -> Manipulator:
    from pteron.manipulator.tables import MachineTable, TiltingMachineTable, platform_table

    carried = document.get("platform")
    motion = carried.get("motion") if isinstance(carried, dict) else None
    tilts = motion in TILTING
    reading = _Reading(tilts=tilts)
    machine = reading.table(TiltingMachineTable if tilts else MachineTable, document, "")
    table = machine.platform or reading.rest(platform_table(motion), carried)
    platform = table and reading.platform(table)
    radii = machine.radii and reading.built("radii.", lambda: Radii(**machine.radii.model_dump()))
    tools = reading.parts("tools", machine.tools or [], Tool)
    given = document.get("legs")
    legs = given if isinstance(given, list) else []
    built: list[Any] = [reading.leg(i, leg) for i, leg in enumerate(legs, start=1)]
    if platform is not None:
        # What was told already is not told again.
        name = "?" if machine.name is None else machine.name
        known = built if machine.legs is not None else [None] * len(platform.coordinates)
        home = None if machine.home is None else tuple(machine.home.pose or ())
        reading.faults += faults_of(name, platform, known, tools, home)
        if not reading.faults:
            return Manipulator(
                name, platform, tuple(built), machine.gravity, radii, tuple(tools), home
            )
    subject = shown(source, bare=True, longest=1000)
    raise ModelError(told(reading.faults), subject=subject, faults=reading.faults)


@dataclass
class _Reading:
    """The faults that were found so far: a file is told all of them at once."""

    faults: list[str] = field(default_factory=list)
    tilts: bool = False
    """Whether the machine's platform does."""
    listed: set[tuple[str, ...]] = field(default_factory=set)
    """The lists of valid keys that were told."""

    def table(self, model: Any, given: object, prefix: str) -> Any:
        """Return a table as its model holds it; with its faults noted, what of it `rest` gives."""
        from pydantic import ValidationError

        try:
            return model.model_validate(given)
        except ValidationError as error:
            self.faults += [prefix + line for line in fault_lines(error, model, self.listed)]
            return self.rest(model, given)

    def rest(self, model: Any, given: object) -> Any:
        """Return what of a table has the right shape, None for the rest and for what is missing."""
        from pydantic import ValidationError

        from pteron.manipulator.leg_tables import part_of

        part, kept = part_of(model), given if isinstance(given, dict) else {}
        try:
            return part.model_validate(kept)
        except ValidationError as error:
            wrong = {str(fault["loc"][0]) for fault in error.errors()}
            found = part.model_validate({k: v for k, v in kept.items() if k not in wrong})
            return found.model_copy(update=dict.fromkeys(wrong.intersection(part.model_fields)))

    def built(self, prefix: str, build: Callable[[], _Built]) -> _Built | None:
        """Return what `build` makes, or None with its faults noted under the keys they name."""
        try:
            return build()
        except ModelError as error:
            self.faults += [f"{prefix}{fault}" for fault in error.faults]
            return None

    def parts(self, key: str, given: Sequence[Any], kind: Callable[..., _Built]) -> list[_Built]:
        """Return those of the parts in a list of tables that can be."""
        found = [
            self.built(f"{key}, item {i}: ", partial(kind, **dict(part)))
            for i, part in enumerate(given, start=1)
        ]
        return [part for part in found if part is not None]

    def platform(self, table: Any) -> Platform | None:
        """Return the platform, or None; one with faults serves to check the legs, where it may."""
        from pteron.manipulator.tables import PlatformTable, TiltingTable

        inertia = table.unit
        body = table.mass, table.inertia, table.center_of_mass or table.first_moment
        if type(table) in (PlatformTable, TiltingTable) or None not in body:
            inertia = self.built("platform.", lambda: table.inertia_of("")) or inertia
        given: dict[str, Any] = {"axis": table.axis, "x_axis": table.x_axis}
        more = {"limits": table.limits, "tool": table.tool or (0.0, 0.0, 0.0)}
        if self.tilts:
            given |= {"axis": table.axis or (0.0, 0.0, 1.0), "angle_order": table.angles or "rpy"}
            given |= {"center": table.center, "second_axis": table.second_axis}
        else:
            more["bars"] = tuple(self.parts("platform.bars", table.bars or [], Bar))
            more["geared"] = tuple(self.parts("platform.geared", table.geared or [], Geared))
            given["slides"] = bool(table.slides)
            if table.motion is None or table.axis is None:
                return None
        whole = self.built("platform.", lambda: Platform(table.motion, inertia, **given, **more))
        if whole is not None:
            return whole
        with suppress(ModelError):
            if not self.tilts:
                axis = unit_vector(table.axis, "axis")
                given |= {"axis": axis, "x_axis": vector(perpendicular_to(axis), "x_axis")}
                given["slides"] &= table.motion == "3T1R"
            return Platform(table.motion, inertia, **given)
        return None

    def leg(self, i: int, given: object) -> LegKind | None:
        """Return leg i, from 1, or None; one with faults serves to check the machine."""
        from pteron.manipulator.leg_tables import FORMER, leg_of, leg_table

        prefix = f"leg {i}: "
        if not isinstance(given, dict):
            self.faults.append(f"{prefix}{shown(given)} given, a table [[legs]] expected")
            return None
        name = given.get("type", DEFAULT_KIND)
        try:
            kind = kind_named(name) if isinstance(name, str) else None
        except ModelError as error:
            self.faults.append(f"{prefix}type: {shown(name)} cannot be loaded: {error}")
            return None
        if kind is None:
            valid = ", ".join(kind_names())
            self.faults.append(f"{prefix}type: {shown(name)} is not one of {valid}")
            return None
        for key, former in FORMER.items():
            if key in given and former in given:
                self.faults.append(
                    f"{prefix}{former}: the former name of {key}, which is given too; give one"
                )
                given = {k: v for k, v in given.items() if k != former}
        leg, faults = leg_of(kind, self.table(leg_table(kind), given, prefix), self.tilts)
        self.faults += [prefix + fault for fault in faults]
        return leg
