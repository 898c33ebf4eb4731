"""Pteron's exceptions, with the root `PteronError`, and its warning, `UnlikelyValue`."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from reprlib import Repr
from typing import Any

_LONGEST = 60
"""Most characters of a value that a message shows; see `shown`."""

_brief = Repr()
_brief.maxstring = _brief.maxother = _brief.maxlong = _LONGEST
_brief.maxlevel = 3


class PteronError(ValueError):
    """Root of every error that Pteron raises for something the user can correct.

    Attributes
    ----------
    message : str
        The fault.
    subject : str
        The file or machine that the error's text names before it; empty where it names none.
    """

    def __init__(self, message: str = "", *, subject: str = "") -> None:
        super().__init__(f"{subject}: {message}" if subject else message)
        self.message = message
        self.subject = subject

    def __reduce__(self) -> tuple[Any, ...]:
        # Errors cross to other processes; most ask for more than what `args` has.
        return _restore_error, (type(self), self.args, self.__dict__)


def _restore_error(
    kind: type[PteronError], args: tuple[Any, ...], state: dict[str, Any]
) -> PteronError:
    """Return an error rebuilt from pickled class, arguments and attributes."""
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class ModelError(PteronError):
    """A manipulator, or the file that describes it, is not a machine Pteron can model.

    Attributes
    ----------
    faults : tuple of str
        Everything that is wrong with a file or a machine, one line each.
    """

    def __init__(self, message: str, *, subject: str = "", faults: Sequence[str] = ()) -> None:
        super().__init__(message, subject=subject)
        self.faults = tuple(faults) or (message,)


class DataError(PteronError):
    """An array, a table or a log has invalid contents."""


class OutputError(PteronError):
    """A result cannot be written to its destination."""


class UnlikelyValue(UserWarning):
    """A value that is possible, but likely in another unit, such as millimetres or degrees."""


def warn_unlikely(text: str) -> None:
    """Issue an `UnlikelyValue` warning at the calling line outside of Pteron."""
    frame, level = sys._getframe(), 1
    while frame.f_back and frame.f_globals.get("__name__", "").startswith("pteron."):
        frame, level = frame.f_back, level + 1
    warnings.warn(text, UnlikelyValue, stacklevel=level)


class UnreachablePose(PteronError):
    """A leg is too short, or folds too far, for the pose.

    Attributes
    ----------
    leg : int
        The leg that fails, counted from 1 as in the paper; 0 where no single leg does.
    shortfall : float
        By how many metres it misses the platform point; 0 where no single leg does.
    index : tuple of int
        Which element of the batch; empty for a single pose.
    millimetres : bool
        Whether it misses by so much that the message asks whether millimetres were meant.
    """

    def __init__(
        self,
        message: str,
        *,
        leg: int,
        shortfall: float,
        index: tuple[int, ...],
        millimetres: bool = False,
    ) -> None:
        super().__init__(message)
        self.millimetres = millimetres
        self.leg = leg
        self.shortfall = shortfall
        self.index = index


class SingularPose(PteronError):
    """The pose is singular, so that the result is not determined there.

    Attributes
    ----------
    kind : str
        ``"I"`` (a leg stretched or folded), ``"II"`` (the actuators do not hold the platform),
        ``"constraint"`` (the legs leave the platform a turn that it must not have), ``"elbow"``
        (the two ends of a leg coincide, so that its elbow may be anywhere) or
        ``"angles"`` (two of the pose's angles turn alike, while the machine may hold the platform).
    measure : float
        The type-I measure of the leg, the type-II or constraint measure of the machine, or the
        cosine of the pose's second angle: a number without unit that is 0 at the singularity and 1
        at best.
    index : tuple of int
        Which element of the batch; empty for a single pose.
    leg : int
        The leg, counted from 1; 0 for kind II and for angles.
    """

    def __init__(
        self,
        message: str,
        *,
        kind: str,
        measure: float,
        index: tuple[int, ...],
        leg: int = 0,
        subject: str = "",
    ) -> None:
        super().__init__(message, subject=subject)
        self.kind = kind
        self.measure = measure
        self.index = index
        self.leg = leg


def shorten(value: object, *, bare: bool = False, longest: int = _LONGEST) -> str:
    r"""Return a value as short text for messages, on one line, without control characters.

    Parameters
    ----------
    value : object
        What a user gave.
    bare : bool
        Whether it is a name or a path, which stands without quotation marks.
    longest : int
        Characters of a text that are kept.

    Examples
    --------
    >>> shorten("1,5"), shorten("rho1\x1b[31m", bare=True), shorten([1.0] * 9)
    ("'1,5'", 'rho1\\x1b[31m', '[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, ...]')
    """
    if isinstance(value, str):
        text = value if len(value) <= longest else f"{value[:longest]}..."
        if not bare:
            return repr(text)
        return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    try:
        text = _brief.repr(value)
    except ValueError:  # Python does not print integers of over 4300 digits
        text = f"a value of type {type(value).__name__}"
    return text if len(text) <= 4 * _LONGEST else f"{text[: 4 * _LONGEST]}..."
