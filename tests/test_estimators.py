"""Estimators on equations made by hand: values, what they say of their errors, what they refuse."""

from dataclasses import replace
from functools import lru_cache, partial
from types import SimpleNamespace

import numpy as np
import pytest
from logs_of_motions import log_of, truth
from mechanisms import CATALOG, CLIENTS, NIGHTLY, gated
from scipy.signal import lfilter
from scipy.stats import binom

from pteron.errors import DataError
from pteron.identification.estimators import (
    ESTIMATORS,
    column_errors,
    essential_parameters,
    halves,
    huber,
    instrumental,
    maximum_likelihood,
    ordinary,
    qr_factor,
    total,
    weighted_least_squares,
    whiteness,
)
from pteron.identification.estimators.covariance import Noise, noise_of
from pteron.identification.model import identification_model
from pteron.identification.observation import Observations, observations_of
from pteron.identification.signals import Processing, preprocessing_for_log

P = 6
TRUE = np.array([2.0, -1.0, 0.5, 3.0, 0.3, -0.2])
NAMES = ("a", "b", "c", "d", "Fc1", "offset1")
DRAWS = 100

each_estimator = pytest.mark.parametrize("estimator", list(ESTIMATORS.values()), ids=ESTIMATORS)


def made(matrix, forces, *, names=NAMES, used=None):
    """Return equations; those that are not used are zero, as `observations_of` leaves them."""
    gain = np.ones(forces.shape) if used is None else used.astype(float)
    rows = len(forces)
    return Observations(
        tuple(names[: matrix.shape[-1]]),
        ("N",) * matrix.shape[-1],
        matrix * gain[..., None],
        forces * gain,
        np.arange(rows) / 10.0,
        gain,
        np.zeros(rows, dtype=np.int64),
    )


def regressor(rows=120, n=3, seed=0):
    """Return a regressor whose columns differ in size and hang together a little."""
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(rows, n, P)) * [1.0, 20.0, 0.3, 2.0, 1.0, 1.0]
    matrix[..., 2] += 0.2 * matrix[..., 0]
    matrix[..., 4] = np.sign(matrix[..., 4])
    matrix[..., 5] = 1.0
    return matrix


def drawn(seed, noise=0.3, **shape):
    """Return equations with white noise of a size, one or one for each actuator."""
    matrix = regressor(**shape)
    forces = matrix @ TRUE
    return made(matrix, forces + noise * np.random.default_rng(seed).normal(size=forces.shape))


def standard_errors(estimator, equations):
    """Return the errors of many draws in standard deviations, (draws, p)."""
    found = []
    for seed in range(DRAWS):
        estimate = estimator(equations(seed))
        found.append((estimate.values - TRUE) / estimate.deviations)
    return np.array(found)


