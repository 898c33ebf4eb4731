"""The steps of a fit: preprocessing of a recording, its observations, checks, and the estimate."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from pteron.errors import DataError, PteronError
from pteron.identification.errors import LogError
from pteron.identification.estimators import (
    ESTIMATORS,
    Estimate,
    column_errors,
    halves,
    instrumental,
    maximum_likelihood,
    total,
    weighted_least_squares,
)
from pteron.identification.estimators.least_squares import median_noise
from pteron.identification.exchanged_columns import DECISIVE, column_fault, exchanged_joints
from pteron.identification.logs import Log
from pteron.identification.logs.at_motor import AnyLog, apply_rated_torque, percent_advice
from pteron.identification.logs.recorded import check_forces, check_recorded, saturation_sentences
from pteron.identification.model import Model, identification_model
from pteron.identification.observation import (
    LinearModel,
    Observations,
    observations_of,
    stack_observations,
)
from pteron.identification.plausibility import excess_residual_cause, unseen_shares
from pteron.identification.recordings import Recording, hold_same_samples
from pteron.identification.signals import Preprocessing, Processing, preprocessing_for_log
from pteron.manipulator import Manipulator

METHODS = (*ESTIMATORS, "instrumental", "likelihood")
"""Names of the estimators that `identify` knows."""

_EXPLAINED = 0.2
"""Error of a fit, over the forces, below which joints in another order count as the right ones
where those of the log have no pose."""

NO_COLUMN = "no payload column; declare one that is 0 without payload and 1 with it"
"""The fault of a log that does not tell when a payload is carried."""

_FEWEST = 20
"""Rows of a log from which a spectrum can be computed; the filters' edges take more."""

_LOOK = 12_000
"""Most rows in which other orders of joints are tried."""

_MOST = 10.0
"""Largest ratio of the noise of two recordings that weights take into account."""

_NOISELESS = 1e-10
"""Residuals, relative to the forces, that are rounding."""


def convert_to_newtons(log: AnyLog, robot: Manipulator) -> AnyLog:
    """Return a log with forces in per cent of rated torque, if they are, as N or N m."""
    return apply_rated_torque(log, robot) if log.description.force_unit == "%" else log


def check_recordings(
    robot: Manipulator,
    recordings: Sequence[Recording],
    others: Sequence[Recording],
    processing: Processing,
) -> None:
    """Raise where recordings are missing, too short, in currents, forceless or given twice."""
    if not recordings:
        raise DataError("logs: none given, one or more expected")
    for recording in (*recordings, *others):
        # What is no force at all would hide how much the others change.
        if isinstance(recording.log, Log):
            check_forces(
                recording.log.forces,
                recording.log.force_names,
                recording.source,
                recording.log.first_row,
            )
        check_recorded(recording.head())
        if isinstance(recording.log, Log) and recording.rows < _FEWEST:
            raise DataError(
                f"{recording.source}: {recording.rows} rows are too few to identify; record longer"
            )
        unit = recording.head().description.force_unit
        if unit != "N":
            other = f", {percent_advice(robot)}" if unit == "%" else ""
            raise recording.log.fault(
                "currents",
                f"its forces are in {unit}; declare gains (N, at a crank N m, per {unit}) in its "
                f"description, or find them with identify_drive_gains{other}",
            )
    twice = "the same samples as {}; give them once"
    held_out = (
        "is held out, but the same samples are fitted; hold out another motion, or nothing: then "
        "the end of each log is"
    )
    pairs = [(*pair, twice.format(pair[0].source)) for pair in combinations(recordings, 2)]
    pairs += [(*pair, held_out) for pair in product(recordings, others)]
    for recording, again, said in pairs:
        if hold_same_samples(recording, again):
            raise again.log.fault("twice", said)
    for log in (recording.log for recording in recordings):
        period = processing.period
        if isinstance(log, Log) and period and log.duration < period * (1.0 - 1e-3):
            raise log.fault(
                "too short",
                f"period: {period:g} s given, but it lasts {log.duration:g} s; give the time "
                "after which the motion repeats, or none",
            )


def check_payload(fit: Sequence[Recording]) -> None:
    """Raise LogError where recordings do not state when a payload is carried, or carry several."""
    heads = [recording.head() for recording in fit]
    masses = {head.payload_mass: head.source for head in heads if head.payload_mass is not None}
    said = ""
    if len(masses) > 1:
        several = ", ".join(f"{mass:g} kg in {source}" for mass, source in masses.items())
        said = f"several payloads, {several}; identify one at a time, each with the log without it"
    elif all(head.payload is None for head in heads):
        said = f"{NO_COLUMN}, or identify without the payload"
    if said:
        raise fit[0].log.fault("no payload", said)


def choose_preprocessing(
    robot: Manipulator,
    recording: Recording,
    processing: Processing,
    start: tuple[float, ...] | None = None,
) -> Preprocessing:
    """Return the preprocessing of a recording, from its beginning.

    `start` is a pose of its assembly mode, where it is known.
    """
    head = recording.head()
    period = processing.period or head.description.period
    # What lasts less than a period is no periodic log.
    if processing.derivatives is None and period is not None and head.duration < 0.999 * period:
        described = replace(head.description, period=None, start=None, end=None)
        head = replace(head, description=described)
        processing = replace(processing, period=None)
    # A file that is read in pieces is never fitted in one.
    rows = recording.rows if isinstance(recording.log, Log) else 1 << 30
    return preprocessing_for_log(robot, head, processing, rows=rows, start=start)


