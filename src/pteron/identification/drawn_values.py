"""Values that a motion does not show, left near the machine's drawing: a prior in the fit.

A base parameter whose standard deviation exceeds its usual size is not measured. It gets a normal
prior: its drawn value, with a deviation of its usual size. What the forces show of it stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pteron.identification.estimators import Estimate
from pteron.identification.estimators.estimate import residuals_of, whiteness
from pteron.identification.model import Model
from pteron.identification.observation import Observations
from pteron.identification.plausibility import unseen_names, usual_sizes
from pteron.kernels import Array
from pteron.manipulator import parameters

_LITTLE = 0.5
"""Deviation after a fit, over that of the drawing, from which a value counts as not shown."""


@dataclass(frozen=True)
class DrawnValues:
    """Drawn values that replace those that a motion does not determine.

    Attributes
    ----------
    names : tuple of str
        Base parameters that are reported as not shown: all K, or fewer.
    places : array of int, shape (K,)
        Their places among the values.
    values, deviations : array, shape (K,)
        Drawn values, and the deviations that they are given, SI units.
    """

    names: tuple[str, ...]
    places: NDArray[np.int64]
    values: Array
    deviations: Array

    @classmethod
    def from_estimate(cls, model: Model, estimate: Estimate, known: Array) -> DrawnValues:
        """Return drawn values for what a fit leaves open; `known` (p,) is the rotors' part."""
        names = unseen_names(model, estimate.deviations)
        places = np.array([model.names.index(name) for name in names], dtype=np.int64)
        drawn = parameters(model.robot)
        drawn_values = (model.base.grouping @ drawn + known[: model.base.rank])[places]
        return cls(names, places, drawn_values, usual_sizes(model.base, drawn)[places])

    @classmethod
    def from_model(cls, model: Model, known: Array) -> DrawnValues:
        """Return the drawn values of all base parameters, for a log that does not determine them.

        `known` (p,) is the rotors' part of the values.
        """
        drawn = parameters(model.robot)
        drawn_values = model.base.grouping @ drawn + known[: model.base.rank]
        places = np.arange(model.base.rank)
        return cls(model.base.names, places, drawn_values, usual_sizes(model.base, drawn))

    def name_undetermined(self, estimate: Estimate) -> DrawnValues:
        """Return these drawn values, naming only the parameters that the fit hardly determines."""
        share = estimate.deviations[self.places] / self.deviations
        names = zip(self.names, share.tolist(), strict=True)
        return replace(self, names=tuple(name for name, s in names if s > _LITTLE))

    def update_estimate(self, estimate: Estimate, observations: Observations) -> Estimate:
        """Return the estimate updated with the drawn values as further measurements."""
        if not len(self.places):
            return estimate
        size = np.maximum(estimate.deviations, np.finfo(float).tiny)
        covariance = estimate.covariance / np.outer(size, size)
        rows, deviations = covariance[self.places], self.deviations / size[self.places]
        gain = np.linalg.solve(rows[:, self.places] + np.diag(deviations**2), rows).T
        shift = gain @ ((self.values - estimate.values[self.places]) / size[self.places])
        reduction = np.eye(len(size))
        reduction[:, self.places] -= gain
        # Joseph's form, which stays positive where deviations differ by many orders.
        covariance = reduction @ covariance @ reduction.T + gain @ np.diag(deviations**2) @ gain.T
        updated = estimate.values + size * shift
        residuals = residuals_of(observations, updated)
        return replace(
            estimate,
            values=updated,
            covariance=0.5 * (covariance + covariance.T) * np.outer(size, size),
            residuals=residuals,
            whiteness=whiteness(residuals, observations.gain > 0.0),
        )

    def append_drawn_values(self, observations: Observations, noise: Array) -> Observations:
        """Return the observations followed by an equation for each drawn value: T + K rows.

        Each is an equation of the first actuator, weighted as a force with its `noise` (n,), and
        later in time than the observations.
        """
        count = len(self.places)
        if not count:
            return observations
        n, p = observations.matrix.shape[1:]
        matrix, forces = np.zeros((count, n, p)), np.zeros((count, n))
        weights = noise[0] / self.deviations
        matrix[np.arange(count), 0, self.places] = weights
        forces[:, 0] = weights * self.values
        gain = np.zeros((count, n))
        gain[:, 0] = 1.0
        step = float(np.median(np.diff(observations.time))) if len(observations.time) > 1 else 1.0
        return replace(
            observations,
            matrix=np.concatenate([observations.matrix, matrix]),
            forces=np.concatenate([observations.forces, forces]),
            time=np.r_[observations.time, observations.time[-1] + step * np.arange(1, count + 1)],
            gain=np.concatenate([observations.gain, gain]),
            payload=np.r_[observations.payload, np.zeros(count, dtype=np.int64)],
        )
