"""Parts of recordings in which faults are searched: those in which the joints move most.

Each has the columns of all faults beside those of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pteron.identification.estimators import Estimate
from pteron.identification.faults.columns import FaultColumns, families_of
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.observation import Observations, observations_of, stack_observations
from pteron.identification.recordings import Recording
from pteron.identification.signals import (
    Preprocessing,
    Processing,
    States,
    preprocessing_for_log,
    samples,
)

_POINTS = 5
"""States in a period of the highest frequency at which slow columns are computed; between them they
are interpolated."""

_MOTION = 0.3
"""Share of the band that the motion's own forces are in."""


@dataclass(frozen=True)
class SearchedPart:
    """A part of a recording that is searched, with its states, model and preprocessing."""

    model: FaultColumns
    log: Log
    preprocessing: Preprocessing
    states: list[States]


def choose_parts(
    model: Model,
    estimate: Estimate,
    recordings: Sequence[Recording],
    preprocessing: Sequence[Preprocessing],
    most: int,
) -> list[SearchedPart]:
    """Return the parts of recordings that are searched, `most` rows in all."""
    rows = most // len(recordings)
    chosen = [
        (log, _plan_single_periods(model, log, how), part)
        for recording, how in zip(recordings, preprocessing, strict=True)
        for log in [recording.head()]
        for part in _select_moving_parts(log, rows)
    ]
    states = [[b.states for b in samples(model.robot, part, how)] for _, how, part in chosen]
    rates = np.concatenate([s.joint_rates for blocks in states for s in blocks])
    usual = np.sqrt((rates**2).mean(axis=0))
    families = families_of(model)
    if model.terms.stribeck == "auto":  # its speeds are found already
        families = tuple(family for family in families if family.name != "stribeck")
    parts = []
    for (log, how, part), blocks in zip(chosen, states, strict=True):
        fastest = max(how.cutoff or 0.0, how.band)
        ends, stride = log.time[[0, -1]].tolist(), max(int(how.rate / (_POINTS * fastest)), 1)
        about = families, stride, _MOTION * how.band
        columns = FaultColumns(model, estimate.values, usual, ends[0], ends[1], *about)
        parts.append(SearchedPart(columns, part, how, blocks))
    return parts


def _select_moving_parts(log: Log, rows: int) -> list[Log]:
    """Return the parts of a log, `rows` in all, in which the joints move most.

    There is one part of each payload phase.
    """
    if log.rows <= rows:
        return [log]
    steps = (np.diff(log.joints, axis=0) ** 2).sum(axis=1)
    travel = np.concatenate([[0.0], np.cumsum(steps)])
    phase = np.zeros(log.rows) if log.payload is None else log.payload
    phases = sorted(log.phases, key=lambda part: part[0] - part[1])
    longest = {phase[start]: (start, stop) for start, stop in reversed(phases)}
    size = rows // len(longest)
    parts = []
    for start, stop in longest.values():
        starts = np.arange(start, max(stop - size, start) + 1, max(size // 2, 1))
        ends = np.minimum(starts + size, stop)
        best = int(np.argmax(travel[ends - 1] - travel[starts]))
        parts.append(log.part(int(starts[best]), int(ends[best])))
    return parts


def _plan_single_periods(model: Model, log: Log, how: Preprocessing) -> Preprocessing:
    """Return the preprocessing without averaging of periods, which would hide passing faults."""
    if how.derivatives != "periodic":
        return how
    processing = Processing(derivatives="central")
    again = preprocessing_for_log(model.robot, log, processing, start=how.start)
    return replace(again, slow=how.slow, delay=how.delay)


def observe_parts(parts: Sequence[SearchedPart]) -> Observations:
    """Return the observations of parts, with the columns of all faults."""
    return stack_observations(
        [observations_of(part.model.extended_model, part.log, part.preprocessing) for part in parts]
    )
