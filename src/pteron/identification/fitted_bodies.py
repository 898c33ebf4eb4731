"""Real bodies of a fit: `consistent_model` for its values, and how far that changes its forces.

Friction and offsets follow by the values' covariance, as in the model file.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.errors import ModelError
from pteron.identification.conditional_values import conditional_shift
from pteron.identification.consistency import Bounds, Consistency, MissingSolver, consistent_model
from pteron.identification.fit_rounds import FittedValues
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.tolerances import EXACT


@dataclass(frozen=True)
class FittedBodies:
    """Real bodies near the values of a fit.

    Attributes
    ----------
    consistency : Consistency or None
        The bodies; None where there are none.
    residual_share : float
        Root mean square difference of their forces from those of the fit, over that of its
        residuals.
    force_share : float
        The same over the forces, percent.
    notes : tuple of str
        The reason why there are no bodies; empty where there are some.
    """

    consistency: Consistency | None
    residual_share: float = float("nan")
    force_share: float = float("nan")
    notes: tuple[str, ...] = ()


def fit_real_bodies(
    fit: FittedValues, cad: Manipulator | None, bounds: Bounds | None
) -> FittedBodies:
    """Return real bodies nearest to the values of a fit, and of these, nearest to `cad`."""
    model, estimate, observations = fit.equations.model, fit.estimate, fit.equations.observations
    rank = model.base.rank
    identified = (estimate.values - fit.known)[:rank]
    covariance = _make_positive(estimate.covariance[:rank, :rank])
    try:
        consistency = consistent_model(
            model.robot, model.base, identified, covariance, cad=cad, bounds=bounds
        )
    except ModelError as error:
        # Values too far from those of real bodies for the solver are no reason to say nothing; what
        # a user asks of bodies is.
        if bounds is not None and not isinstance(error, MissingSolver):
            raise
        return FittedBodies(None, notes=(f"No model of real bodies: {error}",))
    change = consistency.base_values - identified
    shift = conditional_shift(estimate.covariance, range(rank), change)
    change = np.sqrt(((observations.matrix @ shift) ** 2).mean())
    residual = np.sqrt((estimate.residuals**2).mean())
    size, tiny = np.sqrt((observations.forces**2).mean()), np.finfo(float).tiny
    return FittedBodies(
        consistency, float(change / max(residual, tiny)), float(100.0 * change / max(size, tiny))
    )


def _make_positive(covariance: Array) -> Array:
    """Return a covariance (p, p) without the negative eigenvalues that rounding gives it.

    Without noise many values are known alike, to rounding.
    """
    size = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    eigenvalues, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    least = EXACT * eigenvalues[-1]
    if eigenvalues[0] >= least:
        return covariance
    lifted = (vectors * np.maximum(eigenvalues, least)) @ vectors.T
    return np.asarray(0.5 * (lifted + lifted.T) * np.outer(size, size))
