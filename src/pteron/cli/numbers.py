"""Numbers on the command line: several to an option, and negative ones without ado."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Sequence
from typing import Any

from typer.core import TyperCommand

from pteron.errors import DataError

__all__ = ["NumbersCommand", "parsed_numbers", "regrouped"]

VECTORS = ("--pose", "--velocity", "--acceleration", "--wrench")
"""The options that take as many numbers as follow them."""


class NumbersCommand(TyperCommand):
    """A command whose arguments may be negative numbers, and whose options may take several."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments, put in an order that Typer understands."""
        valued = [
            name
            for parameter in self.params
            if parameter.param_type_name == "option" and not getattr(parameter, "is_flag", False)
            for name in parameter.opts
        ]
        return super().parse_args(ctx, regrouped(args, valued))


def regrouped(args: Sequence[str], valued: Collection[str]) -> list[str]:
    """Return arguments with an option's numbers joined by commas and the free ones behind ``--``.

    Parameters
    ----------
    args : sequence of str
        As typed.
    valued : collection of str
        The options that take a value.

    Examples
    --------
    >>> regrouped(["robot", "-0.1", "0", "--json", "2"], [])
    ['robot', '--json', '--', '-0.1', '0', '2']
    >>> regrouped(["robot", "--pose", "-1", "2", "--out", "-3"], ["--pose", "--out"])
    ['robot', '--pose=-1,2', '--out', '-3']
    """
    kept: list[str] = []
    free: list[str] = []
    rest = deque(args)
    while rest:
        word = rest.popleft()
        if word == "--":
            free += rest
            break
        if word in VECTORS and rest and _numeric(rest[0]):
            values = []
            while rest and _numeric(rest[0]):
                values.append(rest.popleft())
            kept.append(f"{word}={','.join(values)}")
        elif word in valued and rest:
            kept += [word, rest.popleft()]
        else:
            (free if _numeric(word) else kept).append(word)
    return [*kept, "--", *free] if free else kept


def _numeric(word: str) -> bool:
    """Say whether a word is meant as a number, also where it is none, as in -0.1.2."""
    if word[:1] == "-" and word[1:2] and word[1] in ".0123456789":
        return True
    try:
        for part in word.split(","):
            float(part)
    except ValueError:
        return False
    return True


def parsed_numbers(words: Sequence[str], names: Sequence[str], what: str) -> list[float]:
    """Return the numbers in words, apart by blanks or commas.

    Parameters
    ----------
    words : sequence of str
        As typed.
    names : sequence of str
        What each number is, in order.
    what : str
        What they are together.

    Raises
    ------
    DataError
        If one is not a finite number, or if their count is wrong.
    """
    parts = " ".join(words).replace(",", " ").split()
    values = []
    for part in parts:
        try:
            value = float(part)
        except ValueError:
            raise DataError(f"{what}: {part!r} is not a number; give {' '.join(names)}") from None
        if not math.isfinite(value):
            raise DataError(f"{what}: {part!r} is not a finite number; give {' '.join(names)}")
        values.append(value)
    if len(values) != len(names):
        noun = "value" if len(values) == 1 else "values"
        raise DataError(
            f"{what}: {len(values)} {noun} given, {len(names)} expected: {' '.join(names)}"
        )
    return values
