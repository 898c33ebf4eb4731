"""The trial of a fit: which faults its residuals show by name, how large, and what they spoil."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import chi2  # type: ignore[import-untyped]

from pteron.identification.estimators import Estimate, weighted
from pteron.identification.faults.cycle import Cycle, Extent
from pteron.identification.faults.suspects import DELAY, Family, Suspects, families_of
from pteron.identification.faults.suspicion import Suspicion
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.observation import Observations, observations_of
from pteron.identification.recordings import Recording
from pteron.identification.signals import (
    Preprocessing,
    Processing,
    States,
    preprocessing_of,
    samples,
)
from pteron.identification.signals.preprocessing import LATEST
from pteron.kernels import Array

_LOOK = 20_000
"""Rows of a log that are looked at."""

_CHANCE = 1e-6
"""Chance that a fault is named where there is none, each."""

_EXACT = 1e-7
"""Residuals, over the forces, that tell of rounding and of how columns are differenced."""

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

_POINTS = 8
"""States in a period of the fastest frequency, between which costly columns are interpolated."""

_MOTION = 0.3
"""Share of the band that the motion's own forces are in."""

_MOST = 3
_ROUNDS = 6


@dataclass(frozen=True)
class Trial:
    """What a fit's residuals show.

    Attributes
    ----------
    suspicions : tuple of Suspicion
        Faults by name, the clearest first.
    uncertain : array, shape (n,)
        What the values' covariance leaves open of a pick-and-place cycle's forces, in percent of
        their standard deviation; NaN where the machine has no room for a cycle.
    spoiled : array, shape (n,)
        What all suspicions together spoil of it, likewise.
    """

    suspicions: tuple[Suspicion, ...]
    uncertain: Array
    spoiled: Array

    @property
    def off(self) -> Array:
        """By how much such a cycle's forces are expected to be off, in percent (n,)."""
        return np.asarray(np.hypot(self.uncertain, self.spoiled))

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        shares = {"uncertain": self.uncertain, "spoiled": self.spoiled, "off": self.off}
        return {
            "faults": [one.as_dict() for one in self.suspicions],
            "cycle_percent": {
                name: None if np.isnan(values).any() else values.tolist()
                for name, values in shares.items()
            },
        }


@dataclass(frozen=True)
class _Named:
    """A family that was taken in: its sizes, the fit with it, and the families in before it."""

    family: Family
    sizes: Array
    deviations: Array
    chance: float
    fit: Estimate
    others: tuple[tuple[Family, Array], ...] = ()


def trial(
    model: Model, estimate: Estimate, recording: Recording, preprocessing: Preprocessing
) -> Trial:
    """Try a fit's residuals for faults of the log and of the machine.

    Each fault adds columns to the regressor (`families_of`). Those whose sizes the data tell from
    zero are taken in one after the other, the clearest first. What they spoil is worked out on a
    pick-and-place cycle as fast as the log's own motion.

    Parameters
    ----------
    model, estimate : Model, Estimate
        The fit.
    recording : Recording
        What was fitted; its first 20 000 rows are looked at.
    preprocessing : Preprocessing
        How it was preprocessed.
    """
    log, how = _looked_at(model, recording, preprocessing)
    states = [block.states for block in samples(model.robot, log, how)]
    suspects = _suspects(model, estimate, log, how, states)

    # Which faults the residuals show
    if np.abs(estimate.residuals).max() < _EXACT * np.abs(log.forces).max():
        suspects = replace(suspects, families=())
    plain, named = _searched(suspects, observations_of(suspects, log, how))
    if any(one.family is DELAY for one in named):
        # A long delay is no small one: the rest is told once forces are where they belong.
        late, shifted = _delay(suspects, log, how)
        rest = replace(suspects, families=suspects.families[1:])
        fit, named = _searched(rest, observations_of(rest, log, shifted))
        if late is not None:
            named.insert(0, replace(late, fit=fit))

    # What they spoil
    p = len(model.names)
    nothing = np.full(len(model.robot.legs), np.nan)
    cycle = Cycle.within(model.robot, Extent.of(states))
    uncertain, spoiled, each = nothing, nothing, [nothing for _ in named]
    if cycle is not None:
        later = np.full(len(cycle.states), 0.5)
        motion = suspects.motion(cycle.states, later)
        matrix = motion.matrix
        told = [matrix @ plain.values]
        for one in named:
            forces = matrix @ one.fit.values[:p]
            for family, sizes in (*one.others, (one.family, one.sizes)):
                if family.of_machine:
                    forces = forces + family.columns(motion) @ sizes
            told.append(forces)
        each = [cycle.share(b - a, told[0]) for a, b in pairwise(told)]
        spoiled = cycle.share(told[-1] - told[0], told[0])
        # Unnamed, a fault is in the residuals, and with them in the covariance.
        covariance = named[-1].fit.covariance[:p, :p] if named else estimate.covariance
        variance = np.einsum("rnp,pq,rnq->rn", matrix, covariance, matrix, optimize=True)
        uncertain = cycle.share(np.sqrt(np.maximum(variance, 0.0)), told[0])
    fits = [plain, *(one.fit for one in named)]
    shifts = [
        float(np.abs((b.values[:p] - a.values[:p]) / b.deviations[:p]).max())
        for a, b in pairwise(fits)
    ]
    suspicions = tuple(
        Suspicion(
            one.family.name,
            tuple(one.family.sizes(model)),
            one.sizes,
            one.deviations,
            one.chance,
            shift,
            spoils,
            None if one.family.speed is None else one.family.speed * suspects.usual,
        )
        for one, shift, spoils in zip(named, shifts, each, strict=True)
    )
    return Trial(suspicions, uncertain, spoiled)


