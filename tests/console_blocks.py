"""The console blocks of a page: their commands, run in order in one folder, and their outputs.

A block is fenced as `console` or indented by four columns. Its commands stand after `$ `, with
their output below; where no line has a `$ `, each line is a command whose output the page does not
show. A line that begins with `# ` is a remark, one that ends with a backslash goes on in the next.

Outputs agree if their words do and their numbers do within a tolerance: a number with a decimal
point or an exponent within one unit of its last digit that is shown, an integer exactly, or as
`Tolerance` says. `...` in a shown output stands for anything.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from typer.testing import CliRunner

from pteron.cli.main import app
from pteron.kernels.c import compiler

ROOT = Path(__file__).parent.parent

PROGRAMS = ("pteron", "python", "cp", "cc", "grep", "controller/test")
"""Programs that are run."""

OTHERS = ("make", "pip", "jupyter", "halcompile", "dask")
"""Programs that change the machine, or that few machines have."""

_FENCE = re.compile(r"^(`{3,}|:{3,})\s*(\S*)")
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\d.]*\w)|[-+]?\d+\.\d+")


@dataclass(frozen=True)
class Step:
    """A command of a page and the lines that are shown below it."""

    page: str
    line: int
    command: str
    shown: tuple[str, ...] = ()

    @property
    def words(self) -> list[str]:
        """The command's words."""
        return shlex.split(self.command)


@dataclass(frozen=True)
class Tolerance:
    """A tolerance for the numbers of an output, and the reason that it has its size.

    `relative` is of the number that is shown; `only` is a regular expression of the shown lines
    that have it, by default all.
    """

    relative: float
    reason: str
    only: str = ""


def blocks(text: str) -> Iterator[tuple[int, str, list[str]]]:
    """Yield the line number, language and lines of each block; an indented one has no language."""
    lines = text.split("\n")
    k = 0
    while k < len(lines):
        fence = _FENCE.match(lines[k])
        if fence:
            end = next(
                (j for j in range(k + 1, len(lines)) if lines[j].startswith(fence[1])), len(lines)
            )
            yield k + 2, fence[2], lines[k + 1 : end]
            k = end + 1
        elif lines[k].startswith("    ") and (k == 0 or not lines[k - 1].strip()):
            end = k
            while end < len(lines) and (lines[end].startswith("    ") or not lines[end].strip()):
                end += 1
            while not lines[end - 1].strip():
                end -= 1
            yield k + 1, "", [line[4:] for line in lines[k:end]]
            k = end
        else:
            k += 1


def is_console(language: str, lines: list[str]) -> bool:
    """Return whether a block shows commands."""
    if language:
        return language == "console"
    if any(line.startswith("$ ") for line in lines):
        return True
    commands = [line for line in lines if line.strip() and not line.startswith("# ")]
    return bool(commands) and _bare(commands[0]).split()[0] in (*PROGRAMS, *OTHERS)


def _bare(command: str) -> str:
    """Return a command without its environment's folder and without a remark behind it."""
    return re.split(r" +# ", command)[0].rstrip().removeprefix(".venv/bin/")


def steps(page: str, text: str) -> list[Step]:
    """Return the commands of a page, in order."""
    result: list[Step] = []
    for first, language, lines in blocks(text):
        if not is_console(language, lines):
            continue
        prompts = any(line.startswith("$ ") for line in lines)
        k = 0
        while k < len(lines):
            line, begin = lines[k], first + k
            k += 1
            if not line.strip() or line.startswith("# "):
                continue
            command = line.removeprefix("$ ")
            while command.endswith("\\"):
                command = command[:-1] + lines[k].strip()
                k += 1
            shown = []
            while prompts and k < len(lines) and not lines[k].startswith(("$ ", "# ")):
                shown.append(lines[k])
                k += 1
            result.append(Step(page, begin, _bare(command), tuple(x for x in shown if x.strip())))
    return result


