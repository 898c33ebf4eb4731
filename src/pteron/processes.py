"""Processes of this computer that share work, and end with the process that started them."""

from __future__ import annotations

import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from threading import Thread, current_thread, main_thread
from types import ModuleType
from typing import Any, TypeVar

from pteron.errors import PteronError

_Job = TypeVar("_Job")

_LOOK = 0.2
"""Seconds after which a wait looks for Ctrl-C and for messages."""

_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Environment of the processes: together they have a thread for each core, and no more."""


class LostWorkerError(PteronError):
    """A worker process was ended from outside, or could not start."""


class WorkerPool(ProcessPoolExecutor):
    """Worker processes that ignore Ctrl-C, and end with this process or on cancellation.

    Parameters
    ----------
    workers : int
        Number of processes. Each starts when there is work for it.
    shared : object, optional
        First argument of the calls of `start`. It crosses to each process once, which keeps it.
    script : bool
        Whether they run the caller's script, where its functions and classes are. It must then
        ask for them under ``if __name__ == "__main__":``.

    Raises
    ------
    PteronError
        If `shared` cannot cross to other processes; `start` if they cannot import it.
    """

    def __init__(self, workers: int, shared: Any = None, *, script: bool = True) -> None:
        context = get_context("spawn")
        self._messages, self._script = context.SimpleQueue(), script
        try:
            pickled = pickle.dumps(shared)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise _import_error(error) from None
        super().__init__(workers, context, _initialise_worker, (pickled, self._messages))
        self._others = set(active_children())

    def submit(self, function: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
        """Submit a call to the worker processes; return its future."""
        main = sys.modules["__main__"]
        with held_interrupts(), _environment(_ONE_THREAD):
            try:
                if not self._script:
                    sys.modules["__main__"] = ModuleType("__main__")
                return super().submit(function, *arguments, **options)
            except (BrokenProcessPool, OSError, ValueError):
                # Python 3.10 and 3.11 close the pipes of a pool whose first process has ended while
                # another one starts: it then finds a closed pipe (OSError), or its descriptor used
                # twice (ValueError).
                raise _lost_worker() from None
            finally:
                sys.modules["__main__"] = main

    def start(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Call a function in a worker, with the pool's shared object first; return the future."""
        return self.submit(_call_with_shared, function, *arguments)

    def messages(
        self, function: Callable[[_Job, Callable[[Any], None]], Any], jobs: Sequence[_Job]
    ) -> Iterator[tuple[int, Any]]:
        """Yield (job index, message) as workers send messages; a job's result is its last.

        `function` is called with a job and a callable that sends a message.
        """
        pending = {self.submit(_call, function, k, job): k for k, job in enumerate(jobs)}
        while pending:
            ready, _ = wait(pending, _LOOK, FIRST_COMPLETED)
            while not self._messages.empty():
                yield self._messages.get()
            for future in ready:
                yield pending.pop(future), result_of(future)

    def __exit__(self, kind: Any, *error: Any) -> bool | None:
        """End the worker processes: at once after an exception, else when they are done."""
        if kind is not None:
            for process in set(active_children()) - self._others:
                process.terminate()
        return super().__exit__(kind, *error)


def result_of(future: Future[Any]) -> Any:
    """Wait for a call and return its result, or raise its error.

    Raises
    ------
    LostWorkerError
        If one of the pool's processes was ended.
    """
    # Polars, once imported, lets a wait without end go on through Ctrl-C.
    while not wait([future], _LOOK).done:
        pass
    try:
        return future.result()
    except BrokenProcessPool:
        raise _lost_worker() from None


def _lost_worker() -> LostWorkerError:
    """Return the error that a worker process was ended from outside."""
    return LostWorkerError(
        "a process that did a part of the work was ended: is there enough memory? what is "
        "finished is kept in the folder, if one is given: run it again"
    )


_shared: Any = None
_queue: Any = None


def _import_error(error: Exception) -> PteronError:
    """Return the error that a worker process cannot import the function of its job."""
    return PteronError(
        f"other processes cannot take part: {type(error).__name__}: {error}; define functions and "
        "classes at the top of a module that can be imported, or do the work without workers"
    )


def _initialise_worker(pickled: bytes, messages: Any) -> None:
    """Ignore SIGINT, exit when the parent does, and store the object that calls share."""
    global _shared, _queue
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_exit_with_parent, daemon=True).start()
    _queue = messages
    try:
        _shared = pickle.loads(pickled)
    except Exception as error:  # whatever an import raises is for the caller to see
        _shared = _import_error(error)


def _exit_with_parent() -> None:
    """Exit this process when its parent has ended, even if that was killed."""
    parent = parent_process()
    assert parent is not None  # this one was spawned
    parent.join()
    os._exit(1)


def _call_with_shared(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the result of a function called with the worker's shared object first."""
    if isinstance(_shared, PteronError):
        raise _shared
    return function(_shared, *arguments)


def _call(function: Callable[[Any, Callable[[Any], None]], Any], k: int, job: Any) -> Any:
    """Return a function's result on job number k; it can send messages by a callback."""
    return function(job, lambda message: _queue.put((k, message)))


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """In this context, set environment variables, for processes that are started."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, setting in before.items():
            if setting is None:
                del os.environ[name]
            else:
                os.environ[name] = setting


@contextmanager
def held_interrupts() -> Iterator[None]:
    """In this context, defer SIGINT (Ctrl-C); processes started here ignore it.

    A new process imports for seconds before it can ignore SIGINT, and prints an error if it is
    interrupted meanwhile. Python's resource tracker unblocks signals when it starts: it must have
    started before, as it has once there is a pool of processes.
    """
    heard: list[int] = []
    usual = signal.getsignal(signal.SIGINT)
    # Signals are handled in the main thread alone; a handler that is not Python's stays.
    mine = usual is not None and current_thread() is main_thread()
    if mine:
        signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    masks = hasattr(signal, "pthread_sigmask")
    if masks:
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        if masks:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if mine:
            signal.signal(signal.SIGINT, usual)
        if heard:
            signal.raise_signal(signal.SIGINT)
