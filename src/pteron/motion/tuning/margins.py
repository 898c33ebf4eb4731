"""Stability margins of a sampled loop: of gain, phase and delay, at each drive and at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.kernels import Array
from pteron.motion.tuning.sampled_loop import SampledLoop
from pteron.result import Result

_AT_ONE = 1e-7
"""Distance from the unit circle within which a pole is on it: of what a law never learns, z = 1
exactly, and by rounding some of the root of eps away where several coincide."""

_FREQUENCIES = 300
"""Frequencies of a response."""

_LOWEST = 1e-5
"""The lowest of these, as a share of the highest, half the sample rate."""

_STEPS = 0.5, 0.1
"""Steps in which the smallest unstable delay, in periods, and the smallest unstable gain, of 1, are
looked for: a loop that is stable again beyond a shorter range than this could be missed."""

_MOST = 60.0, 1000.0
"""Greatest delay, in periods, and gain of the search; beyond them a margin is infinite."""


@dataclass(frozen=True, eq=False, repr=False)
class LoopMargins(Result):
    """Gain, phase and delay margins of a sampled loop.

    At each drive, the other loops closed: `gain`, the factor on its force above 1, `phase`, rad,
    and `delay`, s, beyond the loop's own, all (n,), from the frequency response; and `crossover`,
    (n,), the highest frequency at which the drive's loop has the gain 1, rad/s, NaN where none. At
    all drives at once: `common_gain`, `common_delay` and `disk`. All are 0 where the loop is
    unstable as it is, and infinite where nothing makes it so.

    Attributes
    ----------
    loop : SampledLoop
        The loop, its delay included.

    Examples
    --------
    >>> from pteron.motion import tune
    >>> margins = tune("five-bar", poses=[[0.0, 0.12]]).margins[0]
    >>> bool(margins.common_gain <= margins.gain.min())
    True
    """

    SHOWN = "gain phase delay crossover common_gain common_delay disk slowest"

    loop: SampledLoop

    @cached_property
    def gain(self) -> Array:
        """The gain margin of each drive's loop, a factor above 1, (n,)."""
        return np.asarray(self._single_margins[0])

    @cached_property
    def phase(self) -> Array:
        """The phase margin of each drive's loop, lag or lead, rad, (n,)."""
        return np.asarray(self._single_margins[1])

    @cached_property
    def delay(self) -> Array:
        """The delay margin of each drive's loop, s, (n,)."""
        return np.asarray(self._single_margins[2])

    @cached_property
    def crossover(self) -> Array:
        """The highest gain crossover frequency of each drive's loop, rad/s, (n,)."""
        return np.asarray(self._single_margins[3])

    @cached_property
    def common_gain(self) -> float:
        """The least common factor above 1 on all forces that makes the loop unstable."""
        matrix, inputs, force_rows = self.loop.open_loop()
        fed_back = inputs @ force_rows
        return self._stable and 1.0 + _smallest_change(
            lambda added: radius(matrix + (1.0 + added) * fed_back), 1.0, 1
        )

    @cached_property
    def common_delay(self) -> float:
        """The least additional delay of all forces that makes the loop unstable, s."""
        return self._stable and _smallest_change(
            lambda added: radius(self.loop.closed_loop(added)), self.loop.period, 0
        )

    @cached_property
    def disk(self) -> float:
        """The disk margin d at all drives at once.

        The loop stays stable if each force is multiplied by any complex number in the disk whose
        diameter ends at (1 + d / 2) / (1 - d / 2) and its inverse. It is a lower bound, the better
        of one by the greatest singular value and one by Perron's theorem.
        """
        identity = np.eye(len(self._response[0]))
        middle = np.linalg.inv(identity + self._response) - 0.5 * identity
        greatest = np.linalg.norm(middle, ord=2, axis=(1, 2))
        perron = np.abs(np.linalg.eigvals(np.abs(middle))).max(axis=-1)
        return self._stable and float(1.0 / np.minimum(greatest, perron).max())

    @property
    def least(self) -> dict[str, float]:
        """The least gain, phase (rad), delay (s) and disk margin of the loop, by name."""
        return {
            "gain": float(min(self.gain.min(), self.common_gain)),
            "phase": float(self.phase.min()),
            "delay": float(min(self.delay.min(), self.common_delay)),
            "disk": self.disk,
        }

    @cached_property
    def slowest(self) -> float:
        """The decay rate of the slowest pole, 1/s; negative for an unstable pole."""
        return float(-np.log(radius(self.loop.closed_loop())) / self.loop.period)

    @cached_property
    def drive_loops(self) -> Array:
        """Frequency response of each drive's loop with the others closed, (W, n), complex."""
        sensitivity = np.linalg.inv(np.eye(len(self._response[0])) + self._response)
        return np.asarray(1.0 / np.diagonal(sensitivity, axis1=1, axis2=2) - 1.0)

    @property
    def frequencies(self) -> Array:
        """Frequencies of the response, rad/s, (W,): up to half the sample rate."""
        return np.geomspace(_LOWEST, 1.0, _FREQUENCIES) * np.pi / self.loop.period

    @cached_property
    def _stable(self) -> float:
        """1.0 if the closed loop is stable, else 0.0."""
        return float(self.slowest > 0.0)

    @cached_property
    def _response(self) -> Array:
        """Complex frequency response of the loop opened at all drives, (W, n, n)."""
        return self.loop.response(self.frequencies)

    @cached_property
    def _single_margins(self) -> Array:
        """Gain, phase (rad) and delay (s) margin, crossover (rad/s), of each drive (4, n)."""
        n = self.loop.plant.inputs.shape[1]
        if not self._stable:
            return np.array([0.0, 0.0, 0.0, np.nan])[:, None] * np.ones(n)
        margins = [_classical(self.frequencies, drive_loop) for drive_loop in self.drive_loops.T]
        return np.array(margins).T


