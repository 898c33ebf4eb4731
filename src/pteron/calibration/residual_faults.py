"""Faults that residuals show after a calibration's fit: rows that do not fit, slipped zeros, ...

Most faults are one more unknown. Its column of slopes tells, without another fit, by how much the
squared residuals would fall if it were sought too (a score test).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2  # type: ignore[import-untyped]

from pteron.calibration.fit import BEYOND, Fit, Fitter
from pteron.calibration.guess import Block, Guess, Unknown
from pteron.calibration.measurements import Measurements, evenly
from pteron.calibration.result import Finding

Array = NDArray[np.float64]

_ROWS = 3000
"""Most rows that are examined, evenly spread."""

_CHANCE = 1e-6
"""Probability, over all faults tried, of a finding where there is no fault."""

_HEAVIEST = 3.0
"""Most that a row may be off, in what a middle row is off: a few rows alone are no such fault."""

_SHARE = 0.2
"""Least share of the squared residuals that a reported fault explains."""

_NOISY = 4.0
"""Mean square along one leg's coordinate, in variances, above which its model is doubted."""

_LISTED = 8
"""Most outlying rows that are named."""


def residual_faults(
    start: Guess, fit: Fit, blocks: tuple[Block, ...], given: Measurements
) -> tuple[Finding, ...]:
    """Return the faults that residuals show, first the one that explains most."""
    outliers = _outliers(fit, given)
    found = list(_shown(start, fit, blocks, given)) or list(_bad_leg(start, fit, blocks, given))
    if not found:
        return outliers
    best = max(found, key=lambda one: one.improvement)
    return (best,) if (~fit.kept).sum() > _LISTED else (best, *outliers)


def _outliers(fit: Fit, given: Measurements) -> tuple[Finding, ...]:
    rows = np.flatnonzero(~fit.kept)
    if not len(rows):
        return ()
    worst = rows[np.argsort(-fit.distances[rows])][:_LISTED]
    named = ", ".join(f"{given.places[i]} ({_size(fit, i)})" for i in worst)
    more = f" and {len(rows) - len(worst)} more" if len(rows) > len(worst) else ""
    text = f"Left out, as {'they do' if len(rows) > 1 else 'it does'} not fit: {named}{more}."
    return (Finding("outlier", text, float((fit.distances[rows] ** 2).sum())),)


def _size(fit: Fit, row: int) -> str:
    if fit.distances[row] >= BEYOND:
        return "its readings lead to no pose"
    left = fit.residuals[row]
    k = int(np.abs(left).argmax())
    angle = 3 <= k < len(left) - 2
    return f"off by {1e3 * abs(left[k]):.3g} {'mrad' if angle else 'mm'}"


