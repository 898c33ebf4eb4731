"""The search for faults that residuals show: their columns join the fit, the clearest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.identification.estimators import Estimate, weighted_least_squares
from pteron.identification.estimators.estimate import wald
from pteron.identification.estimators.qr import actuator_factors
from pteron.identification.faults.columns import Family, FaultColumns, length_tolerance
from pteron.identification.faults.fault import ORDER, FaultName
from pteron.identification.observation import Observations, scale_columns
from pteron.kernels import Array

_CHANCE = 1e-6
"""Probability that a fault is named where there is none, for each fault."""

_SEEN = 1e-3
"""Least share of a combination of columns that is independent of the model's columns."""

_AS_WELL = 0.8
"""Share of the best gain of log-likelihood from which a fault that comes earlier is preferred,
where none explains all: own plants name most causes right between 0.75 and 0.9."""

_AT_NOISE = 1.15
"""Residuals, over the forces' noise, that are noise: both are known to some per cent."""

_TOLD = 3
"""Most faults that are named as explaining the residuals equally well."""

_VANISHED = 1e-3
"""Residuals, over those before, that count as none, in logs without noise."""

_CLEAR = 3.0
"""Size of a combination, in standard deviations, from which it is more than noise."""

_ENOUGH = 2
"""Least number of equations for each value."""

_BESIDE = 0.1
"""Least statistic of a further fault, as a share of the first one's."""

_MOSTLY = 0.5
"""Least share of the effect of a fault of lengths that errors of the usual size explain too."""

_MOST_OF = 5.0
"""Factor by which a fault that varies freely with time must lower residuals that noise is not all
of: others' residuals it lowers up to twice."""

_TIMES = 3.0
"""Greatest friction that falls with speed, over the remaining dry friction."""

_MOST = 3
"""Greatest number of faults that are found."""


@dataclass(frozen=True)
class FoundFault:
    """A family of fault columns that joined the fit, with that fit and the families before it.

    Parameters
    ----------
    family : Family
        The family.
    mix : array, shape (k, q)
        The q combinations of its k columns that the data show.
    sizes, deviations : array, shape (k,)
        Factors of its columns, and their standard deviations.
    statistic, chance : float
        Wald's statistic, and the probability of sizes as large as these without the fault.
    fit : Estimate
        The fit with the family.
    likely : float
        Share of the fault's effect that errors of a usual size explain too.
    others : tuple of (Family, array)
        The families before it, and their sizes in this fit.
    as_well : tuple of str
        Other faults that explain the residuals as well.
    """

    family: Family
    mix: Array
    sizes: Array
    deviations: Array
    statistic: float
    chance: float
    fit: Estimate
    likely: float = 1.0
    others: tuple[tuple[Family, Array], ...] = ()
    as_well: tuple[FaultName, ...] = ()


def search_faults(
    model: FaultColumns,
    observations: Observations,
    families: Sequence[Family] | None = None,
    noise: Array | None = None,
) -> tuple[Estimate, list[FoundFault]]:
    """Return the fit of the model without faults, and the faults that its observations show.

    Only `families` are tried, by default all of them; `noise` (n,) is that of the forces.
    """
    p = len(model.model.names)
    found_faults: list[FoundFault] = []
    first = 0.0
    sought = model.families if families is None else families
    # A fit needs products of columns only, which are the same for their triangular factors.
    triangles = actuator_factors(observations)
    plain = weighted_least_squares(
        observations.columns(range(p)), triangles=triangles.columns(range(p))
    )
    while len(found_faults) < _MOST:
        clear = []
        fit_noise = found_faults[-1].fit.noise if found_faults else plain.noise
        vanished = _VANISHED * fit_noise
        floor = vanished if noise is None else np.maximum(noise, vanished)
        for k, family in enumerate(model.families):
            if family not in sought or family.name in (fault.family.name for fault in found_faults):
                continue
            fault = _fit_fault(model, observations, triangles, found_faults, k)
            if fault is None or not fault.chance < _CHANCE:
                continue
            # Beside a fault that explains most, a second one can fit worse than none.
            if not _likelihood_gain(fault, fit_noise, observations.equation_counts) > 0:
                continue
            if _is_possible(fault, model, fit_noise, floor):
                clear.append(fault)
        best = max((fault.statistic for fault in clear), default=0.0)
        first = first or best
        # Residuals beside a clear fault may come from its shape, which no column has exactly.
        if not best > _BESIDE * first:
            break
        found_faults.append(_likeliest(clear, fit_noise, observations.equation_counts, floor))
    return plain, found_faults


def _likelihood_gain(fault: FoundFault, fit_noise: Array, rows: Array) -> float:
    """Return by how much a fault raises the log-likelihood of `rows` (n,) equations."""
    noise = np.maximum(fault.fit.noise, 1e-300)
    return float(rows @ np.log(np.maximum(fit_noise, 1e-300) / noise))


