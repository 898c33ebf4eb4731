"""Which columns of a file hold what, and in which unit: declared, documented or guessed."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from pteron.errors import DataError, shown
from pteron.identification.logs.description import Description
from pteron.identification.logs.joints import joint_symbols
from pteron.identification.logs.log import Finding
from pteron.manipulator import Manipulator
from pteron.tables import listed

TIMES = {"s": "s", "sec": "s", "ms": "ms", "us": "us", "µs": "us"}
LENGTHS = {"m": "m", "mm": "mm", "um": "um", "µm": "um"}
ANGLES = {"rad": "rad", "deg": "deg", "°": "deg"}
_DRIVE = {"a": "A", "v": "V", "%": "%"}
UNITS = {
    "m": LENGTHS,
    "rad": ANGLES,
    "N": {"n": "N"} | _DRIVE,
    "N m": {"nm": "N m", "n m": "N m", "n*m": "N m", "n·m": "N m"} | _DRIVE,
}
"""Spellings of the units, in small letters, by the SI unit of what they measure."""

_TIME_WORDS = ("t", "time", "timestamp")
_WORDS: dict[str, tuple[str, ...]] = {
    "rho": ("rho", "q", "s", "joint"),
    "theta": ("theta", "q", "angle", "crank"),
    "force": ("force", "f", "tau", "current", "i"),
    "torque": ("torque", "moment", "tau", "current", "i"),
}
"""What numbered columns are called, by the documented word."""
_CURRENTS = ("current", "i")

_NAME = re.compile(
    r"(?P<stem>(?P<word>[a-z]+)[ _]?)(?P<number>[1-9]\d*)?"
    r"(?P<tail>(?:[ _]*[\[(] *(?P<inside>[^\])]+?) *[\])]|[ _](?P<behind>[^\d\W]+|[%°]))?)",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Columns:
    """Where in a file the parts of a log are, as names of columns, and their units."""

    time: str
    joints: tuple[str, ...]
    forces: tuple[str, ...]
    pose: tuple[str, ...]
    payload: str | None
    time_unit: str
    joint_units: tuple[str, ...]
    force_unit: str
    length_unit: str
    angle_unit: str
    unit_of_time_known: bool
    findings: tuple[Finding, ...]


def find_columns(
    names: Sequence[str], robot: Manipulator, description: Description, source: str, hint: str
) -> Columns:
    """Return where a file's columns are, after what is declared, documented, or else guessed.

    `source` is what messages call the file, `hint` what may be amiss with its header where nothing
    is found.

    Raises
    ------
    DataError
        If a needed column is missing, or if a guess would be ambiguous.
    """
    d, joints = description, joint_symbols(robot)
    needed = [d.time_column or "t"]
    needed += d.joint_columns or [f"{one.coordinate}{i}" for i, one in enumerate(joints, 1)]
    needed += d.force_columns or [f"{one.force}{i}" for i, one in enumerate(joints, 1)]
    search = _Search(tuple(names), len(joints), needed, source, hint)
    time, time_unit = search.time(d.time_column, d.time_unit)
    coordinates, joint_units = search.of_legs(
        "joints",
        [
            _Wanted(one.coordinate, f"{one.noun}s", f"{one.noun} coordinates", one.unit)
            for one in joints
        ],
        d.joint_columns,
        d.joint_units(robot),
    )
    forces, force_units = search.of_legs(
        "forces",
        [
            _Wanted(one.force, f"{one.force}s", f"actuator {one.force}s", one.force_unit)
            for one in joints
        ],
        d.force_columns,
        [
            one.force_unit if d.column_force_unit in ("N", "N m") else d.column_force_unit
            for one in joints
        ],
    )
    if len(set(force_units) - {"N", "N m"}) + bool({"N", "N m"} & set(force_units)) > 1:
        raise DataError(
            f"{source}: {listed(forces)} are in {', '.join(force_units)}; give all in their SI "
            "units, or all in one unit of the drives"
        )
    pose, length_unit, angle_unit = search.pose(robot.coordinates, d.pose_columns)
    return Columns(
        time,
        coordinates,
        forces,
        pose,
        search.payload(d.payload_column),
        time_unit=search.unit("time", d.time_unit, time_unit, "s"),
        joint_units=joint_units,
        force_unit=force_units[0],
        length_unit=search.unit("pose", d.length_unit, length_unit, "m"),
        angle_unit=search.unit("pose", d.angle_unit, angle_unit, "rad"),
        unit_of_time_known=(d.time_unit or time_unit) is not None,
        findings=tuple(search.findings),
    )


class _Name(NamedTuple):
    """The parts of a column's name such as ``Rho_1 (mm)``; the word is in small letters."""

    word: str
    number: int | None
    stem: str
    tail: str


