"""Essential parameters: what is left once the data have had their say on what they cannot show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2  # type: ignore[import-untyped]

from pteron.identification.equations import Equations
from pteron.identification.estimators.estimate import Estimate

__all__ = ["Essential", "essential_parameters"]

LEVEL = 0.05


@dataclass(frozen=True)
class Essential:
    """The essential parameters, and the test that left the others out.

    Attributes
    ----------
    names : tuple of str
        Of the values kept.
    dropped : tuple of str
        Of those left out, in the order in which they went.
    estimate : Estimate
        Of the values kept, with the others at zero.
    p_value : float
        Chance of a larger statistic if all that were dropped are zero: at least `level`.
    level : float
        Of the test.
    """

    names: tuple[str, ...]
    dropped: tuple[str, ...]
    estimate: Estimate
    p_value: float
    level: float


def essential_parameters(
    equations: Equations,
    estimate: Estimate,
    estimator: Callable[[Equations], Estimate],
    *,
    level: float = LEVEL,
) -> Essential:
    """Return the values that the data can show, and the fit of these alone.

    Wald's test, backwards: of all values, the one whose loss costs least goes first, as long as the
    hypothesis that *all* that are gone are zero is not rejected: b^T C^-1 b of those, with C their
    covariance, against chi-square with as many degrees of freedom. Testing them together keeps two
    values that only show as a pair.

    Parameters
    ----------
    equations : Equations
        What was solved.
    estimate : Estimate
        Of all values.
    estimator : callable
        What fits those that are kept.
    level : float
        Of the test.

    Returns
    -------
    Essential

    Notes
    -----
    A value that was dropped need not be zero, only too small for these data; what it did is then
    done by those it is correlated with. For statements about single values use the full estimate.
    """
    values, covariance = estimate.values, estimate.covariance
    gone: list[int] = []
    p_value = 1.0
    left = list(range(len(values)))
    while len(left) > 1:
        # Cost of dropping each of those left, beside those already gone.
        statistics = [_wald(values, covariance, [*gone, k]) for k in left]
        least = int(np.argmin(statistics))
        chance = float(chi2.sf(statistics[least], len(gone) + 1))
        if chance < level:
            break
        p_value = chance
        gone.append(left.pop(least))
    if not gone:
        return Essential(estimate.names, (), estimate, 1.0, level)
    refit = estimator(equations.columns(left))
    return Essential(refit.names, tuple(estimate.names[k] for k in gone), refit, p_value, level)


def _wald(values: np.ndarray, covariance: np.ndarray, chosen: list[int]) -> float:
    b = values[chosen]
    scale = np.sqrt(np.diag(covariance)[chosen])
    scale = np.where(scale > 0.0, scale, np.finfo(float).tiny)
    c = covariance[np.ix_(chosen, chosen)] / np.outer(scale, scale)
    u = b / scale
    return float(u @ np.linalg.solve(c, u))