def _shown(
    start: Guess, fit: Fit, blocks: tuple[Block, ...], given: Measurements
) -> Iterator[Finding]:
    """Yield the faults that explain what noise does not."""
    joints, names = len(start.robot.legs), start.robot.joint_names
    count = blocks[-1].where.stop
    whole = _extended(blocks, given, joints)
    fitter = Fitter(given, whole, start, fit.poses)
    chosen = evenly(len(given), _ROWS)
    at = fitter.slopes.rows(fit.guess, given, fit.poses, chosen)
    r, slopes, _ = fitter.whitened(at, fit.guess, fit.noise)
    off = np.sqrt(np.einsum("nk,nk->n", r, r) / np.maximum(at.measured.sum(axis=1), 1))
    weights = np.minimum(1.0, _HEAVIEST * np.median(off) / np.maximum(off, 1e-12))
    weights[~np.isfinite(slopes).all(axis=(1, 2))] = 0.0  # no pose
    r = weights[:, None] * r
    slopes = weights[:, None, None] * np.nan_to_num(slopes)
    own, more = slopes[..., :count], slopes[..., count:]
    flat = own.reshape(-1, count)
    covariance = np.linalg.inv(flat.T @ flat + np.diag(fitter.prior[:count]))
    left = r - (own @ (covariance @ (flat.T @ r.reshape(-1))))
    # Noise that was found has the fault in it: a middle row's is nearer the truth.
    squares = np.einsum("nk,nk->n", left, left) / np.maximum(at.measured.sum(axis=1), 1)
    variance = max(float(np.median(squares)) / 0.6, 1e-12)
    total = float(squares.sum())

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

    tests: list[tuple[str, str, int, float]] = []
    later = np.arange(len(chosen))
    for i, leg in enumerate(start.robot.legs):
        column, told = more[..., i : i + 1], "mrad" if leg.joint.unit == "rad" else "mm"
        for t in range(3, len(chosen) - 3, max(1, len(chosen) // 200)):
            found, amount = score(column * (later >= t)[:, None, None])
            text = (
                f"The zero of joint {i + 1} ({names[i]}) slipped by {1e3 * amount[0]:+.3g} {told} "
                f"before {given.places[chosen[t]]}: home it again, and measure anew from there."
            )
            tests.append(("slipped zero", text, 1, found))
        steps = np.sign(np.diff(given.readings[chosen, i], prepend=given.readings[chosen[0], i]))
        found, amount = score(column * steps[:, None, None])
        text = (
            f"Joint {i + 1} ({names[i]}) stops {2e3 * abs(amount[0]):.3g} {told} apart by its "
            "direction of approach: approach poses from one side, or take up its play."
        )
        tests.append(("backlash", text, 1, found))
    times = given.times[chosen] if given.times is not None else chosen.astype(float)
    span = np.ptp(times)
    if span > 0.0:
        along = (times - times.mean()) / span
        found, amount = score(more[..., :joints] * along[:, None, None])
        text = (
            "The readings drift from the first row to the last, by up to "
            f"{1e3 * np.abs(amount).max():.3g} mm or mrad, as a machine's do that grows warm: let "
            "it warm up, and measure quickly."
        )
        tests.append(("drift", text, joints, found))
    for k, name in enumerate(sorted({given.marks[i] for i in chosen})):
        columns = more[..., joints + 3 * k : joints + 3 * k + 3]
        for t in range(3, len(chosen) - 3, max(1, len(chosen) // 60)):
            found, amount = score(columns * (later >= t)[:, None, None])
            text = (
                f"The mark {name or 'tool'} moved by {1e3 * np.linalg.norm(amount):.3g} mm before "
                f"{given.places[chosen[t]]}: fix it, and measure anew from there."
            )
            tests.append(("moved mark", text, 3, found))
    for kind, text, freedom, found in tests:
        limit = chi2.isf(_CHANCE / len(tests), freedom)
        if found > limit and found * variance > _SHARE * total:
            yield Finding(kind, text, float(found - chi2.isf(0.5, freedom)))


def _bad_leg(
    start: Guess, fit: Fit, blocks: tuple[Block, ...], given: Measurements
) -> Iterator[Finding]:
    """Yield the leg whose coordinate alone explains residuals that are not noise."""
    if not set(given.setup.noise) - {"readings"}:
        return  # noise that was found explains everything
    names = start.robot.joint_names
    fitter = Fitter(given, blocks, start, fit.poses)
    kept = np.flatnonzero(fit.kept)
    chosen = kept[evenly(len(kept), _ROWS)]
    at = fitter.slopes.rows(fit.guess, given, fit.poses, chosen)
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
    """Return the blocks with a zero for each joint and every mark once more."""
    start = blocks[-1].where.stop
    zeros = tuple(Unknown("", "zeros", "", np.inf) for _ in range(joints))
    found = [
        *blocks,
        Block("zeros", "", slice(start, start + joints), zeros, (), tuple(range(joints))),
    ]
    start += joints
    for name in sorted(set(given.marks)):
        where = slice(start, start + 3)
        found.append(Block("mark", name, where, (Unknown("", "tool", "m", np.inf),) * 3))
        start += 3
    return tuple(found)