def run(step: Step, folder: Path) -> tuple[int, str]:
    """Return the exit code and the output of a step in a folder, which is the working one."""
    program, *words = step.words
    if program == "pteron":
        result = CliRunner().invoke(app, words)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result.exit_code, result.output
    if program == "cp":
        shutil.copy(*words)
        return 0, ""
    before = {"python": [sys.executable], "cc": list(compiler() or ["cc"]), "grep": ["grep"]}
    done = subprocess.run(
        [*before.get(program, [f"./{program}"]), *words],
        cwd=folder,
        env={**os.environ, "PYTHONWARNINGS": "error"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


def difference(shown: str, printed: str, tolerances: tuple[Tolerance, ...] = ()) -> str:
    """Return the first difference of a shown output and a printed one; nothing where they agree."""
    parts: list[list[_Word]] = [[]]
    for line in shown.split("\n"):
        relative = _relative(line, tolerances)
        for word in line.split():
            if word == "...":
                parts.append([])
            else:
                parts[-1].append((word, relative))
    given = printed.split()
    at = 0
    for k, part in enumerate(parts):
        last = k == len(parts) - 1
        places = list(range(at, max(at, len(given) - len(part)) + 1))
        if k == 0:
            places = places[:1]
        elif last and part:
            places = places[-1:]
        common = {place: _common(part, given[place:]) for place in places}
        place = max(places, key=lambda p: (common[p], -p))
        if common[place] < len(part):
            return _told(part[common[place]][0], given, place + common[place])
        at = place + len(part)
    if parts[-1] and at != len(given):
        return f"more is printed: {' '.join(given[at : at + 12])}"
    return ""


_Word = tuple[str, float | None]
"""A shown word, and the relative tolerance of its numbers; None for that of the last digit."""


def _relative(line: str, tolerances: tuple[Tolerance, ...]) -> float | None:
    """Return the relative tolerance of a shown line, None for that of the last digit."""
    return next((t.relative for t in tolerances if re.search(t.only, line)), None)


def _common(part: list[_Word], given: list[str]) -> int:
    """Return how many words agree from the first on."""
    k = 0
    while k < min(len(part), len(given)) and agrees(part[k][0], given[k], part[k][1]):
        k += 1
    return k


def _told(word: str, given: list[str], k: int) -> str:
    if k >= len(given):
        return f"shown {word!r}, and no more is printed"
    return f"shown {word!r}, printed {given[k]!r} in {' '.join(given[max(0, k - 4) : k + 5])!r}"


def agrees(shown: str, printed: str, relative: float | None = None) -> bool:
    """Return whether a printed word is the shown one, its numbers within the tolerance.

    `...` in a word stands for any letters; the rule below a table's head may have any length.
    """
    if shown == printed or not (set(shown) | set(printed)) - {"─"}:
        return True
    return _numbers_agree(shown, printed, relative)


def _numbers_agree(shown: str, printed: str, relative: float | None) -> bool:
    head, dots, tail = shown.partition("...")
    parts = [re.escape(_NUMBER.sub("#", part)) for part in (head, tail)]
    if not re.fullmatch((".*" if dots else "").join(parts), _NUMBER.sub("#", printed)):
        return False
    theirs = _NUMBER.findall(printed)
    first, last = _NUMBER.findall(head), _NUMBER.findall(tail)
    pairs = [
        *zip(first, theirs, strict=False),
        *zip(reversed(last), reversed(theirs), strict=False),
    ]
    return all(abs(float(a) - float(b)) <= _allowed(a, relative) for a, b in pairs)


def _allowed(number: str, relative: float | None) -> float:
    """Return by how much a number may be off."""
    if relative is not None:
        return relative * abs(float(number)) * (1.0 + 1e-12)
    mantissa, _, exponent = number.partition("e")
    decimals = len(mantissa.partition(".")[2])
    if not decimals and not exponent:
        return 0.0
    return 10.0 ** (int(exponent or 0) - decimals) * (1.0 + 1e-9)
