"""Progress of long work, on standard error: a spinner, a bar, and the time of each stage."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TYPE_CHECKING

from pteron.cli.terminal import is_interactive, plain

if TYPE_CHECKING:
    from rich import progress as rich_progress

    from pteron.progress import Progress

_SHORT = 0.05
"""Time below which a stage is not listed, s."""

_APART = 1.0
"""Least time between the progress reports from which a rate of work is computed, s."""

_UNKNOWN, _LITTLE = 5.0, 0.02
"""Time, s, and share of the work, before which the time that is left is not known."""

_RECENT = 60.0
"""Least time over which a rate of work is computed, s."""


@contextmanager
def spinner(task: str) -> Iterator[None]:
    """Show a person that work of unknown length goes on."""
    if not is_interactive():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(plain(task)):
        yield


@contextmanager
def progress_bar(task: str) -> Iterator[Progress]:
    """Show a person how much of long work is done, and what time it needs yet.

    The callable takes the share, from 0 to 1; what it takes first may have been done before.
    """
    estimate = TimeLeft()
    with _bar(estimate) as progress:
        number = progress.add_task(plain(task), total=1.0)

        def tell(share: float) -> None:
            """Update the bar's share, 0 to 1, its step's text and the time remaining."""
            estimate.tell(share)
            text = plain(getattr(share, "step", "") or task)
            is_new = text != progress.tasks[number].description
            progress.update(number, completed=share, description=text, refresh=is_new)

        yield tell


class TimeLeft:
    """The estimated time remaining, from the recent rate of work.

    Work that goes on where an earlier run was ended begins with what that had done, at no rate.
    While nothing is done the time grows, since the rate is that up to now.

    Parameters
    ----------
    clock : callable
        Returns the time, s.
    """

    def __init__(self, clock: Callable[[], float] = perf_counter) -> None:
        self._clock = clock
        self._reported: deque[tuple[float, float]] = deque()
        self._first: tuple[float, float] | None = None
        self._share = 0.0

    def tell(self, share: float) -> None:
        """Record the share of the work that is done, from 0 to 1."""
        now = self._clock()
        self._share = share
        if self._first is None:
            self._first = now, share
        if not self._reported or now - self._reported[-1][0] >= _APART:
            self._reported.append((now, share))
        # The rate counts over half of the time, or all of a short one.
        since = now - max(_RECENT, 0.5 * (now - self._first[0]))
        while len(self._reported) > 1 and self._reported[1][0] <= since:
            self._reported.popleft()

    def seconds(self) -> float | None:
        """Return the estimated time remaining, s; None while it is unknown."""
        if self._first is None:
            return None
        now, (began, base) = self._clock(), self._first
        (start, earlier_share), share = self._reported[0], self._share
        if (
            now - began < _UNKNOWN
            or share - base < _LITTLE * (1.0 - base)
            or share <= earlier_share
        ):
            return None
        return (now - start) * max(1.0 - share, 0.0) / (share - earlier_share)

    def words(self) -> str:
        """Return the time remaining in words, with two digits; empty while it is unknown."""
        seconds = self.seconds()
        if seconds is None:
            return ""
        for name, unit in (("s", 1.0), ("min", 60.0)):
            if seconds < 90.0 * unit:
                return f"about {float(f'{seconds / unit:.2g}'):.0f} {name} left"
        return f"about {float(f'{seconds / 3600.0:.2g}'):g} h left"


def _bar(estimate: TimeLeft) -> rich_progress.Progress:
    """Return a progress bar on standard error that shows the time remaining."""
    from rich import progress
    from rich.console import Console
    from rich.text import Text

    class Left(progress.ProgressColumn):
        def render(self, task: progress.Task) -> Text:
            """Return the estimate of the time remaining as text."""
            return Text(estimate.words())

    return progress.Progress(
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.TaskProgressColumn(),
        Left(),
        console=Console(stderr=True),
        disable=not is_interactive(),
        transient=True,
    )


class Times:
    """The time of each step of long work, measured by a progress callable."""

    def __init__(self, tell: Progress) -> None:
        self._tell = tell
        self._spent: dict[str, float] = {}
        self._step, self._since = "", perf_counter()

    def __call__(self, share: float) -> None:
        """Record the share of the work that is done, with the name of its step."""
        self.begin(getattr(share, "step", ""))
        self._tell(share)

    def begin(self, step: str) -> None:
        """Count the time from here on for a step."""
        now = perf_counter()
        self._spent[self._step] = self._spent.get(self._step, 0.0) + now - self._since
        self._step, self._since = step, now

    def summary(self) -> str:
        """Return the steps with their times, in a line."""
        self.begin("")
        spans = ((name, spent) for name, spent in self._spent.items() if name and spent > _SHORT)
        return f"Time: {', '.join(f'{name.lower()} {spent:.1f} s' for name, spent in spans)}"
