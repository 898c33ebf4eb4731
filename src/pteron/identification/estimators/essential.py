"""Essential parameters: the values that the data can show, by a backward Wald test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.identification.estimators.estimate import Estimate
from pteron.identification.observation import Observations
from pteron.result import Result

LEVEL = 0.05
"""Usual level of the test."""


@dataclass(frozen=True, eq=False, repr=False)
class Essential(Result):
    """The essential parameters, and the test that left the others out.

    Attributes
    ----------
    names : tuple of str
        The values kept.
    dropped : tuple of str
        Those left out, in the order in which they went.
    estimate : Estimate
        The fit of the values kept, with the others at zero.
    p_value : float
        Chance of a larger statistic if all that were dropped are zero: at least `level`.
    level : float
        The level of the test.
    """

    ROWS = "estimate"

    names: tuple[str, ...]
    dropped: tuple[str, ...]
    estimate: Estimate
    p_value: float
    level: float


def essential_parameters(
    observations: Observations,
    estimate: Estimate,
    estimator: Callable[[Observations], Estimate],
    *,
    level: float = LEVEL,
) -> Essential:
    """Return the values that the data can show, and the fit of these alone.

    Wald's test, backwards: of all values, the one whose loss costs least goes first, as long as the
    hypothesis that *all* that are gone are zero is not rejected: b^T C^-1 b of those, with C their
    covariance, against Fisher's F, since the noise is known from a limited number of equations.
    Testing them together keeps two values that only show as a pair.

    Parameters
    ----------
    observations : Observations
        What was solved.
    estimate : Estimate
        The fit of all values.
    estimator : callable
        What fits those that are kept.
    level : float
        The level of the test.

    Notes
    -----
    A value that was dropped need not be zero, only too small for these data; what it did is then
    done by those it is correlated with. For statements about single values use the full estimate.
    """
    beta = estimate.values
    gone: list[int] = []
    p_value = 1.0
    remaining = list(range(len(beta)))
    while len(remaining) > 1:
        # Cost of dropping each of those left, beside those already gone.
        statistics = [estimate.wald(beta[[*gone, k]], [*gone, k]) for k in remaining]
        least = int(np.argmin(statistics))
        count = len(gone) + 1
        chance = float(scipy.stats.f.sf(statistics[least] / count, count, estimate.degrees))
        if chance < level:
            break
        p_value = chance
        gone.append(remaining.pop(least))
    if not gone:
        return Essential(estimate.names, (), estimate, 1.0, level)
    refit = estimator(observations.columns(remaining))
    return Essential(refit.names, tuple(estimate.names[k] for k in gone), refit, p_value, level)
