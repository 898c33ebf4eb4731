"""The variables of a machine's FMU: names, units, causality, start values, dependencies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from pteron.equations.drives import Drives, drive_numbers
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.platforms import Platform

_UNITS = {
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "s": {"s": 1},
    "kg": {"kg": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
    "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "1": {},
}
"""The units of the variables by the powers of SI's base units, as FMI wants them."""

Kind = Literal["TIME", "STATE", "START", "INPUT", "RESULT"]
"""Kind of a block in the C code: START is set before the simulation begins, and never after."""

_XML: dict[Kind, dict[str, str]] = {
    "TIME": {"causality": "independent", "variability": "continuous"},
    "STATE": {"causality": "output", "variability": "continuous", "initial": "exact"},
    "START": {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    "INPUT": {"causality": "input", "variability": "continuous"},
    "RESULT": {"causality": "output", "variability": "continuous", "initial": "calculated"},
}
"""Attributes in modelDescription.xml of a block's variables."""


@dataclass(frozen=True)
class FmuVariable:
    """One variable of modelDescription.xml."""

    name: str
    unit: str
    description: str
    start: float | None = None
    least: float | None = None


@dataclass(frozen=True)
class Block:
    """Variables whose numbers stand behind each other in the C code."""

    name: str
    first: int
    """The value reference of the first of them."""
    kind: Kind
    place: str
    """Their place in the C code: a byte offset, or the name of a result."""
    variables: tuple[FmuVariable, ...]
    rate_of: str = ""
    """The block whose rates these are."""

    @property
    def references(self) -> tuple[int, ...]:
        """The value references."""
        return tuple(range(self.first, self.first + len(self.variables)))


@dataclass(frozen=True)
class FmuVariables:
    """All variables of an FMU."""

    blocks: tuple[Block, ...]

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
        """The units that occur, and what they are made of."""
        used = [variable.unit for block in self.blocks for variable in block.variables]
        return {unit: _UNITS[unit] for unit in dict.fromkeys(used)}

    @property
    def attributes(self) -> Iterator[dict[str, object]]:
        """The attributes of every variable in modelDescription.xml, in order."""
        for block in self.blocks:
            hidden = {"causality": "local"} if block.rate_of else {}
            for k, variable in enumerate(block.variables):
                found = {
                    "name": variable.name,
                    "valueReference": block.first + k,
                    "description": variable.description,
                    **_XML[block.kind],
                    **hidden,
                    "unit": variable.unit,
                    "min": variable.least,
                    "derivative": self[block.rate_of][k] if block.rate_of else None,
                    "start": variable.start,
                }
                yield {name: value for name, value in found.items() if value is not None}

    @property
    def known(self) -> dict[int, tuple[int, ...]]:
        """For each variable that is computed, or is a state, the variables that it depends on."""
        state = self["pose"] + self["velocity"]
        forced = state + self["forces"] + self["wrench"]
        return {
            **{own: (own,) for own in state},
            **dict(zip(self["pose_rates"], ((own,) for own in self["velocity"]), strict=True)),
            **dict.fromkeys(self["acceleration"] + self["velocity_rates"], forced),
            **dict.fromkeys(self["joints"] + self["reserves"], self["pose"]),
            **dict.fromkeys(self["joint_rates"], state),
        }

    @property
    def outputs(self) -> tuple[int, ...]:
        """The value references of the outputs."""
        names = ("pose", "velocity", "acceleration", "joints", "joint_rates", "reserves")
        return sum((self[name] for name in names), ())

    @property
    def derivatives(self) -> tuple[int, ...]:
        """The value references of the rates of the states."""
        return self["pose_rates"] + self["velocity_rates"]

    @property
    def computed(self) -> tuple[int, ...]:
        """The value references of what is computed from the start values."""
        states = self["pose"] + self["velocity"]
        found = {*self.outputs, *self.derivatives} - {*states}
        return tuple(sorted(found))


def fmu_variables(robot: Manipulator, pose: Array, forces: Array) -> FmuVariables:
    """Return the variables of a machine that starts at rest at a pose, held by forces."""
    blocks: list[Block] = []
    for name, kind, place, variables, *rate_of in _parts(robot, pose, forces):
        first = sum(len(block.variables) for block in blocks)
        blocks.append(Block(name, first, kind, place, tuple(variables), *rate_of))
    return FmuVariables(tuple(blocks))


_Part = tuple[str, Kind, str, list[FmuVariable]] | tuple[str, Kind, str, list[FmuVariable], str]


def _parts(robot: Manipulator, pose: Array, forces: Array) -> Iterator[_Part]:
    pairs = list(zip(robot.platform.coordinates, robot.units, strict=True))
    legs = list(enumerate((leg.joint for leg in robot.legs), start=1))
    start = dict(zip(robot.platform.coordinates, pose.tolist(), strict=True))

    def of_pose(word: str, per: str, told: str, start: Mapping[str, float]) -> list[FmuVariable]:
        return [
            FmuVariable(word.format(name), unit + per, told.format(name), start.get(name))
            for name, unit in pairs
        ]

    yield "time", "TIME", "offsetof(Values, time)", [FmuVariable("time", "s", "Time")]
    states = of_pose("pose.{}", "", "Platform pose, {}", start)
    yield "pose", "STATE", "offsetof(Values, state)", states
    states = of_pose("velocity.{}", "/s", "Rate of the pose's {}", dict.fromkeys(start, 0.0))
    yield "velocity", "STATE", "offsetof(Values, state) + M * sizeof(double)", states
    results = of_pose("acceleration.{}", "/s2", "Acceleration of the pose's {}", {})
    yield "acceleration", "RESULT", "ACCELERATION", results
    results = [FmuVariable(f"{j.coordinate}{i}", j.unit, f"Leg {i}: the {j.noun}") for i, j in legs]
    yield "joints", "RESULT", "JOINTS", results
    results = [
        FmuVariable(f"{j.coordinate}{i}_rate", f"{j.unit}/s", f"Leg {i}: the {j.noun}'s rate")
        for i, j in legs
    ]
    yield "joint_rates", "RESULT", "JOINT_RATES", results
    text = "Leg {}: the simulation ends where this is 0"
    results = [FmuVariable(f"reach_reserve{i}", "1", text.format(i)) for i, _ in legs]
    yield "reserves", "RESULT", "RESERVES", results
    inputs = [
        FmuVariable(f"{j.force}{i}", _dotted(j.force_unit), f"Leg {i}: the drive's {j.force}", f)
        for (i, j), f in zip(legs, forces.tolist(), strict=True)
    ]
    yield "forces", "INPUT", "offsetof(Values, forces)", inputs
    text = "What acts on the platform at P along {}"
    inputs = [
        FmuVariable(f"wrench.{name}", unit, text.format(along), 0.0)
        for name, unit, along in _wrench(robot.platform)
    ]
    yield "wrench", "INPUT", "offsetof(Values, wrench)", inputs
    # Each state's rate is a variable of its own: some tools do not take an output in its place.
    for name, per, place in (("pose", "/s", "VELOCITY"), ("velocity", "/s2", "ACCELERATION")):
        rates = of_pose(f"der({name}.{{}})", per, f"Rate of {name}.{{}}", {})
        yield f"{name}_rates", "RESULT", place, rates, name
    yield from _payload(robot)
    yield "drives", "START", "offsetof(Values, drives)", list(_drives(robot))


def _dotted(unit: str) -> str:
    return unit.replace(" ", ".")


def _wrench(platform: Platform) -> Iterator[tuple[str, str, str]]:
    """Yield each part of a wrench: its name, its unit and along what it does work."""
    if platform.tilts:
        for name in platform.wrench_columns:
            axis = f"the base frame's {name[1]}"
            force = name[0] == "f"
            yield name, "N" if force else "N.m", axis if force else f"a turn about {axis}"
        return
    for name, unit in zip(platform.coordinates, platform.units, strict=True):
        yield name, "N.m" if unit == "rad" else "N", name


def _payload(robot: Manipulator) -> Iterator[_Part]:
    """Yield the payload's parameters: its mass, and what matters where the platform turns."""
    told = [FmuVariable("payload.mass", "kg", "A body that the platform carries", 0.0, 0.0)]
    yield "payload.mass", "START", "offsetof(Values, mass)", told
    platform = robot.platform
    if platform.rotation_axes:
        told = [
            FmuVariable(f"payload.{x}", "m", f"Its centre of mass in the platform frame, {x}", 0.0)
            for x in ("xyz" if platform.tilts else "xy")
        ]
        yield "payload.centre", "START", "offsetof(Values, center)", told
    if platform.angles:
        axis = "Its inertia about the axis through its own centre"
        names = {"nertia": axis}
        if platform.tilts:
            pairs = ("xx", "xy", "xz", "yy", "yz", "zz")
            names = {pair: f"I{pair} about its own centre" for pair in pairs}
        least = dict.fromkeys(("nertia", "xx", "yy", "zz"), 0.0)
        told = [
            FmuVariable(f"payload.i{name}", "kg.m2", text, 0.0, least.get(name))
            for name, text in names.items()
        ]
        yield "payload.inertia", "START", "offsetof(Values, inertia)", told


def _drives(robot: Manipulator) -> Iterator[FmuVariable]:
    """Yield the numbers of the drives, in the order of the table that the C code has."""
    texts = {
        "inertia": "the motor's inertia at the joint",
        "coulomb": "dry friction",
        "viscous": "viscous friction",
        "offset": "a constant force",
        "stribeck": "what dry friction has more at rest",
        "stribeck_speed": "the speed by which that is gone",
        "rest_speed": "half the width of the speeds where dry friction changes its sign",
    }
    values = iter(drive_numbers(robot))
    for name in Drives._fields:
        for i, leg in enumerate(robot.legs, start=1):
            turns = leg.joint.unit == "rad"
            units = {
                "inertia": "kg.m2" if turns else "kg",
                "viscous": "N.m.s/rad" if turns else "N.s/m",
                "stribeck_speed": f"{leg.joint.unit}/s",
                "rest_speed": f"{leg.joint.unit}/s",
            }
            unit = units.get(name, _dotted(leg.joint.force_unit))
            least = None if name == "offset" else 1e-12 if "speed" in name else 0.0
            yield FmuVariable(
                f"drive{i}.{name}", unit, f"Leg {i}: {texts[name]}", float(next(values)), least
            )
