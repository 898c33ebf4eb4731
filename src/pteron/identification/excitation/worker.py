"""Starts improved in processes of their own, so that several cores work on several starts.

Processes are started as programs, not forked and not through `multiprocessing`: CasADi's state and
the threads of compilations are not inherited, and the caller's script is not run again.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from queue import Empty, SimpleQueue

from pteron.identification.excitation.fourier import FourierMotion
from pteron.identification.excitation.improvement import Round, Stage, improvements
from pteron.identification.excitation.nonlinear_program import Setting

__all__ = ["Report", "Task", "here", "in_processes", "serve"]


@dataclass(frozen=True)
class Task:
    """A start to be improved, how, and the seconds for it."""

    number: int
    setting: Setting
    start: FourierMotion
    plan: Round
    seconds: float


Report = tuple[int, Stage | None]
"""A task's number and what a stage found; None when the task is done."""


def here(tasks: Sequence[Task]) -> Generator[Report, None, None]:
    """Yield reports on tasks that are done one by one, in this process."""
    for task in tasks:
        for stage in improvements(task.setting, task.start, task.plan, task.seconds):
            yield task.number, stage
        yield task.number, None


def in_processes(tasks: Sequence[Task], workers: int) -> Generator[Report, None, None]:
    """Yield reports on tasks that are done in so many processes at a time.

    A task whose process fails is done here, after the others. When the iteration is given up the
    processes are ended.
    """
    waiting: SimpleQueue[Task] = SimpleQueue()
    reports: SimpleQueue[tuple[Task, Stage | None, bool]] = SimpleQueue()
    for task in tasks:
        waiting.put(task)
    running: list[subprocess.Popen[bytes]] = []

    def work() -> None:
        task = None
        try:
            with _started() as process:
                running.append(process)
                while True:
                    task = waiting.get_nowait()
                    for stage in _answers(process, task):
                        reports.put((task, stage, True))
                    reports.put((task, None, True))
        except Empty:
            return
        except Exception:
            # Whatever it was, the reader waits for a report. What failed in one process, for want
            # of memory say, is not tried in the others.
            if task is not None:
                reports.put((task, None, False))
            with contextlib.suppress(Empty):
                while True:
                    reports.put((waiting.get_nowait(), None, False))

    for _ in range(workers):
        threading.Thread(target=work, daemon=True).start()
    failed = []
    left = len(tasks)
    try:
        while left:
            task, stage, good = reports.get()
            if stage is not None:
                yield task.number, stage
                continue
            left -= 1
            if good:
                yield task.number, None
            else:
                failed.append(task)
    finally:
        with contextlib.suppress(Empty):
            while True:
                waiting.get_nowait()
        for process in running:
            process.kill()
    yield from here(failed)


def serve() -> None:
    """Do the tasks that come on standard input; what they find goes to standard output."""
    # Whatever else is printed, by a solver say, must not mix with the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with answers, contextlib.suppress(EOFError):
        while True:
            task: Task = pickle.load(sys.stdin.buffer)
            for stage in improvements(task.setting, task.start, task.plan, task.seconds):
                pickle.dump(stage, answers)
                answers.flush()
            pickle.dump(None, answers)
            answers.flush()


def _started() -> subprocess.Popen[bytes]:
    code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import serve; serve()"
    return subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        # One thread each, and an interrupt from the keyboard is for the caller to deal with.
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        start_new_session=True,
    )


def _answers(process: subprocess.Popen[bytes], task: Task) -> Iterator[Stage]:
    """Hand a task to a process and yield what it finds."""
    assert process.stdin is not None
    assert process.stdout is not None
    pickle.dump(task, process.stdin)
    process.stdin.flush()
    while (stage := pickle.load(process.stdout)) is not None:
        yield stage
