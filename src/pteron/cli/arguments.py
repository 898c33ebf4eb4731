"""Reading of arguments that subcommands share: lists of numbers, a machine and its working mode."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any, Literal

from typer.core import TyperCommand

from pteron.cli.terminal import warn
from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator

    MachineArgument = Manipulator
else:

    class MachineArgument:
        """The machine that a command is about, loaded from its ROBOT and --elbows."""


STANDARD = "adept"
"""The name of the pick-and-place cycle of 25, 305 and 25 mm."""

Failure = Literal["raise", "nan"]
"""Handling of a row that fails: it ends the command ("raise") or is left empty ("nan")."""

MOTION = ("--pose", "--velocity", "--acceleration", "--wrench")
"""The options that give a state of motion, as several numbers each."""

VECTORS = (*MOTION, "--from", "--to", "--around", "--pivot", "--speed", "--force", "--jerk")
"""The options that take several numbers: all that follow them."""


class Command(TyperCommand):
    """A command whose help shows flags without a type."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters; a flag is ``--json``, not ``--json <bool>``."""
        return hide_flag_types(super().get_params(ctx))


def hide_flag_types(parameters: list[Any]) -> list[Any]:
    """Return a command's parameters; flags get no type in the help."""
    for parameter in parameters:
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
    return parameters


class NumbersCommand(Command):
    """A command whose arguments may be negative numbers, and whose options may take several."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments, reordered for Typer."""
        valued = [
            name
            for parameter in self.params
            if parameter.param_type_name == "option" and not getattr(parameter, "is_flag", False)
            for name in parameter.opts
        ]
        return super().parse_args(ctx, group_numbers(args, valued))


def group_numbers(args: Sequence[str], valued: Collection[str]) -> list[str]:
    """Return arguments with each option's numbers joined by commas, and the others behind ``--``.

    `valued` are the options that take a value.

    Examples
    --------
    >>> group_numbers(["robot", "-0.1", "0", "--json", "2"], [])
    ['robot', '--json', '--', '-0.1', '0', '2']
    >>> group_numbers(["robot", "--pose", "-1", "2", "--out", "-3"], ["--pose", "--out"])
    ['robot', '--pose=-1,2', '--out', '-3']
    >>> group_numbers(["robot", "--to", "0", "b", "-1", "--json"], [])
    ['robot', '--to=0,b,-1', '--json']
    """
    options: list[str] = []
    free: list[str] = []
    words = deque(args)
    while words:
        word = words.popleft()
        if word == "--":
            free += words
            break
        if word in VECTORS and (count := _meant_for_vector(words)):
            options.append(f"{word}={','.join(words.popleft() for _ in range(count))}")
        elif word in valued and words:
            options += [word, words.popleft()]
        else:
            (free if _numeric(word) else options).append(word)
    return [*options, "--", *free] if free else options


def _meant_for_vector(words: Sequence[str]) -> int:
    """Return the number of words of an option: up to the last number before the next option.

    Numbers that are joined by commas are one word, and all of them.
    """
    if words and "," in words[0].strip(","):
        return 1
    count = 0
    for i, word in enumerate(words, start=1):
        if _numeric(word):
            count = i
        elif word.startswith("-"):
            break
    return count


def _numeric(word: str) -> bool:
    """Return whether a word is meant as a number, even if malformed, such as -0.1.2."""
    if word[:1] == "-" and word[1:2] and word[1] in ".0123456789":
        return True
    try:
        for part in word.split(","):
            float(part)
    except ValueError:
        return False
    return True


def parsed_numbers(words: Sequence[str], names: Sequence[str], what: str) -> list[float]:
    """Return the finite numbers in words separated by blanks or commas, one for each name."""
    parts = " ".join(words).replace(",", " ").split()
    numbers = []
    for part in parts:
        try:
            number = float(part)
        except ValueError:
            raise DataError(f"{what}: {part!r} is not a number; give {' '.join(names)}") from None
        if not math.isfinite(number):
            raise DataError(f"{what}: {part!r} is not a finite number; give {' '.join(names)}")
        numbers.append(number)
    if len(numbers) != len(names):
        noun = "value" if len(numbers) == 1 else "values"
        raise DataError(
            f"{what}: {len(numbers)} {noun} given, {len(names)} expected: {' '.join(names)}"
        )
    return numbers


def parsed_list(text: str | None, what: str) -> list[float] | None:
    """Return all numbers in an option's text; None where the option is left out."""
    if text is None:
        return None
    words = text.replace(",", " ").split()
    return parsed_numbers([text], ["a number"] * max(1, len(words)), what)


def split_numbers(
    option: str, text: str, between: str, count: int | None, expected: str
) -> tuple[float, ...]:
    """Return the numbers in an option's text; raise unless they are `count`, where it is stated.

    Raises
    ------
    DataError
        If it has others, or none: it says what is expected.
    """
    try:
        numbers = tuple(float(part) for part in text.split(between))
    except ValueError:
        numbers = ()
    if not numbers or (count is not None and len(numbers) != count):
        raise DataError(f"{option}: {text!r} given, {expected}")
    return numbers


def load_robot(name_or_path: str, elbows: str | None = None, *, quiet: bool = False) -> Manipulator:
    """Load a machine in a working mode, given by `elbows` such as ``++-+``.

    Warnings about its file are shown unless `quiet`.
    """
    from pteron.cli.kept_machines import kept_machine

    robot, unlikely = kept_machine(name_or_path)
    if not quiet:
        warn(unlikely, f"{name_or_path}: ")
    if elbows is None:
        return robot
    from pteron.manipulator.variants import with_elbows

    text, count = elbows_text(robot), len(robot.legs)
    if set(elbows) - set("+-") or len(elbows) not in (count, len(text)):
        several = len(text) > count
        raise DataError(
            f"--elbows: {elbows!r} given, {count}{f' or {len(text)}' * several} signs + or - "
            f"expected, one{' or two' * several} for each leg of {robot.name}, such as {text}"
        )
    return with_elbows(robot, [int(f"{sign}1") for sign in elbows])


def about_pivot(robot: Manipulator, text: str | None) -> Manipulator:
    """Return the machine with poses about the point of `--pivot`, or as it is without one."""
    if text is None:
        return robot
    from pteron.manipulator import with_pivot

    return with_pivot(robot, parsed_numbers([text], ["x", "y", "z"], "--pivot"))


def check_rate(rate: float) -> None:
    """Raise DataError unless a sampling rate is a number above 0."""
    if not 0.0 < rate < math.inf:
        raise DataError(f"--rate: {rate:g} given, samples a second above 0 expected")


def elbows_text(robot: Manipulator) -> str:
    """Return a machine's working mode as text: + or -, one or two for each leg."""
    from pteron.manipulator.variants import elbow_signs, elbows_of

    return elbow_signs(elbows_of(robot))
