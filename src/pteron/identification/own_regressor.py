"""`estimate`: identification with a user's own regressor; forces are regressor @ values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from pteron.arguments import expect
from pteron.errors import DataError, ModelError
from pteron.identification.checked_regressor import checked_observations, finite
from pteron.identification.errors import LogError
from pteron.identification.estimators import (
    ESTIMATORS,
    Essential,
    Estimate,
    essential_parameters,
    instrumental,
    weighted_least_squares,
)
from pteron.identification.estimators.reduction import Reduced, independent_columns
from pteron.identification.observation import Observations
from pteron.identification.prediction import FRICTION, Prediction
from pteron.identification.recordings import FITTED
from pteron.identification.signals.filters import white_noise
from pteron.identification.verdict import verdict_of
from pteron.kernels import Array
from pteron.result import Result
from pteron.verdict import Verdict

_LEAST_ROWS = 9
"""Least number of samples: from so many the noise of forces is estimated without a model."""

_ESTIMATORS = (*ESTIMATORS, "instrumental")
"""Estimators by name."""


@dataclass(frozen=True, eq=False, repr=False)
class RegressorFit(Result):
    """The values of a model with a regressor of the user's own, and a verdict on them.

    Attributes
    ----------
    estimate : Estimate
        The values.
    essential : Essential
        The values that the data determine, and the fit of these alone.
    held_out : Prediction
        The prediction of the held-out forces.
    verdict : Verdict
        Whether the values can be trusted, by the held-out forces alone.
    reduced : Reduced or None
        The independent columns, if `reduce` was given.
    """

    ROWS = "estimate"

    estimate: Estimate
    essential: Essential
    held_out: Prediction
    verdict: Verdict
    reduced: Reduced | None = None

    def __repr__(self) -> str:
        """Return the fit in a line."""
        return f"<RegressorFit: {len(self.estimate.values)} values, {self.verdict.grade}>"


def estimate(
    regressor: ArrayLike,
    forces: ArrayLike,
    *,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    kinds: Sequence[str] | None = None,
    time: ArrayLike | None = None,
    used: ArrayLike | None = None,
    estimator: str | Callable[[Observations], Estimate] = "weighted",
    held_out: tuple[ArrayLike, ...] | None = None,
    instruments: ArrayLike | Callable[[Array], ArrayLike] | None = None,
    reduce: bool = False,
) -> RegressorFit:
    """Estimate the values of a model whose forces are `regressor` @ values, and judge them.

    Parameters
    ----------
    regressor : array, shape (R, n, p) or (R n, p)
        W at R samples of n actuators, in the order of time; stacked sample by sample if it has two
        axes. If it is filtered, the forces must be filtered alike.
    forces : array, shape (R, n), or (R,) of a single actuator
        F, N or N m.
    names : sequence of str, optional
        Names of the p values; "beta1" ... by default.
    units : sequence of str, optional
        Their units; none by default.
    kinds : sequence of str, optional
        Their kinds: "coulomb", "viscous" and "offset" are friction, "base" is the rest. The
        verdict then says whether friction is what a model misses.
    time : array, shape (R,), optional
        s; one second a sample by default.
    used : array of bool, shape (R, n), optional
        Equations that count; leave out those that the model does not hold for, such as those of
        joints at rest.
    estimator : str or callable
        ordinary, weighted, huber, total, instrumental; or a function from observations to an
        estimate.
    held_out : tuple of arrays, optional
        Regressor and forces of another motion, and which equations count there; by default the last
        30 % of the samples.
    instruments : array or callable, optional
        For "instrumental": the regressor at states whose noise is independent of that of the given
        ones, such as a simulation's; or a function that returns it for values of the kept columns.
    reduce : bool
        Whether columns that depend on others are left out and named, numerically: see `reduced`.

    Raises
    ------
    DataError
        If shapes do not fit one another, numbers are missing, or the samples do not determine the
        values; the message says what was expected.
    ModelError
        If the estimator is not known.

    Examples
    --------
    A pendulum's torque, I q'' + m g l sin(q), with I = 0.2 kg m^2 and m l = 0.5 kg m:

    >>> import numpy as np
    >>> from pteron.identification import estimate
    >>> t = np.linspace(0.0, 10.0, 1000)
    >>> q, ddq = np.sin(t) + 0.3 * np.sin(3.0 * t), -np.sin(t) - 2.7 * np.sin(3.0 * t)
    >>> W = np.column_stack([ddq, 9.81 * np.sin(q)])
    >>> noise = 0.01 * np.random.default_rng(0).normal(size=t.shape)
    >>> fit = estimate(W, W @ [0.2, 0.5] + noise, names=["I", "ml"], units=["kg m^2", "kg m"])
    >>> fit.estimate.values.round(3).tolist(), fit.verdict.grade
    ([0.2, 0.5], 'trustworthy')
    """
    if isinstance(estimator, str) and estimator not in _ESTIMATORS:
        raise ModelError(f"estimator: {estimator!r} is not one of {', '.join(_ESTIMATORS)}")
    if (estimator == "instrumental") != (instruments is not None):
        raise ModelError('instruments: belong to estimator "instrumental"; give both or neither')
    observations = checked_observations(
        regressor, forces, names=names, units=units, kinds=kinds, time=time, used=used
    )
    fit, check = _hold_out(observations, held_out, kinds)
    independent = independent_columns(fit) if reduce else None
    if independent is not None:
        fit, check = fit.columns(independent.kept), check.columns(independent.kept)
    solve = (
        ESTIMATORS.get(estimator, weighted_least_squares)
        if isinstance(estimator, str)
        else estimator
    )
    try:
        if instruments is None:
            solution = solve(fit)
        else:
            read = partial(_instruments, observations, len(fit.time), independent)
            solution = _estimate_by_instruments(fit, instruments, read)
    except LogError as error:
        if error.reason == "too little motion" and not reduce:
            error.args = (f"{error}; or give reduce=True, which leaves out dependent columns",)
        raise
    prediction = _predict(check, solution, repeats=held_out is None)
    return RegressorFit(
        solution,
        essential_parameters(fit, solution, solve),
        prediction,
        verdict_of([prediction], repeats=held_out is None),
        independent,
    )


def _hold_out(
    observations: Observations, held_out: tuple[ArrayLike, ...] | None, kinds: Sequence[str] | None
) -> tuple[Observations, Observations]:
    """Return the observations to fit, and those for validation: another motion's or the last."""
    count = len(observations.time)
    if held_out is None:
        rows = round(FITTED * count)
        if rows in (0, count):
            raise DataError(f"forces: {count} samples given, more are needed")
        return observations.part(slice(rows)), observations.part(slice(rows, None))
    regressor, forces, *used = held_out
    check = checked_observations(
        regressor,
        forces,
        names=observations.names,
        units=observations.units,
        kinds=kinds,
        used=used[0] if used else None,
        place="held_out",
    )
    actuators = f"forces of {check.actuators} actuators"
    expect(check.actuators == observations.actuators, "held_out", actuators, observations.actuators)
    return observations, check


