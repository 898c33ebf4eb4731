"""Processes of this computer that share the designs of a search, and end when it ends."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.process import BaseProcess
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeVar

from pteron.errors import PteronError

if TYPE_CHECKING:
    import polars as pl

    from pteron.design.task import Task

_Job = TypeVar("_Job")


class Processes:
    """Processes that hold the task of a search, and return tables of its designs."""

    def __init__(self, pool: ProcessPoolExecutor) -> None:
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
            number: [self._pool.submit(_in_process, function, job) for job in chunks[number]]
            for number in sorted(chunks, reverse=True)
        }
        return lambda number: _table(pending[number])


def _table(pending: Sequence[Future[pl.DataFrame]]) -> pl.DataFrame:
    import polars as pl

    try:
        found: pl.DataFrame = pl.concat([one.result() for one in pending], rechunk=True)
    except BrokenProcessPool:
        raise PteronError(
            "a process that did a part of the work was ended: is there enough memory? what is "
            "finished is kept in the folder, if one is given: run it again"
        ) from None
    return found


@contextmanager
def processes(task: Task, workers: int) -> Iterator[Processes | None]:
    """Yield so many processes for a task; None where one is asked for, which is this one."""
    if workers < 2:
        yield None
        return
    context, others = get_context("spawn"), set(active_children())
    with ProcessPoolExecutor(workers, context, _begin, (task,)) as pool, ended_with(others):
        yield Processes(pool)


@contextmanager
def ended_with(others: set[BaseProcess]) -> Iterator[None]:
    """End the processes that were started since, where the work is broken off."""
    try:
        yield
    except BaseException:
        for process in set(active_children()) - others:
            process.terminate()
        raise


def begin_process() -> None:
    """Let this process, which was spawned, leave Ctrl-C to the one that asked, and end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when that which asked has ended, even if it was killed."""
    parent = parent_process()
    assert parent is not None  # this one was spawned
    parent.join()
    os._exit(1)


_task: Any = None


def _begin(task: Task) -> None:
    global _task
    _task = task
    begin_process()


def _in_process(function: Callable[[Task, Sequence[_Job]], pl.DataFrame], job: _Job) -> Any:
    return function(_task, [job])
