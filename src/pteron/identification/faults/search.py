"""Which faults residuals show: columns of suspects are taken in, the clearest first.

Only the trial uses it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2  # type: ignore[import-untyped]

from pteron.identification.estimators import Estimate, weighted
from pteron.identification.faults.suspects import Family, Suspects
from pteron.identification.observation import Observations
from pteron.kernels import Array

_CHANCE = 1e-6
"""Chance that a fault is named where there is none, each."""

_SEEN = 1e-3
"""Share of a mixture of columns that the model's cannot make, from which it counts."""

_AS_WELL = 0.7
"""Share of the clearest fault's statistic with which one of fewer sizes is taken in its place."""

_ENOUGH = 2
"""Equations for each value, from which residuals tell of more values."""

_BESIDE = 0.1
"""Share of the first fault's statistic that another one has at least."""

_LENGTH = 0.05
"""Error of the geometry, over the legs' size, beyond which it is another fault, told badly."""

_TIMES = 3.0
"""Friction that falls with speed, over the dry friction that is left, likewise."""

_MOST = 3
"""Faults that are named at most."""


@dataclass(frozen=True)
class Named:
    """A family that was taken in: its sizes, the fit with it, and the families in before it."""

    family: Family
    sizes: Array
    deviations: Array
    chance: float
    fit: Estimate
    others: tuple[tuple[Family, Array], ...] = ()


def searched(suspects: Suspects, observations: Observations) -> tuple[Estimate, list[Named]]:
    """Return the fit of the model without faults, and the faults that the observations show."""
    p = len(suspects.model.names)
    named: list[Named] = []
    taken: list[int] = []
    first = 0.0
    plain = weighted(observations.columns(range(p)))
    while len(named) < _MOST:
        clear = []
        for k, family in enumerate(suspects.families):
            if family.name in (one.family.name for one in named):
                continue
            one, wald = _taken_in(suspects, observations, [*taken, k])
            if one is not None and one.chance < _CHANCE and _is_possible(one, suspects):
                clear.append((wald, k, one))
        best = max((wald for wald, _, _ in clear), default=0.0)
        first = first or best
        # What is left beside a clear fault may be its own shape, which no column has exactly.
        if not best > _BESIDE * first:
            break
        # Of those that explain as much, the one of fewest sizes.
        _, k, one = min(
            (item for item in clear if item[0] >= _AS_WELL * best),
            key=lambda item: (len(item[2].sizes), -item[0]),
        )
        taken.append(k)
        named.append(one)
    return plain, named


def _taken_in(
    suspects: Suspects, observations: Observations, families: Sequence[int]
) -> tuple[Named | None, float]:
    """Return the last of the families as the fit with all of them sees it, and Wald's statistic."""
    p = len(suspects.model.names)
    flat = observations.matrix.reshape(-1, observations.matrix.shape[-1])
    known = np.linalg.qr(_scaled(flat[:, :p])[0])[0]
    mixes, parts = [], [observations.matrix[..., :p]]
    for k in families:
        places = suspects.places[k]
        columns, lengths = _scaled(flat[:, places])
        new = columns - known @ (known.T @ columns)
        _, sizes, ways = np.linalg.svd(new, full_matrices=False)
        seen = ways[sizes > _SEEN].T
        mixes.append(seen / lengths[:, None])
        parts.append(observations.matrix[..., places] @ mixes[-1])
        known = np.hstack([known, np.linalg.qr(new @ seen)[0]])
    q = mixes[-1].shape[1]
    if q == 0 or observations.rows < _ENOUGH * (p + q):
        return None, 0.0
    matrix = np.concatenate(parts, axis=-1)
    names = tuple(map(str, range(matrix.shape[-1])))
    fit = weighted(replace(observations, matrix=matrix, names=names, units=names, kinds=()))
    size, covariance = fit.values[-q:], fit.covariance[-q:, -q:]
    unit = np.sqrt(np.diag(covariance))
    standard = size / unit
    wald = float(standard @ np.linalg.solve(covariance / np.outer(unit, unit), standard))
    ends = np.cumsum([p, *(mix.shape[1] for mix in mixes)])
    found = [mix @ fit.values[a:b] for mix, a, b in zip(mixes, ends[:-1], ends[1:], strict=True)]
    before = [suspects.families[k] for k in families[:-1]]
    mix = mixes[-1]
    return Named(
        suspects.families[families[-1]],
        found[-1],
        np.sqrt(np.einsum("ij,jk,ik->i", mix, covariance, mix)),
        float(chi2.sf(wald, q)),
        fit,
        tuple(zip(before, found[:-1], strict=True)),
    ), wald


def _is_possible(one: Named, suspects: Suspects) -> bool:
    """Say whether sizes can be those of the fault: friction brakes, errors of lengths are small."""
    family = one.family
    largest = family.largest
    if family.unit == "m":
        largest = _LENGTH * float(np.mean([leg.size for leg in suspects.robot.legs]))
    elif family.speed is not None:
        dry = suspects.model.per_joint("coulomb", np.abs(suspects.values))
        largest = np.inf if dry is None else _TIMES * float(dry.max())
    if family.positive and not (one.sizes / one.deviations).sum() > 0.0:
        return False
    return bool(np.abs(one.sizes).max() < largest)


def _scaled(columns: Array) -> tuple[Array, Array]:
    """Return columns (R, k) of unit length, and their lengths."""
    lengths = np.linalg.norm(columns, axis=0)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    return columns / lengths, lengths
