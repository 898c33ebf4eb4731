"""Values, verdict and base parameters of a regressor that a user brings, a serial arm's too."""

import runpy
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from mechanisms import CLIENTS

from pteron.errors import DataError, ModelError
from pteron.identification import estimate, independent_columns, ordinary, weighted_least_squares
from pteron.identification.checked_regressor import checked_observations

ARM = Path(__file__).parent.parent / "examples" / "serial_arm.py"
TRUE = np.array([2.0, -1.0, 0.5])
NAMES, UNITS = ("a", "b", "c"), ("kg", "N s/m", "N")


def made(seed=0, rows=400, noise=0.05):
    """Return a regressor of two actuators along a smooth motion, and noisy forces."""
    time = np.linspace(0.0, 20.0, rows)[:, None, None]
    w = np.sin(time * np.array([[1.0, 1.7, 0.6], [1.3, 0.8, 2.1]]) + [0.0, 1.0, 2.0])
    w[:, :, 2] += 1.0
    f = w @ TRUE + noise * np.random.default_rng(seed).normal(size=(rows, 2))
    return w, f


# Values and verdict


def test_every_form_of_the_same_numbers_gives_the_same_values():
    w, f = made()
    fit = estimate(w, f, names=NAMES, units=UNITS)
    stacked = estimate(w.reshape(-1, 3), f, names=NAMES, units=UNITS)
    lists = estimate(w.tolist(), f.tolist(), names=NAMES, units=UNITS)
    assert (np.abs(fit.estimate.values - TRUE) < 4.0 * fit.estimate.deviations).all()
    for other in (stacked, lists):
        assert other.estimate.values == pytest.approx(fit.estimate.values)
    assert fit.estimate.names == fit.essential.names == NAMES
    assert fit.estimate.units == UNITS
    # 280 of 400 samples are fitted, and the others held out.
    assert (fit.estimate.rows, fit.held_out.samples) == (560, 120)
    plain = np.linalg.lstsq(w[:280].reshape(-1, 3), f[:280].ravel(), rcond=None)[0]
    assert estimate(w, f, estimator="ordinary").estimate.values == pytest.approx(plain)
    assert estimate(w, f, estimator=ordinary).estimate.values == pytest.approx(plain)
    assert estimate(w, f).estimate.names == ("beta1", "beta2", "beta3")


def test_a_single_actuator_needs_no_axis_of_its_own():
    w, f = made()
    fit = estimate(w[:, 0], f[:, 0])
    assert fit.estimate.values == pytest.approx(TRUE, abs=0.1)
    assert fit.held_out.nrms.shape == (1,)


def test_a_model_is_judged_by_another_motion():
    w, f = made()
    other, measured = made(1, rows=300)
    fit = estimate(w, f, held_out=(other, measured))
    assert fit.verdict.grade == "trustworthy"
    assert fit.estimate.rows == 800
    assert not any("repeat the motion" in reason for reason in fit.verdict.reasons)
    assert fit.held_out.error == pytest.approx([0.05, 0.05], rel=0.2)
    # A term is missing.
    fit = estimate(w[..., :2], f, held_out=(other[..., :2], measured))
    assert fit.verdict.grade == "not trustworthy"
    repeated = estimate(w, f)
    assert any("repeat the motion" in reason for reason in repeated.verdict.reasons)


def test_friction_that_is_named_so_is_told_apart():
    w, f = made()
    fit = estimate(w, f, kinds=("base", "viscous", "offset"))
    bare = f[280:] - w[280:, :, :1] @ fit.estimate.values[:1]
    expected = np.sqrt((bare**2).mean(axis=0))
    assert fit.held_out.error_without_friction == pytest.approx(expected)


def test_equations_that_do_not_count_are_left_out():
    w, f = made()
    used = np.ones(f.shape, dtype=bool)
    used[50:80, 1] = used[300:310, 0] = False
    wild = np.where(used, f, 1e6)
    fit = estimate(w, wild, used=used)
    assert fit.estimate.values == pytest.approx(TRUE, abs=0.1)
    assert fit.estimate.rows == 560 - 30
    assert fit.held_out.left_out == pytest.approx([10 / 120, 0.0])
    assert fit.verdict.grade == "trustworthy"


def test_instruments_are_taken_as_numbers_or_from_values():
    w, f = made()
    rng = np.random.default_rng(3)
    noisy = w + 0.3 * rng.normal(size=w.shape)
    plain = estimate(noisy, f).estimate
    numbers = estimate(noisy, f, estimator="instrumental", instruments=w).estimate
    asked = estimate(noisy, f, estimator="instrumental", instruments=lambda values: w).estimate
    assert np.abs(plain.values - TRUE).max() > 0.1
    assert (np.abs(numbers.values - TRUE) < 4.0 * numbers.deviations).all()
    assert asked.values == pytest.approx(numbers.values, rel=1e-2)


# Base parameters


