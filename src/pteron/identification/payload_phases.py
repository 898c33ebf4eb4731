"""The phases of logs without and with a payload: their recordings and observations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pteron.identification.errors import LogError
from pteron.identification.fitting import NO_COLUMN, append_findings
from pteron.identification.logs import Log
from pteron.identification.observation import (
    LinearModel,
    Observations,
    observations_of,
    stack_observations,
)
from pteron.identification.recordings import Recording, read_recording
from pteron.identification.signals import Preprocessing, Processing, preprocessing_for_log
from pteron.kernels import Array

if TYPE_CHECKING:
    pass


def observations_with_payload(
    model: LinearModel, without: Log, with_payload: Log | None, processing: Processing | None
) -> Observations:
    """Return the observations of a log with both phases, or of two logs, as one."""
    fit = read_phases(without, with_payload, processing)
    with append_findings(fit):
        return stack_observations(observe_phases(model, fit, processing)[0])


def currents_by_drive(
    model: LinearModel, without: Log, with_payload: Log | None, processing: Processing | None
) -> Array:
    """Return what the platform feels of each drive's currents alone, (R, n, n), at the rows of all.

    Columns are drives. Only of machines with more legs than coordinates are they no diagonal.
    """
    logs = [recording.head() for recording in read_phases(without, with_payload, processing)]
    plans = [preprocessing_for_log(model.robot, log, processing) for log in logs]
    columns = []
    for drive in np.eye(model.robot.joint_count):
        parts = [replace(log, forces=log.forces * drive) for log in logs]
        rows = [observations_of(model, *pair) for pair in zip(parts, plans, strict=True)]
        columns.append(stack_observations(rows).forces)
    return np.stack(columns, axis=-1)


def read_phases(
    without: Log, with_payload: Log | None, processing: Processing | None
) -> list[Recording]:
    """Return recordings with and without payload, of a log with both phases or of two logs."""
    if with_payload is None:
        logs = [without]
        _check_phases(without)
    else:
        logs = [_set_phase(without, 0), _set_phase(with_payload, 1)]
    period = None if processing is None else processing.period
    return [read_recording(log, period=period) for log in logs]


def observe_phases(
    model: LinearModel, fit: Sequence[Recording], processing: Processing | None
) -> tuple[list[Observations], list[Preprocessing]]:
    """Return observations and preprocessing of each recording; both phases must be in them."""
    logs = [recording.head() for recording in fit]
    plans = [preprocessing_for_log(model.robot, log, processing) for log in logs]
    parts = [observations_of(model, *pair) for pair in zip(logs, plans, strict=True)]
    observations = stack_observations(parts)
    seen = (observations.gain > 0.0).any(axis=1)
    for phase, called in ((0, "without payload"), (1, "with payload")):
        if not (seen & ((observations.payload != 0) == phase)).any():
            raise logs[phase * (len(logs) - 1)].fault(
                "too short",
                f"no samples {called} are left between the filters' edges; record that phase "
                "longer",
            )
    return parts, plans


def _check_phases(log: Log) -> None:
    """Raise LogError where a single log does not have both phases."""
    phases = [] if log.payload is None else np.unique(log.payload).tolist()
    if len(phases) > 1:
        return
    said = NO_COLUMN
    if phases:
        which = "one without payload" if phases[0] else "one where a payload is carried"
        said = f"its payload column has phase {phases[0]} only, 0 and 1 are expected; add {which}"
    raise log.fault("no payload", f"{said}, or give two logs")


def _set_phase(log: Log, phase: int) -> Log:
    """Return a log in which all rows have a phase; raise if its column contradicts it."""
    if log.payload is not None and ((log.payload != 0) != phase).any():
        row = int(np.argmax((log.payload != 0) != phase))
        raise LogError(
            "no payload",
            log.place(row),
            f"payload {log.payload[row]} in the log {'with' if phase else 'without'} payload, "
            f"{phase} expected throughout; give first the log without payload, then the one with "
            "it, or one log with both phases alone",
        )
    return replace(log, payload=np.full(log.rows, phase, dtype=np.int64))
