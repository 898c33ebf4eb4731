"""Improvement of random motions in stages: better conditioning, limits kept between samples too."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pteron.identification.excitation.fourier import FourierMotion
from pteron.identification.excitation.margins import relative_margins
from pteron.identification.excitation.random_motions import shrink_into_limits
from pteron.identification.excitation.search_program import Setting, minimise
from pteron.kernels import Array
from pteron.processes import LostWorkerError, WorkerPool

_NEAR = 0.5
"""A limit whose margin at the start is above this share of its size is left out until it is
violated: it would cost time."""

_CHECKED = 200
"""Samples in a period of the highest harmonic in which violations are sought."""


@dataclass(frozen=True)
class Round:
    """A round of the improvement: the stages that each of its starts goes through."""

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


class Stage(NamedTuple):
    """The result of one stage in the improvement of a start."""

    number: int
    """Number of the start."""
    done: int
    """Number of stages done."""
    feasible: FourierMotion | None
    """A motion that keeps all limits, if the stage reached one."""
    ended: bool
    finished: bool
    """Whether it was done thoroughly."""


@dataclass(frozen=True, eq=False)
class Improvement:
    """The improvement of one start, a motion that keeps all limits, within `seconds`."""

    number: int
    setting: Setting
    plan: Round
    start: FourierMotion
    seconds: float

    def stages(self) -> Iterator[Stage]:
        """Yield the result of each stage; that of the last has `ended`."""
        plan, setting, remaining = self.plan, self.setting, self.seconds
        safe = current = self.start
        # The limits that the program keeps, by name, and instants (E,) beside its own samples, s
        watched, instants = _watched_limits(current, setting), np.empty(0)
        for stage in range(plan.stages):
            if remaining <= 0.0:
                yield Stage(self.number, stage, None, ended=True, finished=False)
                return
            begin, sharp = time.monotonic(), len(plan.doublings) - 1
            doublings = plan.doublings[min(stage, sharp)]
            coefficients = minimise(
                setting, current.coefficients, doublings, watched, instants, remaining
            )
            feasible, good = None, False
            current = safe
            if coefficients is not None:
                # A motion that does not keep the limits yet is still a place to go on from.
                motion = self.start.with_coefficients(coefficients)
                feasible = shrink_into_limits(motion, setting.limits)
                violated, further_instants = _violations(motion, setting)
                good = not violated or (feasible is not None and not plan.thorough)
                safe, current = feasible or safe, feasible or motion
                watched = tuple(dict.fromkeys([*watched, *violated]))
                instants = np.unique(np.concatenate([instants, further_instants]))
            remaining -= time.monotonic() - begin
            last = stage == plan.stages - 1
            finished = (last and remaining > 0.0) or (stage >= sharp and good)
            yield Stage(self.number, stage + 1, feasible, last or finished, finished)
            if finished:
                return


def improve_starts(starts: Sequence[Improvement], workers: int) -> Generator[Stage, None, None]:
    """Yield every stage of all starts, computed by `workers` processes, or in this one for 1.

    A start whose process fails is improved here; closing the generator ends all processes.
    """
    if workers > 1:
        starts = yield from _improve_in_processes(starts, workers)
    for start in starts:
        yield from start.stages()


def _improve_in_processes(
    starts: Sequence[Improvement], workers: int
) -> Generator[Stage, None, list[Improvement]]:
    """Yield every stage of all starts, and return those starts whose processes fail."""
    remaining = dict(enumerate(starts))
    with suppress(LostWorkerError), WorkerPool(workers, script=False) as pool:
        for k, stage in pool.messages(_send_stages, starts):
            if stage.ended:
                del remaining[k]
            yield stage
    return list(remaining.values())


def _send_stages(start: Improvement, send: Callable[[Stage], None]) -> Stage:
    """Send the result of each stage but the last, and return the last."""
    for stage in start.stages():
        if not stage.ended:
            send(stage)
    return stage


def _watched_limits(motion: FourierMotion, setting: Setting) -> tuple[str, ...]:
    """Return the names of the limits to watch: those near, and always types I and II."""
    margins, always = _margins(motion, setting)[0], ("type_i", "type_ii")
    return tuple(name for name, margin in margins.items() if name in always or margin.min() < _NEAR)


def _violations(motion: FourierMotion, setting: Setting) -> tuple[tuple[str, ...], Array]:
    """Return the violated limits' names, and instants (E,), s, of margins' negative minima."""
    margins, times = _margins(motion, setting)
    instants = [np.empty(0)]
    for margin in np.hstack(list(margins.values())).T:
        # Of a stretch out of reach, all -inf, the first instant counts.
        dip = (margin < 0.0) & (margin <= np.roll(margin, -1)) & (margin < np.roll(margin, 1))
        instants.append(times[dip])
    names = tuple(name for name, margin_values in margins.items() if (margin_values < 0.0).any())
    return names, np.concatenate(instants)


def _margins(motion: FourierMotion, setting: Setting) -> tuple[dict[str, Array], Array]:
    """Return the relative margins to the limits by name, (T, ...), and their instants (T,)."""
    times = motion.uniform_times(_CHECKED * motion.harmonics)
    return relative_margins(motion, setting.limits, times), times
