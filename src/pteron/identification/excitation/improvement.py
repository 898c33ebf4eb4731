"""Improvement of random motions in stages: better conditioning, limits kept between samples too."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from queue import SimpleQueue

import numpy as np

from pteron.identification.excitation.fourier import FourierMotion
from pteron.identification.excitation.margins import relative_margins
from pteron.identification.excitation.random_motions import within_limits
from pteron.identification.excitation.search_program import Setting, minimised
from pteron.kernels import Array

_NEAR = 0.5
"""A limit whose margin at the start is above this share of its size is left out until it is
violated: it would cost time."""

_CHECKED = 200
"""Samples in a period of the highest harmonic in which violations are sought."""


@dataclass(frozen=True)
class Round:
    """A round of the improvement: its stages."""

    doublings: tuple[int, ...]
    """Sharpness of each stage's measure: the blunt one has wide valleys, the sharp one is all but
    the condition number."""
    exchanges: int
    """Further stages: instants where limits are violated between samples join the program."""
    thorough: bool
    """Whether exchanges go on when a motion that keeps the limits has been found."""

    @property
    def stages(self) -> int:
        """Number of stages, exchanges included."""
        return len(self.doublings) + self.exchanges


ROUNDS = {
    "condition": (Round((0,), 2, False), Round((2, 4), 3, True)),
    "logdet": (Round((0,), 2, False), Round((0,), 3, True)),
}
"""For each criterion, the round for all starts, and that for the best of them."""


@dataclass(frozen=True, eq=False)
class Improvement:
    """The state of the improvement of one start."""

    number: int
    setting: Setting
    plan: Round
    safe: FourierMotion
    """The last motion found that keeps all limits; the start at first."""
    seconds: float
    """Time left, s."""
    stage: int = 0
    """Number of stages done."""
    current: FourierMotion | None = None
    """The motion from which the next stage begins: it need not keep the limits; None for `safe`."""
    watched: tuple[str, ...] = ()
    """The limits that the program keeps, by name."""
    instants: Array = field(default_factory=lambda: np.empty(0))
    """Instants at which it keeps them beside its own samples (E,), s."""
    improved: bool = False
    """Whether the last stage found a motion that keeps all limits."""
    ended: bool = False
    finished: bool = False
    """Whether it was done thoroughly."""

    def next(self) -> Improvement:
        """Do one stage."""
        if self.seconds <= 0.0:
            return replace(self, improved=False, ended=True)
        begin = time.monotonic()
        plan, start = self.plan, self.current or self.safe
        watched = self.watched or _near(start, self.setting)
        coefficients = minimised(
            self.setting,
            start.coefficients,
            plan.doublings[min(self.stage, len(plan.doublings) - 1)],
            watched,
            self.instants,
            self.seconds,
        )
        ended = self.stage == plan.stages - 1
        finished = ended and time.monotonic() < begin + self.seconds
        done = replace(self, stage=self.stage + 1, watched=watched, improved=False, current=None)
        if coefficients is not None:
            # A motion that does not keep the limits yet is still a place to go on from.
            motion = start.with_coefficients(coefficients)
            kept = within_limits(motion, self.setting.limits)
            violated, instants = _violations(motion, self.setting)
            good = not violated or (kept is not None and not plan.thorough)
            finished = finished or (self.stage >= len(plan.doublings) - 1 and good)
            done = replace(
                done,
                safe=kept or self.safe,
                current=kept or motion,
                improved=kept is not None,
                watched=tuple(dict.fromkeys([*watched, *violated])),
                instants=np.unique(np.concatenate([self.instants, instants])),
            )
        left = self.seconds - (time.monotonic() - begin)
        return replace(done, seconds=left, ended=ended or finished, finished=finished)


def improved(starts: Sequence[Improvement], workers: int) -> Generator[Improvement, None, None]:
    """Yield every start after each of its stages, done by so many processes; by this one if one.

    A start whose process fails is improved here; where the iteration is given up, all are ended.
    """
    if workers > 1:
        failed: list[Improvement] = []
        yield from _in_processes(starts, workers, failed)
        starts = failed
    for one in starts:
        while not one.ended:
            one = one.next()
            yield one


def serve() -> None:
    """Do the stages that come on standard input; their results go to standard output."""
    # Whatever else is printed, by a solver say, must not mix with the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with answers, suppress(EOFError):
        while True:
            pickle.dump(pickle.load(sys.stdin.buffer).next(), answers)
            answers.flush()


def _in_processes(
    starts: Sequence[Improvement], workers: int, failed: list[Improvement]
) -> Iterator[Improvement]:
    """Yield every start after each of its stages, and note those whose processes fail."""
    idle: SimpleQueue[subprocess.Popen[bytes]] = SimpleQueue()

    def next_stage(one: Improvement) -> Improvement:
        process = idle.get()
        try:
            assert process.stdin is not None
            assert process.stdout is not None
            pickle.dump(one, process.stdin)
            process.stdin.flush()
            answer: Improvement = pickle.load(process.stdout)
            return answer
        finally:
            idle.put(process)

    pool = ThreadPoolExecutor(workers)
    with ExitStack() as ends:
        # Last in, first out: no new work, no processes, then no threads that wait for them.
        ends.enter_context(pool)
        for _ in range(workers):
            process = _started()
            ends.callback(_end, process)
            idle.put(process)
        ends.callback(pool.shutdown, wait=False, cancel_futures=True)
        running = {pool.submit(next_stage, one): one for one in starts}
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                before = running.pop(future)
                try:
                    one = future.result()
                except (OSError, EOFError, pickle.UnpicklingError):
                    failed.append(before)
                    continue
                yield one
                if not one.ended:
                    running[pool.submit(next_stage, one)] = one


def _started() -> subprocess.Popen[bytes]:
    # A program of its own: neither CasADi's state and the threads of compilations are inherited,
    # as in a fork, nor is the caller's script run again, as by `multiprocessing`.
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


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    with suppress(OSError), process:
        pass


def _near(motion: FourierMotion, setting: Setting) -> tuple[str, ...]:
    """Return the limits that the motion is near to; the platform's place is always watched."""
    found, always = _margins(motion, setting)[0], ("type_i", "type_ii")
    return tuple(name for name, values in found.items() if name in always or values.min() < _NEAR)


def _violations(motion: FourierMotion, setting: Setting) -> tuple[tuple[str, ...], Array]:
    """Return the limits that are violated, and the instants (E,) of the least margins."""
    found, times = _margins(motion, setting)
    instants = [np.empty(0)]
    for margin in np.hstack(list(found.values())).T:
        # Of a stretch out of reach, all -inf, the first instant counts.
        dip = (margin < 0.0) & (margin <= np.roll(margin, -1)) & (margin < np.roll(margin, 1))
        instants.append(times[dip])
    names = tuple(name for name, values in found.items() if (values < 0.0).any())
    return names, np.concatenate(instants)


def _margins(motion: FourierMotion, setting: Setting) -> tuple[dict[str, Array], Array]:
    times = motion.uniform_times(_CHECKED * motion.harmonics)
    return relative_margins(motion, setting.limits, times), times
