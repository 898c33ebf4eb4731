"""Faults that residuals show after a calibration's fit: rows that do not fit, slipped zeros, ...

Most faults are one more unknown. Its column of slopes tells, without another fit, by how much the
squared residuals would fall if it were sought too (a score test).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.fit import BEYOND, FLOOR, CalibrationFit, Fitter
from pteron.calibration.guess import Unknown, UnknownBlock, number_unknowns
from pteron.calibration.measurements import Measurements, spread_rows
from pteron.calibration.mistakes import order_mistakes
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.result import CalibrationFinding
from pteron.calibration.thresholds import OFF_TOLERANCES, ORDINARY_ERROR
from pteron.kinematics.evaluate import evaluate_kernel

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Score = Callable[[Array], tuple[float, Array]]
"""From columns (N, K, c) to the fall of the squared residuals, and the columns' amounts."""

_ROWS = 3000
"""Most rows that are examined, evenly spread."""

_CHANCE = 1e-6
"""Probability, over all faults tried, of a finding where there is no fault."""

_HEAVIEST = 3.0
"""Most that a row may be off, in what a middle row is off: a few rows alone are no such fault."""

_TRIED = 300
"""Faults that are tried of a log of 60 rows, about: their logarithm counts."""

_GREATEST_TILT = 0.1
"""Tilt of a platform, rad, above which it is no fault of its joints: rods would come off."""

_SHARE = 0.2
"""Least share of the squared residuals that a reported fault explains."""

_EXPLAINED = 0.3
"""Share of a row's residuals up to which the rest is explained by a fault."""

_NOISY = 4.0
"""Mean square along one leg's coordinate, in variances, above which its model is doubted."""

_FLAT = 1e-3
"""Determinant of the couples of rods, over the cube of their size, below which nothing holds."""

_LISTED = 8
"""Most outlying rows that are named."""


class FaultTrial(NamedTuple):
    """A candidate fault: its text, its shift of the residuals, and the fall of their squares."""

    kind: str
    text: str
    freedom: int
    fall: float
    moved: Array
    """Residuals (N, K) less those without it, before the other unknowns follow."""


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
    """Return the joints whose zeros are beyond their tolerances, with sizes.

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
    named = ", ".join(
        f"{measurements.places[i]} ({reasons.get(int(i)) or _residual_text(fit, i)})" for i in worst
    )
    others = f" and {len(rows) - len(worst)} more" if len(rows) > len(worst) else ""
    text = f"Left out, as {'they do' if len(rows) > 1 else 'it does'} not fit: {named}{others}."
    return (CalibrationFinding("outlier", text, float((fit.distances[rows] ** 2).sum())),)


def _residual_text(fit: CalibrationFit, row: int) -> str:
    """Return a row's largest residual in words, or that its readings lead to no pose."""
    if fit.distances[row] == BEYOND:
        return "its readings lead to no pose"
    residuals = fit.residuals[row]
    k = int(np.abs(residuals).argmax())
    angle = 3 <= k < len(residuals) - 2
    return f"off by {1e3 * abs(residuals[k]):.3g} {'mrad' if angle else 'mm'}"


