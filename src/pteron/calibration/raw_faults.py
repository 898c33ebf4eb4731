"""The mistake in a whole log, found before the fit: units, order, signs, zeros, scales, frame.

Measurements should lie within noise and tolerances of what the machine as drawn would give; where
they do not, each likely mistake is undone on trial, and reported where they then do.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pteron.calibration.calibration_fit import CalibrationFit
from pteron.calibration.fit import Fitter
from pteron.calibration.guess import Guess, UnknownBlock, tolerances_of
from pteron.calibration.measurements import Measurements
from pteron.calibration.mistake import Mistake, leg_orders, reorder_readings
from pteron.calibration.mistakes import likely_mistakes
from pteron.calibration.reading_mistakes import QUICK_MODES
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.result import CalibrationFinding, HiddenOrder
from pteron.calibration.start import place_surroundings, starting_poses
from pteron.errors import DataError, UnlikelyValue

Array = NDArray[np.float64]

_FAR = 25.0
"""Median over rows of the mean squared residual, in variances of noise and tolerances, from which
mistakes are tried."""

_NEAR = 9.0
"""Median of the same below which a mistake, undone, explains the residuals."""

_FALLEN = 0.1
"""Share of the misfit that a mistake, undone, leaves at most."""

_CLEAR = 2.0
"""Misfit that leaves no doubt: its expected value is below 1 where nothing is wrong."""

_FINALISTS = 12
"""Number of mistakes of least misfit row by row, between which all rows together decide. Chosen:
with 4 a wrong lead of all screws is missed, with 36 nothing changes but the time."""

_ALIKE = 20.0
"""Excess of the squared residuals of all rows, in variances, up to which the mistake that is more
likely beforehand is named; and of a value that was fitted to name one.

Chosen: a chance of e^-10 against it."""

_LEFT_TOGETHER = 0.1
"""Share of these squares without the mistake undone that it may leave.

Chosen: what leaves more is part of another cause, such as a zero that slipped."""

_MOST_OF_ROW = 1000.0
"""Greatest contribution of one row there, in variances: a few rows may have faults of their own."""

_ROWS = 16
"""Rows that are examined, drawn at random."""

_ROWS_TOGETHER = 60
"""Rows by which the finalists are compared."""

_CHUNK = 4096
"""Rows that are evaluated at a time."""

_FIRST = 5
"""Rows that are evaluated first for each mistake."""

_NOISE = 1e-4
"""Assumed noise, m and rad: small beside the effect of tolerances."""


def raw_mistake(
    measurements: Measurements,
    blocks: Sequence[UnknownBlock],
    robot_guess: Guess,
    *,
    fitted: bool = False,
) -> Mistake | None:
    """Return the mistake that explains measurements far from the drawing; else None.

    After a fit that left errors beyond ordinary tolerances (`fitted`), of those that are near.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnlikelyValue)  # what is tried may well be unlikely
        misfit = _misfit(_sample_rows(measurements), blocks, robot_guess)
        if fitted == (misfit >= _FAR):  # what is far was searched before the fit
            return None
        return _best_mistake(measurements, blocks, robot_guess, min(_NEAR, _FALLEN * misfit))


def describe_mistake(
    mistake: Mistake, measurements: Measurements, guess: Guess
) -> CalibrationFinding:
    """Return the finding of a mistake: its cause, what to do, and its size on the drawn machine."""
    logged_errors, errors = (
        _drawing_errors(rows, guess) for rows in (measurements, mistake.undo(measurements))
    )
    text = f"{mistake.text[0].upper()}{mistake.text[1:]}."
    sizes = []
    for kind, error in errors.items():
        logged = (
            f" (as logged within {_size_text(logged_errors[kind], kind)})"
            if kind in logged_errors
            else ""
        )
        sizes.append(f"nine in ten {kind}s are within {_size_text(error, kind)}{logged}")
    none = "" if logged_errors else "; as logged, most readings lead to no pose"
    text += (
        f" With this undone, as in what follows, {' and '.join(sizes)} of the machine as "
        f"drawn{none}."
    )
    return CalibrationFinding("mistake", text, effect=float("inf"))


def _size_text(error: float, kind: str) -> str:
    """Return an error as text in mrad, mm or m."""
    if kind == "angle":
        return f"{1e3 * error:.3g} mrad"
    return f"{1e3 * error:.3g} mm" if error < 1.0 else f"{error:.4g} m"


def _drawing_errors(measurements: Measurements, guess: Guess) -> dict[str, float]:
    """Return the 90 % quantile of absolute residuals by kind on the drawn machine, m and rad."""
    rows = _sample_rows(measurements)
    try:
        residuals, measured = _drawing_residuals(guess, rows)
    except DataError:
        return {}
    kinds = {kind: measured & (measurements.kind_of == kind) for kind in measurements.kinds}
    return {
        kind: float(np.quantile(np.abs(residuals[here]), 0.9))
        for kind, here in kinds.items()
        if here.any()
    }