def check_coverage(errors):
    """Check that 95 % intervals hold the truth as often as they say, and errors average out."""
    held = (np.abs(errors) < 1.959964).sum()
    low, high = binom.interval(0.9999, errors.size // 2, 0.95)  # columns hang together a little
    assert 2.0 * low < held + 0.006 * errors.size
    assert held - 0.006 * errors.size < 2.0 * high
    assert np.abs(errors.mean(axis=0)).max() < 4.0 / np.sqrt(len(errors))


# Values


def test_ordinary_is_that_of_numpy():
    equations = drawn(1)
    flat, forces = equations.matrix.reshape(-1, P), equations.forces.ravel()
    expected, rest, _, _ = np.linalg.lstsq(flat, forces, rcond=None)
    estimate = ordinary(equations)
    assert estimate.values == pytest.approx(expected, rel=1e-11)
    covariance = rest[0] / (len(flat) - P) * np.linalg.inv(flat.T @ flat)
    # White noise here: what little correlation in time it seems to have changes little.
    assert estimate.deviations == pytest.approx(np.sqrt(np.diag(covariance)), rel=0.15)
    size = np.sqrt(np.diag(covariance))
    assert estimate.correlation == pytest.approx(covariance / np.outer(size, size), abs=0.1)
    assert estimate.condition == pytest.approx(np.linalg.cond(flat / np.linalg.norm(flat, axis=0)))
    assert estimate.residuals == pytest.approx(equations.forces - equations.matrix @ expected)


def test_weighted_is_that_of_numpy_with_rows_scaled():
    equations = drawn(2, noise=np.array([0.1, 1.0, 5.0]))
    estimate = weighted_least_squares(equations)
    assert estimate.noise == pytest.approx([0.1, 1.0, 5.0], rel=0.2)
    scaled = equations.matrix / estimate.noise[:, None]
    expected = np.linalg.lstsq(
        scaled.reshape(-1, P), (equations.forces / estimate.noise).ravel(), rcond=None
    )[0]
    # Weights settle to a thousandth.
    assert (np.abs(estimate.values - expected) < 0.01 * estimate.deviations).all()


def test_a_factor_holds_all_that_its_blocks_do():
    equations = drawn(3, rows=200)
    weights = np.random.default_rng(0).uniform(0.5, 2.0, equations.forces.shape)
    whole = qr_factor(equations, weights)
    parts = qr_factor(equations, weights, block=7)
    assert parts.values() == pytest.approx(whole.values(), rel=1e-12)
    assert parts.inverse() == pytest.approx(whole.inverse(), rel=1e-10)
    assert parts.rest == pytest.approx(whole.rest, rel=1e-10)


@each_estimator
def test_noise_free_equations_give_the_values(estimator):
    estimate = estimator(drawn(0, noise=0.0))
    assert estimate.values == pytest.approx(TRUE, abs=1e-10)
    assert (estimate.deviations < 1e-9).all()


@each_estimator
def test_an_estimate_carries_its_diagnosis(estimator):
    estimate = estimator(drawn(4))
    assert estimate.names == NAMES
    assert estimate.deviations == pytest.approx(np.sqrt(np.diag(estimate.covariance)))
    assert estimate.relative_deviations == pytest.approx(
        estimate.deviations / np.abs(estimate.values)
    )
    assert np.diag(estimate.correlation) == pytest.approx(1.0)
    assert np.abs(estimate.correlation).max() < 1.0 + 1e-12
    assert estimate.whiteness.white
    assert not estimate.has_correlated_residuals
    assert estimate.rows == 360
    assert estimate.noise == pytest.approx(0.3, rel=0.25)
    low, high = estimate.intervals(0.5)
    assert high - low == pytest.approx(2.0 * 0.6744897 * estimate.deviations)
    assert estimate.value("c") == estimate.values[2]
    assert estimate.as_dict()["equations"] == 360


@pytest.mark.parametrize("estimator", [weighted_least_squares, huber])
def test_an_estimate_says_whether_its_search_has_settled(estimator):
    equations = drawn(4, noise=np.array([0.1, 1.0, 5.0]))
    settled, hasty = estimator(equations), estimator(equations, iterations=1)
    assert settled.converged
    assert settled.iterations > 1
    assert not hasty.converged
    assert hasty.iterations == 1
    assert hasty.as_dict()["converged"] is False


def test_total_counts_its_iterations_and_says_whether_they_settled():
    equations = noisy_columns(0, 0.1)
    settled, hasty = total(equations, ERRORS), total(equations, ERRORS, iterations=1)
    assert settled.converged
    assert settled.iterations > 1
    assert (hasty.converged, hasty.iterations) == (False, 1)
    assert total(equations).iterations == 1


@each_estimator
def test_rows_that_are_not_used_count_for_nothing(estimator):
    whole = drawn(5, rows=100)
    spread = np.arange(150) % 3 != 2
    matrix, forces = regressor(150), np.zeros((150, 3))
    matrix[spread], forces[spread] = whole.matrix, whole.forces
    holed = made(matrix, forces, used=np.tile(spread[:, None], (1, 3)))
    one, other = estimator(whole), estimator(holed)
    assert other.rows == one.rows == 300
    assert other.values == pytest.approx(one.values, rel=1e-9)
    # Holes move rows apart in time, where their correlation is looked for.
    assert other.correlation == pytest.approx(one.correlation, abs=0.05)
    assert other.deviations == pytest.approx(one.deviations, rel=0.3)
    assert other.noise == pytest.approx(one.noise, rel=1e-9)


@each_estimator
def test_an_actuator_without_equations_is_no_matter(estimator):
    equations = drawn(6)
    used = np.ones((120, 3), dtype=bool)
    used[:, 1] = False
    estimate = estimator(made(equations.matrix, equations.forces, used=used))
    rest = np.ascontiguousarray(equations.matrix[:, ::2]), equations.forces[:, ::2]
    expected = estimator(made(*rest))
    assert estimate.rows == 240
    assert estimate.values == pytest.approx(expected.values, rel=1e-8)
    assert estimate.deviations == pytest.approx(expected.deviations, rel=1e-6)
    assert estimate.noise[1] == 0.0
    assert estimate.whiteness.p_values[1] == 1.0


@each_estimator
def test_one_equation_more_than_values_is_enough(estimator):
    equations = drawn(7, rows=7, n=1)
    estimate = estimator(equations)
    assert np.isfinite(estimate.values).all()
    assert (estimate.deviations > 0.0).all()


# Errors


@pytest.mark.parametrize(
    "estimator", gated([ordinary, weighted_least_squares, huber], [weighted_least_squares])
)
def test_intervals_hold_the_truth(estimator):
    check_coverage(standard_errors(estimator, drawn))


@pytest.mark.parametrize("estimator", gated([weighted_least_squares, huber], [huber]))
def test_intervals_hold_the_truth_where_actuators_differ(estimator):
    noise = np.array([0.05, 0.5, 3.0])
    check_coverage(standard_errors(estimator, lambda seed: drawn(seed, noise)))


def test_weights_are_worth_their_while():
    noise = np.array([0.05, 0.5, 3.0])
    errors = {
        name: np.mean(
            [(ESTIMATORS[name](drawn(seed, noise)).values - TRUE) ** 2 for seed in range(30)],
            axis=0,
        )
        for name in ("ordinary", "weighted")
    }
    assert (errors["weighted"] < 0.1 * errors["ordinary"]).all()


def with_outliers(seed, share=0.05):
    rng = np.random.default_rng(seed + 1000)
    equations = drawn(seed)
    hit = rng.uniform(size=equations.forces.shape) < share
    return equations.with_forces(equations.forces + hit * rng.normal(20.0, 20.0, hit.shape))


@CLIENTS
def test_huber_forgives_outliers():
    errors = standard_errors(huber, with_outliers)
    # One-sided outliers pull at the offset, and at nothing else.
    check_coverage(errors[:, :5])
    plain, robust = (
        np.mean([(f(with_outliers(seed)).values - TRUE) ** 2 for seed in range(40)], axis=0)
        for f in (ordinary, huber)
    )
    assert (robust < 0.05 * plain).all()


def test_huber_takes_half_of_the_equations_being_exact():
    # The median is zero then, and with it the scale.
    equations = drawn(0, noise=0.0)
    forces = equations.forces.copy()
    forces[::3] += np.random.default_rng(1).normal(size=forces[::3].shape)
    assert huber(equations.with_forces(forces)).values == pytest.approx(TRUE, abs=0.2)


MIX = np.eye(P)
MIX[0, 1], MIX[2, 3] = 20.0, 0.15
"""What makes column 1 all but column 0, and column 3 all but column 2, beside what is their own."""

BASE = np.linalg.solve(np.diag([1, 0.05, 1, 0.01, 1, 1]) + MIX - np.eye(P), TRUE)


def alike(equations):
    """Return equations of which two pairs of columns hang together; the truth is `BASE`."""
    mixed = equations.matrix @ (np.diag([1, 0.05, 1, 0.01, 1, 1]) + MIX - np.eye(P))
    return replace(equations, matrix=np.ascontiguousarray(mixed))


def coloured(seed, memory=0.8):
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(400, 3))
    for k in range(1, len(noise)):
        noise[k] += memory * noise[k - 1]
    slow = np.sin(0.02 * np.arange(400)[:, None, None] * np.arange(1, 4)[None, :, None])
    matrix = regressor(400)
    matrix[..., 5:] *= slow + 1.5
    return made(matrix, matrix @ TRUE + 0.3 * noise)


