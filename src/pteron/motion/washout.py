"""Washout: filters that turn a vehicle's accelerations and rates into a simulator's motion.

A classical washout (L. D. Reid, M. A. Nahon, UTIAS Report 296, 1985): the platform follows quick
accelerations by moving and lasting ones by tilting, so that a part of gravity replaces them, and it
always returns to the middle. `WashoutFilter` takes one sample after another; files and live
telemetry pass through the same filter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg  # type: ignore[import-untyped]

from pteron.arguments import checked_arguments, expect
from pteron.kernels import Array

_GRAVITY = 9.81
"""Gravity, m/s^2: a lasting acceleration over it is the sine of the tilt."""

_STEEPEST = 0.9
"""Largest sine of a tilt: arcsin has no slope bound beyond."""


@checked_arguments
@dataclass(frozen=True)
class Washout:
    """The filters of a washout.

    Parameters
    ----------
    scale : float
        Share of the vehicle's accelerations and rates that is shown.
    translation : float
        Cut-off, rad/s, of the high-pass filter of accelerations, by which the platform moves.
    return_speed : float
        Cut-off, rad/s, of the filter that returns the platform to the middle.
    tilting : float
        Cut-off, rad/s, of the low-pass filter of accelerations, by which the platform tilts.
    tilt_rate : float
        Greatest rate of that tilt, rad/s: people do not notice one below some 0.05.
    rotation : float
        Cut-off, rad/s, of the high-pass filter of the vehicle's turns, by which the platform turns.
    smoothing : float
        Cut-off, rad/s, of the low-pass filter of the platform's turns.
    """

    scale: float = 0.5
    translation: float = 2.5
    return_speed: float = 0.25
    tilting: float = 2.0
    tilt_rate: float = 0.05
    rotation: float = 0.7
    smoothing: float = 30.0

    def __post_init__(self) -> None:
        for name, setting in vars(self).items():
            expect(0.0 < setting < np.inf, name, repr(setting), "a number above 0")


class WashoutFilter:
    """The filters of a washout at a fixed step, sample by sample; limits of poses are not its own.

    Between samples the input is linear in time, for which the recursion is exact.

    Parameters
    ----------
    washout : Washout
        The filters.
    step : float
        Time between samples, s.
    """

    def __init__(self, washout: Washout, step: float) -> None:
        w, s, turn = washout.translation, washout.smoothing, washout.rotation
        # All filters are critically damped.
        quick = ([1.0, 0.0], np.polymul([1.0, 2.0 * w, w * w], [1.0, washout.return_speed]))
        turns = ([1.0, 0.0], np.polymul([1.0, 2.0 * turn, turn * turn], [1.0 / s, 1.0]))
        lasting = ([1.0], [1.0 / washout.tilting**2, 2.0 / washout.tilting, 1.0])
        tilts = ([1.0], [1.0 / s**2, 2.0 / s, 1.0])
        self._washout, self._most_tilt = washout, washout.tilt_rate * step
        self._first = _FilterBank([quick] * 3 + [turns] * 3 + [lasting] * 2, step)
        self._second = _FilterBank([tilts] * 2, step)
        self._tilt = np.zeros(2)
        self._begun = False

    def reset(self) -> None:
        """Return to rest in the middle, as before the first sample."""
        self._first.reset()
        self._second.reset()
        self._tilt = np.zeros(2)
        self._begun = False

    def advance(self, sample: Array) -> Array:
        """Return the platform's motion from the middle (3, 6) after a sample (6,): m, rad and s.

        The sample has accelerations, m/s^2, and rates, rad/s. The first one is at time 0.
        """
        scaled = self._washout.scale * sample
        a, b = scaled[0], scaled[1]
        # On a level platform g acts along z, on a tilted one a part of it ahead or to the side.
        outputs = self._first.advance(np.append(scaled, (b, -a)))
        target = np.arcsin(np.clip(outputs[0, 6:] / _GRAVITY, -_STEEPEST, _STEEPEST))
        if self._begun:
            most = self._most_tilt
            self._tilt = self._tilt + np.clip(target - self._tilt, -most, most)
        self._begun = True
        outputs[:, 3:5] += self._second.advance(self._tilt)
        motion: Array = outputs[:, :6]
        return motion

    def run(self, samples: Array) -> Array:
        """Return the motion (3, T, 6) of samples (T, 6), from rest."""
        self.reset()
        motion = np.empty((3, len(samples), 6))
        for k, sample in enumerate(samples):
            motion[:, k] = self.advance(sample)
        return motion


class _FilterBank:
    """Linear filters side by side, each with one input, its output and two derivatives of it."""

    def __init__(self, filters: Sequence[tuple[Any, Any]], step: float) -> None:
        parts = [_state_space(*numbers) for numbers in filters]
        a, b, c, d = (scipy.linalg.block_diag(*matrices) for matrices in zip(*parts, strict=True))
        count, inputs = b.shape
        # The state and the input, which changes linearly: the exponential of both is exact.
        joint = np.zeros((count + 2 * inputs,) * 2)
        joint[:count, :count], joint[:count, count : count + inputs] = a * step, b * step
        joint[count : count + inputs, count + inputs :] = np.eye(inputs)
        power = scipy.linalg.expm(joint)[:count]
        change = power[:, count + inputs :]
        self._transition = power[:, :count]
        self._before, self._after = power[:, count : count + inputs] - change, change
        order = np.arange(3 * inputs).reshape(inputs, 3).T.ravel()
        self._state_gain, self._input_gain = c[order], d[order]
        self.reset()

    def reset(self) -> None:
        """Set the state to 0; the next input is the first."""
        self._state, self._input = np.zeros(len(self._transition)), None

    _state: Array
    _input: Array | None

    def advance(self, inputs: Array) -> Array:
        """Return the outputs and their two derivatives (3, K) after the next inputs (K,)."""
        if self._input is not None:
            self._state = (
                self._transition @ self._state + self._before @ self._input + self._after @ inputs
            )
        self._input = inputs
        outputs = self._state_gain @ self._state + self._input_gain @ inputs
        return np.asarray(outputs.reshape(3, len(inputs)))


def _state_space(numerator: Any, denominator: Any) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D of a filter whose outputs are its own and two derivatives of it.

    This is the controller canonical form: the state is the filtered input's derivatives.
    """
    leading, count = denominator[0], len(denominator) - 1
    numerators = np.zeros((3, count + 1))
    for order in range(3):
        row = np.polymul(numerator, [1.0] + [0.0] * order)
        numerators[order, count + 1 - len(row) :] = row / leading
    poles, direct = np.asarray(denominator[1:]) / leading, numerators[:, :1]
    a = np.vstack([-poles, np.eye(count)[:-1]])
    return a, np.eye(count)[:, :1], numerators[:, 1:] - direct * poles, direct


def compress(demand: Array, half: Array) -> Array:
    """Return x / (1 + (x / L)^6)^(1 / 6) of x (..., 6), which stays within L, and its derivatives.

    `demand` is x and its two derivatives (3, ..., 6), `half` is L (6,).
    """
    x, dx, ddx = demand
    share = x / half
    compression = 1.0 + share**6
    slope = compression ** (-7.0 / 6.0)
    bend = -7.0 * share**5 * slope / compression / half
    return np.array([x * compression ** (-1.0 / 6.0), slope * dx, slope * ddx + bend * dx * dx])