def test_dependent_columns_are_found_and_named():
    w, f = made()
    wide = np.concatenate([w, 2.0 * w[..., :1] - 0.5 * w[..., 2:], 0.0 * w[..., :1]], axis=-1)
    names = (*NAMES, "d", "none")
    with pytest.raises(DataError, match=r"cannot be seen .*; or give reduce=True"):
        estimate(wide, f, names=names)
    fit = estimate(wide, f, names=names, reduce=True)
    found = fit.reduced
    assert (len(found.names), found.dependent_names[-1]) == (3, "none")
    assert found.gap > 1e6
    # The kept columns times the shares are the dependent ones.
    kept, dependent = wide[..., found.kept], wide[..., found.dependent]
    assert kept @ found.shares == pytest.approx(dependent, abs=1e-9)
    everything = np.array([*TRUE, 0.25, 7.0])
    assert kept @ found.values(everything) == pytest.approx(wide @ everything)
    assert found.expressions[found.names.index("b")] == "b"
    left = next(name for name in "acd" if name not in found.names)
    assert sum(left in text for text in found.expressions) == 2
    error = np.abs(fit.estimate.values - found.values(np.array([*TRUE, 0.0, 0.0])))
    assert (error < 4.0 * fit.estimate.deviations).all()


def test_independent_columns_stay_as_they_are():
    w, f = made()
    found = independent_columns(checked_observations(w, f))
    assert (found.kept, found.dependent, found.gap) == ((0, 1, 2), (), float("inf"))
    with pytest.raises(DataError, match="every column of the regressor is zero"):
        independent_columns(checked_observations(0.0 * w, f))


# Refusals


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"forces": np.zeros((400, 3))}, r"regressor: shape \(400, 2, 3\) given, \(400, 3, p\) or"),
        ({"forces": np.zeros((2, 2, 2))}, r"forces: shape \(2, 2, 2\) given"),
        ({"forces": []}, r"forces: shape \(0,\) given"),
        ({"forces": ["x"]}, r"forces: \['x'\] given, real numbers expected"),
        ({"regressor": "nan"}, r"regressor: nan at \[7, 1, 2\], a finite number expected"),
        ({"names": ["a", "b"]}, "names: 2 given, 3 expected"),
        ({"names": "abc"}, r"names: 'abc' given, a sequence \(each a text\)"),
        ({"names": ["a", "b", "a"]}, "names: 'a' stands twice"),
        ({"units": ["N"]}, "units: 1 given, 3 expected"),
        ({"time": np.zeros(400)}, "time: 400 rising numbers expected"),
        ({"used": [True]}, r"used: shape \(1,\) given, \(400, 2\) expected"),
        ({"held_out": (np.zeros((5, 2, 2)), np.zeros((5, 2)))}, "held_out: names: 3 given, 2"),
        ({"held_out": (np.zeros((5, 1, 3)), np.zeros((5, 1)))}, "held_out: forces of 1 actuators"),
        (
            {"estimator": "instrumental", "instruments": np.zeros((4, 2, 3))},
            r"instruments: shape \(4, 2, 3\) given, that of the regressor",
        ),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(change, message):
    w, f = made()
    if change.get("regressor") == "nan":
        w[7, 1, 2] = np.nan
        change = {}
    with pytest.raises(DataError, match=message) as caught:
        estimate(**({"regressor": w, "forces": f} | change))
    assert "\n" not in str(caught.value)


def test_estimators_and_instruments_belong_together():
    w, f = made()
    with pytest.raises(
        ModelError, match="estimator: 'likelihood' is not one of ordinary, weighted"
    ):
        estimate(w, f, estimator="likelihood")
    for given_ones in ({"estimator": "instrumental"}, {"instruments": w}):
        with pytest.raises(ModelError, match="instruments: belong to estimator"):
            estimate(w, f, **given_ones)


# A serial arm


@lru_cache(maxsize=1)
def arm():
    """Return the example of a serial arm, with its functions."""
    pytest.importorskip("pinocchio")
    return runpy.run_path(str(ARM))


@CLIENTS
def test_a_serial_arm_is_identified():
    example = arm()
    other = example["prepared"](*example["recorded"](100))
    distances, single = [], []
    for seed in range(6):
        w, f, used = example["prepared"](*example["recorded"](seed))
        fit = estimate(w, f, names=example["NAMES"], used=used, held_out=other, reduce=True)
        # 36 base parameters of six revolute joints (Khalil and Gautier), and 12 of friction.
        assert len(fit.reduced.names) == 48
        assert fit.reduced.gap > 1e6
        truth = fit.reduced.values(example["TRUTH"])
        low, high = fit.estimate.intervals()
        single.append(((low <= truth) & (truth <= high)).mean())
        distances.append(fit.estimate.distance(truth) ** 2 / 48)
        assert fit.verdict.grade == "trustworthy"
        # Held-out error is noise, averaged over blocks of 20 samples.
        assert fit.held_out.error == pytest.approx(example["NOISE"] / np.sqrt(20.0), rel=0.2)
        assert {"Fc1", "Fv1", "Fc6"} <= set(fit.essential.names)
    assert np.mean(single) > 0.9
    assert np.mean(distances) == pytest.approx(1.0, abs=0.25)


def test_a_serial_arm_without_friction_in_its_model_is_not_trusted():
    example = arm()
    (w, f, used), (w2, f2, used2) = (
        example["prepared"](*example["recorded"](seed)) for seed in (1, 2)
    )
    fit = estimate(
        w[..., :60], f, used=used, held_out=(w2[..., :60], f2, used2), reduce=True,
        estimator=weighted_least_squares,
    )  # fmt: skip
    assert fit.verdict.grade == "not trustworthy"