def fit_observations(
    model: LinearModel, recording: Recording, preprocessing: Preprocessing
) -> Observations:
    """Return a recording's observations; where it has no poses, say whether joints are swapped."""
    try:
        return observations_of(model, recording.samples(), preprocessing)
    except LogError as error:
        if error.reason != "no pose":
            raise
        swap = exchanged_joints(model, recording.head().part(0, _LOOK), preprocessing, _EXPLAINED)
        if swap is None:
            raise
        error.args = (f"{error}; or {swap.message()}: then every row has a pose",)
        raise


def stack_balanced(parts: Sequence[Observations]) -> Observations:
    """Return the observations of recordings stacked, each weighted by its noise.

    A motion of small forces is recorded with less noise than one of large ones: unscaled, the noise
    of both would be taken for one, and the values' intervals would hold for neither.
    """
    if len(parts) == 1:
        return parts[0]
    unscaled = stack_observations(parts)
    estimate = weighted_least_squares(unscaled)
    ends = np.cumsum([len(part.forces) for part in parts])[:-1]
    noises = [
        median_noise(part, residuals)
        for part, residuals in zip(parts, np.split(estimate.residuals, ends), strict=True)
    ]
    usual = median_noise(unscaled, estimate.residuals)
    if (usual <= _NOISELESS * np.abs(unscaled.forces).max(axis=0)).any():
        return unscaled
    scaled = []
    for part, noise in zip(parts, noises, strict=True):
        factor = np.clip(usual / np.maximum(noise, 1e-300), 1.0 / _MOST, _MOST)
        rows, forces = part.matrix * factor[:, None], part.forces * factor
        scaled.append(replace(part, matrix=rows, forces=forces, gain=part.gain / factor))
    return stack_observations(scaled)


def estimate_values(
    estimator: str | Callable[[Observations], Estimate],
    model: Model,
    fit: Sequence[Recording],
    preprocessing: Sequence[Preprocessing],
    observations: Observations,
) -> Estimate:
    """Return the estimate from the observations, or from their recording."""
    if not isinstance(estimator, str):
        return estimator(observations)
    if estimator in ESTIMATORS and estimator != "total":
        return ESTIMATORS[estimator](observations)
    logs = [recording.head() for recording in fit if isinstance(recording.log, Log)]
    if len(logs) < len(fit) or (len(logs) > 1 and estimator != "instrumental"):
        how_many = "logs" if estimator == "instrumental" else "one log"
        raise DataError(
            f"estimator: {estimator} takes {how_many} of at most some million rows; choose "
            "weighted, or give such"
        )
    if estimator == "instrumental":
        pairs = [halves(model, log, how) for log, how in zip(logs, preprocessing, strict=True)]
        first, second = (stack_observations(half) for half in zip(*pairs, strict=True))
        return instrumental(first, second, mutual=True)
    if estimator == "likelihood":
        return maximum_likelihood(model, logs[0], preprocessing[0])
    return total(observations, column_errors(model, logs[0], preprocessing[0]))


@contextmanager
def append_findings(recordings: Sequence[Recording]) -> Iterator[None]:
    """Append the findings of logs to an error that is raised within, as possible explanations."""
    try:
        yield
    except PteronError as error:
        findings = [
            said.rstrip(".")
            for recording in recordings
            for said in saturation_sentences(recording.head())
        ]
        findings += [finding.message for recording in recordings for finding in recording.findings]
        if findings:
            error.args = (f"{error} (noticed before: {'; '.join(findings[:3])})",)
        raise


def check_motion(
    model: Model, estimate: Estimate, preprocessing: Sequence[Preprocessing], first: Recording
) -> None:
    """Raise LogError where values are so uncertain that the forces cannot be the machine's."""
    hidden, nothing = unseen_shares(model, estimate.deviations)
    if not nothing:
        return
    cause = excess_residual_cause(estimate, preprocessing)
    rank = model.base.rank
    names = ", ".join(hidden) if len(hidden) < rank else "all"
    raise first.log.fault(
        "too little motion",
        f"{cause or 'too little motion'}: {len(hidden)} of {rank} base parameters cannot be seen "
        f"({names}), their standard deviations are larger than their usual size; "
        f"{'mend that, or ' if cause else ''}move faster and along all coordinates, as the motion "
        "does that pteron excite ROBOT --out motion.csv writes, faster still with --speed and "
        "--acceleration",
    )


def check_columns(
    model: Model, recording: Recording, preprocessing: Preprocessing, *, decisive: bool = False
) -> None:
    """Raise LogError where exchanged columns or signs would explain a log's forces far better.

    If `decisive`, only where they reduce the fit's error: unphysical values alone may come from
    another fault of the log.
    """
    head = recording.head().part(0, _LOOK)
    if model.terms.payload and (head.payload is None or not head.payload.any()):
        model = identification_model(
            model.robot, replace(model.terms, payload=False), base=model.base
        )
    fault = column_fault(model, head, preprocessing)
    if fault is None or (decisive and not fault.after * DECISIVE < fault.before):
        return
    if fault.after < 1e-6 * fault.before:
        why = ": mended so, the error of the fit vanishes"
    elif fault.after * DECISIVE < fault.before:
        why = f": mended so, the error of the fit falls {fault.before / fault.after:.1f} times"
    else:
        why = ": as they are, the machine would have negative inertia or friction"
    if fault.equivalents:
        why += f" (as well explained: {'; or '.join(fault.equivalents)})"
    raise recording.log.fault(
        "columns",
        f"{fault.message()}{why}; "
        + (
            "correct gravity in the machine's file"
            if fault.gravity
            else "correct the columns, or declare their order and gains in the log's description"
        ),
    )
