"""The verdict on an identified or calibrated machine: a grade, reasons and advice."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from pteron.result import Result

Grade = Literal["trustworthy", "usable with care", "not trustworthy"]
"""The grades of a verdict, best first."""


@dataclass(frozen=True, eq=False, repr=False)
class Verdict(Result):
    """Whether a result can be trusted, and why.

    Attributes
    ----------
    grade : {"trustworthy", "usable with care", "not trustworthy"}
        An identified model has the grade of its worst actuator: trustworthy where the held-out
        error is at most 1.5 times the noise floor, or what is missed beyond the noise is at most
        5 % of the force, and a pick-and-place cycle is expected to be at most 3 % off, and no fault
        that matters shows; not trustworthy where either is more than 15 %, or where the error is
        more than half of the force. A calibrated geometry is trustworthy where errors at rows that
        were held out are those of noise and intervals and at most half of an ordinary tolerance,
        and no fault shows; not trustworthy where they are more than an ordinary tolerance, or did
        not fall.
    reasons : tuple of str
        The reasons, in sentences.
    next_steps : tuple of str
        Advice for a better result.
    """

    ROWS = "reasons"

    grade: Grade
    reasons: tuple[str, ...]
    next_steps: tuple[str, ...] = ()

    def summary(self) -> str:
        """Return the grade, the reasons and the advice as lines of text."""
        return "\n".join([self.grade, *self.reasons, *self.next_steps])


@dataclass
class Opinion:
    """A verdict to which reasons are added, and whose grade may fall."""

    grade: Grade = "trustworthy"
    reasons: list[str] = field(default_factory=list)
    steps: list[str] = field(default_factory=list)

    def lower(self, grade: Grade) -> None:
        """Lower the grade of the opinion to another one, if that is worse."""
        self.grade = max(self.grade, grade, key=get_args(Grade).index)

    def add(self, reason: str, step: str = "", *, grade: Grade = "trustworthy") -> None:
        """Add a reason, the best grade that it allows, and advice, to the opinion."""
        self.lower(grade)
        self.reasons.append(reason)
        self.steps += [step] * bool(step)

    def verdict(self) -> Verdict:
        """Return the grade, reasons and advice as a `Verdict`."""
        return Verdict(self.grade, tuple(self.reasons), tuple(dict.fromkeys(self.steps)))
