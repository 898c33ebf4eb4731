"""`calibrate`: finds a machine's geometry from measurements and judges it at held-out rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect
from pteron.calibration.calibration_fit import CalibrationFit
from pteron.calibration.fault_trials import hidden_tilt
from pteron.calibration.fit import Fitter
from pteron.calibration.guess import Guess, UnknownBlock, tolerances_of
from pteron.calibration.measurements import Measurements, spread_rows
from pteron.calibration.observability import observability_of
from pteron.calibration.raw_faults import describe_mistake, hidden_order, raw_mistake
from pteron.calibration.residual_faults import residual_faults, zero_faults
from pteron.calibration.result import (
    Calibration,
    CalibrationFinding,
    HeldOut,
    calibrated_robot,
    open_errors,
    values_of,
)
from pteron.calibration.set_aside import rows_set_aside
from pteron.calibration.start import place_surroundings, starting_poses
from pteron.calibration.thresholds import FEW_LEFT_OUT, ordinary_error
from pteron.calibration.unknowns import blocks_of
from pteron.calibration.verdict import EVERY, Evidence, fitted_errors, rows_for_check, verdict_of
from pteron.errors import DataError
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.progress import Progress, Steps
from pteron.shapes import Seed, seed_number

Array = NDArray[np.float64]

_TRIED_ROWS = 5000
"""Most rows of the fit that is judged at the held-out rows; more change it little."""

_RANK_ROWS = 400
"""Rows, evenly spread, at which the singular values are taken."""

_STEPS = {"Starting": 1.0, "Fitting": 4.0, "Judging": 1.0, "Looking for faults": 2.0}
"""The steps of a calibration, and about how their times compare."""

_IN_TIME = ("slipped zero", "backlash", "drift")
"""Faults that differ from row to row, so that none of the whole log explains them."""


def calibrate(
    robot: RobotLike,
    measurements: Measurements,
    *,
    free: Sequence[str] | None = None,
    prior: Mapping[str, float] | None = None,
    held_out: Measurements | None = None,
    seed: Seed = 0,
    progress: Progress | None = None,
) -> Calibration:
    """Find a machine's geometry from measurements at many poses.

    Every row's readings lead to a pose; what was measured there, whole poses, positions of marks,
    heights over planes, distances, any of them together, is compared with it. The most probable
    geometry follows from the measurements and from ordinary tolerances about the drawing, which
    keep what the measurements do not show.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine as drawn.
    measurements : Measurements
        Readings and what was measured; `read_measurements` reads a log.
    free : sequence of str, optional
        What is sought: groups ("zeros", "scales", "lengths", "points", "directions", "tool",
        "radius", "angles") or single values; by default all groups but the last two, and "tool"
        only with positions or heights.
    prior : mapping, optional
        Standard deviations by group or value, m and rad, in place of ordinary tolerances
        (`TOLERANCES`); inf for none.
    held_out : Measurements, optional
        Rows for the verdict. By default every fifth row is, where there are enough: the verdict is
        on a fit without them, the values are from all.
    seed : int
        Of the random poses of the exact rank.
    progress : callable, optional
        Takes the share of the work that is done, a `Share` with the name of its step.

    Returns
    -------
    Calibration

    Raises
    ------
    DataError
        If most readings lead to no pose, or a name is unknown.

    Notes
    -----
    A mistake in the whole log that explains the measurements, such as swapped or reversed readings,
    is undone before the fit: the result is not trustworthy, and its first reason names the mistake.

    Residuals are weighted by their noise, given or found; readings' noise is carried to them. Rows
    beyond what noise explains count less (Huber), and, far beyond, not at all. Intervals are those
    of measurements and tolerances together. See docs/theory/calibration.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from pteron.calibration import Measurements, calibrate
    >>> robot = pteron.load("linear-delta")
    >>> poses = pteron.random_poses(robot, 40)
    >>> readings = pteron.inverse_kinematics(robot, poses) + [0.001, 0.0, 0.0]
    >>> measurements = Measurements.from_readings(robot, readings, poses=poses)
    >>> found = calibrate(robot, measurements, free=["zeros"])
    >>> found.fit.guess.zeros.round(6) + 0.0
    array([-0.001,  0.   ,  0.   ])
    """
    robot = as_manipulator(robot)
    _check_readings(robot, measurements)
    blocks = blocks_of(robot, measurements, free, prior)
    start = Guess.drawn(robot, measurements)
    seed = seed_number(seed)
    steps = Steps(progress, _STEPS)
    calibration = _undo_mistakes(
        start, measurements, blocks, partial(_calibrate, robot, seed=seed, steps=steps), held_out
    )
    steps.end()
    return calibration


def _undo_mistakes(
    start: Guess,
    measurements: Measurements,
    blocks: tuple[UnknownBlock, ...],
    run_calibration: Callable[..., Calibration],
    held_out: Measurements | None,
) -> Calibration:
    """Return the calibration of a log, with a mistake in it undone if one explains its errors."""
    mistake = raw_mistake(measurements, blocks, start)
    if mistake is None:
        calibration = run_calibration(measurements, blocks, held_out)
        explained = any(finding.kind in _IN_TIME for finding in calibration.findings)
        if explained or not _exceeds_ordinary_error(calibration.fit, measurements):
            return calibration
        mistake = raw_mistake(measurements, blocks, start, fitted=True)
        if mistake is None:
            return calibration
    finding = describe_mistake(mistake, measurements, start)
    undone = mistake.undo(measurements)
    other = None if held_out is None else mistake.undo(held_out)
    try:
        return run_calibration(undone, blocks, other, mistakes=[finding])
    except DataError as error:
        raise DataError(finding.text) from error


def _calibrate(
    robot: Manipulator,
    measurements: Measurements,
    blocks: tuple[UnknownBlock, ...],
    held_out: Measurements | None,
    *,
    seed: int,
    steps: Steps,
    mistakes: Sequence[CalibrationFinding] = (),
) -> Calibration:
    """Return the calibration of a log without mistakes; `mistakes` are findings on those undone."""
    steps.report("Starting")
    start = Guess.drawn(robot, measurements)
    poses = starting_poses(start, measurements)
    start = place_surroundings(start, measurements, poses)
    checked = rows_for_check(measurements, blocks)
    fitted_rows = np.ones(len(measurements), dtype=bool)
    if held_out is None and len(measurements) >= checked:
        fitted_rows[EVERY // 2 :: EVERY] = False
    steps.report("Fitting")
    partial_fit = None
    if held_out is not None or not fitted_rows.all():
        partial_fit = _partial_fit(start, measurements, blocks, fitted_rows)
    aside = rows_set_aside(start, measurements, blocks, poses)
    fitter = Fitter(measurements, blocks, start, poses, aside.aside, aside.barred)
    steps.report("Fitting", 0.5)
    fit = fitter.run(partial_fit)
    judged = None
    steps.report("Judging")
    if partial_fit is not None:
        if held_out is None:
            held_out = _select_fitting_rows(measurements, fit, ~fitted_rows)
        judged = _held_out_errors(start, partial_fit, blocks, held_out)
    shown = observability_of(start, measurements, blocks, _scaled_slopes(fitter, fit), seed)
    steps.report("Looking for faults")
    faults = (*zero_faults(fitter, fit), *residual_faults(fitter, fit, aside.reasons))
    findings = (*mistakes, *faults)
    possible = open_errors(measurements, fit, blocks)
    hidden = None if mistakes else hidden_order(measurements, blocks, start, fit)
    tilt = hidden_tilt(fitter, fit)
    evidence = Evidence(
        measurements, fit, blocks, shown, judged, findings, possible, hidden, tilt, checked
    )
    return Calibration(
        robot,
        calibrated_robot(fit.guess),
        values_of(start, fit, blocks),
        {kind: deviation for kind, deviation in fit.noise.items() if kind in measurements.kinds},
        shown,
        judged,
        findings,
        verdict_of(evidence),
        measurements,
        fit,
        blocks,
        start,
        possible,
        hidden,
    )


def _partial_fit(
    start: Guess,
    measurements: Measurements,
    blocks: tuple[UnknownBlock, ...],
    fitted_rows: NDArray[np.bool_],
) -> CalibrationFit:
    """Return a fit to at most `_TRIED_ROWS` of the fitted rows, which predicts held-out rows."""
    sampled_rows = np.zeros_like(fitted_rows)
    sampled_rows[np.flatnonzero(fitted_rows)[:: -(-int(fitted_rows.sum()) // _TRIED_ROWS)]] = True
    rows = measurements.rows(sampled_rows)
    poses = starting_poses(start, rows)
    aside = rows_set_aside(start, rows, blocks, poses)
    return Fitter(rows, blocks, start, poses, aside.aside, aside.barred).run()


def _exceeds_ordinary_error(fit: CalibrationFit, measurements: Measurements) -> bool:
    """Return whether the error of some kind of measurement exceeds ordinary tolerances."""
    stated = measurements.setup.noise
    return not fit.settled or any(
        error > ordinary_error(kind, stated.get(kind))
        for kind, error in fitted_errors(fit, measurements).items()
    )


def _select_fitting_rows(
    measurements: Measurements, fit: CalibrationFit, chosen: NDArray[np.bool_]
) -> Measurements:
    """Return the chosen rows of measurements, without the fit's outliers if these are few."""
    few = (~fit.kept).sum() <= FEW_LEFT_OUT * len(fit.kept)
    some = chosen & fit.kept if few else chosen
    return measurements.rows(some if some.any() else chosen)


