"""Progress of long work, on standard error: a spinner, a bar, and the time of each stage."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TYPE_CHECKING

from pteron.cli.terminal import plain

if TYPE_CHECKING:
    from rich.progress import Progress

_SHORT = 0.05
"""Time below which a stage is not listed, s."""


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
    """Show a person how much of long work is done: the callable takes the share, from 0 to 1."""
    with _bar() as progress:
        number = progress.add_task(plain(task), total=1.0)
        yield lambda share: progress.update(number, completed=share)


@contextmanager
def stages(task: str, rows: int) -> Iterator[Callable[[str, int, int], None]]:
    """Show a bar for each stage of long work, and between them that the work goes on.

    The callable takes a stage's name, how many of its rows are done, and how many there are: no
    more than are done where the stage does not know, which then has `rows`.
    """
    with _bar() as progress:
        number = progress.add_task(plain(task), total=None)
        stage, before = "", 0

        def tell(name: str, done: int, total: int) -> None:
            nonlocal before, stage
            if name != stage:
                progress.reset(number, total=max(total, rows), description=plain(name))
                stage, before = name, 0
            # The rows of a stage's next file are counted anew.
            progress.update(number, advance=done - before if done >= before else done)
            before = done
            if done >= max(total, rows):
                progress.reset(number, total=None, description=plain(task))
                stage = ""

        yield tell


def _bar() -> Progress:
    from rich import progress
    from rich.console import Console

    return progress.Progress(
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.TaskProgressColumn(),
        progress.TimeRemainingColumn(),
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

    def told(self) -> str:
        """Return the stages with their times, in a line."""
        self._end("")
        found = ((name, spent) for name, spent in self._spent.items() if name and spent > _SHORT)
        return f"Time: {', '.join(f'{name.lower()} {spent:.1f} s' for name, spent in found)}"

    def _end(self, name: str) -> None:
        now, stage = perf_counter(), self._stage or name
        self._spent[stage] = self._spent.get(stage, 0.0) + now - self._since
        self._since = now
