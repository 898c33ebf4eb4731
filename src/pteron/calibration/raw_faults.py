"""Likely mistakes in measurements, found before the fit: units, order, signs, zeros, scales, frame.

Measurements should lie within noise and tolerances of what the machine as drawn would give; where
they do not, each likely mistake is undone on trial, and told where they then do.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.fit import Fit, Fitter
from pteron.calibration.guess import Block, Guess, Unknown, numbered, tolerances_of
from pteron.calibration.measurements import Measurements
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.result import HiddenOrder
from pteron.calibration.start import placed, starting_poses
from pteron.calibration.thresholds import OFF_TOLERANCES
from pteron.calibration.unknowns import TOLERANCES
from pteron.errors import DataError, UnlikelyValue

Array = NDArray[np.float64]

_FAR = 25.0
"""Median over rows of the mean squared residual, in variances of noise and tolerances, from which
mistakes are tried."""

_NEAR = 9.0
"""The same below which a mistake, undone, explains the residuals."""

_FALLEN = 0.1
"""Share of the misfit that a mistake, undone, leaves at most."""

_CLEAR = 2.0
"""Misfit that leaves no doubt: its expected value is below 1 where nothing is wrong."""

_ALIKE = 2.0
"""Ratio of misfits up to which the mistake that is more likely beforehand, the earlier, is told."""

_ROWS = 16
"""Rows that are examined, drawn at random."""

_QUICK_MODES = 3
"""Freedom up to which all assembly modes of a row take milliseconds; of hexapods a tenth second."""

_CHUNK = 4096
"""Rows that are evaluated at a time."""

_FIRST = 5
"""Rows that are examined first of a mistake."""

_NOISE = 1e-4
"""Assumed noise, m and rad: small beside the effect of tolerances."""


def raw_fault(
    given: Measurements, blocks: Sequence[Block], robot_guess: Guess, *, fitted: bool = False
) -> str | None:
    """Return the mistake, in words, that explains measurements far from the drawing; else None.

    After a fit that left errors beyond ordinary tolerances (`fitted`) they are far in any case.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnlikelyValue)  # what is tried may well be unlikely
        rows = _some_rows(given)
        now = _misfit(rows, blocks, robot_guess)
        if not fitted and now < _FAR:
            return None
        return _best_mistake(rows, blocks, robot_guess, min(_NEAR, _FALLEN * now))


def hidden_order(
    given: Measurements, blocks: Sequence[Block], robot_guess: Guess, fit: Fit
) -> HiddenOrder | None:
    """Return two legs whose readings could be swapped and nothing would show; None for none.

    Heights over the bed of a symmetric machine are those of its mirror image.
    """
    rows = _some_rows(given)
    if set(given.kinds) != {"height"}:
        return None
    now = _misfit(rows, blocks, robot_guess)
    for pair, _, mended in _swapped(rows, robot_guess):
        if _misfit(mended, blocks, robot_guess) < max(_CLEAR, 1.5 * now):
            return HiddenOrder(pair, _change_by_order(given, robot_guess, fit, pair))
    return None


def _change_by_order(given: Measurements, start: Guess, fit: Fit, pair: tuple[int, int]) -> float:
    """Return the greatest change of the tool's place if two readings are swapped, m.

    It is that of the calibrated machine beyond the mirror image that the drawn one has.
    """
    order = list(range(given.readings.shape[1]))
    order[pair[0] - 1], order[pair[1] - 1] = pair[1] - 1, pair[0] - 1
    slopes = MachineSlopes(start.robot, ())
    middle = np.tile(np.median(fit.poses[fit.kept], axis=0), (len(given), 1))

    def places(guess: Guess, readings: Array) -> Array:
        poses = slopes.poses(guess, guess.joints(readings), middle)
        return guess.points(given.marks, poses)

    swapped = given.readings[:, order]
    drawn, drawn_swapped = places(start, given.readings), places(start, swapped)
    found, found_swapped = places(fit.guess, given.readings), places(fit.guess, swapped)
    good = fit.kept & np.isfinite(drawn + drawn_swapped + found + found_swapped).all(axis=1)
    if not good.any():
        return float("inf")
    around = np.column_stack([drawn[good], np.ones(good.sum())])
    mirror = np.linalg.lstsq(around, drawn_swapped[good], rcond=1e-6)[0]
    image = np.column_stack([found[good], np.ones(good.sum())]) @ mirror
    return float(np.linalg.norm(found_swapped[good] - image, axis=1).max())


