"""Run what stands behind the figures of README and docs, and say what differs: `make evidence`.

claims.toml has a claim a table: the page and the words that state it, the command, and what of the
output is the value. A command runs once, for all its claims. Values that are times depend on the
machine: they are printed, and not judged. With words, claims that hold one of them are tried alone;
--all runs what takes hours too, --quick what takes seconds. Exit code 1 if a value differs.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
CLAIMS = Path(__file__).with_name("claims.toml")

_TOLD = 2000
"""Characters of a failed command's output that are shown, its last."""


@dataclass(frozen=True)
class Claim:
    """A value that a page states, and where it comes from.

    `stated` and `found` are regular expressions with a group for each number; without `found` the
    claim is that the command ends well. `judged` is "equal" (within `tolerance`, relative), "bound"
    (found is at most what is stated) or "time". `takes` is "seconds", "minutes" or "hours".
    """

    says: str
    page: str
    command: str
    stated: str
    found: str = ""
    judged: str = "equal"
    tolerance: float = 0.0
    takes: str = "minutes"

    @property
    def values(self) -> tuple[str, ...]:
        """The numbers on the page."""
        text = " ".join((ROOT / self.page).read_text(encoding="utf-8").split())
        place = re.search(self.stated, text)
        if place is None:
            raise LookupError(f"{self.page} does not say {self.stated!r}")
        return place.groups()


def claims() -> list[Claim]:
    """Return all claims."""
    return [Claim(**one) for one in tomllib.loads(CLAIMS.read_text(encoding="utf-8"))["claim"]]


@cache
def ran(command: str) -> tuple[int, str]:
    """Run a command in the clone's folder; return its exit code and output, and tell its time."""
    begin = time.perf_counter()
    words = [sys.executable if word == "python" else word for word in shlex.split(command)]
    done = subprocess.run(
        words, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    print(f"({time.perf_counter() - begin:.0f} s: {command})", flush=True)
    return done.returncode, done.stdout


def verdict(claim: Claim) -> tuple[str, str, str]:
    """Return what is stated, what is found, and whether they differ."""
    stated = claim.values
    code, output = ran(claim.command)
    if not claim.found:
        print(output[-_TOLD:] if code else "", end="")
        return ", ".join(stated), f"exit code {code}", "differs" if code else "same"
    place = re.search(claim.found, output)
    if place is None:
        return ", ".join(stated), f"nothing (exit code {code})", "differs"
    found = place.groups()
    if claim.judged == "time":
        word = "time"
    else:
        word = (
            "same"
            if all(holds(claim, *pair) for pair in zip(found, stated, strict=True))
            else "differs"
        )
    return ", ".join(stated), ", ".join(found), word


def holds(claim: Claim, found: str, stated: str) -> bool:
    """Return whether one number is as it is stated."""
    a, b = float(found), float(stated)
    return a <= b if claim.judged == "bound" else abs(a - b) <= claim.tolerance * abs(b)


def main() -> None:
    """Try the claims that were asked for."""
    words = [word for word in sys.argv[1:] if not word.startswith("--")]
    takes = {"seconds", *([] if "--quick" in sys.argv else ["minutes"])}
    if "--all" in sys.argv:
        takes.add("hours")
    differs = left = 0
    for claim in claims():
        if words and not any(word in claim.says + claim.command for word in words):
            continue
        if claim.takes not in takes:
            left += 1
            continue
        stated, found, word = verdict(claim)
        differs += word == "differs"
        print(f"{word:8} {claim.says}: stated {stated}; found {found} ({claim.page})", flush=True)
    if left:
        print(f"{left} claims take longer and were not tried; --all tries every one.")
    print(f"{differs} claims differ.")
    sys.exit(bool(differs))


if __name__ == "__main__":
    main()
