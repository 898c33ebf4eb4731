"""The most probable values of a calibration's unknowns, by Gauss and Newton's method with priors.

Rows whose residuals are too large for their noise count less (Huber) and, far beyond, not at all.
Noise that is not given is found from the residuals, by kind of measurement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve  # type: ignore[import-untyped]
from scipy.stats import chi2  # type: ignore[import-untyped]

from pteron.calibration.guess import Block, Guess, tolerances_of
from pteron.calibration.measurements import KINDS, Measurements
from pteron.calibration.residuals import MachineSlopes, Rows
from pteron.errors import DataError

Array = NDArray[np.float64]

_START = 1e-4
"""Noise that is assumed before any is found, m and rad."""

_FLOOR = 1e-7
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
    """The result of a search for the most probable values.

    Attributes
    ----------
    guess : Guess
        The values.
    total : array, shape (p,)
        All steps from the drawing.
    covariance : array, shape (p, p)
        Of all unknowns, from data and tolerances.
    information : array, shape (p, p)
        What the data alone say: J' W J.
    noise : dict
        Standard deviation by kind of measurement.
    poses : array, shape (N, m)
        Of all rows.
    residuals, measured : array, shape (N, K)
        Of all rows, computed minus measured, m and rad; and which of them count.
    distances : array, shape (N,)
        Of each row's residuals from zero, in standard deviations (Mahalanobis); and
    kept : array of bool, shape (N,)
        the rows that are no outliers.
    steps : int
        Gauss and Newton's steps in all.
    """

    guess: Guess
    total: Array
    covariance: Array
    information: Array
    noise: dict[str, float]
    poses: Array
    residuals: Array
    measured: NDArray[np.bool_]
    distances: Array
    kept: NDArray[np.bool_]
    steps: int


@dataclass
class _Sums:
    """The normal equations of a guess."""

    matrix: Array
    right: Array
    cost: float
    poses: Array
    residuals: Array
    measured: NDArray[np.bool_]
    distances: Array


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
        Near the rows' poses.
    """

    def __init__(
        self, given: Measurements, blocks: tuple[Block, ...], guess: Guess, poses: Array
    ) -> None:
        self.given, self.blocks, self.begin = given, blocks, guess
        self.slopes = MachineSlopes(guess.robot, blocks)
        self.prior = 1.0 / tolerances_of(blocks) ** 2
        self.begin_poses = poses
        self.kind_of = given.kind_of
        self.readings_noise = given.setup.noise.get("readings", 0.0)

    def run(self, before: Fit | None = None) -> Fit:
        """Return what is found; another fit, as of some of the rows, may tell where to begin.

        Raises
        ------
        DataError
            If it does not settle, or the measurements leave something without a tolerance open.
        """
        setup = self.given.setup.noise
        noise = {kind: max(setup.get(kind, _START), _FLOOR) for kind in KINDS}
        sought = [kind for kind in self.given.kinds if kind not in setup]
        kept = np.ones(len(self.given), dtype=bool)
        guess, poses = self.begin, self.begin_poses
        total = np.zeros(len(self.prior))
        if before is not None:
            guess, total, noise = before.guess, before.total, dict(before.noise)
        steps = 0
        for _ in range(_ROUNDS):
            guess, total, sums, taken = self._settled(guess, total, poses, noise, kept)
            poses, steps = sums.poses, steps + taken
            covariance = self._covariance(sums.matrix)
            found = {**noise, **self._noise(sums, kept, covariance, guess, noise, sought)}
            scaled = sums.distances * (noise[sought[0]] / found[sought[0]] if sought else 1.0)
            limits = chi2.isf(_OUTLYING / len(kept), np.maximum(sums.measured.sum(axis=1), 1))
            fine = scaled**2 <= limits
            if 2 * fine.sum() < len(fine):  # no rows are the faultless ones
                fine[:] = True
            alike = all(abs(found[k] / noise[k] - 1.0) < 0.01 for k in sought)
            if alike and (fine == kept).all():
                break
            noise, kept = found, fine
        return Fit(
            guess,
            total,
            covariance,
            sums.matrix,
            noise,
            sums.poses,
            sums.residuals,
            sums.measured,
            sums.distances,
            kept,
            steps,
        )

    def _settled(
        self,
        guess: Guess,
        total: Array,
        poses: Array,
        noise: dict[str, float],
        kept: NDArray[np.bool_],
    ) -> tuple[Guess, Array, _Sums, int]:
        sums = self._sums(guess, total, poses, noise, kept)
        for taken in range(1, _STEPS + 1):
            covariance = self._covariance(sums.matrix)
            step = -covariance @ (sums.right + self.prior * total)
            small = np.abs(step) / np.sqrt(np.diag(covariance))
            share = 1.0
            while True:
                try:
                    moved = guess.moved(self.blocks, share * step)
                    after = self._sums(moved, total + share * step, sums.poses, noise, kept)
                    fell = after.cost <= sums.cost * (1.0 + 1e-9) + 1e-12
                    if not fell and share == 1.0:
                        strays = self._strays(sums, after, kept)
                        if strays is not None:
                            kept, fell = kept & ~strays, True
                except ValueError:  # no such machine, or out of its reach
                    fell = False
                if fell:
                    break
                share *= 0.5
                if share < 1e-3:
                    if small.max() < 1e-2:
                        return guess, total, sums, taken
                    raise DataError(
                        "the search for the geometry does not settle: the measurements contradict "
                        "the machine as drawn; check units, the order of the joints, and the frame"
                    )
            guess, total, sums = moved, total + share * step, after
            if share == 1.0 and small.max() < _SETTLED:
                break
        return guess, total, sums, taken

    def _strays(
        self, before: _Sums, after: _Sums, kept: NDArray[np.bool_]
    ) -> NDArray[np.bool_] | None:
        """Return the few rows without which a step is a great one; None where there are none.

        The pose of a row next to a singularity jumps where the geometry moves by little.
        """
        strays = kept & (after.distances > _STRAY)
        if not 0 < strays.sum() <= max(1.0, _FEW * kept.sum()):
            return None
        others = kept & ~strays
        squares = [float((sums.distances[others] ** 2).sum()) for sums in (before, after)]
        return strays if squares[1] < 0.1 * squares[0] else None

    def cost(self, guess: Guess, total: Array, fit: Fit) -> float:
        """Return the squared residuals, in variances, and tolerances of a guess; inf: no pose."""
        try:
            return float(self._sums(guess, total, fit.poses, fit.noise, fit.kept).cost)
        except ValueError:
            return float(np.inf)

    def _covariance(self, information: Array) -> Array:
        matrix = information + np.diag(self.prior)
        size = np.sqrt(np.diag(matrix))
        size[size == 0.0] = 1.0
        try:
            factor = cho_factor(matrix / np.outer(size, size))
        except np.linalg.LinAlgError:
            raise DataError(
                "the measurements leave open what has no tolerance: free less, or give `prior` "
                "finite standard deviations"
            ) from None
        inverse: Array = np.asarray(cho_solve(factor, np.eye(len(size)))) / np.outer(size, size)
        return inverse

    def _sums(
        self,
        guess: Guess,
        total: Array,
        poses: Array,
        noise: dict[str, float],
        kept: NDArray[np.bool_],
    ) -> _Sums:
        count, rows = len(self.prior), len(self.given)
        width = len(self.kind_of)
        matrix, right, cost = np.zeros((count, count)), np.zeros(count), 0.0
        joints = guess.joints(self.given.readings)
        found = self.slopes.poses(guess, joints, poses)
        lost: NDArray[np.bool_] = np.asarray(np.isnan(found).any(axis=1))
        if 2 * lost[kept].sum() > kept.sum():
            raise ValueError
        found[lost] = poses[lost]  # out of reach by little; it may come back
        cost += _LOST * float((lost & kept).sum())
        residuals = np.zeros((rows, width))
        measured = np.zeros((rows, width), dtype=bool)
        distances = np.zeros(rows)
        for start in range(0, rows, _CHUNK):
            chosen = np.arange(start, min(start + _CHUNK, rows))
            at = self.slopes.rows(guess, self.given, found, chosen)
            residuals[chosen], measured[chosen] = at.residuals, at.measured
            r, slopes = self.whitened(at, guess, noise)
            r[lost[chosen]], slopes[lost[chosen]] = 0.0, 0.0
            squares = np.einsum("nk,nk->n", r, r)
            distances[chosen] = np.sqrt(squares)
            limit = np.sqrt(chi2.ppf(_DOUBTED, np.maximum(at.measured.sum(axis=1), 1)))
            far = np.maximum(distances[chosen], limit)
            weights = np.where(kept[chosen], limit / far, 0.0)
            cost += float(
                (kept[chosen] * np.where(far > limit, 2 * limit * far - limit**2, squares)).sum()
            )
            flat = slopes.reshape(-1, count)
            heavy = np.repeat(weights, width)
            matrix += (flat * heavy[:, None]).T @ flat
            right += flat.T @ (heavy * r.reshape(-1))
        cost += float(self.prior @ total**2)
        if not np.isfinite(cost):
            raise ValueError
        return _Sums(matrix, right, cost, found, residuals, measured, distances)

    def whitened(self, at: Rows, guess: Guess, noise: dict[str, float]) -> tuple[Array, Array]:
        """Return residuals and slopes in standard deviations, independent within a row."""
        sizes = np.array([noise[kind] for kind in self.kind_of])
        if not self.readings_noise:
            return at.residuals / sizes, at.slopes / sizes[:, None]
        pushed = at.by_reading * (self.readings_noise * guess.scales)
        covariance = pushed @ np.swapaxes(pushed, -1, -2) + np.diag(sizes**2)
        root = np.linalg.cholesky(covariance)
        both = np.concatenate([at.residuals[..., None], at.slopes], axis=-1)
        white = np.linalg.solve(root, both)
        return white[..., 0], white[..., 1:]

    def _noise(
        self,
        sums: _Sums,
        kept: NDArray[np.bool_],
        covariance: Array,
        guess: Guess,
        noise: dict[str, float],
        sought: list[str],
    ) -> dict[str, float]:
        """Return the noise by kind that the residuals show, less what the unknowns took of it."""
        if not sought:
            return {}
        taken = dict.fromkeys(KINDS, 0.0)
        for start in range(0, len(kept), _CHUNK):
            chosen = np.arange(start, min(start + _CHUNK, len(kept)))
            at = self.slopes.rows(guess, self.given, sums.poses, chosen[kept[chosen]])
            for kind in sought:
                part = at.slopes[:, self.kind_of == kind].reshape(-1, len(covariance))
                taken[kind] += float(np.einsum("ij,jk,ik->", part, covariance, part, optimize=True))
        found = {}
        for kind in sought:
            own = (self.kind_of == kind) & sums.measured & kept[:, None]
            count = int(own.sum())
            if not count:
                continue
            left = count - taken[kind] / noise[kind] ** 2
            # Half the middle of their sizes serves where a few rows are far off.
            values = np.abs(sums.residuals[own])
            rms = float(np.sqrt((values**2).sum() / max(left, 1.0)))
            middle = float(np.median(values)) / 0.6745 * np.sqrt(count / max(left, 1.0))
            found[kind] = max(middle if rms > 2.0 * middle and count > 20 else rms, _FLOOR)
        return found
