"""The most probable values of a calibration's unknowns, by Gauss and Newton's method with priors.

Rows whose residuals are too large for their noise count less (Huber) and, far beyond, not at all.
Noise that is not given is found from the residuals, by kind of measurement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.guess import Block, Guess, tolerances_of
from pteron.calibration.measurements import KINDS, Measurements, evenly
from pteron.calibration.residuals import MachineSlopes, Rows
from pteron.errors import DataError
from pteron.kinematics import direct_kinematics

Array = NDArray[np.float64]

_START = 1e-4
"""Noise that is assumed before any is found, m and rad."""

FLOOR = 1e-7
"""Least noise, m and rad: with less, rounding would outweigh the tolerances."""

_CHUNK = 4096
"""Rows that are evaluated at a time."""

_STEPS = 30
_SETTLED = 1e-4
"""A step smaller than this share of every unknown's interval ends the search."""

_DOUBTED = 0.99
"""Quantile of a row's squared residuals beyond which it counts less."""

_LOST = 30.0
"""Cost of a row whose readings lead to no pose, in variances, as if it hardly fitted."""

BEYOND = 1e3
"""Distance that marks such a row, so that it is left out in the end; no residual has just this."""

_STRAY = 30.0
"""Standard deviations beyond which a row may be left out of a step that improves all others."""

_FEW = 0.05
"""Greatest share of the rows that may be left out so."""

_OUTLYING = 1e-5
"""Probability of a faultless row, over their number, below which it is left out."""

_ROUNDS = 12
"""Most alternations of fit and search for noise and outliers; two or three usually do."""


@dataclass(frozen=True)
class Fit:
    """Values, the rows' residuals there, and the normal equations; at best the most probable ones.

    Attributes
    ----------
    guess : Guess
        The values.
    total : array, shape (p,)
        All steps from the drawing.
    noise : dict
        Standard deviation by kind of measurement.
    kept : array of bool, shape (N,)
        The rows that are no outliers.
    poses : array, shape (N, m)
        Of all rows.
    prior : array, shape (p,)
        What tolerances say: one over their squares.
    residuals, measured : array, shape (N, K)
        Of all rows, computed minus measured, m and rad; and which of them count.
    distances : array, shape (N,)
        Of each row's residuals from zero, in standard deviations (Mahalanobis).
    information, gradient : array, shapes (p, p) and (p,)
        What the data alone say: J' W J and J' W r.
    cost : float
        Squared residuals, in variances, and tolerances.
    steps : int
        Gauss and Newton's steps in all.
    shared : array, shape (p, p), or 0
        By how much `information` is too great where several distances share a row's readings: each
        row is weighted as if its noise were its own alone.
    settled : bool
        Whether the search has ended where nothing is more probable nearby.
    """

    guess: Guess
    total: Array
    noise: dict[str, float]
    kept: NDArray[np.bool_]
    poses: Array
    prior: Array
    residuals: Array
    measured: NDArray[np.bool_]
    distances: Array
    information: Array
    gradient: Array
    cost: float = np.inf
    steps: int = 0
    shared: Array | float = 0.0
    settled: bool = True

    @cached_property
    def covariance(self) -> Array:
        """The covariance of all unknowns (p, p), from data and tolerances."""
        matrix = self.information + np.diag(self.prior)
        size = np.sqrt(np.diag(matrix))
        size[size == 0.0] = 1.0
        try:
            factor = scipy.linalg.cho_factor(matrix / np.outer(size, size))
        except np.linalg.LinAlgError:
            raise DataError(
                "the measurements leave open what has no tolerance: free less, or give `prior` "
                "finite standard deviations"
            ) from None
        inverse = scipy.linalg.cho_solve(factor, np.eye(len(size))) / np.outer(size, size)
        return np.asarray(
            inverse if np.ndim(self.shared) == 0 else inverse + inverse @ self.shared @ inverse
        )