def _estimate_by_instruments(
    fit: Observations,
    instruments: ArrayLike | Callable[[Array], ArrayLike],
    read: Callable[[ArrayLike], Observations],
) -> Estimate:
    """Return the estimate by instruments, or by a function that returns them for values."""
    if callable(instruments):
        return instrumental(fit, lambda beta: read(instruments(beta)))
    return instrumental(fit, read(instruments))


def _instruments(
    observations: Observations, count: int, independent: Reduced | None, numbers: ArrayLike
) -> Observations:
    """Return instruments as observations of the first `count` samples, which are fitted."""
    matrix = finite(numbers, "instruments")
    shape = observations.matrix.shape
    expected = f"that of the regressor, {shape},"
    expect(
        matrix.size == observations.matrix.size, "instruments", f"shape {matrix.shape}", expected
    )
    part = replace(observations, matrix=matrix.reshape(shape)).part(slice(count))
    return part if independent is None else part.columns(independent.kept)


def _predict(check: Observations, estimate: Estimate, *, repeats: bool) -> Prediction:
    """Return the prediction of held-out forces by the estimated values, with its errors."""
    predicted = check.matrix @ estimate.values
    without = np.full(predicted.shape, np.nan)
    if check.kinds:
        without = check.matrix @ np.where(np.isin(check.kinds, FRICTION), 0.0, estimate.values)
    # Equations that do not count are zero on both sides.
    used, counts = check.gain > 0.0, np.maximum(check.equation_counts, 1)
    error, error_without_friction = (
        np.sqrt(((check.forces - forces) ** 2).sum(axis=0) / counts)
        for forces in (predicted, without)
    )
    mean = check.forces.sum(axis=0) / counts
    size = np.sqrt((used * (check.forces - mean) ** 2).sum(axis=0) / counts)
    noise = estimate.noise
    if len(check.forces) >= _LEAST_ROWS and used.all():
        # Each of both is too large in one case: few samples, or a model that misses something.
        noise = np.minimum(noise, white_noise(check.forces))
    return Prediction(
        source="the last samples" if repeats else "the samples held out",
        samples=len(check.forces),
        left_out=1.0 - used.mean(axis=0),
        size=np.maximum(size, np.finfo(float).tiny),
        error=error,
        error_without_friction=error_without_friction,
        error_of_all=error,
        # Filters spread outliers: which samples they come from is not known.
        robust_error=error,
        outliers=np.zeros_like(error),
        noise=noise,
        time=check.time,
        measured=check.forces,
        predicted=predicted,
        without_friction=without,
        speed=np.full(predicted.shape, np.nan),
        used=used,
    )
