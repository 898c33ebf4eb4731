"""Ridge regression, as a warning: what a fit owes to the prior and not to the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pteron.identification.equations import Equations
from pteron.identification.estimators.estimate import Estimate, estimate_of
from pteron.identification.estimators.triangle import triangle
from pteron.identification.estimators.weighted import actuator_noise
from pteron.kernels import Array

__all__ = ["Ridge", "ridge"]


@dataclass(frozen=True)
class Ridge:
    """A ridge estimate, and how much of it the data have said.

    Attributes
    ----------
    estimate : Estimate
        Its covariance is that of the posterior: prior and data together.
    from_data : array, shape (p,)
        Share of each value that comes from the data; the rest comes from the prior.
    prior, spread : array, shape (p,)
        What was taken for granted: values and their standard deviations.
    """

    estimate: Estimate
    from_data: Array
    prior: Array
    spread: Array

    @property
    def poorly_excited(self) -> tuple[str, ...]:
        """Values that owe more than half of what they are to the prior."""
        pairs = zip(self.estimate.names, self.from_data, strict=True)
        return tuple(name for name, share in pairs if share < 0.5)


def ridge(equations: Equations, prior: ArrayLike, spread: ArrayLike) -> Ridge:
    """Return the values that data and a prior give together.

    It always answers, also where a motion is too poor to determine the values: then the prior
    answers. Hence it is no default here but a warning: `poorly_excited` names the values that the
    data hardly touch.

    Parameters
    ----------
    equations : Equations
        From `equations_of`.
    prior : array, shape (p,)
        Values that are expected, such as those of the CAD.
    spread : array, shape (p,)
        Their standard deviations.

    Returns
    -------
    Ridge
    """
    expected, width = np.asarray(prior, dtype=float), np.asarray(spread, dtype=float)
    centred = equations.with_forces(equations.forces - equations.matrix @ expected)
    factor = triangle(centred)
    if factor.degrees > 0:
        matrix = factor.factor * factor.scale * width
        start = np.linalg.lstsq(matrix, factor.image, rcond=1e-10)[0] * width
        noise = actuator_noise(centred, start)
    else:
        # As few equations leave no residual to tell noise by; it is at most what the prior leaves.
        noise = actuator_noise(centred, np.zeros(len(width)), fitted=False)
    factor = triangle(centred, 1.0 / noise)
    # In units of the spread the prior is one more row of the identity for each value.
    matrix = np.vstack([factor.factor * factor.scale * width, np.eye(len(width))])
    shift = np.linalg.lstsq(matrix, np.r_[factor.image, np.zeros(len(width))], rcond=None)[0]
    posterior = np.linalg.inv(matrix.T @ matrix)
    estimate = estimate_of(
        "ridge",
        equations,
        factor,
        expected + width * shift,
        posterior * np.outer(width, width),
        weights=1.0 / noise,
        inverse=posterior * np.outer(width, width),
    )
    return Ridge(estimate, 1.0 - np.diag(posterior), expected, width)
