"""Faults that residuals show after a calibration's fit: rows that do not fit, slipped zeros, ...

Most faults are one more unknown. Its column of slopes tells, without another fit, by how much the
squared residuals would fall if it were sought too (a score test).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.fit import BEYOND, FLOOR, Fit, Fitter
from pteron.calibration.guess import Block, Guess, Unknown, numbered
from pteron.calibration.measurements import Measurements, evenly
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.result import Finding
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


class Trial(NamedTuple):
    """A fault that was tried: what it is and moves, and by how much squared residuals fall."""

    kind: str
    text: str
    freedom: int
    fall: float
    moved: Array
    """Residuals (N, K) less those without it, before the other unknowns follow."""


def residual_faults(
    fitter: Fitter, fit: Fit, reasons: Mapping[int, str] | None = None
) -> tuple[Finding, ...]:
    """Return the fault that explains most residuals, and the rows that do not fit even so.

    `reasons` say by row why it was set aside before the fit.
    """
    found, explained = _shown(fitter, fit)
    found = found or tuple(_bad_leg(fitter, fit))
    return *found, *_outliers(fit, fitter.given, ~fit.kept & ~explained, reasons or {})


def zero_faults(fitter: Fitter, fit: Fit) -> tuple[Finding, ...]:
    """Return the joints whose zeros are beyond their tolerances, with sizes.

    A size is the median difference of joint coordinates, as a guide point takes part of a zero.
    """
    start, given = fitter.begin, fitter.given
    rows = np.flatnonzero(fit.kept)
    joints = fitter.slopes.joints(start, fit.poses[rows]) - start.joints(given.readings[rows])
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
            findings.append(Finding("zero", text))
    return tuple(findings)


def _outliers(
    fit: Fit, given: Measurements, out: NDArray[np.bool_], reasons: Mapping[int, str]
) -> tuple[Finding, ...]:
    rows = np.flatnonzero(out)
    if not len(rows):
        return ()
    worst = rows[np.argsort(-fit.distances[rows])][:_LISTED]
    named = ", ".join(f"{given.places[i]} ({reasons.get(int(i)) or _size(fit, i)})" for i in worst)
    more = f" and {len(rows) - len(worst)} more" if len(rows) > len(worst) else ""
    text = f"Left out, as {'they do' if len(rows) > 1 else 'it does'} not fit: {named}{more}."
    return (Finding("outlier", text, float((fit.distances[rows] ** 2).sum())),)


def _size(fit: Fit, row: int) -> str:
    if fit.distances[row] == BEYOND:
        return "its readings lead to no pose"
    left = fit.residuals[row]
    k = int(np.abs(left).argmax())
    angle = 3 <= k < len(left) - 2
    return f"off by {1e3 * abs(left[k]):.3g} {'mrad' if angle else 'mm'}"


def _shown(fitter: Fitter, fit: Fit) -> tuple[tuple[Finding, ...], NDArray[np.bool_]]:
    """Return the fault, if any, that best explains what noise does not, and the rows (N,) so."""
    start, blocks, given = fitter.begin, fitter.blocks, fitter.given
    count = blocks[-1].where.stop
    more = _extended(blocks, given, len(start.robot.legs))
    fitter = Fitter(given, (*blocks, *more), start, fit.poses)
    chosen = np.union1d(evenly(len(given), _ROWS), np.flatnonzero(~fit.kept)[:_ROWS])
    at = fitter.slopes.rows(fit.guess, given, fit.poses, chosen)
    r, slopes, _ = fitter.whitened(at, fit.guess, fit.noise)
    off = np.sqrt(np.einsum("nk,nk->n", r, r) / np.maximum(at.measured.sum(axis=1), 1))
    weights = np.minimum(1.0, _HEAVIEST * np.median(off) / np.maximum(off, 1e-12))
    weights[~np.isfinite(slopes).all(axis=(1, 2))] = 0.0  # no pose
    r = weights[:, None] * r
    slopes = weights[:, None, None] * np.nan_to_num(slopes)
    own = slopes[..., :count]
    flat = own.reshape(-1, count)
    covariance = np.linalg.inv(flat.T @ flat + np.diag(fitter.prior[:count]))

    def remaining(moved: Array) -> Array:
        """Return what is left of residuals (N, K) where the fit's unknowns follow."""
        return np.asarray(moved - own @ (covariance @ (flat.T @ moved.reshape(-1))))

    left = remaining(r)
    # Noise that was found has the fault in it: a middle row's is nearer the truth.
    squares = np.einsum("nk,nk->n", left, left) / np.maximum(at.measured.sum(axis=1), 1)
    least = min(FLOOR / fit.noise[kind] for kind in given.kinds) ** 2
    took = float(np.trace(covariance @ (flat.T @ flat))) / at.measured.sum()  # by the fit
    variance = max(float(np.median(squares)) / (0.6 * (1.0 - took)), least)

    def score(columns: Array) -> tuple[float, Array]:
        """Return how the squared residuals fall with columns (N, K, c), and their amounts."""
        wide = columns.reshape(-1, columns.shape[-1])
        across = flat.T @ wide
        square = wide.T @ wide - across.T @ covariance @ across
        right = wide.T @ left.reshape(-1)
        size = np.sqrt(np.maximum(np.diag(wide.T @ wide), 1e-300))
        scaled = square / np.outer(size, size)
        inverse = np.linalg.pinv(scaled, rcond=1e-6, hermitian=True)
        amounts = -(inverse @ (right / size)) / size
        return float(-right @ amounts) / variance, amounts

    tried, best, gain = 0, None, -np.inf
    frame = [block for block in blocks if block.kind == "frame"]
    trials = (
        *_trials(start, given, chosen, slopes, [*more, *frame], score),
        *_scale_trials(start, given, chosen, slopes[..., more[0].where], score),
        *_rod_trials(fit, given, chosen, slopes, more, score),
    )
    for trial in trials:
        tried += 1
        more_than_chance = trial.fall - float(scipy.stats.chi2.isf(0.5, trial.freedom))
        if more_than_chance > gain:
            best, gain = trial, more_than_chance
    explained = np.zeros(len(given), dtype=bool)
    share = _SHARE * float(squares.sum()) / variance
    if best is None or best.fall <= share:
        return (), explained
    chance = float(scipy.stats.chi2.sf(best.fall, best.freedom))
    if not set(given.kinds) <= set(given.setup.noise):
        # The noise that was found has the fault in it: an F test leaves it out.
        total, fall = float(np.einsum("nk,nk->", left, left)), best.fall * variance
        free = max(float(at.measured.sum()) * (1.0 - took) - best.freedom, 1.0)
        ratio = (fall / best.freedom) / max((total - fall) / free, least)
        chance = min(chance, float(scipy.stats.f.sf(ratio, best.freedom, free)))
    if chance >= _CHANCE / tried:
        return (), explained
    after = np.linalg.norm(left + remaining(best.moved), axis=-1)
    explained[chosen] = after < _EXPLAINED * np.linalg.norm(left, axis=-1)
    # Rods that differ the geometry takes; what it does not take of them is left.
    moved = remaining(best.moved) if best.kind == "unequal rods" else best.moved
    limits = np.array([ORDINARY_ERROR[str(kind)] / fit.noise[str(kind)] for kind in given.kind_of])
    effect = float((np.abs(moved) / limits)[fit.kept[chosen]].max(initial=0.0))
    return (Finding(best.kind, best.text, gain, effect),), explained


