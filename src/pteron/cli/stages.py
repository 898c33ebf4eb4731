"""How far long work in several stages is, on standard error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from pteron.cli.progress import progress_bar, spinner

__all__ = ["stages"]


@contextmanager
def stages(task: str, rows: int) -> Iterator[Callable[[str, int, int], None]]:
    """Show a bar for each stage, and between them that the work goes on.

    Parameters
    ----------
    task : str
        What is shown where no stage says how far it is.
    rows : int
        How many rows a stage has, where it does not know that itself.

    Yields
    ------
    callable
        To be told a stage's name, how many of its rows are done, and how many there are: no more
        than are done where the stage does not know.
    """
    with ExitStack() as shown:
        shown.enter_context(spinner(task))
        stage = ""
        before = 0
        advance: Callable[[int], None]

        def tell(name: str, done: int, total: int) -> None:
            nonlocal advance, before, stage
            if name != stage:
                shown.close()
                advance = shown.enter_context(progress_bar(name, max(total, rows)))
                stage, before = name, 0
            # The rows of a stage's next file are counted anew.
            advance(done - before if done >= before else done)
            before = done
            if done >= max(total, rows):
                shown.close()
                shown.enter_context(spinner(task))
                stage = ""

        yield tell
