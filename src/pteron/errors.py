"""The errors a user can meet; every one says what was given, what was expected and what to do."""

from __future__ import annotations

from reprlib import Repr

_LONGEST = 60
_brief = Repr()
_brief.maxstring = _brief.maxother = _brief.maxlong = _LONGEST
_brief.maxlevel = 3


class PteronError(ValueError):
    """Root of every error that Pteron raises for something the user can mend."""


class ModelError(PteronError):
    """A manipulator, or the file that describes it, is not a machine Pteron can model."""


class DataError(PteronError):
    """An array, a table or a log does not hold what it should."""


class OutputError(PteronError):
    """A result cannot be written where it was asked for."""


class UnreachablePose(PteronError):
    """A leg is too short, or folds too far, for the pose.

    Attributes
    ----------
    leg : int
        The leg that fails, counted from 1 as in the paper.
    shortfall : float
        By how many metres its links miss the platform point.
    index : tuple of int
        Which element of the batch; empty for a single pose.
    """

    def __init__(self, message: str, *, leg: int, shortfall: float, index: tuple[int, ...]) -> None:
        super().__init__(message)
        self.leg = leg
        self.shortfall = shortfall
        self.index = index


class SingularPose(PteronError):
    """The pose is singular, so that what was asked for is not determined there.

    Attributes
    ----------
    kind : str
        ``"I"`` (a leg stretched or folded), ``"II"`` (the sliders do not hold the platform) or
        ``"elbow"`` (R1 and R3 of a leg coincide, so that its elbow may be anywhere).
    closeness : float
        A number without unit that is 0 at the singularity: the sine of the elbow's angle for
        kind I, the ratio abs(det J) to its largest value over all orientations for kind II.
    index : tuple of int
        Which element of the batch; empty for a single pose.
    """

    def __init__(
        self, message: str, *, kind: str, closeness: float, index: tuple[int, ...]
    ) -> None:
        super().__init__(message)
        self.kind = kind
        self.closeness = closeness
        self.index = index


def shown(value: object, *, bare: bool = False, longest: int = _LONGEST) -> str:
    r"""Return a value as messages show it: short, on one line, without control characters.

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
    >>> shown("1,5"), shown("rho1\x1b[31m", bare=True), shown([1.0] * 9)
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