def _some_rows(given: Measurements) -> Measurements:
    # At random: rows at even steps might all be of one mark.
    return given.rows(np.random.default_rng(0).permutation(len(given)) < _ROWS)


def _best_mistake(
    rows: Measurements, blocks: Sequence[Block], guess: Guess, most: float
) -> str | None:
    """Return the mistake that, undone, leaves least; of those that leave about as little the first.

    A group of mistakes that clearly has it ends the search.
    """
    tried: list[tuple[float, str]] = []
    for mistakes in _MISTAKES:
        tried += [
            (_quick_misfit(mended, blocks, guess, most), text)
            for text, mended in mistakes(rows, guess)
        ]
        if min(tried, default=(np.inf, ""))[0] < min(_CLEAR, most):
            break
    best = min(tried, default=(np.inf, ""))[0]
    if best >= most:
        return None
    return next(text for left, text in tried if left <= min(_ALIKE * best + _CLEAR / 4.0, most))


def _quick_misfit(rows: Measurements, blocks: Sequence[Block], guess: Guess, most: float) -> float:
    """Return `_misfit`, or inf where the first few rows are already far above the most that counts.

    All assembly modes of rows that lead to no pose take long to seek.
    """
    some = np.arange(len(rows)) < _FIRST
    if len(rows) > 2 * _FIRST and _misfit(rows.rows(some), blocks, guess) > 10.0 * most:
        return np.inf
    return _misfit(rows, blocks, guess)


def _misfit(rows: Measurements, blocks: Sequence[Block], guess: Guess) -> float:
    """Return the rows' median of the mean squared residual, in variances; inf: no pose."""
    try:
        poses = _trial_poses(guess, rows)
    except DataError:
        return np.inf
    return float(np.median(row_misfits(guess, rows, blocks, poses)))


def _trial_poses(guess: Guess, rows: Measurements) -> Array:
    """Return poses of readings that may be wrong: all assembly modes where these are quick to find.

    The right readings lead to the measured pose, or near home, by Newton's steps alone.
    """
    return starting_poses(guess, rows, modes=guess.robot.freedom <= _QUICK_MODES)


def row_misfits(guess: Guess, rows: Measurements, blocks: Sequence[Block], poses: Array) -> Array:
    """Return each row's mean squared residual (N,), in variances of noise and tolerances.

    inf where it has no pose.
    """
    lost: NDArray[np.bool_] = np.asarray(np.isnan(poses).any(axis=1))
    lost |= (rows.origins >= 0) & lost[rows.origins]
    if lost.all():
        return np.full(len(rows), np.inf)
    poses = np.where(np.isnan(poses), np.median(poses[~np.isnan(poses).any(axis=1)], axis=0), poses)
    start = placed(guess, rows, poses)
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


