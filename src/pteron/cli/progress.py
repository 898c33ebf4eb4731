"""Progress of long work, on standard error: a spinner, a bar, and the time of each stage."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TYPE_CHECKING

from pteron.cli.terminal import plain

if TYPE_CHECKING:
    from rich.progress import Progress

_SHORT = 0.05
"""Time below which a stage is not listed, s."""

_APART = 1.0
"""Time between the shares that a rate is taken from, s."""

_UNKNOWN, _LITTLE = 5.0, 0.02
"""Time, s, and share of the work, before which the time that is left is not known."""

_RECENT = 60.0
"""Time that a rate is taken over at least, s."""


def is_watched() -> bool:
    """Say whether a person watches standard error.

    Rich takes FORCE_COLOR for one, which Jupyter and build servers set: colours are meant, not
    pictures that move.
    """
    return sys.stderr.isatty()


@contextmanager
def spinner(task: str) -> Iterator[None]:
    """Show a person that work of unknown length goes on."""
    if not is_watched():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(plain(task)):
        yield


@contextmanager
def progress_bar(task: str) -> Iterator[Callable[[float], None]]:
    """Show a person how much of long work is done, and what time it needs yet.

    The callable takes the share, from 0 to 1; what it takes first may have been done before.
    """
    estimate = TimeLeft()
    with _bar(estimate) as progress:
        number = progress.add_task(plain(task), total=1.0)

        def tell(share: float) -> None:
            estimate.tell(share)
            progress.update(number, completed=share)

        yield tell


class TimeLeft:
    """The time that work still needs, by its recent rate.

    Work that goes on where an earlier run was ended begins with what that had done, at no rate.
    While nothing is done the time grows, since the rate is that up to now.

    Parameters
    ----------
    clock : callable
        Returns the time, s.
    """

    def __init__(self, clock: Callable[[], float] = perf_counter) -> None:
        self._clock = clock
        self._told: deque[tuple[float, float]] = deque()
        self._first: tuple[float, float] | None = None
        self._share = 0.0

    def tell(self, share: float) -> None:
        """Take the share that is done, from 0 to 1."""
        now = self._clock()
        self._share = share
        if self._first is None:
            self._first = now, share
        if not self._told or now - self._told[-1][0] >= _APART:
            self._told.append((now, share))
        # The rate counts over half of the time, or all of a short one.
        since = now - max(_RECENT, 0.5 * (now - self._first[0]))
        while len(self._told) > 1 and self._told[1][0] <= since:
            self._told.popleft()

    def seconds(self) -> float | None:
        """Return what time is left, s; None as long as that is not known."""
        if self._first is None:
            return None
        now, (began, base) = self._clock(), self._first
        (start, earlier_share), share = self._told[0], self._share
        if (
            now - began < _UNKNOWN
            or share - base < _LITTLE * (1.0 - base)
            or share <= earlier_share
        ):
            return None
        return (now - start) * max(1.0 - share, 0.0) / (share - earlier_share)

    def words(self) -> str:
        """Return what time is left in words, of two digits; empty as long as it is not known."""
        seconds = self.seconds()
        if seconds is None:
            return ""
        for name, unit in (("s", 1.0), ("min", 60.0)):
            if seconds < 90.0 * unit:
                return f"about {float(f'{seconds / unit:.2g}'):.0f} {name} left"
        return f"about {float(f'{seconds / 3600.0:.2g}'):g} h left"


@contextmanager
def stages(task: str, rows: int) -> Iterator[Callable[[str, int, int], None]]:
    """Show a bar for each stage of long work, and between them that the work goes on.

    The callable takes a stage's name, how many of its rows are done, and how many there are: no
    more than are done where the stage does not know, which then has `rows`.
    """
    with _bar() as progress:
        number = progress.add_task(plain(task), total=None)
        stage, done_rows = "", 0

        def tell(name: str, done: int, total: int) -> None:
            nonlocal done_rows, stage
            if name != stage:
                progress.reset(number, total=max(total, rows), description=plain(name))
                stage, done_rows = name, 0
            # The rows of a stage's next file are counted anew.
            progress.update(number, advance=done - done_rows if done >= done_rows else done)
            done_rows = done
            if done >= max(total, rows):
                progress.reset(number, total=None, description=plain(task))
                stage = ""

        yield tell


def _bar(estimate: TimeLeft | None = None) -> Progress:
    from rich import progress
    from rich.console import Console
    from rich.text import Text

    class Left(progress.ProgressColumn):
        def render(self, task: progress.Task) -> Text:
            return Text("" if estimate is None else estimate.words())

    return progress.Progress(
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.TaskProgressColumn(),
        progress.TimeRemainingColumn() if estimate is None else Left(),
        console=Console(stderr=True),
        disable=not is_watched(),
        transient=True,
    )


class Times:
    """The times of the stages of long work; it is called as a bar of `stages` is."""

    def __init__(self, tell: Callable[[str, int, int], None]) -> None:
        self._tell = tell
        self._spent: dict[str, float] = {}
        self._stage, self._since = "", perf_counter()

    def __call__(self, name: str, done: int, total: int) -> None:
        """Take a stage's name, and how much of it is done."""
        self._end(name)
        # Some stages tell of themselves as they go on, others when they begin.
        self._stage = "" if done else name
        self._tell(name, done, total)

    def summary(self) -> str:
        """Return the stages with their times, in a line."""
        self._end("")
        spans = ((name, spent) for name, spent in self._spent.items() if name and spent > _SHORT)
        return f"Time: {', '.join(f'{name.lower()} {spent:.1f} s' for name, spent in spans)}"

    def _end(self, name: str) -> None:
        now, stage = perf_counter(), self._stage or name
        self._spent[stage] = self._spent.get(stage, 0.0) + now - self._since
        self._since = now
