"""`calibrate`: finds a machine's geometry from measurements and judges it at held-out rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect
from pteron.calibration.fit import Fit, Fitter
from pteron.calibration.guess import Block, Guess, tolerances_of
from pteron.calibration.measurements import Measurements, evenly
from pteron.calibration.observability import observability_of
from pteron.calibration.raw_faults import describe_mistake, hidden_order, raw_mistake
from pteron.calibration.residual_faults import hidden_tilt, residual_faults, zero_faults
from pteron.calibration.result import (
    Calibration,
    Finding,
    HeldOut,
    calibrated,
    open_errors,
    values_of,
)
from pteron.calibration.set_aside import rows_set_aside
from pteron.calibration.start import placed, starting_poses
from pteron.calibration.thresholds import FEW_LEFT_OUT, ordinary_error
from pteron.calibration.unknowns import blocks_of
from pteron.calibration.verdict import EVERY, Evidence, fitted_errors, rows_for_check, verdict_of
from pteron.errors import DataError
from pteron.manipulator import Manipulator, RobotLike, as_manipulator

Array = NDArray[np.float64]

_TRIED_ROWS = 5000
"""Most rows of the fit that is judged at the held-out rows; more change it little."""

_RANK_ROWS = 400
"""Rows, evenly spread, at which the singular values are taken."""

_IN_TIME = ("slipped zero", "backlash", "drift")
"""Faults that differ from row to row, so that none of the whole log explains them."""


def calibrate(
    robot: RobotLike,
    measurements: Measurements,
    *,
    free: Sequence[str] | None = None,
    prior: Mapping[str, float] | None = None,
    held_out: Measurements | None = None,
    seed: int = 0,
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
    >>> found = calibrate(robot, Measurements.of(robot, readings, poses=poses), free=["zeros"])
    >>> found.fit.guess.zeros.round(6) + 0.0
    array([-0.001,  0.   ,  0.   ])
    """
    robot = as_manipulator(robot)
    _check(robot.joint_count, measurements)
    blocks = blocks_of(robot, measurements, free, prior)
    start = Guess.drawn(robot, measurements)
    mistake = raw_mistake(measurements, blocks, start)
    if mistake is None:
        result = _calibrate(robot, measurements, blocks, held_out, seed)
        explained = any(finding.kind in _IN_TIME for finding in result.findings)
        if explained or not _far_off(result.fit, measurements):
            return result
        mistake = raw_mistake(measurements, blocks, start, fitted=True)
        if mistake is None:
            return result
    finding = describe_mistake(mistake, measurements, start)
    undone = mistake.undo(measurements)
    other = None if held_out is None else mistake.undo(held_out)
    try:
        return _calibrate(robot, undone, blocks, other, seed, [finding])
    except DataError as error:
        raise DataError(finding.text) from error