def radius(matrix: Array) -> float:
    """Return the spectral radius of a matrix, without eigenvalues at 1."""
    poles = np.linalg.eigvals(matrix)
    return float(np.abs(poles[np.abs(poles - 1.0) > _AT_ONE]).max(initial=0.0))


def _smallest_change(radius_of: Callable[[float], float], unit: float, which: int) -> float:
    """Return the least x at which radius_of(x), a spectral radius, reaches 1; inf if none."""
    step, below = _STEPS[which] * unit, 0.0
    while below < _MOST[which] * unit:
        above = below + max(step, 0.1 * below)
        if radius_of(above) >= 1.0:
            return float(
                scipy.optimize.brentq(lambda x: radius_of(x) - 1.0, below, above, rtol=1e-6)
            )
        below = above
    return float("inf")


def _classical(omega: Array, loop: Array) -> tuple[float, float, float, float]:
    """Return gain, phase (rad) and delay (s) margin, crossover (rad/s), of a loop (W,)."""
    lead = np.unwrap(np.angle(-loop))  # 0 where L is on the negative axis
    size = np.log(np.abs(loop))
    turns = (
        2.0 * np.pi * np.arange(np.floor(lead.min() / (2 * np.pi)), lead.max() / (2 * np.pi) + 1)
    )
    sizes = [np.exp(-_values_at_zeros(lead - turn, size)) for turn in turns]
    # At half the sample rate L is real: the last crossing that there is.
    last = [1.0 / abs(loop[-1])] if loop[-1].real < 0.0 else []
    gains = np.concatenate([*sizes, last])
    crossings = np.exp(_values_at_zeros(size, np.log(omega)))
    leads = _values_at_zeros(size, lead)
    ahead = np.mod(leads, 2.0 * np.pi)
    return (
        float(gains[gains > 1.0].min(initial=np.inf)),
        float(np.minimum(ahead, 2.0 * np.pi - ahead).min(initial=np.inf)),
        float((ahead / crossings).min(initial=np.inf)),
        float(crossings.max(initial=-np.inf)) if len(crossings) else float("nan"),
    )


def _values_at_zeros(signal: Array, others: Array) -> Array:
    """Return the values of `others` (W,) interpolated where `signal` (W,) changes its sign."""
    k = np.flatnonzero(np.signbit(signal[1:]) != np.signbit(signal[:-1]))
    share = signal[k] / (signal[k] - signal[k + 1])
    return others[k] + share * (others[k + 1] - others[k])