def _check_readings(robot: Manipulator, measurements: Measurements) -> None:
    """Raise where readings are not finite numbers of shape (N, n), or nothing was measured."""
    shape, joints = measurements.readings.shape, robot.joint_count
    expect(len(shape) == 2 and shape[1] == joints, "readings", f"shape {shape}", f"(N, {joints})")
    shape, closures = measurements.closures.shape, (shape[0], robot.redundancy)
    expect(shape == closures, "closures", f"shape {shape}", f"{closures}, all 0")
    if not np.isfinite(measurements.readings).all():
        row = int(np.argwhere(~np.isfinite(measurements.readings))[0, 0])
        raise DataError(f"{measurements.places[row]}: a reading is missing or not finite")
    if not measurements.kinds:
        raise DataError("measurements: nothing was measured; give a position, an angle, a height")


def _held_out_errors(
    start: Guess, fit: CalibrationFit, blocks: tuple[UnknownBlock, ...], other: Measurements
) -> HeldOut:
    """Return RMS errors by kind at held-out rows, with the drawn and the fitted machine."""
    fitter = Fitter(other, blocks, start, starting_poses(start, other))
    poses = fitter.slopes.poses(start, start.joints(other.readings), fitter.begin_poses)
    fitted_poses = fitter.slopes.poses(fit.guess, fit.guess.joints(other.readings), poses)
    fitted_poses = np.where(np.isnan(fitted_poses), poses, fitted_poses)
    chosen = np.arange(len(other))
    drawn = fitter.slopes.rows(start, other, poses, chosen)
    fitted = fitter.slopes.rows(fit.guess, other, fitted_poses, chosen)
    spread = np.einsum(
        "nkp,pq,nkq->nk", fitted.slopes, fit.covariance, fitted.slopes, optimize=True
    )
    noise = np.array([fit.noise[kind] for kind in other.kind_of])
    usable = fitted.measured & np.isfinite(spread) & np.isfinite(drawn.residuals + fitted.residuals)
    kinds = {kind: usable & (other.kind_of == kind) for kind in fit.noise}

    def rms(squares: Array) -> dict[str, float]:
        """Return the root mean square of each kind's usable cells from squares (N, columns)."""
        return {k: float(np.sqrt(squares[here].mean())) for k, here in kinds.items() if here.any()}

    errors = map(rms, (drawn.residuals**2, fitted.residuals**2, spread + noise**2))
    return HeldOut(int(fitted.measured.any(axis=1).sum()), *errors)


def _scaled_slopes(fitter: Fitter, fit: CalibrationFit) -> Array:
    """Return slopes (K, p) on the machine as drawn, scaled by noise and tolerance."""
    slopes, start, measurements = fitter.slopes, fitter.begin, fitter.measurements
    chosen = spread_rows(len(measurements), _RANK_ROWS)
    poses = slopes.poses(start, start.joints(measurements.readings), fit.poses)
    reached: NDArray[np.bool_] = np.asarray(np.isfinite(poses).all(axis=1))
    reached &= (measurements.origins < 0) | reached[measurements.origins]
    chosen = chosen[reached[chosen]]
    rows = slopes.rows(start, measurements, poses, chosen)
    sizes = np.array([fit.noise[kind] for kind in measurements.kind_of])
    tolerances = tolerances_of(fitter.blocks)
    tolerances[~np.isfinite(tolerances)] = 1.0
    row_weight = np.sqrt(len(measurements) / max(len(chosen), 1))
    flat = (row_weight * rows.slopes / sizes[:, None] * tolerances).reshape(-1, len(tolerances))
    return np.asarray(flat[rows.measured.reshape(-1)])