class _Wanted(NamedTuple):
    """A column that a leg needs: its documented stem, nouns for messages, its SI unit."""

    stem: str
    noun: str
    meaning: str
    unit: str


def _split(name: str, units: Mapping[str, str]) -> _Name | None:
    """Return the parts of a name, or None if it has others or ends in no unit that is known."""
    match = _NAME.fullmatch(name)
    if match is None or (match["tail"] and _unit_in(name, units) is None):
        return None
    number = None if match["number"] is None else int(match["number"])
    return _Name(match["word"].lower(), number, match["stem"], match["tail"])


def _unit_in(name: str, units: Mapping[str, str]) -> str | None:
    """Return the unit that a name ends in, or None."""
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    return units.get((match["inside"] or match["behind"] or "").lower())


@dataclass
class _Search:
    """The names of a file, and what was guessed about them so far."""

    names: tuple[str, ...]
    legs: int
    needed: Sequence[str]
    source: str
    hint: str
    findings: list[Finding] = field(default_factory=list)

    def time(self, declared: str | None, declared_unit: str | None) -> tuple[str, str | None]:
        if declared is not None:
            return self.declared("time", [declared])[0], _unit_in(declared, TIMES)
        if "t" in self.names:
            return "t", None
        found = self.lone(_TIME_WORDS, TIMES)
        if not found:
            raise self.missing("time", "time", 'column = "..."')
        if len(found) > 1:
            raise self.ambiguous("time", "time", found)
        unit = _unit_in(found[0], TIMES)
        self.guess(found, "time", declared_unit or unit or "s", "time")
        return found[0], unit

    def lone(self, words: Sequence[str], units: Mapping[str, str]) -> list[str]:
        """Return the columns called one of some words, without a number."""
        parts = {name: _split(name, units) for name in self.names}
        return [
            name for name, one in parts.items() if one and one.number is None and one.word in words
        ]

    def of_legs(
        self,
        table: str,
        wanted: Sequence[_Wanted],
        declared: tuple[str, ...] | None,
        declared_units: Sequence[str | None],
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the column of each leg, and its unit."""
        columns, units = [""] * self.legs, [""] * self.legs
        for kind in dict.fromkeys(wanted):
            legs = [j for j, one in enumerate(wanted) if one == kind]
            declared_unit = declared_units[legs[0]]
            if declared is not None:
                found = [self.declared(table, declared)[j] for j in legs]
                named = _unit_in(found[0], UNITS[kind.unit])
            else:
                found, named = self.family(table, kind, legs, declared_unit)
            unit = self.unit(kind.noun, declared_unit, named, kind.unit)
            for j, name in zip(legs, found, strict=True):
                columns[j], units[j] = name, declared_units[j] or unit
        return tuple(columns), tuple(units)

    def family(
        self, table: str, kind: _Wanted, legs: Sequence[int], declared_unit: str | None
    ) -> tuple[list[str], str | None]:
        """Return the numbered columns of some legs, and the unit that their names say."""
        families: dict[tuple[str, str], dict[int, str]] = {}
        for name in self.names:
            parts = _split(name, UNITS[kind.unit])
            if parts is not None and parts.number is not None and parts.word in _WORDS[kind.stem]:
                families.setdefault((parts.stem, parts.tail), {})[parts.number] = name
        exact = (kind.stem, "")
        if exact not in families and table == "forces":
            exact = ("current", "")
        if exact in families:
            families = {exact: families[exact]}
        numbers, known = {j + 1 for j in legs}, set(range(1, self.legs + 1))
        complete = [key for key, one in families.items() if numbers <= one.keys() <= known]
        if not complete:
            raise self.incomplete(table, kind, sorted(numbers), list(families.values()))
        if len(complete) > 1:
            raise self.ambiguous(
                table, kind.noun, [families[key][min(numbers)] for key in complete]
            )
        key = complete[0]
        columns = [families[key][number] for number in sorted(numbers)]
        # A word such as current says another unit than the documented one; rho and force do not.
        implied = "A" if key[0].strip(" _").lower() in _CURRENTS else None
        unit = _unit_in(columns[0], UNITS[kind.unit]) or implied
        if key != exact:
            self.guess(columns, kind.meaning, declared_unit or unit or kind.unit, table)
        return columns, unit

    def pose(
        self, coordinates: Sequence[str], declared: tuple[str, ...] | None
    ) -> tuple[tuple[str, ...], str | None, str | None]:
        if declared is None and all(name in self.names for name in coordinates):
            return tuple(coordinates), None, None
        columns = list(
            declared or (name for one in coordinates for name in self.coordinate(one)[:1])
        )
        if len(columns) < len(coordinates):
            if columns:
                self.findings.append(
                    Finding(
                        "guessed",
                        f"{self.source}: {listed(columns)} alone are no pose "
                        f"({', '.join(coordinates)} needed), so that no measured pose is read",
                        column=shown(columns[0], bare=True),
                        count=len(columns),
                    )
                )
            return (), None, None
        turning = [name for name, one in zip(columns, coordinates, strict=True) if one == "phi"]
        moving = [name for name in columns if name not in turning]
        length = _unit_in(moving[0], LENGTHS)
        angle = _unit_in(turning[0], ANGLES) if turning else None
        if declared is not None:
            return self.declared("pose", columns), length, angle
        if any(_unit_in(name, LENGTHS) != length for name in moving):
            raise self.ambiguous("pose", "pose", columns)
        self.guess(columns, "measured pose", f"{length or 'm'} and {angle or 'rad'}", "pose")
        return tuple(columns), length, angle

    def coordinate(self, coordinate: str) -> list[str]:
        """Return the columns that may hold one coordinate of the pose."""
        found = self.lone((coordinate,), ANGLES if coordinate == "phi" else LENGTHS)
        if len(found) > 1:
            raise self.ambiguous("pose", "pose", found)
        return found

    def payload(self, declared: str | None) -> str | None:
        if declared is not None:
            return self.declared("payload", [declared])[0]
        found = [name for name in self.names if name.lower() == "payload"]
        if len(found) > 1:
            raise self.ambiguous("payload", "payload", found)
        return found[0] if found else None

    def unit(self, noun: str, declared: str | None, named: str | None, usual: str) -> str:
        """Return the unit declared, else the one the names say, else the documented one."""
        if declared is not None and named is not None and declared != named:
            # Currents called F1 are the file's business; that the two differ must be said.
            self.findings.append(
                Finding(
                    "units",
                    f"{self.source}: the names of the {noun} columns say {named}, but the "
                    f"description declares {declared}; taken as {declared}",
                )
            )
        return declared or named or usual

    def declared(self, table: str, columns: Sequence[str]) -> tuple[str, ...]:
        absent = [name for name in columns if name not in self.names]
        if absent:
            raise DataError(
                f"{self.source}: no column {listed(absent)}, which the description's [{table}] "
                f"names (found: {listed(self.names)}); correct the description"
                + (f"; {self.hint}" if len(self.names) == 1 else "")
            )
        return tuple(columns)

    def guess(self, columns: Sequence[str], what: str, unit: str, table: str) -> None:
        message = (
            f"{self.source}: {listed(columns)} taken for the {what} in {unit}, by name; declare it "
            f"in the log's TOML file, under [{table}], to be sure"
        )
        first = shown(columns[0], bare=True)
        self.findings.append(Finding("guessed", message, column=first, count=len(columns)))

    def missing(self, table: str, noun: str, key: str) -> DataError:
        return DataError(
            f"{self.source}: no columns for the {noun} (found: {listed(self.names)}; needed: "
            f"{listed(self.needed)}); {self.hint}, or declare the file's own names in a TOML "
            f"file beside it: [{table}] {key}"
        )

    def incomplete(
        self, table: str, kind: _Wanted, numbers: list[int], families: list[dict[int, str]]
    ) -> DataError:
        others = [one for one in families if numbers[0] in one]
        if not others:
            return self.missing(table, kind.noun, "columns = [...]")
        names = [others[0][i] for i in sorted(others[0])]
        stem = others[0][numbers[0]].removesuffix(str(numbers[0]))
        absent = [f"{stem}{i}" for i in numbers if i not in others[0]]
        fault = f"without {listed(absent)}, or " if absent else ""
        return DataError(
            f"{self.source}: the columns {listed(names)} are for {len(names)} {kind.noun}, but the "
            f"machine has {self.legs} legs (needed: {listed(self.needed)}); {fault}"
            "perhaps it is the log of another machine; else declare the columns in a TOML file "
            f"beside it: [{table}] columns = [...]"
        )

    def ambiguous(self, table: str, noun: str, names: Sequence[str]) -> DataError:
        return DataError(
            f"{self.source}: {listed(names)} could each be meant for the {noun}; declare which "
            f"in a TOML file beside the log, under [{table}]"
        )
