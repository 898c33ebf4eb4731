"""Maximum likelihood: values and motion together, where positions are noisy as well as forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.identification.estimators.estimate import Estimate, SearchRecord, estimate_of
from pteron.identification.estimators.least_squares import weighted_least_squares
from pteron.identification.estimators.qr import qr_factor
from pteron.identification.felt_forces import felt_part, usable_samples
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.observation import (
    Observations,
    assemble_observations,
    motion_mask,
    observations_of,
)
from pteron.identification.signals import Preprocessing, States
from pteron.identification.signals.derivatives import Curve
from pteron.kernels import Array
from pteron.shapes import PoseLike

_NAME = "likelihood"
"""The method's name in its estimate."""

_RENEWED = 2
"""Iterations that compute the forces' slopes anew: they change with the motion only a little."""

_SETTLED = 1e-2
"""Largest change of a value, in standard deviations, that no longer matters."""

_STEPS = (1e-5, 1e-3, 1e-1)
"""Steps of the differences by position, rate and acceleration: m and s."""

_LEAST_NOISE = 1e-6
"""Least noise of an actuator, relative to the largest: an actuator without equations would have
none."""

_MOST = 20_000
"""Coefficients of the motion that are fitted at once."""


def maximum_likelihood(
    model: Model, log: Log, preprocessing: Preprocessing, *, iterations: int = 15
) -> Estimate:
    """Return the values, and with them the motion, that make the log most likely.

    Positions and forces carry white noise, each joint and actuator its own. The motion is a smooth
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
    preprocessing : Preprocessing
        How it is preprocessed; its cut-off says how smooth the motion is.
    iterations : int
        How many steps of Gauss and Newton are taken at most.

    Raises
    ------
    LogError
        If the log has gaps, is too long to be fitted at once, or does not determine the values.
    """
    estimate = weighted_least_squares(observations_of(model, log, preprocessing))
    if preprocessing.cutoff is None:
        return replace(estimate, method=_NAME)  # positions carry no noise
    _check_continuous(log)
    curve = preprocessing.differentiator.curve(log)
    measured = curve.coefficients
    _expect_small(log, measured.size)
    base = curve.bases[0]
    precision = scipy.sparse.diags(1.0 / preprocessing.joint_noise**2)
    information = scipy.sparse.kron(base.T @ base, precision, format="csc")
    beta = estimate.values
    # The motion can be bent until it explains nearly all of the forces: what is noise on them is
    # known without a model, and they are not to be followed closer than that.
    least = np.maximum(preprocessing.force_noise, _LEAST_NOISE * estimate.noise.max())
    noise = np.maximum(estimate.noise, least)
    search = SearchRecord(_NAME)
    for _ in search.steps(iterations):
        observations = _sample_observations(model, log, curve, preprocessing)
        if search.iterations <= _RENEWED:
            slopes = _slopes(model, beta, log, curve, observations.gain, preprocessing.start)
        # Linearised about the present motion
        weights = np.tile(1.0 / noise, (len(observations.time), 1))
        w = (weights[..., None] * observations.matrix).reshape(-1, len(beta))
        s = scipy.sparse.diags(weights.ravel()) @ slopes
        residuals = (weights * (observations.forces - observations.matrix @ beta)).ravel()
        # Normal equations; the motion is eliminated, its measurement being its prior.
        normal = scipy.sparse.linalg.splu((information + s.T @ s).tocsc())
        pull = information @ (measured - curve.coefficients).ravel() + s.T @ residuals
        coupling = s.T @ w
        solved = normal.solve(np.column_stack([coupling, pull]))
        schur = w.T @ w - coupling.T @ solved[:, :-1]
        size = np.sqrt(np.diag(schur))
        inverse = np.linalg.inv(schur / np.outer(size, size)) / np.outer(size, size)
        step = inverse @ (w.T @ residuals - coupling.T @ solved[:, -1])
        motion_step = solved[:, -1] - solved[:, :-1] @ step
        beta = beta + step
        coefficients = curve.coefficients + motion_step.reshape(measured.shape)
        curve = replace(curve, coefficients=coefficients)
        # What is left of the forces, less what the values and the motion took.
        remainder = (residuals - w @ step - s @ motion_step).reshape(weights.shape) * noise
        spent = 1.0 - len(beta) / observations.rows
        counts = np.maximum(observations.equation_counts, 1)
        noise = np.maximum(np.sqrt((remainder**2).sum(axis=0) / counts / spent), least)
        search.converged = bool((np.abs(step) <= _SETTLED * np.sqrt(np.diag(inverse))).all())
    # The values' own part of the forces: what the motion could do as well is taken out of it.
    moved = solved[:, :-1]
    projected_rows = (w - s @ moved).reshape(observations.matrix.shape) * noise[:, None]
    observations = _sample_observations(model, log, curve, preprocessing)
    solution = search, observations, qr_factor(observations, 1.0 / noise), beta
    extra = moved.T @ (information @ moved)
    return estimate_of(
        *solution, weights=1.0 / noise, inverse=inverse, instruments=projected_rows, extra=extra
    )


