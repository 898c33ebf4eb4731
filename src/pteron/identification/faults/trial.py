"""The trial of a fit: which faults its residuals show by name, how large, and what they spoil."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from pteron.identification.errors import LogError
from pteron.identification.estimators import Estimate
from pteron.identification.faults.cycle import Cycle, Extent
from pteron.identification.faults.scales import cannot_be_told, factor_of_forces, known_values
from pteron.identification.faults.search import Named, searched
from pteron.identification.faults.suspects import DELAY, Family, Suspects, families_of
from pteron.identification.faults.suspicion import Fault, Suspicion
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.observation import Observations, observations_of, stacked
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

_LOOK, _MORE = 20_000, 100_000
"""Rows of all logs that are looked at, those in which the joints move most; and where these are too
little motion."""

_EXACT = 1e-7
"""Residuals, over the forces, that tell of rounding and of how columns are differenced."""

_POINTS = 8
"""States in a period of the fastest frequency, between which costly columns are interpolated."""

_MOTION = 0.3
"""Share of the band that the motion's own forces are in."""

_ROUNDS = 6
"""Times that a delay is taken out and looked for again, at most."""

_NAMED = 0.05
"""Percent of a cycle's forces from which a fault is named: statistics see smaller ones where a log
has no noise, and the sampling itself makes them."""


@dataclass(frozen=True)
class Trial:
    """What a fit's residuals show.

    Attributes
    ----------
    tried : tuple of str
        The faults that were tried; none where the logs do not suffice for that.
    suspicions : tuple of Suspicion
        Those that show, the clearest first. What changes a cycle by less than 0.05 % is none.
    uncertain : array, shape (n,)
        What the values' covariance leaves open of a pick-and-place cycle's forces, in percent of
        their standard deviation; NaN where the machine has no room for a cycle.
    spoiled : array, shape (n,)
        What all suspicions together spoil of it, likewise.
    why_not : str
        Why nothing was tried, where that is so.
    hidden : tuple of {"gain", "clock", "scale"}
        Faults that these logs cannot tell by the rank of their equations: a factor that all forces
        have, a clock at another rate, one force out of scale beside the others.
    """

    tried: tuple[str, ...]
    suspicions: tuple[Suspicion, ...]
    uncertain: Array
    spoiled: Array
    why_not: str = ""
    hidden: tuple[Fault, ...] = ()

    @property
    def off(self) -> Array:
        """By how much such a cycle's forces are expected to be off, in percent (n,)."""
        return np.asarray(np.hypot(self.uncertain, self.spoiled))

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        shares = {"uncertain": self.uncertain, "spoiled": self.spoiled, "off": self.off}
        return {
            "tried": list(self.tried),
            "why_not": self.why_not,
            "cannot_be_told": list(self.hidden),
            "faults": [one.as_dict() for one in self.suspicions],
            "cycle_percent": {
                name: None if np.isnan(values).any() else values.tolist()
                for name, values in shares.items()
            },
        }


@dataclass(frozen=True)
class _Look:
    """A part of a recording that is looked at, how it is preprocessed, and what is tried on it."""

    suspects: Suspects
    log: Log
    how: Preprocessing
    states: list[States]

    def late(self, delay: float) -> _Look:
        """Return the same for forces that are late by so much more, s."""
        later = float(np.clip(self.how.delay + delay, -LATEST, LATEST))
        return replace(self, how=replace(self.how, delay=later))


