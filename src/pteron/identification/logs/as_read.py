"""How a file was read, in words; and columns of times that a program writes for each channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pteron.errors import DataError, shown
from pteron.identification.logs.clock import Clock
from pteron.identification.logs.columns import Columns
from pteron.identification.logs.description import Description
from pteron.identification.logs.log import Finding
from pteron.identification.logs.names import called, means
from pteron.tables import Table

_ONCE = ("rho", "theta", "force", "torque")
"""Words for columns that there is one of."""


def check_names(repeated: Mapping[str, str], source: str) -> None:
    """Raise a `DataError` where a file has a column of a joint or a force twice."""
    for name in repeated.values():
        parts = called(name)
        if parts and any(means(parts.word, stem) for stem in _ONCE):
            raise _twice(name, source)


class RepeatedTimes:
    """The columns of times beside the first, of the same name, where each channel has its own.

    `repeated` are the names that a file has more than once, as they are told apart.

    Raises
    ------
    DataError
        If another column that is used has its name twice.
    """

    def __init__(self, repeated: Mapping[str, str], columns: Columns, source: str) -> None:
        times = columns.time.names
        used = [name for group in columns[1:5] for name in group.names]
        for name in repeated.values():
            if name in used:
                raise _twice(name, source)
        self.names = tuple(new for new, name in repeated.items() if name in times)
        self._first = times[0]

    def check(self, table: Table) -> None:
        """Raise a `DataError` where a channel was sampled at another time than the first."""
        first = self._first
        for name in self.names:
            apart = (table.frame[name] != table.frame[first]).fill_null(value=True)
            if apart.any():
                row = int(np.argmax(apart.to_numpy()))
                one, other = (shown(str(table.frame[key][row])) for key in (first, name))
                raise DataError(
                    f"{table.place(row)}: its channels were not sampled at one time: {first} is "
                    f"{one}, {name} is {other}; record all channels with one sample time, or "
                    "export them with one time column"
                )


def as_read(
    source: str,
    found: Sequence[str],
    columns: Columns,
    description: Description,
    clock: Clock,
    again: RepeatedTimes,
) -> tuple[Finding, ...]:
    """Return how a file was read, in one finding, where that is neither documented nor declared.

    `found` is what is unlike a plain CSV file.
    """
    parts = list(found)
    time = columns.time.in_words("time")
    if clock.format is not None:
        time = f"{time.removesuffix(' in s')} as text, {clock.format}"
    elif clock.guessed:
        time = f"{time.removesuffix(' in s')} in {clock.unit} (guessed from its size)"
    if columns.time.told or clock.guessed or (clock.format and not description.time_format):
        parts.append(time)
    if again.names:
        parts.append(f"{len(again.names) + 1} equal columns of times")
    groups = {"joints": columns.joints, "forces": columns.forces, "pose": columns.pose}
    parts += [group.in_words(noun) for noun, group in groups.items() if group.told]
    if not parts:
        return ()
    guessed = any(group.guessed for group in (columns.time, *groups.values()))
    advice = "; columns are taken by name: declare them in its TOML file to be sure" * guessed
    return (Finding("read", f"{source}: read as: {', '.join(parts)}{advice}"),)


def _twice(name: str, source: str) -> DataError:
    return DataError(f"{source}: two columns are called {shown(name)}; rename or remove one")
