"""Sweeps: one function on many chunks, in this process, in several, or on a cluster.

Chunks are numbered by a plan that depends on nothing but the task. The process that has computed a
chunk writes it, whole or not at all: a killed process loses its present chunk only, a chunk that is
computed twice is written twice alike, and the result does not depend on who computed what.
`dask.distributed` hands the chunks out, again after a worker is gone.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from functools import partial
from importlib.metadata import version
from itertools import islice
from multiprocessing import resource_tracker
from typing import Any, Protocol, TypeVar

from pteron.errors import DataError, PteronError
from pteron.extras import import_extra
from pteron.processes import held_interrupts
from pteron.progress import Progress
from pteron.shapes import Workers

_Chunk = TypeVar("_Chunk")
_Result = TypeVar("_Result")
_Written = TypeVar("_Written", contravariant=True)

_WAIT = 10.0
"""Seconds after which a scheduler, or its first worker, is taken for absent."""

_START = 300.0
"""Seconds that processes of a busy computer may take to start."""

_GONE = 60.0
"""Seconds that a cluster without any worker may take to get another."""

_AGAIN = "what is finished is kept: run it again"
"""Advice at the end of errors."""

_AHEAD = 4
"""Chunks for each thread that a cluster is given at a time: a sweep may have millions."""


class Store(Protocol[_Written]):
    """A place for a sweep's results. It crosses to other processes, which must reach it."""

    def finished_chunks(self) -> Collection[int]:
        """Return the numbers of the chunks that are written."""

    def write(self, number: int, rows: _Written) -> None:
        """Write a chunk's result; the chunk counts as finished only once this returns."""


def sweep(
    function: Callable[[_Chunk], _Result],
    chunks: Sequence[_Chunk],
    store: Store[_Result],
    *,
    scheduler: str | None = None,
    workers: Workers | None = None,
    threads: Workers = 1,
    progress: Progress | None = None,
) -> int:
    """Compute the chunks missing in a store, and write each result to the store.

    A sweep that was ended, by whatever, is resumed by the same call.

    Parameters
    ----------
    function : callable
        Takes a chunk and returns what the store writes. For other processes it must be found by
        its module and name, as a function of a module is, or a `functools.partial` of one.
    chunks : sequence
        The work, in the plan's order; the k-th is the store's number k.
    store : Store
        The place for the results, such as a `TableStore`.
    scheduler : str, optional
        The address of a Dask scheduler, such as ``tcp://host:8786``, whose workers do the work.
        They reach the store by the same path as this process does. It has no lock of its own: who
        reaches it can run programs on the workers.
    workers : int, optional
        Processes of this computer that do the work; by default this process does it. A script that
        asks for them does so under ``if __name__ == "__main__":``, as Python's `multiprocessing`
        wants it.
    threads : int
        Number of threads that share the work in this process, for functions that leave Python's
        lock to others. The first chunk is computed alone: what it builds, the others share.
    progress : callable, optional
        Takes the share of the chunks that are finished, at first and after each.

    Returns
    -------
    int
        Number of chunks that were computed: none where the store had them all.

    Raises
    ------
    DataError
        If `scheduler` and `workers` are both given, or there are no workers or threads.
    ModelError
        If `dask.distributed` is not installed: the extra `cluster` brings it.
    PteronError
        If the scheduler does not answer, has no workers, or those have another version of Pteron;
        if it ends meanwhile, or all its workers do, or a chunk ends one worker after another. What
        the function raises comes as it is.
    """
    if scheduler is not None and workers is not None:
        raise DataError("scheduler and workers given; a scheduler has its own workers: give one")
    # A store that was written for version 0.1 calls them `finished`.
    finished_chunks = getattr(store, "finished_chunks", None) or getattr(store, "finished")  # noqa: B009
    done = set(finished_chunks())
    remaining = [k for k in range(len(chunks)) if k not in done]
    total, ready = len(chunks), len(chunks) - len(remaining)
    tell = progress or (lambda share: None)
    tell(ready / total if total else 1.0)
    if not remaining:
        return 0
    tasks = ((k, chunks[k]) for k in remaining)
    task = partial(_compute_chunk, function, store)
    finished = (
        _run_here(task, tasks, threads)
        if scheduler is None and workers is None
        else _run_elsewhere(task, tasks, scheduler, workers)
    )
    for count, _ in enumerate(finished, start=ready + 1):
        tell(count / total)
    return len(remaining)


def _compute_chunk(
    function: Callable[[_Chunk], _Result], store: Store[_Result], number: int, chunk: _Chunk
) -> None:
    """Compute a chunk's result and write it to the store."""
    store.write(number, function(chunk))


