"""The score test of a further unknown of a calibration: how much it would reduce the residuals."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.calibration_fit import CalibrationFit
from pteron.calibration.fit import FLOOR, Fitter
from pteron.calibration.guess import Unknown, UnknownBlock, number_unknowns
from pteron.calibration.measurements import Measurements, spread_rows

Array = NDArray[np.float64]

Numbers = NDArray[np.int64]

Score = Callable[[Array], tuple[float, Array]]
"""From columns (N, K, c) to the fall of the squared residuals, and the columns' amounts."""

MOST_ROWS = 3000
"""Most rows that are examined, evenly spread."""

_HEAVIEST = 3.0
"""Greatest weighted residual of a row, over the median row's: a few rows are no such fault."""


class FaultTrial(NamedTuple):
    """A candidate fault: its text, its shift of the residuals, and the fall of their squares."""

    kind: str
    text: str
    freedom: int
    fall: float
    moved: Array
    """Residuals (N, K) less those without it, before the other unknowns follow."""


class ScoreTest:
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
            spread_rows(len(measurements), MOST_ROWS), np.flatnonzero(~fit.kept)[:MOST_ROWS]
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

    def joint_columns(self, steps: Array) -> Array:
        """Return the residuals' columns (N, K, n) for steps (M, n) of all rows' joint coordinates.

        A distance between two rows follows the steps of both.
        """
        count = steps.shape[1]
        origins = self.measurements.origins[self.rows]
        columns: Array = self._joints[..., :count] * steps[self.rows][:, None]
        between = origins >= 0
        columns[between] += self._joints[between, :, count:] * steps[origins[between]][:, None]
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