def trial(
    model: Model,
    estimate: Estimate,
    recordings: Sequence[Recording],
    preprocessing: Sequence[Preprocessing],
    rotors: Mapping[str, float] | None = None,
) -> Trial:
    """Try a fit's residuals for faults of the logs and of the machine.

    Each fault adds columns to the regressor (`families_of`). Those whose sizes the data tell from
    zero are taken in one after the other, the clearest first. What they spoil is worked out on a
    pick-and-place cycle as fast as the logs' own motion.

    Parameters
    ----------
    model, estimate : Model, Estimate
        The fit.
    recordings : sequence of Recording
        What was fitted; 20 000 rows in all are looked at, with and without payload.
    preprocessing : sequence of Preprocessing
        How each was preprocessed.
    rotors : mapping of str to float, optional
        What rotors are known to weigh on the joints, by the name of the value, SI units.
    """
    known, why_not = known_values(model, recordings, rotors or {}), ""
    for rows in (_LOOK, _MORE):
        try:
            looks = _looks(model, estimate, recordings, preprocessing, rows)
            return _tried(looks, model, estimate, known)
        except LogError as error:
            why_not = str(error)
        if sum(one.rows for one in recordings) <= rows:
            break
    nothing = np.full(len(model.robot.legs), np.nan)
    return Trial((), (), nothing, nothing, why_not)


def _tried(
    looks: list[_Look], model: Model, estimate: Estimate, known: Mapping[str, float]
) -> Trial:
    nothing = np.full(len(model.robot.legs), np.nan)
    suspects = looks[0].suspects
    tried = tuple(dict.fromkeys(family.name for family in suspects.families))
    largest = max(float(np.abs(look.log.forces).max()) for look in looks)

    # Which faults the residuals show
    observations = _observed(looks)
    noise = np.mean([look.how.force_noise for look in looks], axis=0)
    left_open = cannot_be_told(suspects, observations, noise)
    exact = np.abs(estimate.residuals).max() < _EXACT * largest
    plain, named = searched(suspects, observations, () if exact else suspects.families)
    if any(one.family is DELAY for one in named):
        # A long delay is no small one: the rest is told once forces are where they belong.
        late, shifted = _delay(looks)
        fit, named = _searched_beside(shifted, DELAY)
        if late is not None:
            named.insert(0, replace(late, fit=fit))

    # What they spoil
    p = len(model.names)
    cycle = Cycle.within(model.robot, Extent.of([s for look in looks for s in look.states]))
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
                    forces = forces + family.of_cycle(motion) @ sizes
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
    step = 1.0 / max(look.how.rate for look in looks)
    suspicions = [
        Suspicion(
            one.family.name,
            tuple(one.family.sizes(model)),
            one.sizes,
            one.deviations,
            one.chance,
            shift,
            spoils,
            None if one.family.speed is None else one.family.speed * suspects.usual,
            step,
        )
        for one, shift, spoils in zip(named, shifts, each, strict=True)
        if not (spoils < _NAMED).all()
    ]

    # What the residuals cannot show: scales of all forces and of time
    factor = factor_of_forces(model, fits[-1], known)
    # By a slow clock all inertia is too small, what is known as well.
    slow = [1.0 + float(one.sizes[0]) for one in suspicions if one.fault == "clock"]
    if factor is not None and factor.wrong and all(factor.times(s).wrong for s in slow):
        off = factor.value - 1.0
        wrong = np.full(len(nothing), 100.0 * abs(1.0 - 1.0 / factor.value))
        size, deviation = np.array([off]), np.array([factor.deviation])
        shift = abs(off) / factor.deviation
        labels = tuple(known)
        suspicions.insert(
            0, Suspicion("gain", labels, size, deviation, factor.chance, shift, wrong)
        )
        spoiled = np.hypot(spoiled, wrong)
    if factor is None or not factor.told:
        left_open.insert(0, "gain")
    shown = {one.fault for one in suspicions}
    hidden = tuple(fault for fault in left_open if fault not in shown)
    if factor is not None:
        tried = (*tried, "gain")
    return Trial(tried, tuple(suspicions), uncertain, spoiled, hidden=hidden)


def delay_of(
    model: Model,
    estimate: Estimate,
    recordings: Sequence[Recording],
    preprocessing: Sequence[Preprocessing],
) -> float:
    """Return the delay of recordings' forces that suits a fit best, s, beside that assumed."""
    looks = _looks(model, estimate, recordings, preprocessing)
    _, shifted = _delay(looks)
    return shifted[0].how.delay - looks[0].how.delay


