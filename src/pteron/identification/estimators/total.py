"""Total least squares, for noise in the regressor W as well as in the forces F."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pteron.identification.estimators.estimate import Estimate, SearchRecord, estimate_of
from pteron.identification.estimators.least_squares import actuator_noise
from pteron.identification.estimators.qr import qr_factor
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.observation import Observations, observations_of
from pteron.identification.signals import Preprocessing
from pteron.kernels import Array
from pteron.shapes import Seed

_SETTLED = 1e-3
"""Relative change of the forces' noise that no longer matters."""

_LEAST_SHARE = 0.01
"""Share of the residuals' variance that is left to the forces, whatever the columns' noise is said
to be: columns whose errors belong together add up to less than the sum of their squares."""

_CONSTANT = ("coulomb", "offset")
"""Kinds of values whose columns are exact: signs and ones."""


class SmallestCorrections(NamedTuple):
    """The solution of mixed total least squares: values (p,) and singular values."""

    values: Array
    sizes: Array
    """The singular values, in units of the noise."""
    share: float
    """Share of the forces in the last right singular vector; the values are wrong where it is 0."""


def smallest_corrections(upper: Array, exact: int, noise: Array) -> SmallestCorrections:
    """Return the values for which the least corrections, in units of noise, make W and F agree.

    `upper` is the triangular factor (p + 1, p + 1) of W, its `exact` columns without noise first,
    and F. `noise` are the standard deviations of the p - `exact` noisy columns and of the forces.
    """
    # The orthogonal factor takes the exact columns out (Van Huffel and Vandewalle).
    _, sizes, directions = np.linalg.svd(upper[exact:, exact:] / noise)
    last = directions[-1]
    with np.errstate(all="ignore"):
        noisy = -last[:-1] / last[-1] * noise[-1] / noise[:-1]
        remainder = upper[:exact, -1] - upper[:exact, exact:-1] @ noisy
        first = np.linalg.solve(upper[:exact, :exact], remainder)
    return SmallestCorrections(np.r_[first, noisy], sizes, float(abs(last[-1])))


def total(
    observations: Observations, errors: Array | None = None, *, iterations: int = 50
) -> Estimate:
    """Return the values of mixed total least squares (Van Huffel and Vandewalle).

    Forces and regressor both get the smallest corrections that make them agree, each measured by
    its own noise. Columns without noise, such as constant ones, are left as they are.

    Parameters
    ----------
    observations : Observations
        From `observations_of`.
    errors : array, shape (p,), optional
        Standard deviation of the noise in each column, N per unit of its value and before the
        filter; zero for an exact one. `column_errors` finds them. By default every column but
        constant and Coulomb ones has the same noise relative to its size as the forces have.
    iterations : int
        How many times the forces' noise is estimated anew at most.

    Raises
    ------
    LogError
        If the observations do not determine the values, or noise explains all there is.
    """
    plain = qr_factor(observations).check_seen()
    noise = actuator_noise(observations, plain.values())
    factor = qr_factor(observations, 1.0 / noise)
    given_errors = errors
    if given_errors is None:
        relative = np.sqrt(factor.rest / (factor.rest + factor.image @ factor.image))
        errors = relative * factor.scale / np.sqrt(factor.rows)
        if observations.kinds:
            errors[np.isin(observations.kinds, _CONSTANT)] = 0.0
    else:
        # On average over the equations that there are: an actuator without any has no noise.
        weight = (observations.equation_counts / noise**2).sum() / observations.rows
        errors = np.asarray(given_errors, dtype=float) * np.sqrt(weight)
    order = np.argsort(errors > 0.0, kind="stable")
    exact = int((errors == 0.0).sum())
    p = len(order)
    stack = np.column_stack([factor.factor * factor.scale, factor.image])
    stack = np.vstack([stack, np.r_[np.zeros(p), np.sqrt(factor.rest)]])
    upper = np.asarray(np.linalg.qr(stack[:, [*order, p]], mode="r"))
    forces, search = 1.0, SearchRecord("total")
    beta = np.empty(p)
    for _ in search.steps(iterations):
        corrections = smallest_corrections(upper, exact, np.r_[errors[order[exact:]], forces])
        sizes = corrections.sizes
        if corrections.share < 1e-12 or (len(sizes) > 1 and sizes[-1] >= sizes[-2]):
            raise observations.fault(
                "too little motion",
                "total least squares: noise explains all there is; record a livelier motion",
            )
        beta[order] = corrections.values
        modelled = ((beta * errors) ** 2).sum()
        # The residuals hold the noise of the columns as well as that of the forces.
        squares_left = (
            factor.rest + ((factor.image - factor.factor @ (factor.scale * beta)) ** 2).sum()
        )
        variance = squares_left / factor.degrees
        search.converged = given_errors is None or variance == 0.0
        if not search.converged:
            last_forces, forces = forces, np.sqrt(max(variance - modelled, _LEAST_SHARE * variance))
            search.converged = bool(abs(forces / last_forces - 1.0) < _SETTLED)
    # The normal equations without the bias of the columns' noise, least^2 times its variance.
    normal = (factor.scale[:, None] * factor.factor.T) @ (factor.factor * factor.scale)
    normal = normal - float(sizes[-1] ** 2) * np.diag(errors**2)
    lengths = np.outer(factor.scale, factor.scale)
    inverse = np.linalg.inv(normal / lengths) / lengths
    return estimate_of(search, observations, factor, beta, weights=1.0 / noise, inverse=inverse)


def column_errors(model: Model, log: Log, preprocessing: Preprocessing, *, seed: Seed = 0) -> Array:
    """Return the standard deviation (p,) of the noise in the regressor's columns.

    Noise like that of the positions is put on them once more; what it changes has the size of what
    their own noise has changed, to first order.

    Parameters
    ----------
    model : Model
        What is identified.
    log : Log
        The log, or a part of it.
    preprocessing : Preprocessing
        How it is preprocessed.
    seed : int
        Where the noise comes from.

    Returns
    -------
    array, shape (p,)
        N per unit of each value, in units of the noise before the parallel filter; zero for columns
        that do not depend on positions.
    """
    rng = np.random.default_rng(seed)
    noise = preprocessing.joint_noise * rng.normal(size=log.joints.shape)
    shaken = observations_of(model, replace(log, joints=log.joints + noise), preprocessing)
    plain = observations_of(model, log, preprocessing)
    # Slow rows that are left out of one, and not of the other, are no error: both sides miss them.
    same = (shaken.gain == plain.gain) & (plain.gain > 0.0)
    if not same.any():
        same = (shaken.gain > 0.0) & (plain.gain > 0.0)
    plain_rows, shaken_rows = plain.matrix[same], shaken.matrix[same]
    change = np.sqrt(((shaken_rows - plain_rows) ** 2).mean(axis=0))
    size = np.sqrt((plain_rows**2).mean(axis=0))
    # What rounding alone moves counts as exact.
    return np.asarray(np.where(change > 1e-12 * size, change, 0.0))
