"""The errors a user can meet; every one says what was given, what was expected and what to do."""

from __future__ import annotations


class PteronError(ValueError):
    """Root of every error that Pteron raises for something the user can mend."""


class ModelError(PteronError):
    """A manipulator, or the file that describes it, is not a machine Pteron can model.

    Attributes
    ----------
    faults : tuple of str
        Every fault of a file, one line each; empty where the message says all.
    """

    def __init__(self, message: str, *, faults: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.faults = faults


class DataError(PteronError):
    """An array, a table or a log does not hold what it should."""


class OutputError(PteronError):
    """A result cannot be written where it was asked for."""


class UnreachablePose(PteronError):
    """A leg is too short, or folds too far, for the pose.

    Attributes
    ----------
    leg : int
        The leg that fails, counted from 1 as in the paper; 0 where no single leg does.
    shortfall : float
        By how many metres it misses the platform point.
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
        ``"I"`` (a leg stretched or folded), ``"II"`` (the actuators do not hold the platform) or
        ``"elbow"`` (the two ends of a leg coincide, so that its elbow may be anywhere).
    measure : float
        The type-I measure of the leg, or the type-II measure of the machine: a number without unit
        that is 0 at the singularity and 1 at best.
    index : tuple of int
        Which element of the batch; empty for a single pose.
    leg : int
        The leg, counted from 1; 0 for kind II.
    """

    def __init__(
        self, message: str, *, kind: str, measure: float, index: tuple[int, ...], leg: int = 0
    ) -> None:
        super().__init__(message)
        self.kind = kind
        self.measure = measure
        self.index = index
        self.leg = leg
