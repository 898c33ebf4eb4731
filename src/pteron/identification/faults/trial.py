"""The trial of a fit: which faults its residuals show by name, how large, and what they spoil."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from pteron.identification.errors import LogError
from pteron.identification.estimators import Estimate
from pteron.identification.faults.cycle import Cycle, Extent
from pteron.identification.faults.search import Named, searched
from pteron.identification.faults.suspects import DELAY, Suspects, families_of
from pteron.identification.faults.suspicion import Suspicion
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.observation import observations_of
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
"""Rows of a log that are looked at: those in which the joints move most."""

_EXACT = 1e-7
"""Residuals, over the forces, that tell of rounding and of how columns are differenced."""

_POINTS = 8
"""States in a period of the fastest frequency, between which costly columns are interpolated."""

_MOTION = 0.3
"""Share of the band that the motion's own forces are in."""

_ROUNDS = 6
"""Times that a delay is taken out and looked for again, at most."""


@dataclass(frozen=True)
class Trial:
    """What a fit's residuals show.

    Attributes
    ----------
    tried : tuple of str
        The faults that were tried; none where the log has too few equations, or no noise.
    suspicions : tuple of Suspicion
        Those that show, the clearest first.
    uncertain : array, shape (n,)
        What the values' covariance leaves open of a pick-and-place cycle's forces, in percent of
        their standard deviation; NaN where the machine has no room for a cycle.
    spoiled : array, shape (n,)
        What all suspicions together spoil of it, likewise.
    """

    tried: tuple[str, ...]
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
            "tried": list(self.tried),
            "faults": [one.as_dict() for one in self.suspicions],
            "cycle_percent": {
                name: None if np.isnan(values).any() else values.tolist()
                for name, values in shares.items()
            },
        }


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
        What was fitted; 20 000 rows of it are looked at.
    preprocessing : Preprocessing
        How it was preprocessed.
    """
    nothing = np.full(len(model.robot.legs), np.nan)
    log, how = _looked_at(model, recording, preprocessing)

    # Which faults the residuals show
    try:
        states = [block.states for block in samples(model.robot, log, how)]
        suspects = _suspects(model, estimate, log, how, states)
        if np.abs(estimate.residuals).max() < _EXACT * np.abs(log.forces).max():
            suspects = replace(suspects, families=())
        plain, named = searched(suspects, observations_of(suspects, log, how))
    except LogError:  # what is looked at is too little by itself
        return Trial((), (), nothing, nothing)
    if any(one.family is DELAY for one in named):
        # A long delay is no small one: the rest is told once forces are where they belong.
        late, shifted = _delay(suspects, log, how)
        rest = replace(suspects, families=suspects.families[1:])
        fit, named = searched(rest, observations_of(rest, log, shifted))
        if late is not None:
            named.insert(0, replace(late, fit=fit))

    # What they spoil
    p = len(model.names)
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
    tried = tuple(dict.fromkeys(family.name for family in suspects.families))
    return Trial(tried, suspicions, uncertain, spoiled)


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
    log = recording.head()
    if log.rows > _LOOK:
        steps = (np.diff(log.joints, axis=0) ** 2).sum(axis=1)
        way = np.concatenate([[0.0], np.cumsum(steps)])
        starts = np.arange(0, log.rows - _LOOK, _LOOK // 2)
        start = int(starts[np.argmax(way[starts + _LOOK - 1] - way[starts])])
        log = log.part(start, start + _LOOK)
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


def _delay(suspects: Suspects, log: Log, how: Preprocessing) -> tuple[Named | None, Preprocessing]:
    """Return the whole delay of a log's forces, and the preprocessing that takes it out."""
    only = replace(suspects, families=(DELAY,))
    late, shifted = None, how
    for _ in range(_ROUNDS):
        _, left = searched(only, observations_of(only, log, shifted))
        if not left:
            break
        first, late = late or left[0], left[0]
        later = float(np.clip(shifted.delay + late.sizes[0], -LATEST, LATEST))
        shifted = replace(shifted, delay=later)
    if late is not None:
        whole = np.array([shifted.delay - how.delay])
        late = replace(late, sizes=whole, chance=first.chance)
    return late, shifted