def _calibrate(
    robot: Manipulator,
    measurements: Measurements,
    blocks: tuple[Block, ...],
    held_out: Measurements | None,
    seed: int,
    mistakes: Sequence[Finding] = (),
) -> Calibration:
    """Return the calibration of a log without a mistake, or in which these are undone."""
    start = Guess.drawn(robot, measurements)
    poses = starting_poses(start, measurements)
    start = placed(start, measurements, poses)
    checked = rows_for_check(measurements, blocks)
    kept = np.ones(len(measurements), dtype=bool)
    if held_out is None and len(measurements) >= checked:
        kept[EVERY // 2 :: EVERY] = False
    partial = None
    if held_out is not None or not kept.all():
        partial = _partial_fit(start, measurements, blocks, kept)
    aside = rows_set_aside(start, measurements, blocks, poses)
    fitter = Fitter(measurements, blocks, start, poses, aside.aside, aside.barred)
    fit = fitter.run(partial)
    judged = None
    if partial is not None:
        other = held_out if held_out is not None else _fitting(measurements, fit, ~kept)
        judged = _held_out(start, partial, blocks, other)
    shown = observability_of(start, measurements, blocks, _scaled_slopes(fitter, fit), seed)
    findings = (
        *mistakes,
        *zero_faults(fitter, fit),
        *residual_faults(fitter, fit, aside.reasons),
    )
    possible = open_errors(measurements, fit, blocks)
    hidden = None if mistakes else hidden_order(measurements, blocks, start, fit)
    tilt = hidden_tilt(fitter, fit)
    evidence = Evidence(
        measurements, fit, blocks, shown, judged, findings, possible, hidden, tilt, checked
    )
    return Calibration(
        robot,
        calibrated(fit.guess),
        values_of(start, fit, blocks),
        {kind: value for kind, value in fit.noise.items() if kind in measurements.kinds},
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
    start: Guess, given: Measurements, blocks: tuple[Block, ...], kept: NDArray[np.bool_]
) -> Fit:
    """Return the fit of rows that are kept, by which held-out rows are judged."""
    fitted = np.zeros_like(kept)
    fitted[np.flatnonzero(kept)[:: -(-int(kept.sum()) // _TRIED_ROWS)]] = True
    rows = given.rows(fitted)
    poses = starting_poses(start, rows)
    aside = rows_set_aside(start, rows, blocks, poses)
    return Fitter(rows, blocks, start, poses, aside.aside, aside.barred).run()


def _far_off(fit: Fit, given: Measurements) -> bool:
    """Return whether a fit leaves more than ordinary tolerances do, in a kind of measurement."""
    stated = given.setup.noise
    return not fit.settled or any(
        error > ordinary_error(kind, stated.get(kind))
        for kind, error in fitted_errors(fit, given).items()
    )


def _fitting(given: Measurements, fit: Fit, chosen: NDArray[np.bool_]) -> Measurements:
    """Return chosen rows, but for the few that a fit of all rows leaves out and findings name."""
    few = (~fit.kept).sum() <= FEW_LEFT_OUT * len(fit.kept)
    some = chosen & fit.kept if few else chosen
    return given.rows(some if some.any() else chosen)


def _check(joints: int, given: Measurements) -> None:
    shape = given.readings.shape
    expect(len(shape) == 2 and shape[1] == joints, "readings", f"shape {shape}", f"(N, {joints})")
    if not np.isfinite(given.readings).all():
        row = int(np.argwhere(~np.isfinite(given.readings))[0, 0])
        raise DataError(f"{given.places[row]}: a reading is missing or not finite")
    if not given.kinds:
        raise DataError("measurements: nothing was measured; give a position, an angle, a height")


def _held_out(start: Guess, fit: Fit, blocks: tuple[Block, ...], other: Measurements) -> HeldOut:
    """Return the errors at rows that a fit did not see."""
    before = Fitter(other, blocks, start, starting_poses(start, other))
    poses = before.slopes.poses(start, start.joints(other.readings), before.begin_poses)
    moved = before.slopes.poses(fit.guess, fit.guess.joints(other.readings), poses)
    moved = np.where(np.isnan(moved), poses, moved)
    chosen = np.arange(len(other))
    old = before.slopes.rows(start, other, poses, chosen)
    new = before.slopes.rows(fit.guess, other, moved, chosen)
    spread = np.einsum("nkp,pq,nkq->nk", new.slopes, fit.covariance, new.slopes, optimize=True)
    noise = np.array([fit.noise[kind] for kind in other.kind_of])
    seen = new.measured & np.isfinite(spread) & np.isfinite(old.residuals + new.residuals)
    kinds = {kind: seen & (other.kind_of == kind) for kind in fit.noise}

    def rms(squares: Array) -> dict[str, float]:
        return {k: float(np.sqrt(squares[here].mean())) for k, here in kinds.items() if here.any()}

    each = map(rms, (old.residuals**2, new.residuals**2, spread + noise**2))
    return HeldOut(int(new.measured.any(axis=1).sum()), *each)


def _scaled_slopes(fitter: Fitter, fit: Fit) -> Array:
    """Return slopes at the measured poses on the machine as drawn, by noise and tolerance."""
    slopes, start, given = fitter.slopes, fitter.begin, fitter.given
    chosen = evenly(len(given), _RANK_ROWS)
    poses = slopes.poses(start, start.joints(given.readings), fit.poses)
    reached: NDArray[np.bool_] = np.asarray(np.isfinite(poses).all(axis=1))
    reached &= (given.origins < 0) | reached[given.origins]
    chosen = chosen[reached[chosen]]
    at = slopes.rows(start, given, poses, chosen)
    sizes = np.array([fit.noise[kind] for kind in given.kind_of])
    tolerances = tolerances_of(fitter.blocks)
    tolerances[~np.isfinite(tolerances)] = 1.0
    more = np.sqrt(len(given) / max(len(chosen), 1))
    flat = (more * at.slopes / sizes[:, None] * tolerances).reshape(-1, len(tolerances))
    return np.asarray(flat[at.measured.reshape(-1)])
