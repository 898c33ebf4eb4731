"""Scales that all equations share: a factor of all forces, and the rate of the clock.

Forces F = W beta tell values beta that grow with a factor of all forces, unless something has a
value that is known: a payload, or a rotor that does not join a body. A clock that runs slow makes
accelerations too large, but not the weight: where gravity acts on the drives the two can be told
apart, else all inertia grows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import norm  # type: ignore[import-untyped]

from pteron.bodies.parameters import PLATFORM_KINDS
from pteron.identification.estimators import Estimate
from pteron.identification.faults.columns import FaultColumns
from pteron.identification.faults.fault import FaultName
from pteron.identification.model import Model
from pteron.identification.observation import Observations
from pteron.identification.recordings import Recording
from pteron.kernels import Array

_CLEAR = 5.0
"""Standard deviations from which a factor is told from one."""

_KNOWN = 0.02
"""Error of a payload's mass, or of a rotor's inertia, that is usual."""

_WANTED = 0.05
"""Share of the weight, or of the forces, that a log must be able to tell."""

_NOISELESS = 1e-9
"""Noise of a force, over that of the noisiest, that counts as at least."""

_INDEPENDENT = 1e-3
"""Share of a column that the model's cannot make, from which it can be told from them."""


class Factor(NamedTuple):
    """The factor of all forces, and its standard deviation."""

    value: float
    deviation: float

    @property
    def told(self) -> bool:
        """Whether a factor that matters would be seen."""
        return _CLEAR * self.deviation < _WANTED

    def times(self, number: float) -> Factor:
        """Return the factor of forces that are so many times as large."""
        return Factor(number * self.value, abs(number) * self.deviation)

    @property
    def wrong(self) -> bool:
        """Whether it is not one, by more than what is known may be off."""
        return abs(self.value - 1.0) > max(_CLEAR * self.deviation, _KNOWN)

    @property
    def chance(self) -> float:
        """Probability that it seems so far from one where it is one."""
        return float(2.0 * norm.sf(abs(self.value - 1.0) / max(self.deviation, 1e-300)))


def known_values(
    model: Model, recordings: Sequence[Recording], rotors: Mapping[str, float]
) -> dict[str, float]:
    """Return the values that are known, by name: of a declared payload, of rotors."""
    found = dict(rotors)
    for one in recordings:
        if (payload := one.head().description.payload) is not None:
            inertia = (payload.mass, *payload.first_moment, payload.inertia)
            found |= zip((f"{kind}_L" for kind in PLATFORM_KINDS), inertia, strict=True)
    return {name: value for name, value in found.items() if name in model.names and value}


def factor_of_forces(model: Model, fit: Estimate, known: Mapping[str, float]) -> Factor | None:
    """Return the factor that all forces have, by what is known of the values; None without that."""
    if not known:
        return None
    places = [model.names.index(name) for name in known]
    true = np.array(list(known.values()))
    weights = np.linalg.pinv(fit.covariance[np.ix_(places, places)], hermitian=True) @ true
    power = float(weights @ true)
    if not power > 0.0:
        return None
    return Factor(float(weights @ fit.values[places]) / power, power**-0.5)


def cannot_be_told(
    model: FaultColumns, observations: Observations, noise: Array
) -> list[FaultName]:
    """Return which of the clock and the scale of one force the equations leave open.

    A fault is left open whose column the model's columns make, but for less than noise (n,) of
    the forces hides.
    """
    weights = 1.0 / np.maximum(noise, _NOISELESS * noise.max() + 1e-300)
    flat = (weights[:, None] * observations.matrix).reshape(-1, observations.matrix.shape[-1])
    known = flat[:, : len(model.model.names)]
    lengths = np.linalg.norm(known, axis=0)
    basis = np.linalg.qr(known / np.where(lengths > 0.0, lengths, 1.0))[0]
    found: dict[FaultName, None] = {}
    for family, places in zip(model.families, model.places, strict=True):
        if family.name not in ("clock", "scale"):
            continue
        columns = flat[:, places]
        left = float(np.linalg.norm(columns - basis @ (basis.T @ columns)))
        independent = left > _INDEPENDENT * float(np.linalg.norm(columns))
        if not (independent and _WANTED * left > _CLEAR):
            found[family.name] = None
    return list(found)
