"""Maximum likelihood where positions are noisy as well as forces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from scipy import sparse  # type: ignore[import-untyped]
from scipy.interpolate import BSpline  # type: ignore[import-untyped]
from scipy.sparse.linalg import splu  # type: ignore[import-untyped]

from pteron.errors import DataError
from pteron.identification.equations import Equations, equations_of, in_motion
from pteron.identification.estimators.estimate import Estimate, estimate_of
from pteron.identification.estimators.triangle import triangle
from pteron.identification.estimators.weighted import weighted
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.signals import States, Treatment
from pteron.identification.signals.fourier import fitted_series
from pteron.identification.signals.spline import fitted_spline
from pteron.kernels import Array

__all__ = ["maximum_likelihood"]

_NAME = "maximum likelihood"

_ITERATIONS = 15
_RENEWED = 2
"""Iterations that compute the forces' slopes anew: they change with the motion only a little."""

_ENDS = 2.0
"""Knots at each end of a spline whose samples are left out: few samples hold it there."""

_SETTLED = 1e-2
"""Largest change of a value, in standard deviations."""

_STEPS = (1e-5, 1e-3, 1e-1)
"""Of the differences by position, rate and acceleration: m and s."""

_LEAST_NOISE = 1e-6
"""Of an actuator, relative to the largest: one without equations has none."""

_MOST = 20_000
"""Coefficients of the motion that are fitted at once."""


@dataclass(frozen=True)
class _Motion:
    """The sliders' motion as a sum of basis functions."""

    coefficients: Array
    noise: Array
    """(n,): standard deviation of the measured positions about it."""
    spline: BSpline | None
    period: float

    @classmethod
    def fitted(cls, log: Log, treatment: Treatment) -> _Motion:
        if treatment.derivatives == "periodic":
            assert treatment.period is not None
            series = fitted_series(
                log.time, log.sliders, treatment.period, highest=treatment.cutoff
            )
            return cls(series.coefficients, series.noise, None, treatment.period)
        spline = fitted_spline(log.time, log.sliders, treatment.cutoff)
        rest = log.sliders - spline(log.time)
        degrees = max(len(rest) - len(spline.c), 1)
        return cls(spline.c, np.sqrt((rest**2).sum(axis=0) / degrees), spline, 0.0)

    def at(self, time: Array, derivative: int) -> Array:
        """Return the sliders (T, n) at times, or their derivatives."""
        return np.asarray(self.basis(time, derivative) @ self.coefficients)

    def basis(self, time: Array, derivative: int) -> sparse.csr_matrix:
        """Return the basis functions (T, C), or their derivatives."""
        if self.spline is None:
            from pteron.identification.signals.fourier import FourierSeries

            series = FourierSeries(self.period, self.coefficients, self.noise, 0)
            return sparse.csr_matrix(series.basis(time, derivative))
        count, degree = len(self.coefficients), self.spline.k
        if derivative == 0:
            return sparse.csr_matrix(BSpline.design_matrix(time, self.spline.t, degree))
        # A derivative is a spline of lower degree, whose coefficients are differences of these.
        slopes = BSpline(self.spline.t, np.eye(count), degree).derivative(derivative)
        design = BSpline.design_matrix(time, slopes.t, slopes.k)
        return sparse.csr_matrix(design @ sparse.csr_matrix(slopes.c[: design.shape[1]]))


