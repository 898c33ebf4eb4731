"""`LogError`: a log lacks what an evaluation needs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from pteron.errors import DataError, ModelError

Reason = Literal[
    "columns",
    "constant",
    "contradicted",
    "currents",
    "gap",
    "left over",
    "no payload",
    "no period",
    "no pose",
    "not repeating",
    "singular",
    "too large",
    "too little motion",
    "too short",
    "twice",
    "unsettled",
    "wrapped",
]
"""Kinds of fault of a log, for programs."""


class LogError(DataError):
    """A log lacks what an evaluation needs.

    Attributes
    ----------
    reason : str
        The kind of fault, such as "too short", "no pose" or "too little motion".
    place : str
        The log, and the row where a single one is to blame.
    """

    def __init__(self, reason: Reason, place: str, message: str) -> None:
        super().__init__(message, subject=place)
        self.reason = reason
        self.place = place


class LogSourceMixin:
    """Base class of a log and of what is computed from one; `source` is its name in messages."""

    source: str

    def fault(self, reason: Reason, message: str) -> LogError:
        """Return the LogError that this log lacks what an evaluation needs."""
        return LogError(reason, self.source, message)


def name_cause(error: DataError | ModelError, causes: Sequence[str]) -> None:
    """Prepend the first cause, if there is one, to an error's message, in place."""
    for cause in causes[:1]:
        place = f"{error.place}: " if isinstance(error, LogError) else ""
        error.args = (f"{place}{cause.rstrip('.')} ({str(error).removeprefix(place)})",)
