"""Processes of this computer that share the designs of a search, and end when it ends."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeVar

from pteron.errors import PteronError
from pteron.maps.held_interrupts import held_interrupts

if TYPE_CHECKING:
    import polars as pl

    from pteron.design.task import Task

_Job = TypeVar("_Job")

_LOOK = 0.2
"""Seconds after which a wait looks for Ctrl-C."""


class Pool(ProcessPoolExecutor):
    """Processes that leave Ctrl-C to this one, and end with it or where the work is broken off.

    Each calls `begin` with what is given before its first job.
    """

    def __init__(self, workers: int, begin: Callable[..., None], *arguments: Any) -> None:
        super().__init__(workers, get_context("spawn"), _initialise_worker, (begin, *arguments))
        self._others = set(active_children())

    def submit(self, function: Any, /, *given: Any, **named: Any) -> Future[Any]:
        """Give the processes a call, and start one where none is free."""
        with held_interrupts():
            return super().submit(function, *given, **named)

    def __exit__(self, kind: Any, *error: Any) -> bool | None:
        """End the processes, at once where the work is broken off."""
        if kind is not None:
            for process in set(active_children()) - self._others:
                process.terminate()
        return super().__exit__(kind, *error)


def _initialise_worker(begin: Callable[..., None], *arguments: Any) -> None:
    """Begin a process, which ends with the one that asked, and ignores Ctrl-C as what it starts."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()
    begin(*arguments)


def _end_with_parent() -> None:
    """End this process when that which asked has ended, even if it was killed."""
    parent = parent_process()
    assert parent is not None  # this one was spawned
    parent.join()
    os._exit(1)


class Processes:
    """Processes that hold the task of a search, and return tables of its designs."""

    def __init__(self, pool: Pool) -> None:
        self._pool = pool

    def tables(
        self,
        function: Callable[[Task, Sequence[_Job]], pl.DataFrame],
        chunks: Mapping[int, Sequence[_Job]],
    ) -> Callable[[int], pl.DataFrame]:
        """Begin with the jobs of numbered chunks; return what waits for the rows of a chunk.

        Each job goes to the process that is free next, those of the last chunk first: it has the
        designs that take longest.
        """
        pending = {
            number: [self._pool.submit(_call_in_process, function, job) for job in chunks[number]]
            for number in sorted(chunks, reverse=True)
        }
        return lambda number: _table(pending[number])


def _table(pending: Sequence[Future[pl.DataFrame]]) -> pl.DataFrame:
    import polars as pl

    try:
        table: pl.DataFrame = pl.concat(map(_result, pending), rechunk=True)
    except BrokenProcessPool:
        raise PteronError(
            "a process that did a part of the work was ended: is there enough memory? what is "
            "finished is kept in the folder, if one is given: run it again"
        ) from None
    return table


def _result(pending: Future[pl.DataFrame]) -> pl.DataFrame:
    # Polars, once imported, lets a wait without end go on through Ctrl-C.
    while not wait([pending], _LOOK).done:
        pass
    return pending.result()


@contextmanager
def processes(task: Task, workers: int) -> Iterator[Processes | None]:
    """Yield so many processes for a task; None where one is asked for, which is this one."""
    if workers < 2:
        yield None
        return
    with Pool(workers, _begin, task) as pool:
        yield Processes(pool)


_task: Any = None


def _begin(task: Task) -> None:
    global _task
    _task = task


def _call_in_process(function: Callable[[Task, Sequence[_Job]], pl.DataFrame], job: _Job) -> Any:
    return function(_task, [job])
