"""Predictions of a model for a recording: measured against predicted forces, sample by sample."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.identification.felt_forces import felt_part, usable_samples
from pteron.identification.model import Model
from pteron.identification.observation import motion_mask
from pteron.identification.recordings import Recording
from pteron.identification.signals import Preprocessing, samples
from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.renamed import former_attribute
from pteron.result import Result

_KEPT = 6000
"""Samples, about, that are kept for pictures."""

_STANDS_OUT = 7.0
"""Outlier threshold: distance of an error from those around it, over the noise."""

_AROUND = 9
"""Samples of the window in which an error is compared with others."""

_LEAST_NOISE = 1e-3
"""Least noise of a force, over its size."""

_RARE, _FEW = 1e-3, 0.05
"""Shares of outliers: up to the first they may be chance, from the second on they are no
exception."""

FRICTION = ("coulomb", "viscous", "stribeck", "offset")
"""Kinds of values that are not the rigid bodies'."""


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(Result):
    """A model's prediction of the forces of a recording, at its own samples.

    Samples of a joint that hardly moves are left out, and those next to them in which its direction
    is not certain: dry friction may hold it with any force.
    NRMS is the root mean square of the error over the standard deviation of the measured force, in
    percent, so that a constant load does not flatter.

    Attributes
    ----------
    source : str
        The recording.
    samples : int
        Number of samples.
    left_out : array, shape (n,)
        Share of the samples of each actuator that was left out.
    size : array, shape (n,)
        Standard deviation of the measured forces, N.
    error, error_without_friction : array, shape (n,)
        Root mean square error, with all terms and without friction and offsets, N.
    error_of_all : array, shape (n,)
        The same over every sample, with all terms, N.
    robust_error, outliers : array, shape (n,)
        Root mean square error without outliers, N, and their share: they are missed by seven
        times the noise more than those around them. Up to 0.1 % may be chance
        and beyond 5 % they are no exception: then there are none.
    noise : array, shape (n,)
        Standard deviation of the white noise on the measured forces, N: no model can do better.
    time : array, shape (S,)
        Times of some of the samples, evenly spaced, to be looked at, s.
    measured, predicted, without_friction, speed : array, shape (S, n)
        Forces, N, and the joints' rates, m/s.
    used : array of bool, shape (S, n)
        Whether they count.
    """

    ROWS = "time measured:1 predicted:1 without_friction:1 speed:1"

    source: str
    samples: int
    left_out: Array
    size: Array
    error: Array
    error_without_friction: Array
    error_of_all: Array
    robust_error: Array
    outliers: Array
    noise: Array
    time: Array = field(repr=False)
    measured: Array = field(repr=False)
    predicted: Array = field(repr=False)
    without_friction: Array = field(repr=False)
    speed: Array = field(repr=False)
    used: NDArray[np.bool_] = field(repr=False)

    @property
    def nrms(self) -> Array:
        """Error in percent (n,)."""
        return np.asarray(100.0 * self.error / self.size)

    @property
    def robust_nrms(self) -> Array:
        """Error without the samples that stand out, in percent (n,)."""
        return np.asarray(100.0 * self.robust_error / self.size)

    @property
    def nrms_without_friction(self) -> Array:
        """Error of the model without friction and offsets in percent (n,)."""
        return np.asarray(100.0 * self.error_without_friction / self.size)

    @property
    def floor(self) -> Array:
        """The noise in percent (n,)."""
        return np.asarray(100.0 * self.noise / self.size)

    @property
    def unexplained_error(self) -> Array:
        """Error beyond the noise in percent (n,), without the samples that stand out."""
        beyond = np.sqrt(np.maximum(self.robust_error**2 - self.noise**2, 0.0))
        return np.asarray(100.0 * beyond / self.size)

    def as_dict(self) -> dict[str, Any]:
        """Return everything but the samples as plain data."""
        return json_fields(
            source=self.source,
            samples=self.samples,
            left_out=self.left_out,
            force_standard_deviation=self.size,
            rms_error=self.error,
            rms_error_of_all_samples=self.error_of_all,
            nrms_percent=self.nrms,
            robust_nrms_percent=self.robust_nrms,
            outliers=self.outliers,
            nrms_percent_without_friction=self.nrms_without_friction,
            noise_floor_percent=self.floor,
            unexplained_percent=self.unexplained_error,
        )

    unexplained = former_attribute("unexplained", "unexplained_error")


def predict(
    model: Model, beta: Array, recording: Recording, preprocessing: Preprocessing
) -> Prediction:
    """Return the prediction of a recording by a model with values (p,), with its preprocessing."""
    n = len(model.robot.legs)
    plain = np.where(np.isin(model.kinds, FRICTION), 0.0, beta)
    sums, total = np.zeros((8, n)), 0
    shown: list[Array] = []
    step = max(recording.rows // _KEPT, 1)
    for block in samples(model.robot, recording.samples(), preprocessing):
        states, measured = block.states.part(block.fresh), block.forces[block.fresh]
        matrix, measured = (
            felt_part(model.robot, states.pose, part) for part in (model.matrix(states), measured)
        )
        predicted, without = matrix @ beta, matrix @ plain
        used = motion_mask(states.joint_rates, preprocessing.slow, preprocessing.turning_rows)
        used = usable_samples(model.robot, used)
        error, bare = measured - predicted, measured - without
        least = _LEAST_NOISE * np.sqrt((measured**2).mean(axis=0))
        out = used * _stands_out(error, np.maximum(preprocessing.force_noise, least))
        squares = used * error**2, used * bare**2, error**2, out * error**2
        each = used, out, measured, measured**2, *squares
        sums += [quantity.sum(axis=0) for quantity in each]
        rows = slice(-total % step, None, step)
        columns = states.time, measured, predicted, without, states.joint_rates, used
        shown.append(np.column_stack([column[rows] for column in columns]))
        total += len(states)
    table = np.concatenate(shown)
    parts = np.split(table[:, 1:], 5, axis=1)
    counts, out_counts, force, power, moving, bare, total_power, out_power = sums
    seen = np.maximum(counts, 1.0)
    error = np.sqrt(moving / seen)
    share = out_counts / seen
    outliers = np.where((share > _RARE) & (share < _FEW), share, 0.0)
    inlier_power = (moving - out_power) / np.maximum(counts - out_counts, 1.0)
    robust = np.where(outliers > 0.0, np.sqrt(np.maximum(inlier_power, 0.0)), error)
    return Prediction(
        source=recording.source,
        samples=total,
        left_out=1.0 - counts / total,
        size=np.sqrt(np.maximum(power / total - (force / total) ** 2, np.finfo(float).tiny)),
        error=error,
        error_without_friction=np.sqrt(bare / seen),
        error_of_all=np.sqrt(total_power / total),
        robust_error=robust,
        outliers=outliers,
        noise=preprocessing.force_noise,
        time=table[:, 0],
        measured=parts[0],
        predicted=parts[1],
        without_friction=parts[2],
        speed=parts[3],
        used=parts[4] > 0.0,
    )


def _stands_out(error: Array, noise: Array) -> NDArray[np.bool_]:
    """Return which errors (R, n) are far from those around them, for noise (n,).

    An error that lasts longer than a few samples is no outlier, but not understood.
    """
    around = scipy.ndimage.median_filter(error, size=(_AROUND, 1), mode="nearest")
    return np.asarray(np.abs(error - around) > _STANDS_OUT * noise)
