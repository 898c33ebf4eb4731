"""The search for a log's columns by name: declared ones, documented ones, or similar names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from pteron.errors import DataError, shorten
from pteron.identification.logs.column_names import ColumnNames, SoughtColumn
from pteron.identification.logs.findings import Finding
from pteron.identification.logs.names import (
    CURRENTS,
    RATED,
    NameParts,
    is_synonym,
    parse_column_name,
    parse_unit,
    stamp_columns,
)
from pteron.tables import declaration, join_names

_NO_UNIT = ("", "-", "1", "none")
"""Cells of a line of units that stand for no unit."""


class Group(NamedTuple):
    """The columns of one part of a log, and their units."""

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    unit_stated: bool = True
    """Whether the file or its description states the units."""
    reported: bool = False
    """Whether names or units come from words of the file, which a finding reports."""
    guessed: bool = False
    """Whether the columns are taken by names that are not the documented ones."""

    @property
    def printable_names(self) -> tuple[str, ...]:
        """The names as messages may show them: a name may hold anything."""
        return tuple(shorten(name, bare=True) for name in self.names)

    def phrase(self, noun: str) -> str:
        """Return how the columns are read, for a person."""
        unit = " and ".join(dict.fromkeys(self.units))
        return f"{noun} {join_names(self.names)} in {unit}"


class ColumnSearch(ColumnNames):
    """The search for the columns of a log."""

    def time(self, kind: SoughtColumn, declared: str | None) -> Group:
        """Return the column of the times, or those of seconds and nanoseconds."""
        stamps = stamp_columns(self.names)
        if declared is not None:
            columns = next((s for s in stamps if s[0] == declared), (declared,))
            self.declared_columns("time", columns)
        elif "t" in self.names:
            columns = ("t",)
        elif len(stamps) == 1:
            columns = stamps[0]
        elif stamps:
            raise self.ambiguous(kind, [stamp[:1] for stamp in stamps])
        else:
            columns = tuple(self.family(kind, [0])[0])
        guessed = declared is None and columns != ("t",)
        group = self._group_by_unit([kind] * len(columns), columns, guessed=guessed)
        # What a name says of the time's unit is told, declared or not.
        return group._replace(reported=group.reported or self.unit_of(columns[0], kind) is not None)

    def group(
        self, sought: Sequence[SoughtColumn], declared: Sequence[str] | None, numbers: Sequence[int]
    ) -> Group:
        """Return the columns of quantities, one for each number, by declaration or by name."""
        if declared is not None:
            columns = self.declared_columns(sought[0].table, declared)
            return self._group_by_unit(sought, columns, guessed=False)
        names_by_number, guessed = dict[int, str](), False
        for kind in dict.fromkeys(sought):
            numbers_of_kind = [i for i, m in zip(numbers, sought, strict=True) if m == kind]
            names, by_name = self.family(kind, numbers_of_kind)
            names_by_number |= zip(numbers_of_kind, names, strict=True)
            guessed = guessed or by_name
        columns = [names_by_number[i] for i in numbers]
        # Names that are documented say their units as documented.
        return self._group_by_unit(sought, columns, guessed=guessed)._replace(reported=guessed)

    def _group_by_unit(
        self, sought: Sequence[SoughtColumn], columns: Sequence[str], *, guessed: bool
    ) -> Group:
        """Return columns with their units; all lengths share a unit, and so do all angles."""
        units, said, is_stated = dict[str, str](), True, guessed
        for kind in {member.unit: member for member in sought}.values():
            alike = zip(columns, sought, strict=True)
            named = self.common_unit([c for c, member in alike if member.unit == kind.unit], kind)
            units[kind.unit] = self.unit(kind, named)
            said = said and (kind.declared or named) is not None
            is_stated = is_stated or (named is not None and not kind.declared)
        self.taken.update(columns)
        each = tuple(units[member.unit] for member in sought)
        return Group(tuple(columns), each, said, is_stated, guessed)

    def matches(self, kind: SoughtColumn) -> Iterator[tuple[str, NameParts]]:
        """Yield the columns whose names are a synonym of a quantity, with a fitting unit if any."""
        for name in self.names:
            parts = parse_column_name(name)
            if (
                parts is not None
                and is_synonym(parts.word, kind.stem)
                and (not parts.unit or parse_unit(parts.unit, kind.unit))
            ):
                yield name, parts

    def family(self, kind: SoughtColumn, numbers: Sequence[int]) -> tuple[list[str], bool]:
        """Return the columns with these numbers (0: none); whether by undocumented names."""
        families: dict[str, dict[int, str]] = {}
        for name, parts in self.matches(kind):
            if (parts.number is not None) == (numbers[0] > 0):
                families.setdefault(parts.family, {})[parts.number or 0] = name
        if numbers[0] > 0:
            # Programs count from 0 as well.
            families = {
                key: {i + 1: name for i, name in members.items()} if 0 in members else members
                for key, members in families.items()
            }
        exact = kind.stem + "#" * (numbers[0] > 0)
        if exact not in families and kind.table == "forces":
            exact = "current#"
        if exact in families:
            families = {exact: families[exact]}
        known = set(range(self.legs + 1))
        complete = [
            key for key, members in families.items() if set(numbers) <= members.keys() <= known
        ]
        if not complete:
            raise self.incomplete(kind, numbers, list(families.values()))
        if len(complete) > 1:
            several = [
                [members[i] for i in sorted(members)]
                for members in map(families.get, complete)
                if members
            ]
            raise self.ambiguous(kind, several)
        columns = [families[complete[0]][number] for number in numbers]
        return columns, complete[0] != exact

    def pose(self, sought: Sequence[SoughtColumn], declared: Sequence[str] | None) -> Group:
        """Return the columns of a measured pose, none where it is not whole."""
        stems = [member.stem for member in sought]
        if declared is not None:
            columns = self.declared_columns("pose", declared)
        elif set(stems) <= set(self.names):
            columns = stems
        else:
            columns = [name for member in sought for name in self.lone(member)]
        if len(columns) < len(sought):
            if columns:
                message = (
                    f"{self.source}: {join_names(columns)} alone are no pose ({', '.join(stems)} "
                    "needed), so that no measured pose is read"
                )
                first = shorten(columns[0], bare=True)
                self.findings.append(Finding("guessed", message, column=first, count=len(columns)))
            return Group()
        guessed = declared is None and columns != stems
        return self._group_by_unit(sought, columns, guessed=guessed)

    def lone(self, kind: SoughtColumn) -> list[str]:
        """Return the column without a number that fits, as a list; empty if there is none."""
        candidates = [name for name, parts in self.matches(kind) if parts.number is None]
        if len(candidates) > 1:
            raise self.ambiguous(kind, [[name] for name in candidates])
        return candidates

    def payload(self, declared: str | None) -> Group:
        """Return the column that states when a payload is carried, if any."""
        candidates = [name for name in self.names if name.lower() == "payload"]
        if declared is not None:
            candidates = self.declared_columns("payload", [declared])
        if len(candidates) > 1:
            kind = SoughtColumn("payload", "payload", "payload", "", None)
            raise self.ambiguous(kind, [[name] for name in candidates])
        return Group(tuple(candidates), ("",) * len(candidates))

    def unit_of(self, name: str, kind: SoughtColumn) -> str | None:
        """Return the unit from the line of units, else from the column's name; None without.

        A word such as current says another unit than the documented one; rho and force do not.
        """
        parts = parse_column_name(name)
        text = self.units.get(name, "")
        if text.lower() not in _NO_UNIT:
            unit = parse_unit(text, kind.unit)
            if unit is None and kind.declared is None:
                raise DataError(
                    f"{self.source}: column {shorten(name, bare=True)} is in {shorten(text)}, "
                    f"which is not known for {kind.noun}; say the unit, with one that is, in a "
                    "TOML file beside it:"
                    + declaration(kind.table, **{self.unit_key(kind): kind.unit})
                )
            return unit
        if parts is None:
            return None
        implied = "A" if kind.table == "forces" and parts.word in CURRENTS else None
        return parse_unit(parts.unit, kind.unit) or implied

    @staticmethod
    def unit_key(kind: SoughtColumn) -> str:
        """Return the key of a unit in its table."""
        if kind.table != "pose":
            return "unit"
        return "angle_unit" if kind.unit == "rad" else "length_unit"

    def common_unit(self, columns: Sequence[str], kind: SoughtColumn) -> str | None:
        """Return the unit of columns that belong together."""
        units = dict.fromkeys(self.unit_of(name, kind) for name in columns)
        if len(units) > 1 and kind.declared is None:
            said = ", ".join(unit or "no unit" for unit in units)
            raise DataError(
                f"{self.source}: {join_names(columns)} are in {said}; the {kind.noun} columns have "
                "one unit: say which in a TOML file beside it:"
                + declaration(kind.table, **{self.unit_key(kind): kind.unit})
            )
        words = {parts.word for parts in map(parse_column_name, columns) if parts}
        if kind.declared is None and words & set(RATED) and None in units:
            raise DataError(
                f"{self.source}: {join_names(columns)}: the unit of these torques is not said; "
                "drives write per cent of the rated torque, or N m; say which in a TOML file "
                "beside it, with gains where they are no SI unit:" + declaration("forces", unit="%")
            )
        return next(iter(units))

    def unit(self, kind: SoughtColumn, named: str | None) -> str:
        """Return the declared unit, else that in the file, else the documented unit."""
        if kind.declared and named and kind.declared != named:
            # Currents called F1 are the file's business; that the two differ must be said.
            message = (
                f"{self.source}: the {kind.noun} columns say {named}, but the description declares "
                f"{kind.declared}; taken as {kind.declared}"
            )
            self.findings.append(Finding("units", message))
        return kind.declared or named or kind.unit

    def declared_columns(self, table: str, columns: Sequence[str]) -> list[str]:
        """Return columns that the description names, which the file must have."""
        absent = [name for name in columns if name not in self.names]
        if absent:
            raise DataError(
                f"{self.source}: no column {join_names(absent)}, which the description's [{table}] "
                f"names (found: {join_names(self.names)}); correct the description"
                + (f"; {self.hint}" if len(self.names) == 1 else "")
            )
        return list(columns)
