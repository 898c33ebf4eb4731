"""The most probable values of a calibration's unknowns, by Gauss and Newton's method with priors.

Rows whose residuals are too large for their noise count less (Huber) and, far beyond, not at all.
Noise that is not given is found from the residuals, by kind of measurement.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.calibration_fit import CalibrationFit
from pteron.calibration.guess import Guess, UnknownBlock, tolerances_of
from pteron.calibration.measurements import KINDS, Measurements, spread_rows
from pteron.calibration.residuals import MachineSlopes, ResidualRows
from pteron.calibration.start import fitting_poses
from pteron.errors import DataError

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
"""Quantile of a row's squared residuals above which its weight is reduced."""

_LOST = 30.0
"""Cost of a row whose readings lead to no pose, in variances: that of a row that hardly fits."""

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


class Fitter:
    """A search for the most probable values.

    Parameters
    ----------
    measurements : Measurements
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
        measurements: Measurements,
        blocks: tuple[UnknownBlock, ...],
        guess: Guess,
        poses: Array,
        aside: NDArray[np.bool_] | None = None,
        barred: NDArray[np.bool_] | None = None,
    ) -> None:
        self.measurements, self.blocks, self.begin = measurements, blocks, guess
        self.slopes = MachineSlopes(guess.robot, blocks)
        self.prior = 1.0 / tolerances_of(blocks) ** 2
        none = np.zeros(len(measurements), dtype=bool)
        self.barred = none if barred is None else barred
        lost: NDArray[np.bool_] = np.asarray(np.isnan(poses).any(axis=1))
        self.aside = lost | self.barred | (none if aside is None else aside)
        # Newton's steps to the pose of a lost row, should there be one later, begin in the middle.
        self.begin_poses = poses
        if lost.any() and not lost.all():
            self.begin_poses = np.where(lost[:, None], np.median(poses[~lost], axis=0), poses)
        self.kind_of = measurements.kind_of
        self.readings_noise = measurements.setup.noise.get("readings", 0.0)

    def run(self, initial: CalibrationFit | None = None) -> CalibrationFit:
        """Return the most probable fit; the search begins at `initial`, such as a fit of some rows.

        Raises
        ------
        DataError
            If most readings lead to no pose, or the measurements leave open what has no tolerance.
        """
        setup = self.measurements.setup.noise
        sought = [kind for kind in self.measurements.kinds if kind not in setup]
        guess, total = self.begin, np.zeros(len(self.prior))
        noise = {kind: max(setup.get(kind, _START), FLOOR) for kind in KINDS}
        if initial is not None:
            guess, total, noise = initial.guess, initial.total, initial.noise
        fitted_rows, none = ~self.aside, np.empty(0)
        begin = guess, total, noise, fitted_rows, self.begin_poses, self.prior
        try:
            at = self._evaluate(CalibrationFit(*begin, none, none > 0.0, none, none, none))
        except ValueError:
            raise DataError(
                "most readings lead to no pose of the machine as drawn; check their units, zeros "
                "and order"
            ) from None
        for _ in range(_ROUNDS):
            at = self._recover_poses(self._minimise_cost(at))
            noise = at.noise | self._estimate_noise(at, sought)
            distances = self._prediction_distances(at)
            scaled = distances * (at.noise[sought[0]] / noise[sought[0]] if sought else 1.0)
            limits = scipy.stats.chi2.isf(
                _OUTLYING / len(fitted_rows), np.maximum(at.measured.sum(axis=1), 1)
            )
            fitted_rows = (scaled**2 <= limits) & ~self.barred
            if 2 * fitted_rows.sum() < len(fitted_rows):  # no rows are the faultless ones
                fitted_rows = (at.distances != BEYOND) & ~self.barred
            alike = all(abs(noise[k] / at.noise[k] - 1.0) < 0.01 for k in sought)
            if alike and (fitted_rows == at.kept).all():
                break
            try:
                at = self._evaluate(at, noise=noise, kept=fitted_rows)
            except ValueError:  # of the rows that fit, most lead to no pose
                return replace(at, settled=False, shared=self._shared_information(at))
        return replace(at, shared=self._shared_information(at))

    def _prediction_distances(self, at: CalibrationFit) -> Array:
        """Return the distances (N,) of rows; left-out rows with the fit's uncertainty added.

        Next to a singularity a fit without a row is less sure of its pose than an instrument.
        """
        distances = at.distances.copy()
        rows = np.flatnonzero(~at.kept & ~self.barred & (at.distances != BEYOND))[:_CHUNK]
        if len(rows):
            there = self.slopes.rows(at.guess, self.measurements, at.poses, rows)
            r, slopes, _ = self.whiten_rows(there, at.guess, at.noise)
            spread = np.einsum("nkp,pq,nlq->nkl", slopes, at.covariance, slopes, optimize=True)
            solved = np.linalg.solve(np.eye(r.shape[1]) + spread, r[..., None])[..., 0]
            distances[rows] = np.sqrt(np.maximum(np.einsum("nk,nk->n", r, solved), 0.0))
        return distances

    def _recover_poses(self, at: CalibrationFit) -> CalibrationFit:
        """Return the fit with the poses of rows recovered at which Newton's method diverged."""
        lost = np.flatnonzero(at.distances == BEYOND)
        if not len(lost):
            return at
        joints, poses = at.guess.joints(self.measurements.readings)[lost], at.poses.copy()
        for i, modes in zip(lost, fitting_poses(at.guess.robot, joints), strict=True):
            off = np.abs(modes - self.begin_poses[i]).max(axis=-1)
            if np.isfinite(off).any():
                poses[i] = modes[np.nanargmin(off)]
        return self._evaluate(at, poses=poses)

    def _minimise_cost(self, begin: CalibrationFit) -> CalibrationFit:
        """Return the fit of least cost at fixed noise and rows, by damped Gauss-Newton steps."""
        at, fitted_rows = begin, begin.kept
        for taken in range(1, _STEPS + 1):  # noqa: B007 (told in the result)
            step = -at.covariance @ (at.gradient + at.prior * at.total)
            small = np.abs(step) / np.sqrt(np.diag(at.covariance))
            if small.max() < _SETTLED:
                break
            share = 1.0
            while True:
                try:
                    part = share * step
                    moved, total = at.guess.apply_step(self.blocks, part), at.total + part
                    after = self._evaluate(at, guess=moved, total=total, kept=fitted_rows)
                    fell = after.cost <= at.cost * (1.0 + 1e-9) + 1e-12
                    if not fell and share == 1.0:
                        strays = self._find_strays(at, after, fitted_rows)
                        if strays is not None:
                            fitted_rows, fell = fitted_rows & ~strays, True
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

    def _find_strays(
        self, old_fit: CalibrationFit, new_fit: CalibrationFit, fitted_rows: NDArray[np.bool_]
    ) -> NDArray[np.bool_] | None:
        """Return the few rows (N,) without which a step lowers the cost tenfold, or None.

        The pose of a row next to a singularity jumps where the geometry moves by little.
        """
        strays = fitted_rows & (new_fit.distances > _STRAY)
        if not 0 < strays.sum() <= max(1.0, _FEW * fitted_rows.sum()):
            return None
        others = fitted_rows & ~strays
        squares = [float((fit.distances[others] ** 2).sum()) for fit in (old_fit, new_fit)]
        return strays if squares[1] < 0.1 * squares[0] else None

    def cost(self, guess: Guess, total: Array, fit: CalibrationFit) -> float:
        """Return the cost of a guess: squared residuals and tolerances, in variances.

        Infinite where the guess leads to no poses.
        """
        try:
            return self._evaluate(fit, guess=guess, total=total).cost
        except ValueError:
            return float(np.inf)

    def _evaluate(self, fit: CalibrationFit, **changed: Any) -> CalibrationFit:
        """Return a fit with changed fields, its residuals and normal equations evaluated anew.

        Raise ValueError where the changed values have no poses.
        """
        fit = replace(fit, **changed)
        guess, fitted_rows, poses = fit.guess, fit.kept, fit.poses
        count, rows = len(self.prior), len(self.measurements)
        width = len(self.kind_of)
        matrix, right, cost = np.zeros((count, count)), np.zeros(count), 0.0
        joints = guess.joints(self.measurements.readings)
        new_poses = self.slopes.poses(guess, joints, poses)
        lost: NDArray[np.bool_] = np.asarray(np.isnan(new_poses).any(axis=1))
        lost |= (self.measurements.origins >= 0) & lost[self.measurements.origins]
        if 2 * lost[fitted_rows].sum() > fitted_rows.sum():
            raise ValueError
        # A pose out of reach by little may come back.
        new_poses = np.where(np.isnan(new_poses), poses, new_poses)
        residuals = np.zeros((rows, width))
        measured = np.zeros((rows, width), dtype=bool)
        distances = np.zeros(rows)
        for start in range(0, rows, _CHUNK):
            chosen = np.arange(start, min(start + _CHUNK, rows))
            at = self.slopes.rows(guess, self.measurements, new_poses, chosen)
            residuals[chosen], measured[chosen] = at.residuals, at.measured
            lost[chosen] |= ~np.isfinite(at.by_reading).all(axis=(1, 2))
            r, slopes, _ = self.whiten_rows(at, guess, fit.noise)
            r[lost[chosen]], slopes[lost[chosen]] = 0.0, 0.0
            squares = np.einsum("nk,nk->n", r, r)
            distances[chosen] = np.sqrt(squares)
            limit = np.sqrt(scipy.stats.chi2.ppf(_DOUBTED, np.maximum(at.measured.sum(axis=1), 1)))
            far = np.maximum(distances[chosen], limit)
            weights = np.where(fitted_rows[chosen], limit / far, 0.0)
            cost += float(
                (
                    fitted_rows[chosen] * np.where(far > limit, 2 * limit * far - limit**2, squares)
                ).sum()
            )
            used = at.measured.any(axis=0)
            heavy = np.sqrt(weights)[:, None] * at.measured[:, used]
            flat = (heavy[..., None] * slopes[:, used]).reshape(-1, count)
            matrix += flat.T @ flat
            right += flat.T @ (heavy * r[:, used]).reshape(-1)
        cost += float(self.prior @ fit.total**2) + _LOST * float((lost & fitted_rows).sum())
        if not np.isfinite(cost):
            raise ValueError
        distances[lost] = BEYOND
        state = guess, fit.total, fit.noise, fitted_rows, new_poses, self.prior
        ends = matrix, right, cost, fit.steps, 0.0, fit.settled
        return CalibrationFit(*state, residuals, measured, distances, *ends)

    def whiten_rows(
        self, at: ResidualRows, guess: Guess, noise: dict[str, float]
    ) -> tuple[Array, Array, Array]:
        """Return residuals (N, K) and slopes in standard deviations, independent within a row.

        Third come the residuals' changes (N, K, 2 n) by one standard deviation of each reading.
        """
        sizes = np.array([noise[kind] for kind in self.kind_of])
        pushed = at.by_reading * (self.readings_noise * np.tile(guess.scales, 2))
        if not self.readings_noise:
            return at.residuals / sizes, at.slopes / sizes[:, None], pushed
        sizes[self.kind_of == "closure"] = FLOOR  # their noise is that of the readings
        covariance = pushed @ np.swapaxes(pushed, -1, -2) + np.diag(sizes**2)
        root = np.linalg.cholesky(covariance)
        both = np.concatenate([at.residuals[..., None], at.slopes, pushed], axis=-1)
        white = np.linalg.solve(root, both)
        count = at.slopes.shape[-1]
        return white[..., 0], white[..., 1 : 1 + count], white[..., 1 + count :]

    def _shared_information(self, fit: CalibrationFit) -> Array | float:
        """Return the information (p, p) shared by distances through a row's readings; else 0."""
        origins = self.measurements.origins
        ends = np.unique(origins[origins >= 0])
        if not self.readings_noise or not len(ends):
            return 0.0
        at = self.slopes.rows(fit.guess, self.measurements, fit.poses, np.arange(len(origins)))
        _, slopes, pushed = self.whiten_rows(at, fit.guess, fit.noise)
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

    def _estimate_noise(self, fit: CalibrationFit, sought: list[str]) -> dict[str, float]:
        """Return the noise by kind, from the residuals over their degrees of freedom."""
        if not sought:
            return {}
        usable = fit.kept & (fit.distances != BEYOND)
        rows = np.flatnonzero(usable)
        if not len(rows):
            return {}
        some = rows[spread_rows(len(rows), _CHUNK)]
        at = self.slopes.rows(fit.guess, self.measurements, fit.poses, some)
        noise = {}
        for kind in sought:
            entries = (self.kind_of == kind) & fit.measured & usable[:, None]
            count = int(entries.sum())
            if not count:
                continue
            part = at.slopes[:, self.kind_of == kind].reshape(-1, len(fit.total))
            took = np.einsum("ij,jk,ik->", part, fit.covariance, part, optimize=True)
            freedom = count - took * len(rows) / len(some) / fit.noise[kind] ** 2
            # Half the middle of their sizes serves where a few rows are far off.
            sizes = np.abs(fit.residuals[entries])
            rms = float(np.sqrt((sizes**2).sum() / max(freedom, 1.0)))
            middle = float(np.median(sizes)) / 0.6745 * np.sqrt(count / max(freedom, 1.0))
            noise[kind] = max(middle if rms > 2.0 * middle and count > 20 else rms, FLOOR)
        return noise
