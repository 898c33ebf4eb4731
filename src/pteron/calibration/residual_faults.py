"""Faults that residuals show after a calibration's fit: rows that do not fit, slipped zeros, ...

Most faults are one more unknown. Its column of slopes tells, without another fit, by how much the
squared residuals would fall if it were sought too (a score test).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.calibration_fit import CalibrationFit
from pteron.calibration.fault_trials import (
    CHANCE,
    event_trials,
    order_trials,
    rod_trials,
    scale_trials,
    tilt_trials,
)
from pteron.calibration.fit import BEYOND, Fitter
from pteron.calibration.measurements import Measurements, error_unit, spread_rows
from pteron.calibration.result import CalibrationFinding
from pteron.calibration.score_test import MOST_ROWS, ScoreTest
from pteron.calibration.thresholds import OFF_TOLERANCES, ORDINARY_ERROR

Array = NDArray[np.float64]


_SHARE = 0.2
"""Least share of the squared residuals that a reported fault explains."""

_EXPLAINED = 0.3
"""Share of a row's residuals up to which the rest is explained by a fault."""

_NOISY = 4.0
"""Mean square residual along one leg's coordinate, in variances, above which it is reported."""


_LISTED = 8
"""Most outlying rows that are named."""


def residual_faults(
    fitter: Fitter, fit: CalibrationFit, reasons: Mapping[int, str] | None = None
) -> tuple[CalibrationFinding, ...]:
    """Return the fault that explains most residuals, and the rows that do not fit even so.

    `reasons` say by row why it was set aside before the fit.
    """
    findings, explained = _find_fault(fitter, fit)
    findings = findings or tuple(_bad_leg(fitter, fit))
    return *findings, *_outliers(fit, fitter.measurements, ~fit.kept & ~explained, reasons or {})


def zero_faults(fitter: Fitter, fit: CalibrationFit) -> tuple[CalibrationFinding, ...]:
    """Return a finding for each joint whose zero is far beyond its tolerance, with its size.

    A size is the median difference of joint coordinates, as a guide point takes part of a zero.
    """
    start, measurements = fitter.begin, fitter.measurements
    rows = np.flatnonzero(fit.kept)
    joints = fitter.slopes.joints(start, fit.poses[rows]) - start.joints(
        measurements.readings[rows]
    )
    far = {
        leg
        for block in fitter.blocks
        if block.kind == "zeros"
        for leg, u, t in zip(block.legs, block.unknowns, fit.total[block.where], strict=True)
        if abs(t) > OFF_TOLERANCES * u.tolerance
    }
    findings = []
    for i, (leg, name) in enumerate(zip(start.robot.legs, start.robot.joint_names, strict=True)):
        zero, linear = float(np.median(joints[:, i])), leg.joint.unit == "m"
        if i in far:
            size = f"{1e3 * zero:+.3g} mm" if linear else f"{np.degrees(zero):+.3g} degrees"
            text = (
                f"The zero of joint {i + 1} ({name}) is off by about {size}: home it, or check "
                "where its end stop is."
            )
            findings.append(CalibrationFinding("zero", text))
    return tuple(findings)


def _outliers(
    fit: CalibrationFit,
    measurements: Measurements,
    out: NDArray[np.bool_],
    reasons: Mapping[int, str],
) -> tuple[CalibrationFinding, ...]:
    """Return a finding that lists the outliers with the largest residuals; none without them."""
    rows = np.flatnonzero(out)
    if not len(rows):
        return ()
    worst = rows[np.argsort(-fit.distances[rows])][:_LISTED]
    kinds = measurements.kind_of
    named = ", ".join(
        f"{measurements.places[i]} ({reasons.get(int(i)) or _residual_text(fit, i, kinds)})"
        for i in worst
    )
    others = f" and {len(rows) - len(worst)} more" if len(rows) > len(worst) else ""
    text = f"Left out, as {'they do' if len(rows) > 1 else 'it does'} not fit: {named}{others}."
    return (CalibrationFinding("outlier", text, float((fit.distances[rows] ** 2).sum())),)


def _residual_text(fit: CalibrationFit, row: int, kinds: NDArray[np.str_]) -> str:
    """Return a row's largest residual in words, or that its readings lead to no pose."""
    if fit.distances[row] == BEYOND:
        return "its readings lead to no pose"
    residuals = fit.residuals[row]
    k = int(np.abs(residuals).argmax())
    return f"off by {1e3 * abs(residuals[k]):.3g} {error_unit(str(kinds[k]))}"


def _find_fault(
    fitter: Fitter, fit: CalibrationFit
) -> tuple[tuple[CalibrationFinding, ...], NDArray[np.bool_]]:
    """Return the best-explaining fault, if significant, and the rows (N,) it explains."""
    test = ScoreTest(fitter, fit)
    tried, best, gain = 0, None, -np.inf
    trials = (event_trials, scale_trials, rod_trials, tilt_trials, order_trials)
    for trial in chain.from_iterable(tries(test) for tries in trials):
        tried += 1
        more_than_chance = trial.fall - float(scipy.stats.chi2.isf(0.5, trial.freedom))
        if more_than_chance > gain:
            best, gain = trial, more_than_chance
    explained = np.zeros(len(fitter.measurements), dtype=bool)
    share = _SHARE * float(test.squares.sum()) / test.variance
    if best is None or best.fall <= share or test.chance(best) >= CHANCE / tried:
        return (), explained
    after = np.linalg.norm(test.residuals + test.refit_residuals(best.moved), axis=-1)
    explained[test.rows] = after < _EXPLAINED * np.linalg.norm(test.residuals, axis=-1)
    # Rods that differ, and a tilt, the geometry takes; what it does not take of them is left.
    follows = best.kind in ("unequal rods", "tilted platform")
    moved = test.refit_residuals(best.moved) if follows else best.moved
    kinds = [str(kind) for kind in fitter.measurements.kind_of]
    limits = np.array([ORDINARY_ERROR[kind] / fit.noise[kind] for kind in kinds])
    effect = float((np.abs(moved) / limits)[fit.kept[test.rows]].max(initial=0.0))
    return (CalibrationFinding(best.kind, best.text, gain, effect),), explained


def _bad_leg(fitter: Fitter, fit: CalibrationFit) -> Iterator[CalibrationFinding]:
    """Yield a finding for the leg whose coordinate alone explains residuals beyond noise."""
    if not set(fitter.measurements.setup.noise) - {"readings"}:
        return  # noise that was found explains everything
    names = fitter.begin.robot.joint_names
    fitted_rows = np.flatnonzero(fit.kept)
    chosen = fitted_rows[spread_rows(len(fitted_rows), MOST_ROWS)]
    at = fitter.slopes.rows(fit.guess, fitter.measurements, fit.poses, chosen)
    sizes = np.array([fit.noise[kind] for kind in fitter.kind_of])
    r, columns = at.residuals / sizes, at.by_reading[..., : len(names)] / sizes[:, None]
    projections = np.einsum("nki,nk->ni", columns, r)
    squares = projections**2 / np.maximum(np.einsum("nki,nki->ni", columns, columns), 1e-300)
    mean = squares.mean(axis=0)
    first, second = np.argsort(-mean)[:2]
    if mean[first] > _NOISY and mean[first] > 2.0 * mean[second]:
        text = (
            f"Leg {first + 1} ({names[first]}) does not move as its model says, by "
            f"{np.sqrt(mean[first]):.2g} times the noise: look for play, bending, or joints whose "
            "axes do not meet."
        )
        yield CalibrationFinding("wrong model", text, float(squares[:, first].sum()))