def delay_of(
    model: Model, estimate: Estimate, recording: Recording, preprocessing: Preprocessing
) -> float:
    """Return the delay of a recording's forces that suits a fit best, s, beside that assumed."""
    log, how = _looked_at(model, recording, preprocessing)
    states = [block.states for block in samples(model.robot, log, how)]
    _, shifted = _delay(_suspects(model, estimate, log, how, states), log, how)
    return shifted.delay - how.delay


def _looked_at(
    model: Model, recording: Recording, preprocessing: Preprocessing
) -> tuple[Log, Preprocessing]:
    """Return the part of a recording that is tried, and how it is preprocessed."""
    log = recording.head().part(0, _LOOK)
    if preprocessing.derivatives != "periodic":
        return log, preprocessing
    # One period that stands for all would not tell what comes and goes.
    wanted = Processing(derivatives="central")
    again = preprocessing_of(model.robot, log, wanted, start=preprocessing.start)
    return log, replace(again, slow=preprocessing.slow, delay=preprocessing.delay)


def _suspects(
    model: Model, estimate: Estimate, log: Log, how: Preprocessing, states: Sequence[States]
) -> Suspects:
    rates = np.concatenate([one.joint_rates for one in states])
    fastest = max(how.cutoff or 0.0, how.band)
    return Suspects(
        model,
        estimate.values,
        np.sqrt((rates**2).mean(axis=0)),
        float(log.time[0]),
        float(log.time[-1]),
        families_of(model.robot),
        max(int(how.rate / (_POINTS * fastest)), 1),
        _MOTION * how.band,
    )


def _delay(suspects: Suspects, log: Log, how: Preprocessing) -> tuple[_Named | None, Preprocessing]:
    """Return the whole delay of a log's forces, and the preprocessing that takes it out."""
    only = replace(suspects, families=(DELAY,))
    late, shifted = None, how
    for _ in range(_ROUNDS):
        _, left = _searched(only, observations_of(only, log, shifted))
        if not left:
            break
        first, late = late or left[0], left[0]
        later = float(np.clip(shifted.delay + late.sizes[0], -LATEST, LATEST))
        shifted = replace(shifted, delay=later)
    if late is not None:
        whole = np.array([shifted.delay - how.delay])
        late = replace(late, sizes=whole, chance=first.chance)
    return late, shifted


def _searched(suspects: Suspects, observations: Observations) -> tuple[Estimate, list[_Named]]:
    """Return the fit of the model without faults, and the faults that the observations show."""
    p = len(suspects.model.names)
    named: list[_Named] = []
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
) -> tuple[_Named | None, float]:
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
    return _Named(
        suspects.families[families[-1]],
        found[-1],
        np.sqrt(np.einsum("ij,jk,ik->i", mix, covariance, mix)),
        float(chi2.sf(wald, q)),
        fit,
        tuple(zip(before, found[:-1], strict=True)),
    ), wald


def _is_possible(one: _Named, suspects: Suspects) -> bool:
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