@pytest.mark.parametrize(
    "estimator", gated([ordinary, weighted_least_squares, huber], [weighted_least_squares])
)
def test_coloured_noise_is_seen_and_allowed_for(estimator):
    estimates = [estimator(coloured(seed)) for seed in range(80)]
    assert not any(estimate.whiteness.white for estimate in estimates)
    assert all(estimate.has_correlated_residuals for estimate in estimates)
    assert estimates[0].whiteness.autocorrelation == pytest.approx(0.8, abs=0.1)
    errors = np.array([(e.values - TRUE) / e.deviations for e in estimates])
    # The offset feels it most; what white noise would say of it holds not even two times in three.
    assert (np.abs(errors[:, 5]) < 1.96).mean() > 0.85
    assert (np.abs(errors) < 1.96).mean() > 0.92


@CLIENTS
@pytest.mark.parametrize("estimator", [ordinary, weighted_least_squares, huber])
def test_regions_hold_the_truth(estimator):
    # Two pairs of columns are all but the same: what is known of each single one says little.
    for made_by in (partial(drawn, rows=200), coloured):
        estimates = [estimator(alike(made_by(seed))) for seed in range(DRAWS)]
        held = [one.p_value(BASE) >= 0.05 for one in estimates]
        assert 0.88 <= np.mean(held) <= 0.99
        squares = [one.distance(BASE) ** 2 for one in estimates]
        assert np.mean(squares) == pytest.approx(P, rel=0.2)