def _trials(
    start: Guess,
    given: Measurements,
    chosen: NDArray[np.int64],
    slopes: Array,
    more: Sequence[Block],
    score: Callable[[Array], tuple[float, Array]],
) -> Iterator[Trial]:
    """Try all faults at chosen rows, with slopes (N, K, p) against all unknowns."""
    later, places = np.arange(len(chosen)), [given.places[i] for i in chosen]
    zeros, *others = more

    def since(columns: Array, most: int) -> Iterator[tuple[str, float, Array, Array]]:
        for t in range(3, len(chosen) - 3, max(1, len(chosen) // most)):
            part = columns * (later >= t)[:, None, None]
            fall, amounts = score(part)
            yield places[t], fall, amounts, part @ amounts

    joints = slopes[..., zeros.where]
    for i, (leg, name) in enumerate(zip(start.robot.legs, start.robot.joint_names, strict=True)):
        column, unit = joints[..., i : i + 1], "mrad" if leg.joint.unit == "rad" else "mm"
        for place, fall, amounts, moved in since(column, 200):
            text = (
                f"The zero of joint {i + 1} ({name}) slipped by {1e3 * amounts[0]:+.3g} {unit} "
                f"before {place}: home it again, and measure anew from there."
            )
            yield Trial("slipped zero", text, 1, fall, moved)
        read = given.readings[chosen, i]
        column = column * np.sign(np.diff(read, prepend=read[0]))[:, None, None]
        fall, amounts = score(column)
        text = (
            f"Joint {i + 1} ({name}) stops {2e3 * abs(amounts[0]):.3g} {unit} apart by its "
            "direction of approach: approach poses from one side, or take up its play."
        )
        yield Trial("backlash", text, 1, fall, column @ amounts)
    times = given.times[chosen] if given.times is not None else chosen.astype(float)
    if span := np.ptp(times):
        columns = joints * ((times - times.mean()) / span)[:, None, None]
        fall, amounts = score(columns)
        text = (
            "The readings drift from the first row to the last, by up to "
            f"{1e3 * np.abs(amounts).max():.3g} mm or mrad, as a machine's do that grows warm: let "
            "it warm up, and measure quickly."
        )
        yield Trial("drift", text, len(amounts), fall, columns @ amounts)
    for block in others:
        what, alike = "instrument", ""
        if block.kind == "mark":
            what = f"mark {block.name or 'tool'}"
            alike = "" if start.robot.platform.angular.any() else ", or the instrument"
        for place, fall, amounts, moved in since(slopes[..., block.where], 60):
            text = (
                f"The {what} moved by {1e3 * np.linalg.norm(amounts[:3]):.3g} mm before {place}"
                f"{alike}: fix it, and measure anew from there."
            )
            yield Trial(f"moved {block.kind}", text, len(amounts), fall, moved)


def _scale_trials(
    start: Guess, given: Measurements, chosen: Numbers, joints: Array, score: Score
) -> Iterator[Trial]:
    """Try a scale of each joint, and one of all; slopes (N, K, n) are against the joints' zeros."""
    scales = joints * given.readings[chosen][:, None]
    for i, name in enumerate(start.robot.joint_names):
        fall, amounts = score(column := scales[..., i : i + 1])
        text = (
            f"Joint {i + 1} ({name}) moves {1e2 * amounts[0]:+.3g} % farther than it reads, beyond "
            "what its tolerance allows: check its lead, gear ratio or steps."
        )
        yield Trial("scale", text, 1, fall, column @ amounts)
    fall, amounts = score(column := scales.sum(axis=-1, keepdims=True))
    text = (
        f"All joints move {1e2 * amounts[0]:+.3g} % farther than they read, beyond what tolerances "
        "allow: check leads, gear ratios or steps, or the unit of what is measured."
    )
    yield Trial("scale", text, 1, fall, column @ amounts)


def _rod_trials(
    fit: Fit,
    given: Measurements,
    chosen: Numbers,
    slopes: Array,
    more: Sequence[Block],
    score: Score,
) -> Iterator[Trial]:
    """Try parallel rods of one leg that differ in length, and so tilt a platform that does not.

    With the rod u from a bar b of length w, ends of the rods that differ by d turn the platform by
    theta so that theta . (b x u) = |u| d / w, for each leg.
    """
    robot = fit.guess.robot
    if robot.platform.angular.any():
        return
    poses = fit.poses[chosen]
    couples: Array = evaluate_kernel(robot, "beams", "nan", poses)[-1]
    if couples.shape[1] != 3 or not np.isfinite(couples).all(axis=(1, 2)).any():
        return
    good = np.isfinite(couples).all(axis=(1, 2)) & (given.origins[chosen] < 0)
    size = np.linalg.norm(couples, axis=-1).max(axis=-1)
    flat = np.abs(np.linalg.det(np.where(good[:, None, None], couples, np.eye(3))))
    good &= flat > _FLAT * size**3
    turns = np.linalg.inv(np.where(good[:, None, None], couples, np.eye(3)))  # a column a leg
    arms = np.array([leg.platform_point for leg in robot.legs]) @ np.array(robot.platform.frame)
    arms += np.array([leg.fixed_offset for leg in robot.legs])
    against = MachineSlopes(robot, ()).jacobian(fit.guess, poses) @ robot.platform.directions
    marks = fit.guess.marked([given.marks[i] for i in chosen]) @ np.array(robot.platform.frame)
    for i, (leg, name) in enumerate(zip(robot.legs, robot.joint_names, strict=True)):
        turn = np.where(good[:, None], turns[:, :, i], 0.0)
        shifts = np.cross(turn[:, None], arms)
        column = -np.einsum(
            "nkj,nj->nk", slopes[..., more[0].where], np.einsum("njx,njx->nj", against, shifts)
        )
        for block in more:
            if block.kind == "mark":
                mine = np.array([given.marks[k] == block.name for k in chosen])
                # A mark's slopes are along the platform's frame.
                moved = np.cross(turn, marks) @ np.array(robot.platform.frame).T
                column += mine[:, None] * np.einsum("nkx,nx->nk", slopes[..., block.where], moved)
        fall, amounts = score(column[..., None])
        share = abs(amounts[0]) / leg.size
        bar = leg.bar_length
        difference = f"{1e2 * share:.2g} % of their distance"
        if bar is not None:
            difference = f"{1e3 * share * bar:.2g} mm"
        text = (
            f"The parallel rods of leg {i + 1} ({name}) differ in length, by about {difference}, "
            "and tilt the platform: measure both, and fit a pair of equal ones."
        )
        yield Trial("unequal rods", text, 1, fall, column[..., None] @ amounts)


def _bad_leg(fitter: Fitter, fit: Fit) -> Iterator[Finding]:
    """Yield the leg whose coordinate alone explains residuals that are not noise."""
    if not set(fitter.given.setup.noise) - {"readings"}:
        return  # noise that was found explains everything
    names = fitter.begin.robot.joint_names
    kept = np.flatnonzero(fit.kept)
    chosen = kept[evenly(len(kept), _ROWS)]
    at = fitter.slopes.rows(fit.guess, fitter.given, fit.poses, chosen)
    sizes = np.array([fit.noise[kind] for kind in fitter.kind_of])
    r, columns = at.residuals / sizes, at.by_reading[..., : len(names)] / sizes[:, None]
    along = np.einsum("nki,nk->ni", columns, r)
    squares = along**2 / np.maximum(np.einsum("nki,nki->ni", columns, columns), 1e-300)
    mean = squares.mean(axis=0)
    first, second = np.argsort(-mean)[:2]
    if mean[first] > _NOISY and mean[first] > 2.0 * mean[second]:
        text = (
            f"Leg {first + 1} ({names[first]}) does not move as its model says, by "
            f"{np.sqrt(mean[first]):.2g} times the noise: look for play, bending, or joints whose "
            "axes do not meet."
        )
        yield Finding("wrong model", text, float(squares[:, first].sum()))


def _extended(blocks: tuple[Block, ...], given: Measurements, joints: int) -> tuple[Block, ...]:
    """Return blocks behind others: every joint's zero, each mark, and the instrument's frame."""
    one = Unknown("", "", "", np.inf)
    more = [Block("zeros", "", (one,) * joints, legs=tuple(range(joints)))]
    more += [Block("mark", name, (one,) * 3) for name in sorted(set(given.marks))]
    if not any(block.kind == "frame" for block in blocks):
        more.append(Block("frame", "", (one,) * 6))
    return numbered(more, blocks[-1].where.stop)
