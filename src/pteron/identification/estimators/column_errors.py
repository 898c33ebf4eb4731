"""How much of the positions' noise there is in each column of the regressor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pteron.identification.equations import equations_of
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.signals import Treatment
from pteron.kernels import Array

__all__ = ["column_errors"]


def column_errors(model: Model, log: Log, treatment: Treatment, *, seed: int = 0) -> Array:
    """Return the standard deviation (p,) of the noise in the regressor's columns.

    Noise like that of the positions is put on them once more; what it changes has the size of what
    their own noise has changed, to first order.

    Parameters
    ----------
    model : Model
        What is identified.
    log : Log
        The log, or a part of it.
    treatment : Treatment
        How it is treated.
    seed : int
        Of the noise.

    Returns
    -------
    array, shape (p,)
        N per unit of each value, in units of the noise before the parallel filter; zero for columns
        that do not depend on positions.
    """
    rng = np.random.default_rng(seed)
    noise = treatment.slider_noise * rng.normal(size=log.sliders.shape)
    shaken = equations_of(model, replace(log, sliders=log.sliders + noise), treatment)
    plain = equations_of(model, log, treatment)
    # Slow rows that are left out of one, and not of the other, are no error: both sides miss them.
    same = (shaken.gain == plain.gain) & (plain.gain > 0.0)
    if not same.any():
        same = (shaken.gain > 0.0) & (plain.gain > 0.0)
    before, after = plain.matrix[same], shaken.matrix[same]
    change = np.sqrt(((after - before) ** 2).mean(axis=0))
    size = np.sqrt((before**2).mean(axis=0))
    # What rounding alone moves counts as exact.
    return np.asarray(np.where(change > 1e-12 * size, change, 0.0))