def maximum_likelihood(model: Model, log: Log, treatment: Treatment) -> Estimate:
    """Return the values, and with them the motion, that make the log most likely.

    Positions and forces carry white noise, each slider and actuator its own. The motion is a smooth
    curve, a Fourier series or a spline, whose coefficients are found together with the values: the
    states in the regressor are those of the model, not those measured, as in methods that simulate
    the machine (DIDIM), but no controller needs to be known. Gauss and Newton's method takes the
    curve's coefficients through the forces' derivatives by position, rate and acceleration.

    It is worth its price where encoders are coarse; where they are fine it agrees with `weighted`.

    Parameters
    ----------
    model : Model
        What is identified.
    log : Log
        One log without gaps and with one payload.
    treatment : Treatment
        How it is treated; its cut-off says how smooth the motion is.

    Returns
    -------
    Estimate

    Raises
    ------
    DataError
        If the log has gaps, is too long to be fitted at once, or does not determine the values.
    """
    estimate = weighted(equations_of(model, log, treatment))
    if treatment.cutoff is None:
        return replace(estimate, method=_NAME)  # positions carry no noise
    _check(log)
    curve = _Motion.fitted(log, treatment)
    if curve.coefficients.size > _MOST:
        raise DataError(
            f"{log.source}: its motion has {curve.coefficients.size} coefficients, more than the "
            f"{_MOST} that maximum likelihood fits at once; give a part of the log"
        )
    measured = curve.coefficients
    base = curve.basis(log.time, 0)
    precision = sparse.diags(1.0 / treatment.slider_noise**2)
    information = sparse.kron(base.T @ base, precision, format="csc")
    values = estimate.values
    noise = estimate.noise
    # The motion can be bent until it explains nearly all of the forces: what is noise on them is
    # known without a model, and they are not to be followed closer than that.
    least = np.maximum(treatment.force_noise, _LEAST_NOISE * noise.max())
    noise = np.maximum(noise, least)
    found = measured.copy()
    for iteration in range(1, _ITERATIONS + 1):
        at = replace(curve, coefficients=found)
        equations = _sampled(model, log, at, treatment)
        if iteration <= _RENEWED:
            slopes = _slopes(model, values, at, equations, treatment)
        weights = np.tile(1.0 / (noise[None, :]), (len(equations.time), 1))
        w = (weights[..., None] * equations.matrix).reshape(-1, len(values))
        s = sparse.diags(weights.ravel()) @ slopes
        rest = (weights * (equations.forces - equations.matrix @ values)).ravel()
        # Normal equations; the motion is eliminated, its measurement being its prior.
        normal = splu((information + s.T @ s).tocsc())
        pull = information @ (measured - found).ravel() + s.T @ rest
        coupling = s.T @ w
        solved = normal.solve(np.column_stack([coupling, pull]))
        schur = w.T @ w - coupling.T @ solved[:, :-1]
        size = np.sqrt(np.diag(schur))
        inverse = np.linalg.inv(schur / np.outer(size, size)) / np.outer(size, size)
        step = inverse @ (w.T @ rest - coupling.T @ solved[:, -1])
        motion_step = solved[:, -1] - solved[:, :-1] @ step
        values = values + step
        found = found + motion_step.reshape(found.shape)
        # What is left of the forces, less what the values and the motion took.
        left = (rest - w @ step - s @ motion_step).reshape(weights.shape) * noise
        spent = 1.0 - len(values) / equations.rows
        noise = np.sqrt((left**2).sum(axis=0) / np.maximum(equations.used, 1) / spent)
        noise = np.maximum(noise, least)
        if (np.abs(step) <= _SETTLED * np.sqrt(np.diag(inverse))).all():
            break
    equations = _sampled(model, log, replace(curve, coefficients=found), treatment)
    return estimate_of(
        _NAME,
        equations,
        triangle(equations, 1.0 / noise),
        values,
        inverse,
        weights=1.0 / noise,
        iterations=iteration,
        inverse=inverse,
    )


def _check(log: Log) -> None:
    if len(log.segments) > 1:
        raise DataError(
            f"{log.source}: has gaps; give a part without one to maximum likelihood, or choose "
            "another estimator"
        )
    if log.payload is not None and np.ptp(log.payload) > 0:
        raise DataError(
            f"{log.source}: the payload changes; give a part with one payload to maximum "
            "likelihood, or choose another estimator"
        )


def _states(model: Model, curve: _Motion, log: Log, treatment: Treatment) -> States:
    time = log.time
    return States.of_sliders(
        model.robot,
        (curve.at(time, 0), curve.at(time, 1), curve.at(time, 2)),
        time,
        treatment.mode,
        payload=log.payload,
        source=log.source,
        first_row=log.first_row,
    )


def _sampled(model: Model, log: Log, curve: _Motion, treatment: Treatment) -> Equations:
    """Return the equations of a motion at the log's own samples, which no filter has touched."""
    states = _states(model, curve, log, treatment)
    used = in_motion(states.slider_rates, treatment.slow, treatment.settling)
    if curve.spline is not None:
        ends = ceil(_ENDS * treatment.rate / (2.0 * treatment.cutoff)) if treatment.cutoff else 0
        used[:ends] = used[len(used) - ends :] = 0.0
    return Equations(
        model.names,
        model.units,
        used[..., None] * model.matrix(states),
        used * log.forces,
        log.time,
        used,
        states.payload,
        log.source,
    )


def _slopes(
    model: Model, values: Array, curve: _Motion, equations: Equations, treatment: Treatment
) -> sparse.csr_matrix:
    """Return the derivatives (T n, C n) of the forces by the motion's coefficients."""
    time = equations.time
    parts = [curve.at(time, k) for k in range(3)]
    smooth = values.copy()
    # Coulomb friction has no slope, but where the rate changes its sign.
    smooth[[k for k, name in enumerate(model.names) if name.startswith("Fc")]] = 0.0
    n = equations.actuators
    rows = len(time)
    total = sparse.csr_matrix((rows * n, curve.coefficients.size))

    def forces(motion: list[Array]) -> Array:
        states = States.of_sliders(
            model.robot,
            (motion[0], motion[1], motion[2]),
            time,
            treatment.mode,
            payload=equations.payload,
            source=equations.source,
        )
        return np.asarray(model.matrix(states) @ smooth)

    for k, size in enumerate(_STEPS):
        basis = curve.basis(time, k)
        for j in range(n):
            shift = np.zeros(n)
            shift[j] = size
            plus = forces([part + shift if i == k else part for i, part in enumerate(parts)])
            minus = forces([part - shift if i == k else part for i, part in enumerate(parts)])
            slope = (plus - minus) / (2.0 * size) * equations.gain
            spread = sparse.kron(basis, sparse.csr_matrix(np.ones((n, 1))), format="csr")
            placed = sparse.diags(slope.ravel()) @ spread
            column = sparse.csr_matrix(([1.0], ([0], [j])), shape=(1, n))
            total = total + sparse.kron(placed, column, format="csr")
    return total
