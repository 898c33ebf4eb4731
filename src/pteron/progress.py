"""`Share`, what the callable of an argument `progress` takes, and `Steps`, which reports it.

Every public function that takes `progress` calls it with the share of the work that is done.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

Progress = Callable[[float], None]
"""Takes the share of the work that is done, from 0 to 1; a `Share` where steps have names."""


class Share(float):
    """A share of work that is done, from 0 to 1, and the name of the step that goes on."""

    step: str

    def __new__(cls, share: float, step: str = "") -> Share:
        """Return a share of finished work, 0 to 1, with the name of the current step."""
        number = super().__new__(cls, min(max(share, 0.0), 1.0))
        number.step = step
        return number


class Steps:
    """Reports the progress of work that has several steps.

    The share never falls, also where steps are repeated.

    Parameters
    ----------
    progress : callable, optional
        Takes each `Share`.
    weights : mapping of str to float
        The steps in their order, and how much of the work each is.
    """

    def __init__(self, progress: Progress | None, weights: Mapping[str, float]) -> None:
        self._progress = progress
        total = sum(weights.values())
        self._ends: dict[str, tuple[float, float]] = {}
        start = 0.0
        for step, weight in weights.items():
            self._ends[step] = start, start + weight / total
            start += weight / total
        self._share = 0.0

    def report(self, step: str, share: float = 0.0) -> None:
        """Report that a share (0 to 1) of a step is finished."""
        start, end = self._ends[step]
        self._share = max(self._share, start + (end - start) * min(share, 1.0))
        if self._progress is not None:
            self._progress(Share(self._share, step))

    def end(self) -> None:
        """Report that all steps are finished."""
        if self._progress is not None:
            self._progress(Share(1.0))

    def within(self, step: str) -> Progress:
        """Return a progress callback for a function that does one step of the work."""
        return lambda share: self.report(step, share)