def test_noise_that_actuators_share_is_allowed_for():
    errors, held = [], []
    for seed in range(DRAWS):
        rng = np.random.default_rng(seed)
        equations = drawn(seed, noise=0.1)
        shared = rng.normal(size=(len(equations.forces), 1))
        estimate = weighted_least_squares(equations.with_forces(equations.forces + shared))
        errors.append((estimate.values - TRUE) / estimate.deviations)
        held.append(estimate.p_value(TRUE) >= 0.05)
    assert (np.abs(errors) < 1.96).mean() == pytest.approx(0.95, abs=0.03)
    assert 0.88 <= np.mean(held) <= 0.99


def dense(noise, rows):
    """Return the covariance (R n, R n) of noise, row by row: inverse filters as matrices."""
    n = len(noise.root)
    total = np.zeros((rows, n, rows, n))
    responses = []
    for polynomial in noise.polynomials:
        band = np.zeros((rows, rows))
        for k, value in enumerate(polynomial):
            band += value * np.eye(rows, k=-k)
        responses.append(np.linalg.inv(band))
    for i, j in np.ndindex(n, n):
        share = (noise.root @ noise.root.T)[i, j]
        total[:, i, :, j] = share * responses[i] @ responses[j].T
    return total.reshape(rows * n, rows * n)


NOISE = Noise(
    (np.array([1.0, -0.6, 0.2]), np.array([1.0, 0.3]), np.ones(1)),
    np.array([[1.0, 0.0, 0.0], [0.4, 2.0, 0.0], [-0.2, 0.1, 0.5]]),
)


def test_the_noise_of_a_sum_is_that_of_its_dense_covariance():
    matrix = regressor(40)
    covariance = dense(NOISE, 40)
    flat = matrix.reshape(-1, P)
    assert NOISE.sum_covariance(matrix) == pytest.approx(flat.T @ covariance @ flat, rel=1e-10)
    product = NOISE.multiply_covariance(matrix).reshape(-1, P)
    assert product == pytest.approx(covariance @ flat, rel=1e-10)
    # Whatever the blocks.
    long = regressor(9000)
    ends = NOISE.sum_covariance(long[:40]), NOISE.sum_covariance(np.r_[long[:40], 0.0 * long[40:]])
    assert ends[0] == pytest.approx(ends[1], rel=1e-10)


@pytest.mark.parametrize(("memory", "rows"), [(0.0, 12), (0.5, 40)])
def test_what_a_fit_has_taken_of_the_noise_is_given_back(memory, rows):
    matrix = regressor(rows)
    flat = matrix.reshape(-1, P)
    left = np.eye(len(flat)) - flat @ np.linalg.pinv(flat)
    noise = Noise((np.array([1.0, -memory]),) * 3, np.diag([1.0, 2.0, 0.5]))
    root = np.linalg.cholesky(dense(noise, rows))
    rng = np.random.default_rng(0)
    found, used = [], np.ones((rows, 3), dtype=bool)
    for _ in range(300):
        rest = (left @ root @ rng.normal(size=len(flat))).reshape(rows, 3)
        found.append(np.diag(noise_of(matrix, rest, used).sum_covariance(matrix)))
    expected = np.diag(noise.sum_covariance(matrix))
    # Without it a sixth and more would be missing.
    assert np.mean(found, axis=0) == pytest.approx(expected, rel=0.12)