class Fitter:
    """A search for the most probable values.

    Parameters
    ----------
    given : Measurements
        What was measured.
    blocks : tuple of Block
        What is sought.
    guess : Guess
        Where to begin.
    poses : array, shape (N, m)
        Near the rows' poses; NaN for a row that is first left out, as its readings lead to none.
    aside : array of bool, shape (N,), optional
        Rows that are left out of the first fit, and are back where they then fit.
    barred : array of bool, shape (N,), optional
        Rows that stay left out.
    """

    def __init__(
        self,
        given: Measurements,
        blocks: tuple[Block, ...],
        guess: Guess,
        poses: Array,
        aside: NDArray[np.bool_] | None = None,
        barred: NDArray[np.bool_] | None = None,
    ) -> None:
        self.given, self.blocks, self.begin = given, blocks, guess
        self.slopes = MachineSlopes(guess.robot, blocks)
        self.prior = 1.0 / tolerances_of(blocks) ** 2
        none = np.zeros(len(given), dtype=bool)
        self.barred = none if barred is None else barred
        lost: NDArray[np.bool_] = np.asarray(np.isnan(poses).any(axis=1))
        self.aside = lost | self.barred | (none if aside is None else aside)
        # Newton's steps to the pose of a lost row, should there be one later, begin in the middle.
        self.begin_poses = poses
        if lost.any() and not lost.all():
            self.begin_poses = np.where(lost[:, None], np.median(poses[~lost], axis=0), poses)
        self.kind_of = given.kind_of
        self.readings_noise = given.setup.noise.get("readings", 0.0)

    def run(self, before: Fit | None = None) -> Fit:
        """Return what is found; another fit, as of some of the rows, may tell where to begin.

        Raises
        ------
        DataError
            If most readings lead to no pose, or the measurements leave open what has no tolerance.
        """
        setup = self.given.setup.noise
        sought = [kind for kind in self.given.kinds if kind not in setup]
        guess, total = self.begin, np.zeros(len(self.prior))
        noise = {kind: max(setup.get(kind, _START), FLOOR) for kind in KINDS}
        if before is not None:
            guess, total, noise = before.guess, before.total, before.noise
        kept, none = ~self.aside, np.empty(0)
        begin = guess, total, noise, kept, self.begin_poses, self.prior
        try:
            at = self._at(Fit(*begin, none, none > 0.0, none, none, none))
        except ValueError:
            raise DataError(
                "most readings lead to no pose of the machine as drawn; check their units, zeros "
                "and order"
            ) from None
        for _ in range(_ROUNDS):
            at = self._found_again(self._settled(at))
            noise = at.noise | self._noise(at, sought)
            distances = self._distances_of_left_out(at)
            scaled = distances * (at.noise[sought[0]] / noise[sought[0]] if sought else 1.0)
            limits = scipy.stats.chi2.isf(
                _OUTLYING / len(kept), np.maximum(at.measured.sum(axis=1), 1)
            )
            kept = (scaled**2 <= limits) & ~self.barred
            if 2 * kept.sum() < len(kept):  # no rows are the faultless ones
                kept = (at.distances != BEYOND) & ~self.barred
            alike = all(abs(noise[k] / at.noise[k] - 1.0) < 0.01 for k in sought)
            if alike and (kept == at.kept).all():
                break
            try:
                at = self._at(at, noise=noise, kept=kept)
            except ValueError:  # of the rows that fit, most lead to no pose
                return replace(at, settled=False, shared=self._shared(at))
        return replace(at, shared=self._shared(at))

    def _distances_of_left_out(self, at: Fit) -> Array:
        """Return the rows' distances (N,); of those left out with the fit's own uncertainty there.

        Next to a singularity a fit without a row is less sure of its pose than an instrument.
        """
        distances = at.distances.copy()
        rows = np.flatnonzero(~at.kept & ~self.barred & (at.distances != BEYOND))[:_CHUNK]
        if len(rows):
            there = self.slopes.rows(at.guess, self.given, at.poses, rows)
            r, slopes, _ = self.whitened(there, at.guess, at.noise)
            spread = np.einsum("nkp,pq,nlq->nkl", slopes, at.covariance, slopes, optimize=True)
            solved = np.linalg.solve(np.eye(r.shape[1]) + spread, r[..., None])[..., 0]
            distances[rows] = np.sqrt(np.maximum(np.einsum("nk,nk->n", r, solved), 0.0))
        return distances

    def _found_again(self, at: Fit) -> Fit:
        """Return the fit with the poses of rows that Newton's steps lost on their way."""
        lost = np.flatnonzero(at.distances == BEYOND)
        if not len(lost):
            return at
        joints, poses = at.guess.joints(self.given.readings)[lost], at.poses.copy()
        for i, modes in zip(lost, direct_kinematics(at.guess.robot, joints), strict=True):
            off = np.abs(modes - self.begin_poses[i]).max(axis=-1)
            if np.isfinite(off).any():
                poses[i] = modes[np.nanargmin(off)]
        return self._at(at, poses=poses)

    def _settled(self, begin: Fit) -> Fit:
        """Return the most probable values for a noise and rows that are kept."""
        at, kept = begin, begin.kept
        for taken in range(1, _STEPS + 1):  # noqa: B007 (told in the result)
            step = -at.covariance @ (at.gradient + at.prior * at.total)
            small = np.abs(step) / np.sqrt(np.diag(at.covariance))
            if small.max() < _SETTLED:
                break
            share = 1.0
            while True:
                try:
                    part = share * step
                    moved, total = at.guess.moved(self.blocks, part), at.total + part
                    after = self._at(at, guess=moved, total=total, kept=kept)
                    fell = after.cost <= at.cost * (1.0 + 1e-9) + 1e-12
                    if not fell and share == 1.0:
                        strays = self._strays(at, after, kept)
                        if strays is not None:
                            kept, fell = kept & ~strays, True
                except ValueError:  # no such machine, or out of its reach
                    fell = False
                if fell:
                    break
                share *= 0.5
                if share < 1e-3:
                    if small.max() < 1e-2:
                        break
                    at = replace(at, settled=False)
                    break
            if not fell:
                break
            at = after
        return replace(at, kept=begin.kept, steps=begin.steps + taken)

    def _strays(self, before: Fit, after: Fit, kept: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
        """Return the few rows without which a step is a great one; None where there are none.

        The pose of a row next to a singularity jumps where the geometry moves by little.
        """
        strays = kept & (after.distances > _STRAY)
        if not 0 < strays.sum() <= max(1.0, _FEW * kept.sum()):
            return None
        others = kept & ~strays
        squares = [float((fit.distances[others] ** 2).sum()) for fit in (before, after)]
        return strays if squares[1] < 0.1 * squares[0] else None

    def cost(self, guess: Guess, total: Array, fit: Fit) -> float:
        """Return the squared residuals, in variances, and tolerances of a guess; inf: no pose."""
        try:
            return self._at(fit, guess=guess, total=total).cost
        except ValueError:
            return float(np.inf)

    def _at(self, fit: Fit, **changed: Any) -> Fit:
        """Return a fit with other values, and its residuals and normal equations there.

        ValueError where they have no poses.
        """
        fit = replace(fit, **changed)
        guess, kept, poses = fit.guess, fit.kept, fit.poses
        count, rows = len(self.prior), len(self.given)
        width = len(self.kind_of)
        matrix, right, cost = np.zeros((count, count)), np.zeros(count), 0.0
        joints = guess.joints(self.given.readings)
        found = self.slopes.poses(guess, joints, poses)
        lost: NDArray[np.bool_] = np.asarray(np.isnan(found).any(axis=1))
        lost |= (self.given.origins >= 0) & lost[self.given.origins]
        if 2 * lost[kept].sum() > kept.sum():
            raise ValueError
        found = np.where(np.isnan(found), poses, found)  # out of reach by little; it may come back
        residuals = np.zeros((rows, width))
        measured = np.zeros((rows, width), dtype=bool)
        distances = np.zeros(rows)
        for start in range(0, rows, _CHUNK):
            chosen = np.arange(start, min(start + _CHUNK, rows))
            at = self.slopes.rows(guess, self.given, found, chosen)
            residuals[chosen], measured[chosen] = at.residuals, at.measured
            lost[chosen] |= ~np.isfinite(at.by_reading).all(axis=(1, 2))
            r, slopes, _ = self.whitened(at, guess, fit.noise)
            r[lost[chosen]], slopes[lost[chosen]] = 0.0, 0.0
            squares = np.einsum("nk,nk->n", r, r)
            distances[chosen] = np.sqrt(squares)
            limit = np.sqrt(scipy.stats.chi2.ppf(_DOUBTED, np.maximum(at.measured.sum(axis=1), 1)))
            far = np.maximum(distances[chosen], limit)
            weights = np.where(kept[chosen], limit / far, 0.0)
            cost += float(
                (kept[chosen] * np.where(far > limit, 2 * limit * far - limit**2, squares)).sum()
            )
            used = at.measured.any(axis=0)
            heavy = np.sqrt(weights)[:, None] * at.measured[:, used]
            flat = (heavy[..., None] * slopes[:, used]).reshape(-1, count)
            matrix += flat.T @ flat
            right += flat.T @ (heavy * r[:, used]).reshape(-1)
        cost += float(self.prior @ fit.total**2) + _LOST * float((lost & kept).sum())
        if not np.isfinite(cost):
            raise ValueError
        distances[lost] = BEYOND
        values = guess, fit.total, fit.noise, kept, found, self.prior
        ends = matrix, right, cost, fit.steps, 0.0, fit.settled
        return Fit(*values, residuals, measured, distances, *ends)

    def whitened(
        self, at: Rows, guess: Guess, noise: dict[str, float]
    ) -> tuple[Array, Array, Array]:
        """Return residuals and slopes in standard deviations, independent within a row.

        And what a standard deviation of the readings, of two rows, makes of the residuals.
        """
        sizes = np.array([noise[kind] for kind in self.kind_of])
        pushed = at.by_reading * (self.readings_noise * np.tile(guess.scales, 2))
        if not self.readings_noise:
            return at.residuals / sizes, at.slopes / sizes[:, None], pushed
        covariance = pushed @ np.swapaxes(pushed, -1, -2) + np.diag(sizes**2)
        root = np.linalg.cholesky(covariance)
        both = np.concatenate([at.residuals[..., None], at.slopes, pushed], axis=-1)
        white = np.linalg.solve(root, both)
        count = at.slopes.shape[-1]
        return white[..., 0], white[..., 1 : 1 + count], white[..., 1 + count :]

    def _shared(self, fit: Fit) -> Array | float:
        """Return a fit's `shared`."""
        origins = self.given.origins
        ends = np.unique(origins[origins >= 0])
        if not self.readings_noise or not len(ends):
            return 0.0
        at = self.slopes.rows(fit.guess, self.given, fit.poses, np.arange(len(origins)))
        _, slopes, pushed = self.whitened(at, fit.guess, fit.noise)
        pulls = np.einsum("nkp,nkj->njp", slopes * fit.kept[:, None, None], pushed)
        pulls[~np.isfinite(pulls)] = 0.0  # of rows that are out of reach
        legs = pulls.shape[1] // 2
        place = np.full(len(origins) + 1, -1)  # the last is that of no row
        place[ends] = np.arange(len(ends))
        owners = place[np.concatenate([np.arange(len(origins)), origins])]
        parts = np.concatenate([pulls[:, :legs], pulls[:, legs:]])[owners >= 0]
        sums = np.zeros((len(ends), *parts.shape[1:]))
        np.add.at(sums, owners[owners >= 0], parts)
        both, each = (part.reshape(-1, pulls.shape[-1]) for part in (sums, parts))
        return np.asarray(both.T @ both - each.T @ each)

    def _noise(self, fit: Fit, sought: list[str]) -> dict[str, float]:
        """Return the noise by kind that the residuals show, less what the unknowns took of it."""
        if not sought:
            return {}
        kept = fit.kept & (fit.distances != BEYOND)
        rows = np.flatnonzero(kept)
        if not len(rows):
            return {}
        some = rows[evenly(len(rows), _CHUNK)]
        at = self.slopes.rows(fit.guess, self.given, fit.poses, some)
        found = {}
        for kind in sought:
            own = (self.kind_of == kind) & fit.measured & kept[:, None]
            count = int(own.sum())
            if not count:
                continue
            part = at.slopes[:, self.kind_of == kind].reshape(-1, len(fit.total))
            took = np.einsum("ij,jk,ik->", part, fit.covariance, part, optimize=True)
            left = count - took * len(rows) / len(some) / fit.noise[kind] ** 2
            # Half the middle of their sizes serves where a few rows are far off.
            values = np.abs(fit.residuals[own])
            rms = float(np.sqrt((values**2).sum() / max(left, 1.0)))
            middle = float(np.median(values)) / 0.6745 * np.sqrt(count / max(left, 1.0))
            found[kind] = max(middle if rms > 2.0 * middle and count > 20 else rms, FLOOR)
        return found