def _check_continuous(log: Log) -> None:
    """Raise LogError where a log has gaps or its payload changes."""
    advice = "to maximum likelihood, or choose another estimator"
    if len(log.segments) > 1:
        raise log.fault("gap", f"has gaps; give a part without one {advice}")
    if log.payload is not None and np.ptp(log.payload) > 0:
        said = f"the payload changes; give a part with one payload {advice}"
        raise log.fault("no payload", said)


def _expect_small(log: Log, coefficients: int) -> None:
    """Raise LogError if a motion has more coefficients than are fitted at once."""
    if coefficients > _MOST:
        raise log.fault(
            "too large",
            f"its motion has {coefficients} coefficients, more than the {_MOST} that maximum "
            "likelihood fits at once; give a part of the log",
        )


def _sample_observations(
    model: Model, log: Log, curve: Curve, preprocessing: Preprocessing
) -> Observations:
    """Return the unfiltered observations of a curve's motion at the log's samples."""
    states = States.from_log(model.robot, log, curve.motion, preprocessing.start)
    used = motion_mask(states.joint_rates, preprocessing.slow, preprocessing.settling_rows)
    used[: curve.ends] = used[len(used) - curve.ends :] = 0.0
    used = usable_samples(model.robot, used)
    matrix, forces = (
        felt_part(model.robot, states.pose, part) for part in (model.matrix(states), log.forces)
    )
    rows = used[..., None] * matrix, used * forces
    observations = assemble_observations(model, *rows, used, log.time, states.payload, 1.0)
    return replace(observations, source=log.source)


def _slopes(
    model: Model, beta: Array, log: Log, curve: Curve, used: Array, start: PoseLike
) -> scipy.sparse.csr_matrix:
    """Return the derivatives (T n, C n) of the forces by the motion's coefficients."""
    # Coulomb friction has no slope, but where the rate changes its sign.
    smooth = np.where(np.isin(model.kinds, ("coulomb", "stribeck")), 0.0, beta)
    n = used.shape[1]
    motion = curve.motion
    total = scipy.sparse.csr_matrix((used.size, curve.coefficients.size))

    def forces(k: int, shift: Array) -> Array:
        """Return the forces (T, n) with one derivative of the motion shifted."""
        q, dq, ddq = (part + shift if i == k else part for i, part in enumerate(motion))
        states = States.from_log(model.robot, log, (q, dq, ddq), start)
        return felt_part(model.robot, states.pose, model.matrix(states) @ smooth)

    for k, size in enumerate(_STEPS):
        spread = scipy.sparse.kron(
            curve.bases[k], scipy.sparse.csr_matrix(np.ones((n, 1))), format="csr"
        )
        for j, shift in enumerate(size * np.eye(n)):
            slope = (forces(k, shift) - forces(k, -shift)) / (2.0 * size) * used
            placed = scipy.sparse.diags(slope.ravel()) @ spread
            column = scipy.sparse.csr_matrix(([1.0], ([0], [j])), shape=(1, n))
            total = total + scipy.sparse.kron(placed, column, format="csr")
    return total