def _likeliest(
    faults: Sequence[FoundFault], fit_noise: Array, rows: Array, floor: Array
) -> FoundFault:
    """Return the likeliest fault, for residual deviations (n,) of `rows` (n,) equations.

    Where one leaves only the noise of forces, `floor` (n,), likelihood decides: of those that
    explain as much the one of fewest sizes. Else the fault is large, its columns hold to first
    order only, and what comes first among those that explain nearly as much is taken.
    """
    gains = [_likelihood_gain(fault, fit_noise, rows) for fault in faults]
    most = int(np.argmax(gains))
    clearest = faults[most]
    as_well = _AS_WELL * gains[most]
    at_noise = bool((clearest.fit.noise <= _AT_NOISE * floor).all())
    if at_noise or clearest.family.exact:
        as_well = gains[most] - 0.5 * float(scipy.stats.chi2.isf(_CHANCE, clearest.mix.shape[1]))
    explaining = [(fault, g) for fault, g in zip(faults, gains, strict=True) if g >= as_well]
    explaining.sort(
        key=lambda pair: (
            0 if at_noise else ORDER.index(pair[0].family.name),
            len(pair[0].sizes),
            -pair[1],
        )
    )
    first = explaining[0][0]
    others = sorted(explaining, key=lambda pair: -pair[1])
    names = dict.fromkeys(fault.family.name for fault, _ in others)
    return replace(first, as_well=tuple(n for n in names if n != first.family.name)[:_TOLD])


def _fit_fault(
    model: FaultColumns,
    observations: Observations,
    triangles: Observations,
    known_faults: Sequence[FoundFault],
    k: int,
) -> FoundFault | None:
    """Return the fault of family `k`, fitted beside the faults before it; None if it is not seen.

    Combinations of its columns that are orthogonal to the model's and to each other are fitted
    together. Those whose sizes are clear are then fitted alone: the others are noise.
    `triangles` are the `actuator_factors` of the observations.
    """
    p, family = len(model.model.names), model.families[k]
    places = [model.places[model.families.index(fault.family)] for fault in known_faults]
    mixes = [fault.mix for fault in known_faults]
    flat = triangles.matrix.reshape(-1, triangles.matrix.shape[-1])
    fault_columns = [flat[:, place] @ mix for place, mix in zip(places, mixes, strict=True)]
    known = np.linalg.qr(
        np.hstack([scale_columns(part)[0] for part in (flat[:, :p], *fault_columns)])
    )[0]
    columns, lengths = scale_columns(flat[:, model.places[k]])
    _, seen, right = np.linalg.svd(columns - known @ (known.T @ columns), full_matrices=False)
    mix = right[seen > _SEEN].T / lengths[:, None]
    q = mix.shape[1]
    if q == 0 or observations.rows < _ENOUGH * (p + q):
        return None

    def fit_combinations(mix: Array) -> tuple[Estimate, Array, Array]:
        """Return the fit with these combinations, their sizes, and the sizes' covariance."""
        chosen = [*zip(places, mixes, strict=True), (model.places[k], mix)]

        def append_combinations(rows: Observations) -> Observations:
            """Return observations of p columns and a column for each chosen combination."""
            parts = [rows.matrix[..., place] @ combination for place, combination in chosen]
            return rows.with_matrix(np.concatenate([rows.matrix[..., :p], *parts], axis=-1))

        fit = weighted_least_squares(
            append_combinations(observations), triangles=append_combinations(triangles)
        )
        last = slice(len(fit.values) - mix.shape[1], None)
        return fit, fit.values[last], fit.covariance[last, last]

    fit, size, covariance = fit_combinations(mix)
    statistic = wald(size, covariance)
    chance = float(scipy.stats.chi2.sf(statistic, q))
    clear = np.abs(size) > _CLEAR * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if chance < _CHANCE and clear.any() and not clear.all():
        mix = mix[:, clear]
        fit, size, covariance = fit_combinations(mix)
    ends = np.cumsum([p, *(mix.shape[1] for mix in mixes)])
    others = [
        (fault.family, fault.mix @ fit.values[start:stop])
        for fault, (start, stop) in zip(known_faults, pairwise(ends), strict=True)
    ]
    # Without noise a size may be known exactly: its variance is rounding, of either sign.
    variances = np.einsum("ij,jk,ik->i", mix, covariance, mix)
    deviations = np.sqrt(np.maximum(variances, 0.0))
    usual = _usual_error_share(size, covariance, mix, model) if family.unit == "m" else 1.0
    seen_as = mix, mix @ size, deviations, statistic, chance
    return FoundFault(family, *seen_as, fit, usual, tuple(others))


def _usual_error_share(size: Array, covariance: Array, mix: Array, model: FaultColumns) -> float:
    """Return the share of Wald's statistic that errors of lengths of the usual size explain."""
    spread = length_tolerance(model.model.robot).usual
    back = spread * np.linalg.pinv(mix)
    both = back @ back.T + covariance
    # Of the sizes, C (C0 + C)^-1 remains beside the most likely ones.
    weighted_size = np.linalg.solve(both, size)
    return 1.0 - float(weighted_size @ covariance @ weighted_size) / wald(size, covariance)


def _is_possible(fault: FoundFault, model: FaultColumns, fit_noise: Array, floor: Array) -> bool:
    """Return whether the sizes are possible: friction brakes, errors of lengths are small.

    A fault that varies freely with time must leave noise alone, `floor` (n,), or a small part of
    the residuals `fit_noise` (n,) without it.
    """
    family = fault.family
    if (
        family.free
        and not (fault.fit.noise <= np.maximum(_AT_NOISE * floor, fit_noise / _MOST_OF)).all()
    ):
        return False
    largest = family.largest
    if family.speed is not None:
        dry = model.model.joint_values("coulomb", np.abs(model.values))
        largest = np.inf if dry is None else _TIMES * float(dry.max())
    if family.positive and not (fault.sizes / np.maximum(fault.deviations, 1e-300)).sum() > 0.0:
        return False
    return fault.likely > _MOSTLY and bool(np.abs(fault.sizes).max() < largest)
