"""Instrumental variables: values without the bias that noise in the regressor makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.errors import DataError
from pteron.identification.estimators.estimate import Estimate, SearchRecord, estimate_of
from pteron.identification.estimators.least_squares import actuator_noise
from pteron.identification.estimators.qr import qr_factor
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.observation import Observations, observations_of
from pteron.identification.signals import Preprocessing
from pteron.kernels import Array

_SETTLED = 1e-3
"""Change of a value, in standard deviations, and of the noise, relative, that does not matter."""

_DEGREE = 5
"""Degree of the spline through every other sample."""

Instruments = Observations | Callable[[Array], Observations]
"""Observations at states whose noise is independent of that in the observations to solve; or a
function that makes them from values."""


def instrumental(
    observations: Observations,
    instruments: Instruments,
    *,
    mutual: bool = False,
    iterations: int = 20,
) -> Estimate:
    """Return the values (Z^T V W)^-1 Z^T V F, with instruments Z and V each actuator's weight.

    Noise in positions is noise in W, which pulls least squares towards zero however long the log
    is. Instruments are the regressor at states that are near the true ones, and whose noise has
    nothing to do with that in W: then it averages out. Three kinds are usual.

    - The states of a simulated model, with the machine's controller: give a function from values to
      observations. It is called again with what was found until that settles (IDIM-IV).
    - The motion that was commanded.
    - Another measurement of the same motion, such as `halves` of the samples make.

    Parameters
    ----------
    observations : Observations
        What is solved.
    instruments : Observations or callable
        Of the same rows; their forces play no part unless they are `mutual`.
    mutual : bool
        Whether each is the instrument of the other, as of two measurements that are as good: then
        the noise of both is averaged.
    iterations : int
        How many times the noise, and simulated instruments, are found anew at most.

    Raises
    ------
    DataError
        If instruments are of another shape, or the observations do not determine the values.

    References
    ----------
    A. Janot, P.-O. Vandanjon, M. Gautier, "A generic instrumental variable approach for industrial
    robot identification", IEEE Transactions on Control Systems Technology 22(1), 2014.
    """
    factor = qr_factor(observations).check_seen()
    beta = factor.values()
    noise = actuator_noise(observations, beta)
    search = SearchRecord("instrumental")
    for _ in search.steps(iterations):
        if callable(instruments) or search.iterations == 1:
            instrument_rows = instruments(beta) if callable(instruments) else instruments
            both, z, differences = _align_instruments(observations, instrument_rows, mutual=mutual)
            qr_factor(replace(both, matrix=z)).check_seen()
        inverse, moment = _normal_equations(both, z, differences, noise)
        previous, beta = beta, inverse @ moment
        factor = qr_factor(both, 1.0 / noise)
        last_noise, noise = noise, actuator_noise(both, beta)
        size = np.sqrt(np.maximum(np.diag(factor.inverse()), np.finfo(float).tiny))
        settled = np.abs(noise / last_noise - 1.0).max() < _SETTLED
        values_settled = (np.abs(beta - previous) <= _SETTLED * size).all()
        search.converged = bool(settled and values_settled)
    solved, weights = (search, both, factor, beta), 1.0 / last_noise
    return estimate_of(*solved, weights=weights, inverse=inverse, instruments=z)


def halves(
    model: Model, log: Log, preprocessing: Preprocessing
) -> tuple[Observations, Observations]:
    """Return two sets of observations of a log: from even and from odd samples of the positions.

    A spline through one half of the samples gives the positions at all instants. Encoders' noise is
    not the same in two samples, as long as a joint passes a step or more between them, so that
    the halves are mutual instruments of each other, and no controller needs to be known.
    """
    first, second = (observations_of(model, _every_other(log, s), preprocessing) for s in (0, 1))
    return first, second


def _align_instruments(
    observations: Observations, instruments: Observations, *, mutual: bool
) -> tuple[Observations, Array, Array | None]:
    """Return observations and instruments at common rows, and half their difference if mutual.

    With M and D mean and half the difference of two regressors, (W1^T W2 + W2^T W1) / 2 is
    M^T M - D^T D.
    """
    if instruments.matrix.shape != observations.matrix.shape:
        raise DataError(
            f"instruments: shape {instruments.matrix.shape} given, that of the observations, "
            f"{observations.matrix.shape}, expected; preprocess both logs alike"
        )
    used = (observations.gain > 0.0) & (instruments.gain > 0.0)
    matrix, forces = observations.matrix, observations.forces
    z, differences = instruments.matrix * used[..., None], None
    if mutual:
        differences = 0.5 * (matrix * used[..., None] - z)
        matrix, forces = 0.5 * (matrix + z), 0.5 * (forces + instruments.forces)
    both = replace(
        observations,
        matrix=used[..., None] * matrix,
        forces=used * forces,
        gain=used * observations.gain,
    )
    return both, both.matrix if mutual else z, differences


def _normal_equations(
    observations: Observations, instruments: Array, differences: Array | None, noise: Array
) -> tuple[Array, Array]:
    """Return (Z^T V W)^-1, or (M^T V M - D^T V D)^-1, (p, p), and Z^T V F (p,)."""
    p = instruments.shape[-1]
    z, w = ((a / noise[:, None]).reshape(-1, p) for a in (instruments, observations.matrix))
    size = np.linalg.norm(w, axis=0)
    normal = (z / size).T @ (w / size)
    if differences is not None:
        d = (differences / noise[:, None]).reshape(-1, p) / size
        normal -= d.T @ d
    inverse = np.linalg.inv(normal) / np.outer(size, size)
    return inverse, z.T @ (observations.forces / noise).ravel()


def _every_other(log: Log, start: int) -> Log:
    """Return a log with positions interpolated from every other sample, `start` the first."""
    joints = log.joints.copy()
    for rows in log.segments:
        time, every_other = log.time[rows], slice(start, None, 2)
        if len(time) // 2 <= _DEGREE:
            continue  # too short for the filters, too
        spline = scipy.interpolate.make_interp_spline(
            time[every_other], log.joints[rows][every_other], k=_DEGREE
        )
        joints[rows] = spline(time)
    return replace(log, joints=joints)
