"""What every estimator returns: values, how far they may be trusted, and what was left over."""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import NormalDist
from typing import Any

import numpy as np

from pteron.identification.equations import Equations
from pteron.identification.estimators.triangle import Triangle
from pteron.identification.estimators.whiteness import (
    Whiteness,
    long_run_covariance,
    whiteness,
)
from pteron.kernels import Array

__all__ = ["Estimate", "estimate_of", "residuals_of"]

_BLOCK = 1 << 14


@dataclass(frozen=True)
class Estimate:
    """Estimated values of a model.

    Attributes
    ----------
    method : str
        The estimator.
    names, units : tuple of str
        Of the p values.
    values : array, shape (p,)
        SI units.
    covariance : array, shape (p, p)
        Of the values.
    noise : array, shape (n,)
        Standard deviation of each actuator's residuals, N, of the samples before the filter.
    whiteness : Whiteness
        Whether the residuals are white.
    correlated : bool
        Whether the test says that they are not; the covariance allows for correlation in any case
        (Newey and West).
    condition : float
        Condition number of the regressor with its columns scaled to unit length.
    rows : int
        Equations used.
    iterations : int
        That it took.
    residuals : array, shape (R, n)
        F - W values at the rows of the equations, in units of the noise before the filter, N.
    """

    method: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array = field(repr=False)
    noise: Array
    whiteness: Whiteness
    correlated: bool
    condition: float
    rows: int
    iterations: int = 1
    residuals: Array = field(repr=False, default_factory=lambda: np.empty((0, 0)))

    @property
    def deviations(self) -> Array:
        """Standard deviations (p,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def relative_deviations(self) -> Array:
        """Standard deviations over values (p,), without unit; infinite for a value of zero."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.deviations / np.abs(self.values))

    @property
    def correlation(self) -> Array:
        """Correlation matrix (p, p)."""
        sizes = np.where(self.deviations > 0.0, self.deviations, 1.0)
        return np.asarray(self.covariance / np.outer(sizes, sizes))

    def intervals(self, level: float = 0.95) -> tuple[Array, Array]:
        """Return the lower and upper ends (p,) of the values' intervals at a level."""
        reach = NormalDist().inv_cdf(0.5 + level / 2.0) * self.deviations
        return self.values - reach, self.values + reach

    def value(self, name: str) -> float:
        """Return one value by name."""
        return float(self.values[self.names.index(name)])

    def as_dict(self) -> dict[str, Any]:
        """Return everything but the residuals as plain data."""
        low, high = self.intervals()
        return {
            "method": self.method,
            "names": list(self.names),
            "units": list(self.units),
            "values": self.values.tolist(),
            "standard_deviations": self.deviations.tolist(),
            "relative_deviations": self.relative_deviations.tolist(),
            "intervals_95": [low.tolist(), high.tolist()],
            "correlation": self.correlation.tolist(),
            "noise": self.noise.tolist(),
            "residuals": {
                "white": self.whiteness.white,
                "autocorrelation": self.whiteness.autocorrelation.tolist(),
                "p_values": self.whiteness.p_values.tolist(),
                "correlated": self.correlated,
            },
            "condition_number": self.condition,
            "equations": self.rows,
            "iterations": self.iterations,
        }


def residuals_of(equations: Equations, values: Array) -> Array:
    """Return F - W values (R, n)."""
    rest = np.empty_like(equations.forces)
    for start in range(0, len(rest), _BLOCK):
        rows = slice(start, start + _BLOCK)
        rest[rows] = equations.forces[rows] - equations.matrix[rows] @ values
    return rest


def estimate_of(
    method: str,
    equations: Equations,
    factor: Triangle,
    values: Array,
    covariance: Array,
    *,
    weights: Array,
    iterations: int = 1,
    scores: Array | None = None,
    inverse: Array | None = None,
) -> Estimate:
    """Return the estimate that an estimator found.

    Parameters
    ----------
    method : str
        Its name.
    equations : Equations
        What was solved.
    factor : Triangle
        Of the weighted equations.
    values, covariance : array, shape (p,) and (p, p)
        What was found, for white residuals.
    weights : array, shape (R, n) or (n,)
        What the rows were multiplied by.
    iterations : int
        That it took.
    scores : array, shape (R, n), optional
        Weighted residuals that stand for the plain ones in a covariance that allows for their
        correlation.
    inverse : array, shape (p, p), optional
        Of the weighted normal equations, where it is not that of `factor`.
    """
    rest = residuals_of(equations, values)
    # Only a prior lets there be fewer equations than values.
    share = max(factor.degrees, 1) / max(factor.rows, 1)
    noise = np.sqrt((rest**2).sum(axis=0) / np.maximum(equations.used, 1) / share)
    test = whiteness(rest, equations.gain > 0.0)
    # Whatever the test says: in a short log it does not see all correlation that matters.
    weighted = weights**2 * rest if scores is None else scores
    rows = np.einsum("rnp,rn->rp", equations.matrix, weighted, optimize=True)
    bread = factor.inverse() if inverse is None else inverse
    allowed = long_run_covariance(rows, bread, share)
    # Correlation that happens to help is not counted on.
    worse = np.sqrt(np.maximum(np.diag(allowed) / np.diag(covariance), 1.0))
    covariance = covariance * np.outer(worse, worse)
    return Estimate(
        method,
        equations.names,
        equations.units,
        values,
        covariance,
        noise,
        test,
        not test.white,
        factor.condition,
        factor.rows,
        iterations,
        rest,
    )