def _looks(
    model: Model,
    estimate: Estimate,
    recordings: Sequence[Recording],
    preprocessing: Sequence[Preprocessing],
    most: int = _LOOK,
) -> list[_Look]:
    """Return the parts of recordings that are tried, `most` rows in all."""
    rows = most // len(recordings)
    parts = [
        (log, _unaveraged(model, log, how), part)
        for one, how in zip(recordings, preprocessing, strict=True)
        for log in [one.head()]
        for part in _moving_most(log, rows)
    ]
    states = [[b.states for b in samples(model.robot, part, how)] for _, how, part in parts]
    rates = np.concatenate([s.joint_rates for blocks in states for s in blocks])
    usual = np.sqrt((rates**2).mean(axis=0))
    families = families_of(model.robot)
    if model.terms.stribeck == "auto":  # its speeds are found already
        families = tuple(one for one in families if one.name != "stribeck")
    found = []
    for (log, how, part), blocks in zip(parts, states, strict=True):
        fastest = max(how.cutoff or 0.0, how.band)
        suspects = Suspects(
            model,
            estimate.values,
            usual,
            float(log.time[0]),
            float(log.time[-1]),
            families,
            max(int(how.rate / (_POINTS * fastest)), 1),
            _MOTION * how.band,
        )
        found.append(_Look(suspects, part, how, blocks))
    return found


def _moving_most(log: Log, rows: int) -> list[Log]:
    """Return as many rows of a log, without and with payload, in which the joints move most."""
    if log.rows <= rows:
        return [log]
    steps = (np.diff(log.joints, axis=0) ** 2).sum(axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    phase = np.zeros(log.rows) if log.payload is None else log.payload
    edges = [0, *(np.flatnonzero(np.diff(phase)) + 1).tolist(), log.rows]
    phases = sorted(pairwise(edges), key=lambda part: part[0] - part[1])
    longest = {phase[start]: (start, stop) for start, stop in reversed(phases)}
    size = rows // len(longest)
    found = []
    for start, stop in longest.values():
        starts = np.arange(start, max(stop - size, start) + 1, max(size // 2, 1))
        ends = np.minimum(starts + size, stop)
        best = int(np.argmax(way[ends - 1] - way[starts]))
        found.append(log.part(int(starts[best]), int(ends[best])))
    return found


def _unaveraged(model: Model, log: Log, how: Preprocessing) -> Preprocessing:
    """Return how a log is looked at: one period for all would not tell what comes and goes."""
    if how.derivatives != "periodic":
        return how
    wanted = Processing(derivatives="central")
    again = preprocessing_of(model.robot, log, wanted, start=how.start)
    return replace(again, slow=how.slow, delay=how.delay)


def _observed(looks: Sequence[_Look]) -> Observations:
    return stacked([observations_of(look.suspects, look.log, look.how) for look in looks])


def _with(look: _Look, families: tuple[Family, ...]) -> _Look:
    return replace(look, suspects=replace(look.suspects, families=families))


def _searched_beside(looks: Sequence[_Look], known: Family) -> tuple[Estimate, list[Named]]:
    """Return the fit, and the faults that show, but for one that is taken out."""
    rest = tuple(one for one in looks[0].suspects.families if one is not known)
    without = [_with(look, rest) for look in looks]
    return searched(without[0].suspects, _observed(without))


def _delay(looks: Sequence[_Look]) -> tuple[Named | None, list[_Look]]:
    """Return the whole delay of logs' forces, and the parts with it taken out."""
    late, shifted = None, list(looks)
    for _ in range(_ROUNDS):
        only = [_with(look, (DELAY,)) for look in shifted]
        _, left = searched(only[0].suspects, _observed(only))
        if not left:
            break
        first, late = late or left[0], left[0]
        shifted = [look.late(float(late.sizes[0])) for look in shifted]
    if late is not None:
        whole = np.array([shifted[0].how.delay - looks[0].how.delay])
        late = replace(late, sizes=whole, chance=first.chance)
    return late, shifted