def _units(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield units that were perhaps meant, and the measurements in them."""
    linear = np.array([leg.joint.unit == "m" for leg in guess.robot.legs])
    lengths = [name for name in ("position", "height", "distance") if name in given.kinds]
    for factor, text in ((1e-3, "in millimetres"), (1e3, "1000 times too small, as of km for m")):
        scaled = {f"{name}s": factor * getattr(given, f"{name}s") for name in lengths}
        if linear.any():
            scaled["readings"] = np.where(linear, factor, 1.0) * given.readings
        advice = f"are {text}: give them in metres"
        for name, values in scaled.items():
            yield f"the {name} {advice}", replace(given, **{name: values})
        if len(scaled) > 1:
            yield f"all lengths {advice}", replace(given, **scaled)
    if not linear.all():
        read = np.where(linear, given.readings, np.radians(given.readings))
        yield "the readings are in degrees: give them in radians", replace(given, readings=read)
    if "angle" in given.kinds:
        yield (
            "the measured angles are in degrees: give them in radians",
            replace(given, angles=np.radians(given.angles)),
        )


def _marks(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield marks that were perhaps swapped, and the measurements with them exchanged."""
    used = sorted(set(given.marks))
    for a, b in combinations(used, 2):
        other = {a: b, b: a}
        yield (
            f"the marks {a or 'tool'} and {b or 'tool'} are swapped: exchange their names",
            replace(given, marks=tuple(other.get(name, name) for name in given.marks)),
        )


def _frames(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield quarter turns of the instrument, and the measurements turned back."""
    if given.setup.frame_known and not np.isnan(given.positions).any():
        cube = scipy.spatial.transform.Rotation.create_group("O")
        for turn in np.round(cube[cube.magnitude() > 0.1].as_matrix()):
            # Rows of `turn` say where the instrument's x, y and z point.
            told = ", ".join(
                f"{'xyz'[k]} along {'-' if row.sum() < 0 else ''}{'xyz'[int(np.abs(row).argmax())]}"
                for k, row in enumerate(turn)
            )
            yield (
                f"the instrument's frame is turned: its {told} of the base; turn the positions, or "
                'say [instrument] frame = "unknown"',
                replace(given, positions=given.positions @ turn),
            )


def _swapped(
    given: Measurements, guess: Guess
) -> Iterator[tuple[tuple[int, int], str, Measurements]]:
    """Yield pairs of legs, from 1, their names, and the measurements with readings exchanged."""
    names = guess.robot.joint_names
    for i, j in combinations(range(len(names)), 2):
        order = list(range(len(names)))
        order[i], order[j] = j, i
        told = f"{names[i]} and {names[j]}"
        yield (i + 1, j + 1), told, replace(given, readings=given.readings[:, order])


def _legs(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield legs whose readings were perhaps swapped, and the measurements with them exchanged."""
    for (i, j), told, mended in _swapped(given, guess):
        yield f"the readings of legs {i} and {j} ({told}) are swapped: exchange the columns", mended


def _reversed(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield joints whose readings perhaps count the other way, and the measurements turned round.

    About zero, or between the ends of their travel.
    """
    names, legs = guess.robot.joint_names, guess.robot.legs
    count = len(names)
    ways = [("reverse the signs", np.zeros(count))]
    if all(leg.limits is not None for leg in legs):
        ends = np.array([sum(leg.limits or ()) for leg in legs])
        if np.abs(ends).max() > 0.0:
            ways.append(("they count from the other end of the limits", ends))
    for advice, ends in ways:
        for joints in (tuple(range(count)), *((i,) for i in range(count))):
            turned = guess.joints(given.readings)
            turned[:, joints] = ends[list(joints)] - turned[:, joints]
            yield (
                f"the readings of {_of(joints, names)} are reversed: {advice} of the columns"
                if not ends.any()
                else f"the readings of {_of(joints, names)} are reversed: {advice}",
                replace(given, readings=guess.readings(turned)),
            )


def _scaled(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield joints whose readings are perhaps in wrong steps, and the measurements mended.

    About zero, or from an end of their travel.
    """
    names, legs = guess.robot.joint_names, guess.robot.legs
    count = len(names)
    ends = [("", np.zeros(count))]
    if all(leg.limits is not None for leg in legs):
        limits = np.array([leg.limits for leg in legs])
        ends += [(" from the upper end", limits[:, 1]), (" from the lower end", limits[:, 0])]
    for factor, text, cause in _STEPS:
        for where, end in ends:
            for joints in (tuple(range(count)), *((i,) for i in range(count))):
                mended = guess.joints(given.readings)
                own = list(joints)
                mended[:, own] = end[own] + factor * (mended[:, own] - end[own])
                yield (
                    f"the readings of {_of(joints, names)}{where} are {text} as large as they "
                    f"should be, {cause}: give steps, lead or gear ratio as they are",
                    replace(given, readings=guess.readings(mended)),
                )


def _fitted_zeros(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield the zeros that all rows together show to be off, and the measurements mended."""
    yield from _fitted(given, guess, ("zeros",))


def _fitted_scales(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield the zeros and scales that all rows show to be off, and the measurements mended."""
    yield from _fitted(given, guess, ("scales",))
    yield from _fitted(given, guess, ("scales", "zeros"))


def _fitted(
    given: Measurements, guess: Guess, sought: Sequence[str]
) -> Iterator[tuple[str, Measurements]]:
    legs, names = guess.robot.legs, guess.robot.joint_names
    travel = [_WIDE_ZERO * leg.size if leg.joint.unit == "m" else _WIDE_ANGLE for leg in legs]
    widths = {"zeros": travel, "scales": [_WIDE_SCALE] * len(legs)}
    blocks = numbered(
        Block(
            kind,
            "",
            tuple(Unknown("", kind, "", w) for w in widths[kind]),
            (),
            tuple(range(len(legs))),
        )
        for kind in sought
    )
    try:
        fit = Fitter(given, blocks, guess, _trial_poses(guess, given)).run()
    except DataError:
        return
    found = fit.guess
    texts = []
    for i, (leg, name) in enumerate(zip(legs, names, strict=True)):
        unit = leg.joint.unit
        zero, scale = found.zeros[i] - guess.zeros[i], found.scales[i] / guess.scales[i]
        if "scales" in sought and abs(scale - 1.0) > OFF_TOLERANCES * TOLERANCES["scales"]:
            texts.append(f"{name} reads {1.0 / scale:.4g} times what it should")
        least = TOLERANCES["zeros" if unit == "m" else "zeros, rad"]
        if "zeros" in sought and abs(zero) > OFF_TOLERANCES * least:
            told, word = (1e3 * zero, "mm") if unit == "m" else (np.degrees(zero), "degrees")
            texts.append(f"the zero of {name} is off by {told:+.3g} {word}")
    if texts:
        yield (
            f"{', '.join(texts)}: home the machine again or mend its step units, or give the legs "
            "reading = { zero = .., scale = .. }",
            replace(given, readings=guess.readings(found.joints(given.readings))),
        )


def _of(joints: Sequence[int], names: Sequence[str]) -> str:
    if len(joints) == len(names):
        return "all joints"
    return f"joint {joints[0] + 1} ({names[joints[0]]})"


_STEPS = (
    (2.0, "half", "as with half the lead or twice the steps"),
    (0.5, "twice", "as with twice the lead or half the steps"),
    (4.0, "a quarter", "as with a quarter of the lead"),
    (0.25, "four times", "as with four times the lead"),
    (10.0, "a tenth", "as of cm for mm"),
    (0.1, "ten times", "as of mm for cm"),
    (float(np.pi / 180.0), "180/pi times", "as of degrees for radians"),
    (float(180.0 / np.pi), "pi/180", "as of radians for degrees"),
    (1.0 / (2.0 * np.pi), "2 pi times", "as of radians for turns"),
    (2.0 * np.pi, "1/(2 pi)", "as of turns for radians"),
    (1e-3, "1000 times", "as of mm for m"),
    (25.4e-3, "1/0.0254 times", "as of inches for m"),
)
"""Factors that mend readings, what the readings then are, and a likely cause."""

_WIDE_ZERO = 0.3
_WIDE_ANGLE = 1.0
_WIDE_SCALE = 0.5
"""Widths of a search for zeros (of a leg's size; rad) and scales that may be anything."""

_MISTAKES = (_units, _marks, _frames, _legs, _reversed, _scaled, _fitted_zeros, _fitted_scales)
"""Likely mistakes, those that are quick to try first."""