def _drawing_residuals(guess: Guess, rows: Measurements) -> tuple[Array, NDArray[np.bool_]]:
    """Return the residuals (N, K) of rows if the machine is as drawn, and which of them are valid.

    A row has K residuals at most; one is valid if it is measured and the row's joints have a pose.
    """
    poses = _trial_poses(guess, rows)
    lost: NDArray[np.bool_] = np.asarray(np.isnan(poses).any(axis=1))
    filled = np.where(lost[:, None], np.median(poses[~lost], axis=0), poses)
    start = place_surroundings(guess, rows, filled)
    at = MachineSlopes(guess.robot, ()).rows(start, rows, filled, np.arange(len(rows)))
    lost |= (rows.origins >= 0) & lost[rows.origins]
    return at.residuals, at.measured & ~lost[:, None]


def hidden_order(
    measurements: Measurements,
    blocks: Sequence[UnknownBlock],
    robot_guess: Guess,
    fit: CalibrationFit,
) -> HiddenOrder | None:
    """Return the legs whose readings could be exchanged unnoticed; None if there are none.

    Heights over the bed of a symmetric machine are those of its mirror image.
    """
    if not set(measurements.kinds) <= {"height", "distance", "closure"}:
        return None
    misfit = _misfit(_sample_rows(measurements), blocks, robot_guess)
    legs: set[int] = set()
    error = 0.0
    for order in leg_orders(robot_guess):
        rows = _sample_rows(reorder_readings(measurements, order))
        if _misfit(rows, blocks, robot_guess) < max(_CLEAR, 1.5 * misfit):
            legs |= {i + 1 for i, k in enumerate(order) if i != k}
            error = max(error, _change_by_order(measurements, robot_guess, fit, order))
    return HiddenOrder(tuple(sorted(legs)), error) if legs else None


def _change_by_order(
    measurements: Measurements, start: Guess, fit: CalibrationFit, order: tuple[int, ...]
) -> float:
    """Return the greatest change of the tool's place in another order of the readings, m.

    It is that of the calibrated machine beyond the mirror image that the drawn one has.
    """
    slopes = MachineSlopes(start.robot, ())
    middle = np.tile(np.median(fit.poses[fit.kept], axis=0), (len(measurements), 1))

    def places(guess: Guess, readings: Array) -> Array:
        """Return the positions (N, 3), m, of the marks of a machine with readings (N, n)."""
        poses = slopes.poses(guess, guess.joints(readings), middle)
        return guess.points(measurements.marks, poses)

    swapped = reorder_readings(measurements, order).readings
    drawn, drawn_swapped = places(start, measurements.readings), places(start, swapped)
    fitted, fitted_swapped = places(fit.guess, measurements.readings), places(fit.guess, swapped)
    good = fit.kept & np.isfinite(drawn + drawn_swapped + fitted + fitted_swapped).all(axis=1)
    if not good.any():
        return float("inf")
    around = np.column_stack([drawn[good], np.ones(good.sum())])
    mirror = np.linalg.lstsq(around, drawn_swapped[good], rcond=1e-6)[0]
    image = np.column_stack([fitted[good], np.ones(good.sum())]) @ mirror
    return float(np.linalg.norm(fitted_swapped[good] - image, axis=1).max())


def _sample_rows(measurements: Measurements) -> Measurements:
    """Return a random sample of the rows, the same in each run."""
    # At random: rows at even steps might all be of one mark.
    return measurements.rows(np.random.default_rng(0).permutation(len(measurements)) < _ROWS)


def _best_mistake(
    measurements: Measurements, blocks: Sequence[UnknownBlock], guess: Guess, most: float
) -> Mistake | None:
    """Return the mistake of least cost once undone; among those about as good, the likeliest.

    Rows one by one choose some, and all rows together, in a fit, among these. A group of mistakes
    that clearly has it ends the search.
    """
    tried: list[tuple[float, int, Mistake]] = []
    for mistakes in likely_mistakes(_sample_rows(measurements), guess):
        clear = False
        for mistake in mistakes:
            misfit = _quick_misfit(_sample_rows(mistake.undo(measurements)), blocks, guess, most)
            tried.append((misfit, len(tried), mistake))
            clear |= misfit < min(_CLEAR, most)
        if clear:
            break
    near = sorted((t for t in tried if t[0] < most), key=lambda t: t[:2])[:_FINALISTS]
    finalists = [mistake for *_, mistake in sorted(near, key=lambda t: t[1])]
    costs = [
        _cost_together(mistake.undo(measurements), blocks, guess) + _ALIKE * mistake.freedom
        for mistake in finalists
    ]
    least = min(costs, default=np.inf)
    if not least < np.inf or not least < _LEFT_TOGETHER * _cost_together(
        measurements, blocks, guess
    ):
        return None
    pairs = zip(finalists, costs, strict=True)
    return next(mistake for mistake, cost in pairs if cost <= least + _ALIKE)