class _ScoreTest:
    """Score test: the fall of the squared whitened residuals with a further unknown.

    Attributes
    ----------
    rows : array of int, shape (N,)
        Those that are examined.
    slopes : array, shape (N, K, p)
        Against the unknowns of the fit and, behind them, those of `extra_blocks`.
    extra_blocks : tuple of Block
        Every joint's zero, each mark, and the instrument's frame, where it is not sought.
    weights : array, shape (N,)
        Less than 1 of rows that are far off.
    residuals : array, shape (N, K)
        Residuals after the fit.
    variance : float
        Of these, as a middle row shows it.
    least : float
        Rounding in them, as a variance.
    """

    def __init__(self, fitter: Fitter, fit: CalibrationFit) -> None:
        start, blocks, measurements = fitter.begin, fitter.blocks, fitter.measurements
        self.start, self.measurements, self.fit = start, measurements, fit
        count = blocks[-1].where.stop
        self.extra_blocks = _extra_blocks(blocks, measurements, len(start.robot.legs))
        self.frame = [block for block in blocks if block.kind == "frame"]
        fitter = Fitter(measurements, (*blocks, *self.extra_blocks), start, fit.poses)
        self.rows = np.union1d(
            spread_rows(len(measurements), _ROWS), np.flatnonzero(~fit.kept)[:_ROWS]
        )
        at = fitter.slopes.rows(fit.guess, measurements, fit.poses, self.rows)
        r, slopes, _ = fitter.whiten_rows(at, fit.guess, fit.noise)
        joints = fitter.whiten_rows(at._replace(slopes=at.by_reading), fit.guess, fit.noise)[1]
        off = np.sqrt(np.einsum("nk,nk->n", r, r) / np.maximum(at.measured.sum(axis=1), 1))
        weights = np.minimum(1.0, _HEAVIEST * np.median(off) / np.maximum(off, 1e-12))
        weights[~np.isfinite(slopes).all(axis=(1, 2))] = 0.0  # no pose
        self.weights = weights
        r = weights[:, None] * r
        self.slopes = weights[:, None, None] * np.nan_to_num(slopes)
        self._joints = weights[:, None, None] * np.nan_to_num(joints)
        self._fitted = self.slopes[..., :count]
        self._flat = self._fitted.reshape(-1, count)
        square = self._flat.T @ self._flat
        self._covariance = np.linalg.inv(square + np.diag(fitter.prior[:count]))
        self.residuals = self.refit_residuals(r)
        # Noise that was found has the fault in it: a middle row's is nearer the truth.
        numbers = at.measured.sum(axis=1)
        self.squares = np.einsum("nk,nk->n", self.residuals, self.residuals) / np.maximum(
            numbers, 1
        )
        self.least = min(FLOOR / fit.noise[kind] for kind in measurements.kinds) ** 2
        taken = float(np.trace(self._covariance @ square)) / at.measured.sum()  # by the fit
        self.free = float(at.measured.sum()) * (1.0 - taken)
        self.variance = max(float(np.median(self.squares)) / (0.6 * (1.0 - taken)), self.least)

    def refit_residuals(self, moved: Array) -> Array:
        """Return residuals (N, K) after a refit of the fit's unknowns."""
        change = self._covariance @ (self._flat.T @ moved.reshape(-1))
        return np.asarray(moved - self._fitted @ change)

    def score(self, columns: Array) -> tuple[float, Array]:
        """Return the fall of the squared residuals with columns (N, K, c), and amounts (c,)."""
        wide = columns.reshape(-1, columns.shape[-1])
        cross_products = self._flat.T @ wide
        square = wide.T @ wide - cross_products.T @ self._covariance @ cross_products
        right = wide.T @ self.residuals.reshape(-1)
        size = np.sqrt(np.maximum(np.diag(wide.T @ wide), 1e-300))
        scaled = square / np.outer(size, size)
        inverse = np.linalg.pinv(scaled, rcond=1e-6, hermitian=True)
        amounts = -(inverse @ (right / size)) / size
        return float(-right @ amounts) / self.variance, amounts

    def joint_columns(self, values: Array) -> Array:
        """Return the columns (N, K, n) of steps of all rows' joint coordinates (M, n).

        A distance between two rows follows the steps of both.
        """
        count = values.shape[1]
        origins = self.measurements.origins[self.rows]
        columns: Array = self._joints[..., :count] * values[self.rows][:, None]
        between = origins >= 0
        columns[between] += self._joints[between, :, count:] * values[origins[between]][:, None]
        return columns

    def chance(self, trial: FaultTrial) -> float:
        """Return the p-value of a trial: the probability of its fall in a faultless log."""
        chance = float(scipy.stats.chi2.sf(trial.fall, trial.freedom))
        if not set(self.measurements.kinds) <= set(self.measurements.setup.noise):
            # The noise that was found has the fault in it: an F test leaves it out.
            total = float(np.einsum("nk,nk->", self.residuals, self.residuals))
            fall = trial.fall * self.variance
            free = max(self.free - trial.freedom, 1.0)
            ratio = (fall / trial.freedom) / max((total - fall) / free, self.least)
            chance = min(chance, float(scipy.stats.f.sf(ratio, trial.freedom, free)))
        return chance


def _find_fault(
    fitter: Fitter, fit: CalibrationFit
) -> tuple[tuple[CalibrationFinding, ...], NDArray[np.bool_]]:
    """Return the best-explaining fault, if significant, and the rows (N,) it explains."""
    test = _ScoreTest(fitter, fit)
    tried, best, gain = 0, None, -np.inf
    trials = (_trials, _scale_trials, _rod_trials, _tilt_trials, _order_trials)
    for trial in chain.from_iterable(tries(test) for tries in trials):
        tried += 1
        more_than_chance = trial.fall - float(scipy.stats.chi2.isf(0.5, trial.freedom))
        if more_than_chance > gain:
            best, gain = trial, more_than_chance
    explained = np.zeros(len(fitter.measurements), dtype=bool)
    share = _SHARE * float(test.squares.sum()) / test.variance
    if best is None or best.fall <= share or test.chance(best) >= _CHANCE / tried:
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