def _run_here(
    task: Callable[[int, Any], None], tasks: Iterator[tuple[int, Any]], threads: int
) -> Iterator[None]:
    """Do the tasks in this process; yield after each."""
    for numbered_chunk in islice(tasks, 1 if threads > 1 else None):
        task(*numbered_chunk)
        yield
    with ThreadPoolExecutor(threads) as pool:
        pending = {
            pool.submit(task, *numbered_chunk) for numbered_chunk in islice(tasks, _AHEAD * threads)
        }
        try:
            while pending:
                ready, pending = wait(pending, return_when=FIRST_COMPLETED)
                for future in ready:
                    yield future.result()
                pending |= {
                    pool.submit(task, *numbered_chunk)
                    for numbered_chunk in islice(tasks, len(ready))
                }
        finally:
            for future in pending:
                future.cancel()


def _run_elsewhere(
    task: Callable[[int, Any], None],
    tasks: Iterator[tuple[int, Any]],
    scheduler: str | None,
    workers: int | None,
) -> Iterator[None]:
    """Do the tasks in other processes; yield after each."""
    distributed = _import_distributed()

    def submit_chunk(numbered_chunk: tuple[int, Any]) -> Future[None]:
        """Return the future of a chunk, with its number, submitted to the cluster."""
        # Each is a task of its own: that its result is none does not mean it is not needed.
        future: Future[None] = client.submit(task, *numbered_chunk, pure=False)
        return future

    where = "local workers" if scheduler is None else f"scheduler {scheduler}"
    patience = _START if scheduler is None else _GONE
    with _quiet(), _client(where, scheduler, workers) as client:
        with _told_if_lost(where):
            ahead = _AHEAD * max(1, sum(client.nthreads().values()))
            pending = {submit_chunk(numbered_chunk) for numbered_chunk in islice(tasks, ahead)}
        alone = 0.0
        while pending:
            with _told_if_lost(where):
                try:
                    ready, pending = distributed.wait(pending, _WAIT, "FIRST_COMPLETED")
                except TimeoutError:
                    alone = 0.0 if client.nthreads() else alone + _WAIT
                    ready = ()
            if alone >= patience:
                raise PteronError(f"{where}: has no workers any more; {_AGAIN}")
            for future in ready:
                alone = 0.0
                _settle(future, where)
                yield
                with _told_if_lost(where):
                    pending |= {submit_chunk(numbered_chunk) for numbered_chunk in islice(tasks, 1)}


def _settle(future: Future[None], where: str) -> None:
    """Raise the error that ended a task, if any."""
    try:
        future.result()
    except _import_distributed().KilledWorker as error:
        raise PteronError(
            f"a chunk has ended {error.allowed_failures + 1} workers one after another: do they "
            f"have enough memory? {_AGAIN}"
        ) from None
    except CancelledError:
        raise _lost_workers_error(where) from None


@contextmanager
def _told_if_lost(where: str) -> Iterator[None]:
    """Raise PteronError, in a block, where a scheduler no longer answers."""
    try:
        yield
    except (CancelledError, OSError, RuntimeError):
        raise _lost_workers_error(where) from None


def _lost_workers_error(where: str) -> PteronError:
    """Return the error that a Dask cluster has ended or is no longer connected."""
    return PteronError(f"{where}: has ended, or its connection has; {_AGAIN}")


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence Dask's logs in a block: Pteron reports errors itself."""
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def local_workers(count: int | None) -> Any:
    """Return a cluster of processes of this computer."""
    cluster = _import_distributed().LocalCluster
    if os.name == "posix":
        resource_tracker.ensure_running()
    with held_interrupts():
        # One thread each: its kernels then share no lock with another's.
        return cluster(
            n_workers=count,
            threads_per_worker=1,
            dashboard_address=None,
            silence_logs=logging.CRITICAL,
        )


@contextmanager
def _client(where: str, scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """Yield a client of a cluster that answers and has this version of Pteron."""
    distributed = _import_distributed()
    with ExitStack() as opened:
        address = scheduler or opened.enter_context(local_workers(workers))
        limit = _START if scheduler is None else _WAIT
        try:
            client = opened.enter_context(distributed.Client(address, timeout=limit))
        except (OSError, ValueError, TypeError) as error:
            raise PteronError(
                f"{where}: does not answer ({str(error).splitlines()[0]}); start one with: "
                "dask scheduler"
            ) from None
        try:
            client.wait_for_workers(1, timeout=limit)
        except TimeoutError:
            raise PteronError(
                f"{where}: has no workers; start some with: dask worker {scheduler}"
            ) from None
        here = version("pteron")
        for worker, worker_version in client.run(version, "pteron", on_error="return").items():
            if worker_version != here:
                version_words = (
                    "none" if isinstance(worker_version, BaseException) else worker_version
                )
                raise PteronError(
                    f"{where}: worker {worker} has Pteron {version_words}, {here} expected; "
                    "install the same there"
                )
        yield client


def _import_distributed() -> Any:
    """Return `dask.distributed`, whose functions have no types."""
    return import_extra("cluster", "distributed", "other processes need dask.distributed")


def cores() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
