"""Which columns of a file hold what, and in which unit: declared, documented or guessed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pteron.errors import DataError
from pteron.identification.logs.description import Description
from pteron.identification.logs.finding import Finding
from pteron.identification.logs.names import ANGLES, FORCES, LENGTHS, TIMES, split, unit_in

__all__ = ["Columns", "find_columns"]

_TIMES = ("t", "time", "timestamp")
_SLIDERS = {"rho": "m", "q": "m", "s": "m", "slider": "m"}
_FORCES = {"force": "N", "f": "N", "tau": "N", "current": "A", "i": "A"}


@dataclass(frozen=True)
class Columns:
    """Where in a file the parts of a log are, as indices of columns, and their units."""

    time: int
    sliders: tuple[int, ...]
    forces: tuple[int, ...]
    pose: tuple[int, ...]
    payload: int | None
    time_unit: str
    slider_unit: str
    force_unit: str
    length_unit: str
    angle_unit: str
    unit_of_time_known: bool
    findings: tuple[Finding, ...]


def find_columns(
    names: Sequence[str],
    legs: int,
    coordinates: Sequence[str],
    description: Description,
    source: str,
    hint: str,
) -> Columns:
    """Return where a file's columns are, after what is declared, documented, or else guessed.

    Parameters
    ----------
    names : sequence of str
        The file's columns.
    legs : int
        Number of the machine's legs.
    coordinates : sequence of str
        Names of its pose coordinates.
    description : Description
        What the log's TOML file declares.
    source : str
        What messages call the file.
    hint : str
        What may be amiss with the header where nothing is found.

    Raises
    ------
    DataError
        If two columns have one name, if a needed one is missing, or if a guess would be ambiguous.
    """
    search = _Search(tuple(names), legs, description, source, hint)
    twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
    if twice is not None:
        raise DataError(f"{source}: two columns are called {twice!r}; rename or remove one")
    d = description
    time, time_unit = search.time(d.time_column, d.time_unit)
    sliders, slider_unit = search.family(
        "sliders", "rho", _SLIDERS, LENGTHS, d.slider_columns, d.slider_unit
    )
    forces, force_unit = search.family(
        "forces", "force", _FORCES, FORCES, d.force_columns, d.column_force_unit
    )
    pose, length_unit, angle_unit = search.pose(coordinates, d.pose_columns)
    payload = search.payload(d.payload_column)
    return Columns(
        time,
        sliders,
        forces,
        pose,
        payload,
        time_unit=search.unit("time", d.time_unit, time_unit, "s"),
        slider_unit=search.unit("sliders", d.slider_unit, slider_unit, "m"),
        force_unit=search.unit("forces", d.column_force_unit, force_unit, "N"),
        length_unit=search.unit("pose", d.length_unit, length_unit, "m"),
        angle_unit=search.unit("pose", d.angle_unit, angle_unit, "rad"),
        unit_of_time_known=(d.time_unit or time_unit) is not None,
        findings=tuple(search.findings),
    )


class _Search:
    """The names of a file, and what was guessed about them so far."""

    def __init__(
        self, names: tuple[str, ...], legs: int, given: Description, source: str, hint: str
    ) -> None:
        self.names = names
        self.legs = legs
        self.source = source
        self.hint = hint
        self.findings: list[Finding] = []
        self.needed = [given.time_column or "t"]
        for columns, stem in ((given.slider_columns, "rho"), (given.force_columns, "force")):
            self.needed += columns or [f"{stem}{i + 1}" for i in range(legs)]

    def time(self, declared: str | None, declared_unit: str | None) -> tuple[int, str | None]:
        if declared is not None:
            return self.declared("time", [declared])[0], unit_in(declared, TIMES)
        if "t" in self.names:
            return self.names.index("t"), None
        found = self.lone(_TIMES, TIMES)
        if not found:
            raise self.missing("time", 'column = "..."')
        if len(found) > 1:
            raise self.ambiguous("time", found)
        unit = unit_in(found[0], TIMES)
        self.guess(found, "time", declared_unit or unit or "s", "time")
        return self.names.index(found[0]), unit

    def lone(self, words: Sequence[str], units: Mapping[str, str]) -> list[str]:
        """Return the columns called one of some words, without a number."""
        parts = {name: split(name, units) for name in self.names}
        return [
            name for name, one in parts.items() if one and one.number is None and one.word in words
        ]

    def family(
        self,
        table: str,
        documented: str,
        words: Mapping[str, str],
        units: Mapping[str, str],
        declared: tuple[str, ...] | None,
        declared_unit: str | None,
    ) -> tuple[tuple[int, ...], str | None]:
        """Return the numbered columns of the legs, and the unit their names say."""
        if declared is not None:
            return self.declared(table, declared), unit_in(declared[0], units)
        families: dict[tuple[str, str], dict[int, str]] = {}
        for name in self.names:
            parts = split(name, units)
            if parts is not None and parts.number is not None and parts.word in words:
                key = parts.stem, parts.tail
                families.setdefault(key, {})[parts.number] = name
        exact = (documented, "")
        if exact not in families and documented == "force":
            exact = ("current", "")
        if exact in families:
            families = {exact: families[exact]}
        complete = [key for key, one in families.items() if sorted(one) == self.numbers()]
        if not complete:
            raise self.incomplete(table, list(families.values()))
        if len(complete) > 1:
            raise self.ambiguous(table, [families[key][1] for key in complete])
        key = complete[0]
        columns = [families[key][i] for i in self.numbers()]
        unit = unit_in(columns[0], units)
        # A word such as current says another unit than the documented one; rho and force do not.
        implied = words[key[0].strip(" _").lower()]
        if key != exact:
            usual = declared_unit or unit or implied
            what = {"sliders": "slider coordinates", "forces": "actuator forces"}[table]
            self.guess(columns, what, usual, table)
        return self.indices(columns), unit or (None if implied in ("m", "N") else implied)

    def pose(
        self, coordinates: Sequence[str], declared: tuple[str, ...] | None
    ) -> tuple[tuple[int, ...], str | None, str | None]:
        if declared is not None:
            columns = list(declared)
        elif all(name in self.names for name in coordinates):
            return self.indices(coordinates), None, None
        else:
            columns = [name for one in coordinates for name in self.coordinate(one)[:1]]
            if len(columns) < len(coordinates):
                if columns:
                    self.findings.append(self.partial(columns, coordinates))
                return (), None, None
        length = unit_in(columns[0], LENGTHS)
        angle = unit_in(columns[3], ANGLES) if len(columns) > 3 else None
        if declared is not None:
            return self.declared("pose", columns), length, angle
        if any(unit_in(name, LENGTHS) != length for name in columns[:3]):
            raise self.ambiguous("pose", columns)
        self.guess(columns, "measured pose", f"{length or 'm'} and {angle or 'rad'}", "pose")
        return self.indices(columns), length, angle

    def coordinate(self, coordinate: str) -> list[str]:
        """Return the columns that may hold one coordinate of the pose."""
        found = self.lone((coordinate,), ANGLES if coordinate == "phi" else LENGTHS)
        if len(found) > 1:
            raise self.ambiguous("pose", found)
        return found

    def payload(self, declared: str | None) -> int | None:
        if declared is not None:
            return self.declared("payload", [declared])[0]
        found = [name for name in self.names if name.lower() == "payload"]
        if len(found) > 1:
            raise self.ambiguous("payload", found)
        return self.names.index(found[0]) if found else None

    def unit(self, table: str, declared: str | None, named: str | None, usual: str) -> str:
        """Return the unit declared, else the one the names say, else the documented one."""
        if declared is not None and named is not None and declared != named:
            # Currents called F1 are the file's business; that the two differ must be said.
            self.findings.append(
                Finding(
                    "units",
                    f"{self.source}: the names of the {table} columns say {named}, but the "
                    f"description declares {declared}; taken as {declared}",
                )
            )
        return declared or named or usual

    def declared(self, table: str, columns: Sequence[str]) -> tuple[int, ...]:
        absent = [name for name in columns if name not in self.names]
        if absent:
            raise DataError(
                f"{self.source}: no column {', '.join(absent)}, which the description's [{table}] "
                f"names (found: {self.found()}); correct the description"
            )
        return self.indices(columns)

    def indices(self, columns: Sequence[str]) -> tuple[int, ...]:
        return tuple(self.names.index(name) for name in columns)

    def numbers(self) -> list[int]:
        return list(range(1, self.legs + 1))

    def found(self) -> str:
        return ", ".join(self.names[:20]) + (", ..." if len(self.names) > 20 else "")

    def guess(self, columns: Sequence[str], what: str, unit: str, table: str) -> None:
        some = ", ".join(columns)
        self.findings.append(
            Finding(
                "guessed",
                f"{self.source}: {some} taken for the {what} in {unit}, by name; declare it in "
                f"the log's TOML file, under [{table}], to be sure",
                column=columns[0],
                count=len(columns),
            )
        )

    def partial(self, columns: Sequence[str], coordinates: Sequence[str]) -> Finding:
        return Finding(
            "guessed",
            f"{self.source}: {', '.join(columns)} alone are no pose ({', '.join(coordinates)} "
            "needed), so that no measured pose is read",
            column=columns[0],
            count=len(columns),
        )

    def missing(self, table: str, key: str) -> DataError:
        return DataError(
            f"{self.source}: no columns for the {table} (found: {self.found()}; needed: "
            f"{', '.join(self.needed)}); {self.hint}, or declare the file's own names in a TOML "
            f"file beside it: [{table}] {key}"
        )

    def incomplete(self, table: str, families: list[dict[int, str]]) -> DataError:
        others = [one for one in families if 1 in one]
        if not others:
            return self.missing(table, "columns = [...]")
        names = [others[0][i] for i in sorted(others[0])]
        stem = names[0].removesuffix("1")
        absent = [f"{stem}{i}" for i in self.numbers() if i not in others[0]]
        fault = f"without {', '.join(absent)}, or " if absent else ""
        return DataError(
            f"{self.source}: the columns {', '.join(names)} are for {len(names)} {table}, but the "
            f"machine has {self.legs} legs (needed: {', '.join(self.needed)}); {fault}"
            "perhaps it is the log of another machine; else declare the columns in a TOML file "
            f"beside it: [{table}] columns = [...]"
        )

    def ambiguous(self, table: str, names: Sequence[str]) -> DataError:
        return DataError(
            f"{self.source}: {', '.join(names)} could each be meant for the {table}; declare which "
            f"in a TOML file beside the log, under [{table}]"
        )
