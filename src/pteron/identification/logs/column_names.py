"""The column names of a file, and the errors that ask which of them hold a part of a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from pteron.errors import DataError
from pteron.identification.logs.findings import Finding
from pteron.identification.logs.names import is_synonym, parse_column_name
from pteron.tables import declaration, join_names

_LONGEST = 60
"""Characters of a name beyond which it is not shown as an example."""

_STEMS = ("t", "rho", "theta", "force", "torque", "payload")
"""Documented words that column names begin with."""


class SoughtColumn(NamedTuple):
    """A column looked for: its table, documented name, word for messages, SI and declared unit."""

    table: str
    stem: str
    noun: str
    unit: str
    declared: str | None


@dataclass
class ColumnNames:
    """A file's column names; those `taken` have a meaning already, the `needed` are documented."""

    names: tuple[str, ...]
    units: Mapping[str, str]
    legs: int
    needed: Sequence[str]
    source: str
    hint: str
    findings: list[Finding] = field(default_factory=list)
    taken: set[str] = field(default_factory=set)

    def incomplete(
        self, kind: SoughtColumn, numbers: Sequence[int], families: Sequence[Mapping[int, str]]
    ) -> DataError:
        """Return the error for columns that a file lacks, entirely or for some legs.

        `families` are columns that are called alike, by number.
        """
        example = self._example(kind)
        needed = join_names(self.needed)
        others = next((family for family in families if numbers[0] in family), None)
        if others is None:
            return DataError(
                f"{self.source}: no columns for the {kind.noun} (found: {join_names(self.names)}; "
                f"needed: {needed}); {self.hint}, or declare the file's own names in a TOML file "
                f"beside it{example}"
            )
        present = [others[i] for i in sorted(others)]
        word = others[numbers[0]].removesuffix(str(numbers[0]))
        absent = [f"{word}{i}" for i in numbers if i not in others]
        fault = f"without {join_names(absent)}, or " if absent else ""
        return DataError(
            f"{self.source}: the columns {join_names(present)} are for {len(present)} {kind.noun}, "
            f"but the machine has {self.legs} legs (needed: {needed}); {fault}perhaps it is the "
            f"log of another machine; else declare the columns in a TOML file beside it{example}"
        )

    def ambiguous(self, kind: SoughtColumn, choices: Sequence[Sequence[str]]) -> DataError:
        """Return the error for ambiguous columns, with a declaration of the first as an example."""
        names = [columns[0] for columns in choices] if len(choices) > 1 else choices[0]
        single = kind.table in ("time", "payload")
        declared = {"column": choices[0][0]} if single else {"columns": list(choices[0])}
        if kind.table == "pose" or (not single and len(choices[0]) != self.legs):
            example = f", under [{kind.table}]"
        else:
            example = ", such as" + declaration(kind.table, **declared)
        return DataError(
            f"{self.source}: {join_names(names)} could each be meant for the {kind.noun}; say "
            f"which in a TOML file beside it{example}"
        )

    def _example(self, kind: SoughtColumn) -> str:
        """Return an example of a declaration, with columns whose names have no other meaning."""
        others = [stem for stem in _STEMS if stem != kind.stem]
        free = [
            name
            for name in self.names
            if name not in self.taken and name.isprintable() and len(name) < _LONGEST
            if (parts := parse_column_name(name)) is None
            or not any(is_synonym(parts.word, s) for s in others)
        ]
        if kind.table == "time":
            return ", such as" + declaration("time", column=free[0]) if free else ""
        if len(free) < self.legs:
            return f": [{kind.table}] columns, one for each leg"
        columns = declaration(kind.table, columns=free[: self.legs])
        return f", in the order of the legs, such as{columns}"
