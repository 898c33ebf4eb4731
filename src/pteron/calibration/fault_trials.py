"""Trials of faults by a score test: slipped zeros, backlash, drift, scales, order, unequal rods."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.calibration_fit import CalibrationFit
from pteron.calibration.fit import Fitter
from pteron.calibration.mistakes import order_mistakes
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.score_test import FaultTrial, ScoreTest
from pteron.kinematics.evaluate import evaluate_kernel

Array = NDArray[np.float64]

CHANCE = 1e-6
"""Probability, over all faults tried, of a finding where there is no fault."""

_TRIED = 300
"""Approximate number of faults that are tried on a log of 60 rows: its logarithm counts."""

_GREATEST_TILT = 0.1
"""Tilt of a platform, rad, above which it is no fault of its joints: rods would come off."""

_FLAT = 1e-3
"""Determinant of the couples of rods, over the cube of their size, below which nothing holds."""


def event_trials(test: ScoreTest) -> Iterator[FaultTrial]:
    """Yield trials of slipped zeros, backlash, drift, and marks or an instrument that moved."""
    measurements, rows = test.measurements, test.rows
    places = [measurements.places[i] for i in rows]

    def beginnings(most: int) -> range:
        """Return the evenly spaced row indices, about `most`, at which an event may begin."""
        return range(3, len(rows) - 3, max(1, len(rows) // most))

    legs = test.start.robot.legs
    steps = np.ones((len(measurements), len(legs)))
    for t in beginnings(200):
        later = np.arange(len(measurements)) >= rows[t]
        columns = test.joint_columns(steps * later[:, None])
        for i, (leg, name) in enumerate(zip(legs, test.start.robot.joint_names, strict=True)):
            unit = "mrad" if leg.joint.unit == "rad" else "mm"
            fall, amounts = test.score(column := columns[..., i : i + 1])
            text = (
                f"The zero of joint {i + 1} ({name}) slipped by {1e3 * amounts[0]:+.3g} {unit} "
                f"before {places[t]}: home it again, and measure anew from there."
            )
            yield FaultTrial("slipped zero", text, 1, fall, column @ amounts)
    approach = np.sign(np.diff(measurements.readings, axis=0, prepend=measurements.readings[:1]))
    columns = test.joint_columns(approach)
    for i, (leg, name) in enumerate(zip(legs, test.start.robot.joint_names, strict=True)):
        unit = "mrad" if leg.joint.unit == "rad" else "mm"
        fall, amounts = test.score(column := columns[..., i : i + 1])
        text = (
            f"Joint {i + 1} ({name}) stops {2e3 * abs(amounts[0]):.3g} {unit} apart by its "
            "direction of approach: approach poses from one side, or take up its play."
        )
        yield FaultTrial("backlash", text, 1, fall, column @ amounts)
    times = measurements.times
    if times is None:
        times = np.arange(float(len(measurements)))
    if span := np.ptp(times):
        columns = test.joint_columns(steps * ((times - times.mean()) / span)[:, None])
        fall, amounts = test.score(columns)
        text = (
            "The readings drift from the first row to the last, by up to "
            f"{1e3 * np.abs(amounts).max():.3g} mm or mrad, as a machine's do that grows warm: let "
            "it warm up, and measure quickly."
        )
        yield FaultTrial("drift", text, len(amounts), fall, columns @ amounts)
    for block in (*test.extra_blocks[1:], *test.frame):
        what, alike = "instrument", ""
        if block.kind == "mark":
            what = f"mark {block.name or 'tool'}"
            alike = "" if test.start.robot.platform.angular.any() else ", or the instrument"
        for t in beginnings(60):
            part = test.slopes[..., block.where] * (np.arange(len(rows)) >= t)[:, None, None]
            fall, amounts = test.score(part)
            text = (
                f"The {what} moved by {1e3 * np.linalg.norm(amounts[:3]):.3g} mm before "
                f"{places[t]}{alike}: fix it, and measure anew from there."
            )
            yield FaultTrial(f"moved {block.kind}", text, len(amounts), fall, part @ amounts)


def scale_trials(test: ScoreTest) -> Iterator[FaultTrial]:
    """Yield trials of a wrong scale of each joint, and of a common one."""
    scales = test.joint_columns(test.measurements.readings)
    for i, name in enumerate(test.start.robot.joint_names):
        fall, amounts = test.score(column := scales[..., i : i + 1])
        text = (
            f"Joint {i + 1} ({name}) moves {_scale_text(amounts[0])} than it reads, beyond what "
            "its tolerance allows: check its lead, gear ratio or steps."
        )
        yield FaultTrial("scale", text, 1, fall, column @ amounts)
    fall, amounts = test.score(column := scales.sum(axis=-1, keepdims=True))
    text = (
        f"All joints move {_scale_text(amounts[0])} than they read, beyond what tolerances allow: "
        "check leads, gear ratios or steps, or the unit of what is measured."
    )
    yield FaultTrial("scale", text, 1, fall, column @ amounts)


def _scale_text(change: float) -> str:
    """Return a relative change of scale in words; first order holds below a half."""
    return f"{1e2 * change:+.3g} % farther" if abs(change) < 0.5 else "by quite another factor"


def order_trials(test: ScoreTest) -> Iterator[FaultTrial]:
    """Yield trials of measurements shifted against their readings, and of reversed heights."""
    measurements, noise = test.measurements, test.fit.noise
    sizes = np.array([noise[str(kind)] for kind in measurements.kind_of])
    logged = np.hstack([*measurements.parts.values()])
    for mistake in order_mistakes(measurements, test.start):
        change = logged - np.hstack([*mistake.undo(measurements).parts.values()])
        moved = test.weights[:, None] * np.nan_to_num(change / sizes)[test.rows]
        after = test.residuals + test.refit_residuals(moved)
        fall = float((test.residuals**2).sum() - (after**2).sum()) / test.variance
        yield FaultTrial("order", f"{mistake.text[0].upper()}{mistake.text[1:]}.", 1, fall, moved)


def hidden_tilt(fitter: Fitter, fit: CalibrationFit) -> float | None:
    """Return the greatest tilt, rad, by unequal rods of a pair that stays hidden, or None.

    Two machines, one of which has such rods and the geometry that hides them best, give the same
    measurements to within the noise.
    """
    test = ScoreTest(fitter, fit)
    columns = _rod_columns(test)
    if not columns:
        return None
    least = float(scipy.stats.chi2.isf(CHANCE / _TRIED, 1))
    tilts = []
    for column, turns in columns:
        fall = float((test.refit_residuals(column[..., 0]) ** 2).sum()) / test.variance
        tilts.append(float(np.sqrt(least / max(fall, 1e-300))) * turns)
    return max(tilts)


def rod_trials(test: ScoreTest) -> Iterator[FaultTrial]:
    """Yield a trial for each leg: parallel rods that differ in length, and tilt the platform."""
    robot = test.fit.guess.robot
    for i, (column, _) in enumerate(_rod_columns(test)):
        leg = robot.legs[i]
        fall, amounts = test.score(column)
        share = abs(amounts[0]) / leg.size
        difference = f"{1e2 * share:.2g} % of their distance"
        if leg.bar_length is not None:
            difference = f"{1e3 * share * leg.bar_length:.2g} mm"
        text = (
            f"The parallel rods of leg {i + 1} ({robot.joint_names[i]}) differ in length, by about "
            f"{difference}, and tilt the platform: measure both, and fit a pair of equal ones."
        )
        yield FaultTrial("unequal rods", text, 1, fall, column @ amounts)


def _rod_columns(test: ScoreTest) -> list[tuple[Array, float]]:
    """Return for each leg the column (N, K, 1) of rods that differ, and its tilt, rad; else none.

    With the rod u from a bar b of length w, ends of the rods that differ by d turn the platform by
    theta so that theta . (b x u) = |u| d / w, for each leg. A column is for d / w = 1 / |u|.
    """
    fit, robot = test.fit, test.fit.guess.robot
    if robot.platform.angular.any():
        return []
    couples: Array = evaluate_kernel(robot, "beams", "nan", fit.poses)[-1]
    if couples.shape[1] != 3 or not np.isfinite(couples).all(axis=(1, 2)).any():
        return []
    good: NDArray[np.bool_] = np.asarray(np.isfinite(couples).all(axis=(1, 2)))
    size = np.linalg.norm(couples, axis=-1).max(axis=-1)
    flat = np.abs(np.linalg.det(np.where(good[:, None, None], couples, np.eye(3))))
    good &= flat > _FLAT * size**3
    turns = np.linalg.inv(np.where(good[:, None, None], couples, np.eye(3)))  # a column a leg
    columns = []
    for i in range(len(robot.legs)):
        turn = np.where(good[:, None], turns[:, :, i], 0.0)
        tilt = float(np.median(np.linalg.norm(turn[test.rows], axis=1)))
        columns.append((_turned_column(test, turn)[..., None], tilt))
    return columns


def tilt_trials(test: ScoreTest) -> Iterator[FaultTrial]:
    """Yield a trial of a platform, held by pairs of rods, that stands tilted."""
    if not _rod_columns(test):
        return
    turns = [np.broadcast_to(axis, (len(test.measurements), 3)) for axis in np.eye(3)]
    columns = np.stack([_turned_column(test, turn) for turn in turns], axis=-1)
    fall, amounts = test.score(columns)
    if np.abs(amounts).max() > _GREATEST_TILT:
        return
    angles = ", ".join(
        f"{1e3 * angle:+.3g} mrad about {axis}" for angle, axis in zip(amounts, "xyz", strict=True)
    )
    text = (
        f"The platform stands tilted against the drawing ({angles}), as with a bent joint or rods "
        "of all pairs that differ: level it, and measure anew."
    )
    yield FaultTrial("tilted platform", text, 3, fall, columns @ amounts)


def _turned_column(test: ScoreTest, turn: Array) -> Array:
    """Return the column (N, K) of a platform that is turned by vectors (M, 3), rad, in all rows."""
    measurements, guess, poses = test.measurements, test.fit.guess, test.fit.poses
    robot = guess.robot
    frame = np.array(robot.platform.frame)
    arms = np.array([leg.platform_point for leg in robot.legs]) @ frame
    arms += np.array([leg.fixed_offset for leg in robot.legs])
    against = MachineSlopes(robot, ()).jacobian(guess, poses) @ robot.platform.directions
    shifts = np.cross(turn[:, None], arms)
    steps = np.nan_to_num(np.einsum("njx,njx->nj", against, shifts))
    column: Array = -test.joint_columns(steps).sum(axis=-1)
    # A mark's slopes are along the platform's frame.
    moved = (np.cross(turn, guess.mark_points(measurements.marks) @ frame) @ frame.T)[test.rows]
    alone = measurements.origins[test.rows] < 0
    for block in test.extra_blocks:
        if block.kind == "mark":
            mine = alone & np.array([measurements.marks[k] == block.name for k in test.rows])
            slopes = test.slopes[..., block.where]
            column += mine[:, None] * np.einsum("nkx,nx->nk", slopes, moved)
    return column