def _cost_together(
    measurements: Measurements, blocks: Sequence[UnknownBlock], guess: Guess
) -> float:
    """Return the cost of a fit of all rows: squared residuals and tolerances, in variances.

    inf where the rows have no poses.
    """
    chosen = np.random.default_rng(0).permutation(len(measurements)) < _ROWS_TOGETHER
    noise = {k: max(measurements.setup.noise.get(k, 0.0), _NOISE) for k in measurements.kinds}
    rows = replace(measurements.rows(chosen), setup=replace(measurements.setup, noise=noise))
    try:
        poses = _trial_poses(guess, rows)
        fit = Fitter(rows, tuple(blocks), place_surroundings(guess, rows, poses), poses).run()
    except DataError:
        return np.inf
    squares = np.minimum(fit.distances**2, _MOST_OF_ROW)
    return float(squares.sum() + fit.prior @ fit.total**2)


def _quick_misfit(
    rows: Measurements, blocks: Sequence[UnknownBlock], guess: Guess, most: float
) -> float:
    """Return `_misfit`, or inf if the first rows are already far above `most`.

    Of these no other assembly modes are sought: of readings that lead to no pose that takes long.
    """
    measured = ~np.isnan(np.hstack([*rows.parts.values()])).all(axis=1)
    some = measured & (np.cumsum(measured) <= _FIRST)
    modes = not rows.setup.frame_known  # which the poses of these few rows have to fix
    if len(rows) > 2 * _FIRST:
        misfit = _misfit(rows.rows(some), blocks, guess, modes=modes)
        if misfit > 10.0 * most:
            return np.inf
    return _misfit(rows, blocks, guess)


def _misfit(
    rows: Measurements, blocks: Sequence[UnknownBlock], guess: Guess, *, modes: bool = True
) -> float:
    """Return the rows' median of the mean squared residual, in variances; inf: no pose."""
    try:
        poses = _trial_poses(guess, rows, modes=modes)
    except DataError:
        return np.inf
    measured = ~np.isnan(np.hstack([*rows.parts.values()])).all(axis=1)
    return float(np.median(row_misfits(guess, rows, blocks, poses)[measured]))


def _trial_poses(guess: Guess, rows: Measurements, *, modes: bool = True) -> Array:
    """Return poses of trial readings: all assembly modes if these are quick to compute.

    The right readings lead to the measured pose, or near home, by Newton's steps alone.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnlikelyValue)  # what is tried may well be unlikely
        return starting_poses(guess, rows, modes=modes and guess.robot.freedom <= QUICK_MODES)


def row_misfits(
    guess: Guess, rows: Measurements, blocks: Sequence[UnknownBlock], poses: Array
) -> Array:
    """Return each row's mean squared residual (N,), in variances of noise and tolerances.

    inf where it has no pose.
    """
    lost: NDArray[np.bool_] = np.asarray(np.isnan(poses).any(axis=1))
    lost |= (rows.origins >= 0) & lost[rows.origins]
    if lost.all():
        return np.full(len(rows), np.inf)
    poses = np.where(np.isnan(poses), np.median(poses[~np.isnan(poses).any(axis=1)], axis=0), poses)
    start = place_surroundings(guess, rows, poses)
    slopes = MachineSlopes(guess.robot, blocks)
    tolerances = np.minimum(tolerances_of(blocks), 1.0)
    for block in blocks:
        if block.kind == "frame" and start.turn is not guess.turn:
            tolerances[block.where] = 0.0  # all rows together have fixed it
    squares = np.empty(len(rows))
    for first in range(0, len(rows), _CHUNK):
        chosen = np.arange(first, min(first + _CHUNK, len(rows)))
        at = slopes.rows(start, rows, poses, chosen)
        lost[chosen] |= ~np.isfinite(at.slopes).all(axis=(1, 2))
        bad = lost[chosen]
        scaled = np.where(bad[:, None, None], 0.0, at.slopes) * tolerances
        width = at.residuals.shape[1]
        covariance = scaled @ np.swapaxes(scaled, -1, -2) + _NOISE**2 * np.eye(width)
        residuals = np.where(bad[:, None], 0.0, at.residuals)
        whitened = np.linalg.solve(covariance, residuals[..., None])[..., 0]
        sums = np.einsum("nk,nk->n", residuals, whitened)
        squares[chosen] = sums / np.maximum(at.measured.sum(axis=1), 1)
    return np.where(lost, np.inf, squares)
