"""The variables of a machine's FMU: names, units, causality, start values, dependencies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from tomllib import loads
from typing import Any

from pteron.equations.drives import Drives, drive_numbers
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.platforms import Platform

_TABLE = loads((files("pteron.export") / "fmu_variables.toml").read_text(encoding="utf-8"))
"""The blocks of variables, their kinds, and their units; see its head."""

_Words = dict[str, Any]
"""The words and the numbers of one variable, by their names in the table."""


@dataclass(frozen=True)
class FmuVariable:
    """One variable of modelDescription.xml."""

    name: str
    unit: str
    description: str
    start: float | None = None
    least: float | None = None


@dataclass(frozen=True)
class VariableBlock:
    """Variables whose numbers stand behind each other in the C code."""

    name: str
    first: int
    """The value reference of the first of them."""
    kind: str
    """The kind of the variables; see the table."""
    place: str
    """Their place in the C code: a byte offset, or the name of a result."""
    variables: tuple[FmuVariable, ...]
    rate_of: str
    """The block whose rates these are."""
    like: str
    """The block on whose variables these depend, one on one."""
    depends: tuple[str, ...]
    """The blocks on all of whose variables each of these depends."""

    @property
    def references(self) -> tuple[int, ...]:
        """The value references."""
        return tuple(range(self.first, self.first + len(self.variables)))


@dataclass(frozen=True)
class FmuVariables:
    """All variables of an FMU."""

    blocks: tuple[VariableBlock, ...]

    def __getitem__(self, name: str) -> tuple[int, ...]:
        """Return the value references of a block."""
        return next(block.references for block in self.blocks if block.name == name)

    @property
    def parameters(self) -> list[FmuVariable]:
        """The parameters of payload and drives; all other variables stand before them."""
        return [v for block in self.blocks if block.kind == "START" for v in block.variables]

    @property
    def count(self) -> int:
        """Number of variables."""
        return sum(len(block.variables) for block in self.blocks)

    @property
    def units(self) -> dict[str, dict[str, int]]:
        """The units in use, with their exponents of SI base units."""
        used = [variable.unit for block in self.blocks for variable in block.variables]
        return {unit: _TABLE["units"][unit] for unit in dict.fromkeys(used)}

    @property
    def attributes(self) -> Iterator[dict[str, object]]:
        """The attributes of every variable in modelDescription.xml, in order."""
        for block in self.blocks:
            hidden = {"causality": "local"} if block.rate_of else {}
            for k, variable in enumerate(block.variables):
                attributes = {
                    "name": variable.name,
                    "valueReference": block.first + k,
                    "description": variable.description,
                    **_TABLE["kinds"][block.kind],
                    **hidden,
                    "unit": variable.unit,
                    "min": variable.least,
                    "derivative": self[block.rate_of][k] if block.rate_of else None,
                    "start": variable.start,
                }
                yield {name: a for name, a in attributes.items() if a is not None}

    @property
    def dependencies(self) -> dict[int, tuple[int, ...]]:
        """Value references that each computed variable or state depends on, by its reference."""
        dependencies = {}
        for block in self.blocks:
            every = sum((self[name] for name in block.depends), ())
            for k, reference in enumerate(block.references):
                dependencies[reference] = (self[block.like][k],) if block.like else every
        return dependencies

    @property
    def outputs(self) -> tuple[int, ...]:
        """The value references of the outputs."""
        shown = (b for b in self.blocks if b.kind in ("STATE", "RESULT") and not b.rate_of)
        return sum((block.references for block in shown), ())

    @property
    def derivatives(self) -> tuple[int, ...]:
        """The value references of the rates of the states."""
        return sum((block.references for block in self.blocks if block.rate_of), ())

    @property
    def computed_references(self) -> tuple[int, ...]:
        """The value references of the variables computed from the start values."""
        references = {*self.outputs, *self.derivatives} - {*self["pose"], *self["velocity"]}
        return tuple(sorted(references))


def fmu_variables(robot: Manipulator, pose: Array, forces: Array) -> FmuVariables:
    """Return the variables of a machine that starts at rest at a pose, held by forces."""
    words, blocks, first = _words(robot, pose, forces), list[VariableBlock](), 0
    for row in _TABLE["blocks"]:
        variables = tuple(_variable(row, {**each, "zero": 0.0}) for each in words[row["each"]])
        relations = row.get("rate_of", ""), row.get("like", ""), tuple(row.get("depends", ()))
        if variables:
            blocks.append(
                VariableBlock(row["name"], first, row["kind"], row["place"], variables, *relations)
            )
        first += len(variables)
    return FmuVariables(tuple(blocks))


def _variable(row: dict[str, str], words: _Words) -> FmuVariable:
    """Return the variable of a template row, with its placeholders filled in."""
    name, unit, description = (
        row[key].format(**words) for key in ("variable", "unit", "description")
    )
    start, least = (words.get(row.get(key, "")) for key in ("start", "least"))
    return FmuVariable(name, unit, description, start, least)


def _words(robot: Manipulator, pose: Array, forces: Array) -> dict[str, list[_Words]]:
    """Return the placeholder values of each variable, by what a block has variables for."""
    platform = robot.platform
    coordinates = zip(platform.coordinates, robot.units, pose.tolist(), strict=True)
    legs = enumerate(zip(robot.legs, forces.tolist(), strict=True), start=1)
    return {
        "machine": [{}],
        "coordinates": [{"name": name, "unit": unit, "at": at} for name, unit, at in coordinates],
        "legs": [
            {
                "i": i,
                **vars(leg.joint),
                "force_unit": leg.joint.force_unit.replace(" ", "."),  # as FMI writes it
                "held": force,
            }
            for i, (leg, force) in legs
        ],
        "wrench": list(_wrench(platform)),
        "center": [{"name": x} for x in platform.payload_axes],
        "inertia": list(_inertia(platform)),
        "drives": list(_drives(robot)),
    }


def _wrench(platform: Platform) -> Iterator[_Words]:
    """Yield name, unit and direction of each component of the wrench."""
    if not platform.wrench_in_base_axes:
        for name, unit in zip(platform.coordinates, platform.units, strict=True):
            yield {"name": name, "unit": "N.m" if unit == "rad" else "N", "along": name}
        return
    for name in platform.wrench_columns:
        axis, force = f"the base frame's {name[1]}", name[0] == "f"
        direction = axis if force else f"a turn about {axis}"
        yield {"name": name, "unit": "N" if force else "N.m", "along": direction}


def _inertia(platform: Platform) -> Iterator[_Words]:
    """Yield the parts of a payload's inertia that matter where the platform turns."""
    if len(platform.inertia_names) > 1:
        for pair in (name.removeprefix("I") for name in platform.inertia_names):
            least = {"least": 0.0} if pair[0] == pair[1] else {}
            yield {"name": pair, "told": f"I{pair} about its own centre", **least}
    elif platform.angles:
        description = "Its inertia about the axis through its own centre"
        yield {"name": "nertia", "told": description, "least": 0.0}


def _drives(robot: Manipulator) -> Iterator[_Words]:
    """Yield the drives' numbers, in the order of the C code's table."""
    sizes = iter(drive_numbers(robot).tolist())
    for name in Drives._fields:
        for i, leg in enumerate(robot.legs, start=1):
            row = _TABLE["drives"][name]
            yield {"i": i, "name": name, "unit": row[leg.joint.unit], "number": next(sizes), **row}