def test_white_noise_is_called_white_as_often_as_it_should():
    rng = np.random.default_rng(2)
    white = [whiteness(rng.normal(size=(300, 4))).white for _ in range(400)]
    assert np.mean(white) == pytest.approx(0.99, abs=0.012)


def test_stretches_that_are_left_out_do_not_colour_noise():
    rng = np.random.default_rng(3)
    used = np.tile((np.arange(900)[:, None] // 100) % 3 == 0, (1, 4))
    white = [whiteness(5.0 * used + rng.normal(size=(900, 4)) * used, used) for _ in range(300)]
    assert np.mean([test.white for test in white]) == pytest.approx(0.98, abs=0.02)


# Total least squares


ERRORS = np.array([0.15, 2.0, 0.05, 0.3, 0.0, 0.0])


def noisy_columns(seed, noise):
    rng = np.random.default_rng(seed)
    matrix = regressor(400)
    forces = matrix @ TRUE + noise * rng.normal(size=(400, 3))
    return made(matrix + ERRORS * rng.normal(size=matrix.shape), forces)


@pytest.mark.parametrize(
    "noise",
    [0.1, pytest.param(2.0, marks=NIGHTLY), np.array([0.3, 1.0, 3.0])],
    ids=str,
)
def test_total_takes_out_the_bias_of_noisy_columns(noise):
    plain, found, errors = [], [], []
    for seed in range(DRAWS):
        equations = noisy_columns(seed, noise)
        estimate = total(equations, ERRORS)
        plain.append(ordinary(equations).values - TRUE)
        found.append(estimate.values - TRUE)
        errors.append(found[-1] / estimate.deviations)
    bias, left = np.mean(plain, axis=0), np.mean(found, axis=0)
    assert np.abs(bias[:2] / TRUE[:2]).min() > 0.008
    assert (np.abs(left[:2]) < [0.6, 0.25] * np.abs(bias[:2])).all()
    assert np.abs(np.mean(errors, axis=0)).max() < 0.4
    assert (np.abs(errors) < 1.96).mean() > 0.9


def test_total_is_that_of_the_singular_vector():
    # All columns noisy, each relative to its size as the forces: the textbook's solution.
    names = tuple("abcdef")
    equations = replace(noisy_columns(0, 0.5), names=names)
    flat = equations.matrix.reshape(-1, P)
    estimate = total(equations)
    start = np.linalg.lstsq(flat, equations.forces.ravel(), rcond=None)[0]
    noise = np.sqrt(((equations.forces - equations.matrix @ start) ** 2).sum(axis=0) / 400)
    rows = equations.matrix / noise[:, None]
    forces = (equations.forces / noise).ravel()
    rows = rows.reshape(-1, P)
    # The noise of the forces has the degrees of freedom right, that of the columns is a share.
    size = np.linalg.norm(rows, axis=0) / np.linalg.norm(forces) * np.sqrt(1.0 - P / len(flat))
    last = np.linalg.svd(np.column_stack([rows / size, forces]))[2][-1]
    assert estimate.values == pytest.approx(-last[:-1] / last[-1] / size, rel=1e-6)


def test_exact_columns_are_left_as_they_are():
    equations = drawn(8)
    exact = total(equations, np.zeros(P))
    assert exact.values == pytest.approx(weighted_least_squares(equations).values, rel=1e-2)
    noise = np.sqrt(
        ((equations.forces - equations.matrix @ ordinary(equations).values) ** 2).mean(axis=0)
    )
    expected = np.linalg.lstsq(
        (equations.matrix / noise[:, None]).reshape(-1, P),
        (equations.forces / noise).ravel(),
        rcond=None,
    )[0]
    assert exact.values == pytest.approx(expected, rel=1e-9)


def test_noise_in_every_column_explains_all_or_nothing():
    rng = np.random.default_rng(9)
    equations = made(rng.normal(size=(400, 2, P)), rng.normal(size=(400, 2)))
    estimate = total(equations)
    assert (np.abs(estimate.values) < 5.0 * estimate.deviations).all()


# Instrumental variables


def measured_twice(seed, noise=0.1):
    """Return two regressors with noise of their own on the columns, and the same noisy forces."""
    rng = np.random.default_rng(seed)
    matrix = regressor(400)
    forces = matrix @ TRUE + noise * rng.normal(size=(400, 3))
    first, second = (matrix + ERRORS * rng.normal(size=matrix.shape) for _ in range(2))
    return made(first, forces), made(second, forces)


@pytest.mark.parametrize("mutual", [False, True])
def test_instruments_take_out_the_bias_of_noisy_columns(mutual):
    plain, found, errors = [], [], []
    for seed in range(DRAWS):
        one, other = measured_twice(seed)
        estimate = instrumental(one, other, mutual=mutual)
        assert estimate.converged
        plain.append(ordinary(one).values - TRUE)
        found.append(estimate.values - TRUE)
        errors.append(found[-1] / estimate.deviations)
    # Chance alone makes mean errors of 0.1 standard deviations.
    assert np.abs(np.mean(errors, axis=0)).max() < 0.4
    assert (np.abs(errors) < 1.96).mean() > 0.92
    bias, deviations = np.mean(plain, axis=0), np.std(found, axis=0)
    assert np.abs(bias[:2] / deviations[:2]).max() > 0.8


def test_the_regressor_as_its_own_instrument_is_weighted_least_squares():
    equations = drawn(2, noise=np.array([0.1, 1.0, 5.0]))
    one, other = instrumental(equations, equations), weighted_least_squares(equations)
    assert one.values == pytest.approx(other.values, rel=1e-3)
    assert one.covariance == pytest.approx(other.covariance, rel=1e-2, abs=1e-9)


def test_a_simulated_model_gives_instruments_until_its_values_settle():
    one, _ = measured_twice(0)
    asked = []

    def simulated(values):
        # States that are off as far as the values are: instruments need only be near.
        asked.append(values)
        return made(regressor(400) * (1.0 + 0.1 * (values - TRUE)), np.zeros((400, 3)))

    estimate = instrumental(one, simulated)
    assert estimate.converged
    assert len(asked) == estimate.iterations > 1
    assert asked[0] == pytest.approx(ordinary(one).values)
    expected = instrumental(one, made(regressor(400), np.zeros((400, 3))))
    assert (np.abs(estimate.values - expected.values) < 0.1 * expected.deviations).all()
    assert not instrumental(one, simulated, iterations=1).converged


def test_rows_without_an_instrument_are_left_out():
    one, other = measured_twice(0)
    used = np.ones((400, 3), dtype=bool)
    used[100:150, 1] = False
    part = instrumental(one, made(other.matrix, other.forces, used=used))
    assert part.rows == 1150
    assert not part.residuals[100:150, 1].any()


def test_instruments_of_another_shape_are_refused():
    one, _ = measured_twice(0)
    with pytest.raises(DataError, match=r"instruments: shape \(399, 3, 6\) given"):
        instrumental(one, made(one.matrix[1:], one.forces[1:]))


def test_halves_of_the_samples_are_instruments_of_each_other():
    robot = CATALOG["tripteron"]
    model = identification_model(robot)
    plain = log_of(robot, rate=1000.0, duration=6.0, harmonics=3, period=2.0, seed=2)
    rng = np.random.default_rng(0)
    log = replace(plain, joints=plain.joints + 1e-5 * rng.normal(size=plain.joints.shape))
    log = replace(log, forces=log.forces + 0.05 * rng.normal(size=log.forces.shape))
    # A cut-off that lets much noise through to the accelerations.
    treatment = preprocessing_for_log(robot, log, Processing(cutoff=40.0, band=20.0))
    one, other = halves(model, log, treatment)
    inertia = [k for k, kind in enumerate(model.kinds) if kind == "base"]
    found = instrumental(one, other, mutual=True)
    standard = (found.values - truth(model)) / found.deviations
    assert (np.abs(standard) < 4.0).all()
    biased = weighted_least_squares(observations_of(model, log, treatment))
    off = np.abs((biased.values - truth(model)) / biased.deviations)[inertia]
    assert np.abs(standard[inertia]).max() < 0.5 * off.max()


# Refusals


@each_estimator
def test_a_value_that_is_not_seen_is_named(estimator):
    equations = drawn(13)
    matrix = equations.matrix.copy()
    matrix[..., 3] = 0.0
    with pytest.raises(DataError, match=r"1 of 6 values cannot be seen \(d\)"):
        estimator(made(matrix, equations.forces))
    matrix = equations.matrix.copy()
    matrix[..., 0] = 3.0 * matrix[..., 1]
    with pytest.raises(DataError, match=r"2 of 6 values cannot be seen \(a, b\)"):
        estimator(made(matrix, equations.forces))


@each_estimator
def test_too_few_rows_are_refused(estimator):
    with pytest.raises(DataError, match="6 equations are left"):
        estimator(drawn(14, rows=2))
    with pytest.raises(DataError, match="0 equations are left"):
        estimator(made(regressor(), np.zeros((120, 3)), used=np.zeros((120, 3), dtype=bool)))


@pytest.mark.parametrize("threshold", [0.0, -1.0, float("nan")])
def test_a_threshold_that_cannot_be_is_refused(threshold):
    with pytest.raises(DataError, match="threshold"):
        huber(drawn(15), threshold=threshold)


# Essential parameters


def test_values_of_zero_are_dropped_and_others_kept():
    zero = np.array([True, False, False, False, True, False])
    values = np.where(zero, 0.0, TRUE)
    matrix = regressor()
    dropped = []
    for seed in range(60):
        noise = 0.3 * np.random.default_rng(seed).normal(size=(120, 3))
        equations = made(matrix, matrix @ values + noise)
        found = essential_parameters(
            equations, weighted_least_squares(equations), weighted_least_squares
        )
        assert found.names == tuple(n for n in NAMES if n not in found.dropped)
        assert set(found.dropped) <= {"a", "Fc1"}
        assert found.estimate.names == found.names
        dropped.append(len(found.dropped) == 2)
        if found.dropped:
            assert found.p_value >= found.level == 0.05
    # All zeros together are rejected once in twenty.
    assert binom.cdf(sum(dropped), 60, 0.95) > 1e-4


def test_a_pair_that_only_shows_together_is_kept():
    rng = np.random.default_rng(16)
    matrix = rng.normal(size=(150, 2, 3))
    matrix[..., 1] = matrix[..., 0] + 1e-3 * matrix[..., 1]
    equations = made(matrix, matrix @ [0.5, 0.5, 0.0] + 0.3 * rng.normal(size=(150, 2)))
    estimate = ordinary(equations)
    # Each for itself is lost in its deviation.
    assert (np.abs(estimate.values[:2]) < 2.0 * estimate.deviations[:2]).all()
    found = essential_parameters(equations, estimate, ordinary)
    assert len(set(found.names) & {"a", "b"}) == 1
    kept = next(iter(set(found.names) & {"a", "b"}))
    assert found.estimate.value(kept) == pytest.approx(1.0, abs=0.1)


def test_nothing_is_dropped_where_all_is_significant():
    equations = drawn(17, noise=1e-3)
    estimate = weighted_least_squares(equations)
    found = essential_parameters(equations, estimate, weighted_least_squares)
    assert (found.names, found.dropped) == (NAMES, ())
    assert found.estimate is estimate


# With logs


@lru_cache(maxsize=8)
def experiment(joint_noise, seed=0, derivatives="periodic"):
    """Return the model, log, treatment, equations and true values of a noisy log."""
    robot = CATALOG["tripteron"]
    model = identification_model(robot)
    log = log_of(
        robot,
        rate=250.0,
        joint_noise=joint_noise,
        force_noise=0.2,
        noise_seed=seed,
        harmonics=3,
        period=2.0,
        seed=2,
    )
    period = 2.0 if derivatives == "periodic" else None
    treatment = preprocessing_for_log(
        robot, log, Processing(derivatives=derivatives, period=period)
    )
    return SimpleNamespace(
        model=model,
        log=log,
        treatment=treatment,
        equations=observations_of(model, log, treatment),
        truth=truth(model),
    )


@pytest.mark.parametrize("name", gated(["quadrupteron", "tripteron", "delta"], ["delta"]))
def test_intervals_and_regions_of_logs_hold_the_truth(name):
    # The whole table: benchmarks/identification/regions.py.
    robot = CATALOG[name]
    model = identification_model(robot)
    values, count = truth(model), 12
    motion = {"rate": 500.0, "harmonics": 6, "period": 2.5, "duration": 10.0, "seed": 2}
    plain = log_of(robot, **motion)
    size = 0.01 * np.sqrt((plain.forces**2).mean(axis=0))
    single, distances = [], []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        noise = lfilter([0.8], [1.0, -0.6], rng.normal(size=plain.forces.shape), axis=0)
        positions = plain.joints + 1e-6 * rng.normal(size=plain.joints.shape)
        log = replace(plain, joints=positions, forces=plain.forces + size * noise)
        estimate = weighted_least_squares(
            observations_of(model, log, preprocessing_for_log(robot, log))
        )
        low, high = estimate.intervals()
        single.append(((low <= values) & (values <= high)).mean())
        distances.append(estimate.distance(values) ** 2)
    assert np.mean(single) > 0.9  # values hang together: 12 repetitions say little of single ones
    # Chi-square of p degrees: the mean of 12 is within 0.25 p in 99 cases of 100, and more.
    assert np.mean(distances) / len(values) == pytest.approx(1.0, abs=0.25)


def test_errors_of_columns_grow_with_the_noise():
    made_by = experiment(1e-5)
    small = column_errors(made_by.model, made_by.log, made_by.treatment)
    ten = replace(made_by.treatment, joint_noise=10.0 * made_by.treatment.joint_noise)
    large = column_errors(made_by.model, made_by.log, ten)
    names = made_by.model.names
    noisy = [k for k, name in enumerate(names) if not name.startswith(("Fc", "offset"))]
    moved = np.array([k for k in noisy if small[k] > 0.0])
    assert len(moved) > 0.5 * len(noisy)
    assert np.median(large[moved] / small[moved]) == pytest.approx(10.0, rel=0.15)
    offsets = [k for k, name in enumerate(names) if name.startswith("offset")]
    assert not small[offsets].any()
    assert not large[offsets].any()


def test_likelihood_agrees_with_weights_where_positions_are_good():
    made_by = experiment(1e-8)
    # Likelihood uses every sample, as the others do without a parallel filter.
    plain = replace(made_by.treatment, band=0.45 * made_by.treatment.rate)
    one = weighted_least_squares(observations_of(made_by.model, made_by.log, plain))
    other = maximum_likelihood(made_by.model, made_by.log, plain)
    assert other.names == one.names
    # The other one's band still takes a tenth of the noise away, and of the masked columns.
    assert (np.abs(other.values - one.values) < 1.0 * one.deviations).all()
    assert other.deviations == pytest.approx(one.deviations, rel=0.3)
    assert (np.abs(other.values - made_by.truth) < 4.5 * other.deviations).all()
    assert other.converged
    hasty = maximum_likelihood(made_by.model, made_by.log, plain, iterations=1)
    assert (hasty.converged, hasty.iterations) == (False, 1)


@CLIENTS
def test_likelihood_is_better_where_positions_are_noisy():
    worse = []
    for seed in range(2):
        made_by = experiment(1e-3, seed, "central")
        size = np.sqrt((made_by.equations.matrix**2).sum(axis=(0, 1)))
        likely = maximum_likelihood(made_by.model, made_by.log, made_by.treatment)
        plain = weighted_least_squares(made_by.equations)
        worse.append(
            np.linalg.norm(size * (plain.values - made_by.truth))
            / np.linalg.norm(size * (likely.values - made_by.truth))
        )
    assert np.exp(np.mean(np.log(worse))) > 1.2


def test_likelihood_refuses_what_it_cannot_fit():
    made_by = experiment(1e-5)
    payload = (np.arange(made_by.log.rows) > 1000).astype(int)
    with pytest.raises(DataError, match="payload changes"):
        maximum_likelihood(made_by.model, replace(made_by.log, payload=payload), made_by.treatment)


def test_motion_along_one_axis_names_what_it_cannot_see():
    robot = CATALOG["tripteron"]
    model = identification_model(robot)
    log = log_of(robot, size=np.array(0.0), turn=0.0)
    wave = 0.04 * np.sin(2.0 * np.pi * 0.5 * log.time)
    sliders = log.joints + np.outer(wave, [leg.direction[2] for leg in robot.legs])
    treatment = preprocessing_for_log(robot, replace(log, joints=sliders), Processing(band=10.0))
    with pytest.raises(DataError, match=r"too little motion: .* values cannot be seen"):
        weighted_least_squares(observations_of(model, replace(log, joints=sliders), treatment))