def _trials(test: _ScoreTest) -> Iterator[FaultTrial]:
    """Try zeros that slipped, backlash, drift, and marks or instruments that moved."""
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
            column = columns[..., i : i + 1]
            fall, amounts = test.score(column)
            text = (
                f"The zero of joint {i + 1} ({name}) slipped by {1e3 * amounts[0]:+.3g} {unit} "
                f"before {places[t]}: home it again, and measure anew from there."
            )
            yield FaultTrial("slipped zero", text, 1, fall, column @ amounts)
    approach = np.sign(np.diff(measurements.readings, axis=0, prepend=measurements.readings[:1]))
    columns = test.joint_columns(approach)
    for i, (leg, name) in enumerate(zip(legs, test.start.robot.joint_names, strict=True)):
        unit = "mrad" if leg.joint.unit == "rad" else "mm"
        column = columns[..., i : i + 1]
        fall, amounts = test.score(column)
        text = (
            f"Joint {i + 1} ({name}) stops {2e3 * abs(amounts[0]):.3g} {unit} apart by its "
            "direction of approach: approach poses from one side, or take up its play."
        )
        yield FaultTrial("backlash", text, 1, fall, column @ amounts)
    times = (
        measurements.times
        if measurements.times is not None
        else np.arange(float(len(measurements)))
    )
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


def _scale_trials(test: _ScoreTest) -> Iterator[FaultTrial]:
    """Try a scale of each joint, and one of all."""
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


def _order_trials(test: _ScoreTest) -> Iterator[FaultTrial]:
    """Try measurements that stand beside their readings, and heights of the other sign."""
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
    """Return the greatest tilt by unequal rods of a pair that does not show, rad; None: no pairs.

    Two machines, one of which has such rods and the geometry that hides them best, give the same
    measurements to within the noise.
    """
    test = _ScoreTest(fitter, fit)
    columns = _rod_columns(test)
    if not columns:
        return None
    least = float(scipy.stats.chi2.isf(_CHANCE / _TRIED, 1))
    tilts = []
    for column, turns in columns:
        fall = float((test.refit_residuals(column[..., 0]) ** 2).sum()) / test.variance
        tilts.append(float(np.sqrt(least / max(fall, 1e-300))) * turns)
    return max(tilts)


def _rod_trials(test: _ScoreTest) -> Iterator[FaultTrial]:
    """Try parallel rods of one leg that differ in length, and so tilt the platform."""
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


def _rod_columns(test: _ScoreTest) -> list[tuple[Array, float]]:
    """Return the columns (N, K, 1) of rods that differ and their tilts, rad, a leg each.

    None where no rods can differ.

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


def _tilt_trials(test: _ScoreTest) -> Iterator[FaultTrial]:
    """Try a platform that is held by pairs of rods and stands tilted against the drawing."""
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


def _turned_column(test: _ScoreTest, turn: Array) -> Array:
    """Return the column (N, K) of a platform that stands turned by vectors (M, 3) in all rows."""
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


def _bad_leg(fitter: Fitter, fit: CalibrationFit) -> Iterator[CalibrationFinding]:
    """Yield a finding for the leg whose coordinate alone explains residuals beyond noise."""
    if not set(fitter.measurements.setup.noise) - {"readings"}:
        return  # noise that was found explains everything
    names = fitter.begin.robot.joint_names
    fitted_rows = np.flatnonzero(fit.kept)
    chosen = fitted_rows[spread_rows(len(fitted_rows), _ROWS)]
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


def _extra_blocks(
    blocks: tuple[UnknownBlock, ...], measurements: Measurements, joints: int
) -> tuple[UnknownBlock, ...]:
    """Return further blocks: every joint's zero, each mark, and the instrument's frame."""
    unknown = Unknown("", "", "", np.inf)
    extra_blocks = [UnknownBlock("zeros", "", (unknown,) * joints, legs=tuple(range(joints)))]
    extra_blocks += [
        UnknownBlock("mark", name, (unknown,) * 3) for name in sorted(set(measurements.marks))
    ]
    if not any(block.kind == "frame" for block in blocks):
        extra_blocks.append(UnknownBlock("frame", "", (unknown,) * 6))
    return number_unknowns(extra_blocks, blocks[-1].where.stop)
