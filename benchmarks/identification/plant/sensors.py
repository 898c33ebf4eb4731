"""Sensors: encoders with steps, noisy forces, uneven sampling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import Akima1DInterpolator  # type: ignore[import-untyped]

from plant.machine import Recording
from plant.model import Array

__all__ = ["Log", "measured"]


@dataclass(frozen=True)
class Log:
    """A log of a motion, as a controller writes it.

    Attributes
    ----------
    time : array, shape (T,)
        s.
    joints : array, shape (T, n)
        m; rad at a crank.
    forces : array, shape (T, n)
        N; N m at a crank.
    noise : array, shape (n,)
        Standard deviation of the noise in each actuator's force.
    """

    time: Array
    joints: Array
    forces: Array
    noise: Array


def measured(
    recording: Recording,
    *,
    encoder: float = 1e-6,
    force: float = 0.01,
    jitter: float = 0.0,
    stamped: bool = False,
    seed: int = 0,
) -> Log:
    """Return what sensors make of a recording.

    Parameters
    ----------
    recording : Recording
        What the machine did.
    encoder : float
        Step of the encoders, m or rad: joint coordinates are rounded to its multiples. 0 for none.
    force : float
        Standard deviation of the white Gaussian noise in each force, as a share of the root mean
        square of that actuator's force.
    jitter : float
        Standard deviation of the instants at which samples are really taken, about the nominal
        ones, s; cut off at three of them, and at half the sampling period.
    stamped : bool
        Whether the log has the real instants instead of the nominal ones.
    seed : int
        Of the noise and the jitter, each of which stays the same when the other changes.

    Returns
    -------
    Log
    """
    draws, instants = np.random.default_rng([seed, 0]), np.random.default_rng([seed, 1])
    time, spacing = recording.time, float(recording.time[1] - recording.time[0])
    most = min(3.0 * jitter, spacing / 2.0)
    late = np.clip(jitter * instants.normal(size=time.shape), -most, most)
    # Nothing is known before the first sample and after the last.
    late[[0, -1]] = 0.0
    # So near to a sample, the third derivative adds less than a nanometre.
    d = late[:, None]
    joints = recording.joints + d * recording.rates + 0.5 * d**2 * recording.accelerations
    if encoder > 0.0:
        joints = encoder * np.round(joints / encoder)
    # Local, so that the jumps of friction compensation do not ring.
    forces = Akima1DInterpolator(time, recording.forces)(time + late)
    noise = force * np.sqrt(np.mean(recording.forces**2, axis=0))
    forces = forces + noise * draws.normal(size=forces.shape)
    return Log(time + late if stamped else time.copy(), joints, forces, noise)
