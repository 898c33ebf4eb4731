"""Which columns of a file hold what, and in which unit: declared, documented or guessed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from pteron.errors import DataError, shown
from pteron.identification.logs.description import Description, joint_symbols
from pteron.identification.logs.log import Finding
from pteron.manipulator import Manipulator
from pteron.tables import listed

_DRIVE = {"a": "A", "v": "V", "%": "%"}
_UNITS = {
    "s": {"s": "s", "sec": "s", "ms": "ms", "us": "us", "µs": "us"},
    "m": {"m": "m", "mm": "mm", "um": "um", "µm": "um"},
    "rad": {"rad": "rad", "deg": "deg", "°": "deg"},
    "N": {"n": "N"} | _DRIVE,
    "N m": {"nm": "N m", "n m": "N m", "n*m": "N m", "n·m": "N m"} | _DRIVE,
}
"""Spellings of the units, in small letters, by the SI unit of what they measure."""

_WORDS: dict[str, tuple[str, ...]] = {
    "t": ("t", "time", "timestamp"),
    "rho": ("rho", "q", "s", "joint"),
    "theta": ("theta", "q", "angle", "crank"),
    "force": ("force", "f", "tau", "current", "i"),
    "torque": ("torque", "moment", "tau", "current", "i"),
}
"""What columns are called, by the documented word."""
_CURRENTS = ("current", "i")

_NAME = re.compile(
    r"(?P<stem>(?P<word>[a-z]+)[ _]?)(?P<number>[1-9]\d*)?"
    r"(?P<tail>(?:[ _]*[\[(] *(?P<inside>[^\])]+?) *[\])]|[ _](?P<behind>[^\d\W]+|[%°]))?)",
    re.IGNORECASE,
)
"""The parts of a name such as ``Rho_1 (mm)``."""


class Group(NamedTuple):
    """The columns of one part of a log, their units, and whether anything said these."""

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    said: bool = True

    @property
    def shown(self) -> tuple[str, ...]:
        """The names as messages may show them: a name may hold anything."""
        return tuple(shown(name, bare=True) for name in self.names)


class Columns(NamedTuple):
    """Where in a file the parts of a log are."""

    time: Group
    joints: Group
    forces: Group
    pose: Group
    payload: Group
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
    clock = _Wanted("time", "t", "time", "time", "s", d.time_unit)
    travels = [
        _Wanted("joints", one.coordinate, f"{one.noun}s", f"{one.noun} coordinates", one.unit, unit)
        for one, unit in zip(joints, d.joint_units(robot), strict=True)
    ]
    si = d.column_force_unit in ("N", "N m")
    actuators = [
        _Wanted(
            "forces",
            one.force,
            f"{one.force}s",
            f"actuator {one.force}s",
            one.force_unit,
            one.force_unit if si else d.column_force_unit,
        )
        for one in joints
    ]
    numbers = range(1, len(joints) + 1)
    time = search.group([clock], None if d.time_column is None else [d.time_column], [0])
    coordinates = search.group(travels, d.joint_columns, numbers)
    forces = search.group(actuators, d.force_columns, numbers)
    if len({unit if unit not in ("N", "N m") else "SI" for unit in forces.units}) > 1:
        raise DataError(
            f"{source}: {listed(forces.names)} are in {', '.join(forces.units)}; give all in their "
            "SI units, or all in one unit of the drives"
        )
    pose = [
        _Wanted("pose", one, "pose", "measured pose", "rad", d.angle_unit)
        if one == "phi"
        else _Wanted("pose", one, "pose", "measured pose", "m", d.length_unit)
        for one in robot.coordinates
    ]
    measured, payload = search.pose(pose, d.pose_columns), search.payload(d.payload_column)
    return Columns(time, coordinates, forces, measured, payload, tuple(search.findings))


class _Wanted(NamedTuple):
    """A column looked for: its table, documented name, words for messages, SI and declared unit."""

    table: str
    stem: str
    noun: str
    meaning: str
    unit: str
    declared: str | None


def _unit_in(name: str, si: str) -> str | None:
    """Return the unit that a name ends in, if it is one of what is measured in `si`."""
    match = _NAME.fullmatch(name)
    return match and _UNITS[si].get((match["inside"] or match["behind"] or "").lower())


@dataclass
class _Search:
    """The names of a file, and what was guessed about them so far."""

    names: tuple[str, ...]
    legs: int
    needed: Sequence[str]
    source: str
    hint: str
    findings: list[Finding] = field(default_factory=list)

    def group(
        self,
        wanted: Sequence[_Wanted],
        declared: Sequence[str] | None,
        numbers: Sequence[int],
    ) -> Group:
        """Return the columns wanted, one for each number, that are declared or called alike."""
        columns, units, said = [""] * len(wanted), [""] * len(wanted), True
        for kind in dict.fromkeys(wanted):
            at = [j for j, one in enumerate(wanted) if one == kind]
            if declared is not None:
                found = [self.declared(kind.table, declared)[j] for j in at]
                named = _unit_in(found[0], kind.unit)
            else:
                found, named = self.family(kind, [numbers[j] for j in at])
            unit = self.unit(kind, named)
            said = said and (kind.declared or named) is not None
            for j, name in zip(at, found, strict=True):
                columns[j], units[j] = name, unit
        return Group(tuple(columns), tuple(units), said)

    def matches(self, kind: _Wanted) -> Iterator[tuple[str, re.Match[str]]]:
        """Yield the columns that are called by a word for it, in a unit of it if in any."""
        for name in self.names:
            match = _NAME.fullmatch(name)
            if (
                match is not None
                and match["word"].lower() in _WORDS.get(kind.stem, (kind.stem,))
                and (not match["tail"] or _unit_in(name, kind.unit))
            ):
                yield name, match

    def family(self, kind: _Wanted, numbers: Sequence[int]) -> tuple[list[str], str | None]:
        """Return the columns of these numbers, 0 for none, and the unit that their names say."""
        families: dict[tuple[str, str], dict[int, str]] = {}
        for name, match in self.matches(kind):
            number = int(match["number"] or 0)
            if (number > 0) == (numbers[0] > 0):
                families.setdefault((match["stem"], match["tail"]), {})[number] = name
        exact = (kind.stem, "")
        if exact not in families and kind.table == "forces":
            exact = ("current", "")
        if exact in families:
            families = {exact: families[exact]}
        known = set(range(self.legs + 1))
        complete = [key for key, one in families.items() if set(numbers) <= one.keys() <= known]
        if not complete:
            raise self.incomplete(kind, numbers, list(families.values()))
        if len(complete) > 1:
            raise self.ambiguous(kind, [families[key][numbers[0]] for key in complete])
        key = complete[0]
        columns = [families[key][number] for number in numbers]
        # A word such as current says another unit than the documented one; rho and force do not.
        implied = "A" if key[0].strip(" _").lower() in _CURRENTS else None
        unit = _unit_in(columns[0], kind.unit) or implied
        if key != exact:
            self.guess(kind, columns, kind.declared or unit or kind.unit)
        return columns, unit

    def pose(self, wanted: Sequence[_Wanted], declared: Sequence[str] | None) -> Group:
        """Return the columns of a measured pose, none where it is not whole."""
        stems = [one.stem for one in wanted]
        if declared is not None:
            columns = self.declared("pose", declared)
        elif set(stems) <= set(self.names):
            columns = stems
        else:
            columns = [name for one in wanted for name in self.lone(one)]
        if len(columns) < len(wanted):
            if columns:
                message = (
                    f"{self.source}: {listed(columns)} alone are no pose ({', '.join(stems)} "
                    "needed), so that no measured pose is read"
                )
                self.guessed(message, columns)
            return Group()
        named = [_unit_in(name, one.unit) for name, one in zip(columns, wanted, strict=True)]
        kinds = {one.unit: one for one in wanted}
        told = {one.unit: unit for one, unit in reversed([*zip(wanted, named, strict=True)])}
        if declared is None and columns != stems:
            if any(unit != told[one.unit] for one, unit in zip(wanted, named, strict=True)):
                raise self.ambiguous(wanted[0], columns)
            self.guess(wanted[0], columns, f"{told['m'] or 'm'} and {told.get('rad') or 'rad'}")
        units = {si: self.unit(one, told[si]) for si, one in kinds.items()}
        return Group(tuple(columns), tuple(units[one.unit] for one in wanted))

    def lone(self, kind: _Wanted) -> list[str]:
        """Return the column without a number that may be meant, if any."""
        found = [name for name, match in self.matches(kind) if match["number"] is None]
        if len(found) > 1:
            raise self.ambiguous(kind, found)
        return found

    def payload(self, declared: str | None) -> Group:
        found = [name for name in self.names if name.lower() == "payload"]
        if declared is not None:
            found = self.declared("payload", [declared])
        if len(found) > 1:
            raise self.ambiguous(_Wanted("payload", "payload", "payload", "", "", None), found)
        return Group(tuple(found), ("",) * len(found))

    def unit(self, kind: _Wanted, named: str | None) -> str:
        """Return the unit declared, else the one the names say, else the documented one."""
        if kind.declared and named and kind.declared != named:
            # Currents called F1 are the file's business; that the two differ must be said.
            message = (
                f"{self.source}: the names of the {kind.noun} columns say {named}, but the "
                f"description declares {kind.declared}; taken as {kind.declared}"
            )
            self.findings.append(Finding("units", message))
        return kind.declared or named or kind.unit

    def declared(self, table: str, columns: Sequence[str]) -> list[str]:
        absent = [name for name in columns if name not in self.names]
        if absent:
            raise DataError(
                f"{self.source}: no column {listed(absent)}, which the description's [{table}] "
                f"names (found: {listed(self.names)}); correct the description"
                + (f"; {self.hint}" if len(self.names) == 1 else "")
            )
        return list(columns)

    def guess(self, kind: _Wanted, columns: Sequence[str], unit: str) -> None:
        message = (
            f"{self.source}: {listed(columns)} taken for the {kind.meaning} in {unit}, by name; "
            f"declare it in the log's TOML file, under [{kind.table}], to be sure"
        )
        self.guessed(message, columns)

    def guessed(self, message: str, columns: Sequence[str]) -> None:
        first = shown(columns[0], bare=True)
        self.findings.append(Finding("guessed", message, column=first, count=len(columns)))

    def incomplete(
        self, kind: _Wanted, numbers: Sequence[int], families: list[dict[int, str]]
    ) -> DataError:
        others = next((one for one in families if numbers[0] in one), None)
        if others is None:
            key = 'column = "..."' if kind.table == "time" else "columns = [...]"
            return DataError(
                f"{self.source}: no columns for the {kind.noun} (found: {listed(self.names)}; "
                f"needed: {listed(self.needed)}); {self.hint}, or declare the file's own names in "
                f"a TOML file beside it: [{kind.table}] {key}"
            )
        names = [others[i] for i in sorted(others)]
        stem = others[numbers[0]].removesuffix(str(numbers[0]))
        absent = [f"{stem}{i}" for i in numbers if i not in others]
        fault = f"without {listed(absent)}, or " if absent else ""
        return DataError(
            f"{self.source}: the columns {listed(names)} are for {len(names)} {kind.noun}, but the "
            f"machine has {self.legs} legs (needed: {listed(self.needed)}); {fault}"
            "perhaps it is the log of another machine; else declare the columns in a TOML file "
            f"beside it: [{kind.table}] columns = [...]"
        )

    def ambiguous(self, kind: _Wanted, names: Sequence[str]) -> DataError:
        return DataError(
            f"{self.source}: {listed(names)} could each be meant for the {kind.noun}; declare "
            f"which in a TOML file beside the log, under [{kind.table}]"
        )
