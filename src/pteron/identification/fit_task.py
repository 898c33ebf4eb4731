"""The task of an identification: a model, and recordings with rows to fit and to hold out.

`read_task` reads and checks the logs, and builds the model with the rotors that are known.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from pteron.identification.estimators import Estimate
from pteron.identification.fitting import (
    check_payload,
    check_recordings,
    convert_to_newtons,
    fit_observations,
    stack_balanced,
)
from pteron.identification.logs import Finding, Log, LogFile
from pteron.identification.model import Model, Terms, identification_model
from pteron.identification.observation import LinearModel, Observations
from pteron.identification.recordings import Recording, read_recording, split_test_data
from pteron.identification.result import reflected_inertia
from pteron.identification.signals import Preprocessing, Processing
from pteron.legs import Drive
from pteron.manipulator import Manipulator
from pteron.progress import Steps
from pteron.reduction import base_parameters
from pteron.reduction.sharing import Sharing

Logs = Log | LogFile | Sequence[Log | LogFile]

STEPS = {
    "Reading": 2.0,
    "Filtering": 3.0,
    "Checking": 1.0,
    "Looking for faults": 2.0,
    "Predicting": 1.0,
    "Finding real bodies": 1.0,
}
"""The steps of an identification, and about how their times compare."""


@dataclass(frozen=True)
class Motions:
    """The recordings of an identification.

    Attributes
    ----------
    recordings : list of Recording
        The logs to fit, with all their rows.
    separate : list of Recording
        The logs that are held out; none where the ends of the fitted ones are.
    fit, held_out : list of Recording
        The rows to fit, and those to judge by.
    originals : list of Log
        The logs to fit as they were given, or the first pieces of their files.
    """

    recordings: list[Recording]
    separate: list[Recording]
    fit: list[Recording]
    held_out: list[Recording]
    originals: list[Log]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Oddities of all logs, those to fit first."""
        return tuple(f for log in (*self.recordings, *self.separate) for f in log.findings)


@dataclass(frozen=True)
class FitTask:
    """The model, the recordings and the method of a fit.

    Attributes
    ----------
    robot : Manipulator
        The machine as it is drawn.
    motions : Motions
        The recordings.
    model : Model
        The model, without speeds of Stribeck's friction that are still to be found.
    rotors : tuple of (float, float), optional
        Inertia, kg m^2, and ratio of each joint's motor, where they are known.
    estimator : str or callable
        The estimator's name, or a function from observations to an estimate.
    processing : Processing
        Choices about derivatives and filters.
    steps : Steps
        What reports the progress.
    """

    robot: Manipulator
    motions: Motions
    model: Model
    rotors: tuple[tuple[float, float], ...] | None
    estimator: str | Callable[[Observations], Estimate]
    processing: Processing
    steps: Steps

    @property
    def known_rotors(self) -> dict[str, float]:
        """The inertia that known rotors add at the joints, by name; kg or kg m^2."""
        return reflected_inertia(self.rotors)

    def with_progress(self, recordings: Sequence[Recording], step: str) -> list[Recording]:
        """Return recordings that report which share of their rows a step has read."""
        count_rows = _row_counter(self.steps, step, sum(log.rows for log in recordings))
        return [replace(log, tell=count_rows) for log in recordings]

    def observe(
        self,
        preprocessing: Sequence[Preprocessing],
        columns: LinearModel,
        delay: float | None = None,
    ) -> Observations:
        """Return the observations of the rows to fit; `delay`, s, replaces that of the forces."""
        if delay is not None:
            preprocessing = [replace(how, delay=delay) for how in preprocessing]
        recordings = self.with_progress(self.motions.fit, "Filtering")
        pairs = zip(recordings, preprocessing, strict=True)
        return stack_balanced([fit_observations(columns, log, how) for log, how in pairs])


def read_task(
    robot: Manipulator,
    logs: Logs,
    held_out: Logs,
    *,
    terms: Terms | None,
    shared: Sharing,
    estimator: str | Callable[[Observations], Estimate],
    processing: Processing,
    steps: Steps,
) -> FitTask:
    """Return the task of a fit, with recordings that are read and checked; see `identify`."""
    motions = _read_motions(robot, logs, held_out, processing, steps)
    base = base_parameters(robot, shared=shared)
    rotors = _motor_data(robot, motions.fit)
    known_rotors = replace(terms or Terms(), rotors=True) if rotors else terms
    model = identification_model(robot, known_rotors, base=base)
    if model.terms.payload:
        check_payload(motions.fit)
    return FitTask(robot, motions, model, rotors, estimator, processing, steps)


def _read_motions(
    robot: Manipulator, logs: Logs, held_out: Logs, processing: Processing, steps: Steps
) -> Motions:
    """Return the recordings, checked; without held-out logs the end of each recording is."""
    groups = [logs_in_newtons(group, robot) for group in (logs, held_out)]
    rows = sum(Recording(log, 0, sys.maxsize).rows for group in groups for log in group)
    count_rows = _row_counter(steps, "Reading", rows)
    recordings, separate = (
        [read_recording(log, count_rows, processing.period) for log in group] for group in groups
    )
    check_recordings(robot, recordings, separate, processing)
    originals = _originals(logs)
    if separate:
        return Motions(recordings, separate, recordings, separate, originals)
    parts = [split_test_data(log, processing.period) for log in recordings]
    beginnings, ends = [first for first, _ in parts], [second for _, second in parts]
    return Motions(recordings, separate, beginnings, ends, originals)


def logs_in_newtons(logs: Logs, robot: Manipulator) -> list[Log | LogFile]:
    """Return the logs in newtons, with the machine's joint names where they have none."""
    symbols = tuple(leg.joint for leg in robot.legs)
    named = [
        replace(log, symbols=symbols) if isinstance(log, Log) and log.symbols is None else log
        for log in ([logs] if isinstance(logs, Log | LogFile) else logs)
    ]
    return [convert_to_newtons(log, robot) for log in named]


def _originals(logs: Logs) -> list[Log]:
    """Return the original logs in memory, or the beginning of their files."""
    several = [logs] if isinstance(logs, Log | LogFile) else logs
    return [log if isinstance(log, Log) else next(iter(log.pieces())) for log in several]


def _row_counter(steps: Steps, step: str, total: int) -> Callable[[int], None]:
    """Return a function that adds rows to those done, and reports the step's share of all."""
    done = 0
    steps.report(step)

    def count_rows(rows: int) -> None:
        """Add rows to those done and report the step's share, 0 to 1."""
        nonlocal done
        done += rows
        steps.report(step, done / max(total, 1))

    return count_rows


def _motor_data(
    robot: Manipulator, fit: Sequence[Recording]
) -> tuple[tuple[float, float], ...] | None:
    """Return inertia and ratio of each joint's motor, from the log or else the machine's file."""
    description = fit[0].head().description
    if description.rotor_inertia is not None and description.ratio is not None:
        return tuple(zip(description.rotor_inertia, description.ratio, strict=True))
    drives = [leg.drive for leg in robot.legs]
    if not any(drive and drive.inertia for drive in drives):
        return None
    return tuple((d.inertia / d.gear**2, d.gear) for d in (drive or Drive() for drive in drives))
