"""One start improved, stage by stage, until it is good and keeps its limits between samples too."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pteron.identification.excitation.draws import within_limits
from pteron.identification.excitation.fourier import FourierMotion
from pteron.identification.excitation.margins import relative_margins
from pteron.identification.excitation.nonlinear_program import Setting, minimised
from pteron.kernels import Array

__all__ = ["ROUNDS", "Round", "Stage", "improvements"]


@dataclass(frozen=True)
class Round:
    """A round of the search: how sharp the measure is in each stage, and exchanges after them.

    The blunt measure has wide valleys, the sharp one is all but the condition number. In an
    exchange, instants where limits are violated between the samples join the program.
    """

    doublings: tuple[int, ...]
    exchanges: int
    thorough: bool
    """Whether exchanges go on when a motion that keeps the limits has been found."""

    @property
    def stages(self) -> int:
        """How many stages it has, exchanges included."""
        return len(self.doublings) + self.exchanges


ROUNDS = {
    "condition": (Round((0,), 2, False), Round((2, 4), 3, True)),
    "logdet": (Round((0,), 2, False), Round((0,), 3, True)),
}
"""For each criterion, the round for all starts, and that for the best of them."""

_NEAR = 0.5
"""A limit whose least margin at the start is above that share of its size is not watched, until it
is violated: it would cost time."""

_CHECKED = 200
"""Samples in a period of the highest harmonic in which violations are sought."""


@dataclass(frozen=True)
class Stage:
    """What a stage found.

    Attributes
    ----------
    coefficients : array or None
        Of a motion that keeps all limits; None if none was found.
    last : bool
        Whether nothing is left to be done.
    """

    coefficients: Array | None
    last: bool


def improvements(
    setting: Setting, start: FourierMotion, plan: Round, seconds: float
) -> Iterator[Stage]:
    """Yield what each stage finds, from a start that keeps the limits, for so many seconds."""
    deadline = time.monotonic() + seconds
    current = safe = start.coefficients
    extra = np.empty(0)
    watched = _near(start, setting)
    for k in range(plan.stages):
        left = deadline - time.monotonic()
        if left <= 0.0:
            return
        doublings = plan.doublings[min(k, len(plan.doublings) - 1)]
        found = minimised(setting, current, doublings, watched, extra, left)
        last = k == plan.stages - 1 and time.monotonic() < deadline
        if found is None:
            current = safe
            yield Stage(None, last)
            continue
        motion = start.with_coefficients(found)
        kept = within_limits(motion, setting.limits)
        violated, instants = _violations(motion, setting)
        good = not violated or (kept is not None and not plan.thorough)
        last = last or (k >= len(plan.doublings) - 1 and good)
        yield Stage(None if kept is None else kept.coefficients, last)
        if last:
            return
        # A motion that does not keep the limits yet is still a place to go on from.
        current = found if kept is None else kept.coefficients
        safe = safe if kept is None else kept.coefficients
        watched = tuple(dict.fromkeys([*watched, *violated]))
        extra = np.unique(np.concatenate([extra, instants]))


def _near(motion: FourierMotion, setting: Setting) -> tuple[str, ...]:
    """Return the limits that the motion is near to; the platform's place is always watched."""
    times = motion.uniform_times(_CHECKED * motion.harmonics)
    found = relative_margins(motion, setting.limits, times)
    always = ("elbow_sine", "regularity")
    return tuple(name for name, values in found.items() if name in always or values.min() < _NEAR)


def _violations(motion: FourierMotion, setting: Setting) -> tuple[tuple[str, ...], Array]:
    """Return the limits that are violated, and the instants (E,) of the least margins."""
    times = motion.uniform_times(_CHECKED * motion.harmonics)
    names = []
    instants = [np.empty(0)]
    for name, values in relative_margins(motion, setting.limits, times).items():
        if (values < 0.0).any():
            names.append(name)
        for margin in values.T:
            # Of a stretch out of reach, all -inf, the first instant counts.
            dip = (margin < 0.0) & (margin <= np.roll(margin, -1)) & (margin < np.roll(margin, 1))
            instants.append(times[dip])
    return tuple(names), np.concatenate(instants)
