"""Errors for columns that are missing or could each be meant, with lines to declare."""

from __future__ import annotations

from collections.abc import Sequence

from pteron.errors import DataError
from pteron.identification.logs.names import called, means
from pteron.tables import declaration, listed

_LONGEST = 60
"""A name longer than this is in no example."""


def incomplete(
    source: str,
    legs: int,
    table: str,
    stem: str,
    noun: str,
    numbers: Sequence[int],
    families: list[dict[int, str]],
    *,
    names: Sequence[str],
    taken: set[str],
    needed: Sequence[str],
    hint: str,
) -> DataError:
    """Return the error for columns of a table that a file has not, or has not for all legs.

    `families` are columns that are called alike, by number; `names` are all of the file's, `taken`
    those that have a meaning already, `needed` the documented ones.
    """
    example = _example(legs, table, stem, [name for name in names if name not in taken])
    others = next((one for one in families if numbers[0] in one), None)
    if others is None:
        return DataError(
            f"{source}: no columns for the {noun} (found: {listed(names)}; needed: "
            f"{listed(needed)}); {hint}, or declare the file's own names in a TOML file beside it"
            f"{example}"
        )
    given = [others[i] for i in sorted(others)]
    word = others[numbers[0]].removesuffix(str(numbers[0]))
    absent = [f"{word}{i}" for i in numbers if i not in others]
    fault = f"without {listed(absent)}, or " if absent else ""
    return DataError(
        f"{source}: the columns {listed(given)} are for {len(given)} {noun}, but the machine has "
        f"{legs} legs (needed: {listed(needed)}); {fault}perhaps it is the log of another machine; "
        f"else declare the columns in a TOML file beside it{example}"
    )


def _example(legs: int, table: str, stem: str, names: Sequence[str]) -> str:
    """Return a declaration with columns that are called like nothing else."""
    stems = ("t", "rho", "theta", "force", "torque", "payload")
    free = [
        name
        for name in names
        if name.isprintable()
        and len(name) < _LONGEST
        and (
            (one := called(name)) is None or not any(means(one.word, s) for s in stems if s != stem)
        )
    ]
    if table == "time":
        return ", such as" + declaration("time", column=free[0]) if free else ""
    if len(free) < legs:
        return f": [{table}] columns, one for each leg"
    return ", in the order of the legs, such as" + declaration(table, columns=free[:legs])


def ambiguous(
    source: str, legs: int, table: str, noun: str, choices: Sequence[Sequence[str]]
) -> DataError:
    """Return the error for columns that are as good as others; the first are shown declared."""
    names = [one[0] for one in choices] if len(choices) > 1 else choices[0]
    single = table in ("time", "payload")
    entry = {"column": choices[0][0]} if single else {"columns": list(choices[0])}
    if table == "pose" or (not single and len(choices[0]) != legs):
        example = f", under [{table}]"
    else:
        example = ", such as" + declaration(table, **entry)
    return DataError(
        f"{source}: {listed(names)} could each be meant for the {noun}; say which in a TOML file "
        f"beside it{example}"
    )
