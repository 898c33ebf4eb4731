"""`identify`: from logs to parameters, a model of real bodies, and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from pteron.errors import DataError, ModelError, PteronError
from pteron.identification.consistency import Bounds, Consistency, MissingSolver, consistent_model
from pteron.identification.errors import LogError
from pteron.identification.estimators import (
    ESTIMATORS,
    Estimate,
    essential_parameters,
    weighted,
)
from pteron.identification.faults import delay_of, trial
from pteron.identification.fitting import (
    METHODS,
    check_columns,
    check_payload,
    check_recordings,
    estimated,
    fit_observations,
    preprocessing_for,
)
from pteron.identification.logs import Log, LogFile
from pteron.identification.logs.recorded import at_limits
from pteron.identification.model import Model, Terms, identification_model
from pteron.identification.observation import Observations, stacked
from pteron.identification.plausibility import doubts, left_over, unphysical, unseen
from pteron.identification.prediction import predict
from pteron.identification.recordings import Recording, divided, recording
from pteron.identification.result import Identification
from pteron.identification.signals import Preprocessing, Processing
from pteron.identification.verdict import judged, verdict_of, with_bodies
from pteron.kernels import Array
from pteron.legs import Drive
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.reduction import base_parameters
from pteron.reduction.sharing import Sharing

Logs = Log | LogFile | Sequence[Log | LogFile]

Stage = Callable[[str, int, int], None]
"""Told what is being done, how many rows of it are done, and how many there are."""


def identify(
    robot: RobotLike,
    logs: Logs,
    *,
    held_out: Logs = (),
    terms: Terms | None = None,
    shared: Sharing = False,
    estimator: str | Callable[[Observations], Estimate] = "weighted",
    processing: Processing | None = None,
    cad: RobotLike | Literal["robot"] | None = "robot",
    bounds: Bounds | None = None,
    progress: Stage | None = None,
) -> Identification:
    """Identify a machine from recorded motions.

    Positions are smoothed and differentiated, poses follow by direct kinematics, the observations
    F = W beta are filtered and solved, real bodies are found that have these base parameters, and
    the result is judged on motions that were held out.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine as it is drawn: its geometry counts, its inertial parameters are where the
        search for real bodies begins.
    logs : Log, LogFile or a sequence of them
        What to fit.
    held_out : Log, LogFile or a sequence of them
        What to judge by; by default the last 30 % of each log.
    terms : Terms, optional
        Friction, offsets and other terms beside the base parameters.
    shared : bool or groups of legs
        Whether legs share one parameter set; see `pteron.base_parameters`.
    estimator : str or callable
        One of `METHODS`: ordinary, weighted (the default), huber, total, instrumental, likelihood;
        or what takes observations and returns an estimate, such as
        `functools.partial(huber, threshold=2.0)`.
    processing : Processing, optional
        How positions are differentiated and filtered; by default the data decide.
    cad : Manipulator, name or path, "robot" or None
        What real bodies are to be nearest to.
    bounds : Bounds, optional
        What is known about the bodies.
    progress : callable, optional
        Told what is being done, how many rows of it are done and how many there are.

    Raises
    ------
    LogError
        If a log does not fit the machine or its motion does not show the parameters, if forces have
        their sign flipped or columns are swapped; the message says what was found.
    ModelError
        If the estimator is not known, or the bounds contradict each other.
    """
    robot = as_manipulator(robot)
    drawn = robot if cad == "robot" else None if cad is None else as_manipulator(cad)
    if isinstance(estimator, str) and estimator not in METHODS:
        raise ModelError(f"estimator: {estimator!r} is not one of {', '.join(METHODS)}")
    report = progress or (lambda task, done, total: None)
    wanted = processing or Processing()

    # Read the logs, and hold some rows out
    read = _reader(report, "Reading")
    whole, others = (
        [recording(log, read, wanted.period) for log in _sequence(given, robot)]
        for given in (logs, held_out)
    )
    check_recordings(whole, others, wanted)
    limits = tuple(said for one in whole for said in at_limits(one.head()))
    halves = [] if others else [divided(one, wanted.period) for one in whole]
    fit = [first for first, _ in halves] or whole
    check = others or [second for _, second in halves]

    # Build the model
    base = base_parameters(robot, shared=shared)
    rotors = _rotors(robot, fit)
    known_rotors = replace(terms or Terms(), rotors=True) if rotors else terms
    model = identification_model(robot, known_rotors, base=base)
    if model.terms.payload:
        check_payload(fit)

    # Preprocess, stack and solve
    def fitted_by(how: Processing) -> tuple[tuple[Preprocessing, ...], Observations, Estimate]:
        treated = tuple(preprocessing_for(robot, one, how) for one in fit)
        parts = [
            fit_observations(model, one, each, _reader(report, "Filtering"))
            for one, each in zip(fit, treated, strict=True)
        ]
        rows = stacked(parts)
        try:
            return treated, rows, estimated(estimator, model, fit, treated, rows)
        except DataError as error:
            raise _with_findings(error, whole) from None

    preprocessing, observations, estimate = fitted_by(wanted)
    if wanted.delay == "auto":
        wanted = replace(wanted, delay=delay_of(model, estimate, fit, preprocessing))
        preprocessing, observations, estimate = fitted_by(wanted)

    # Judge by what was held out, which betrays columns that are not what they are called
    modes = [None] * len(check) if others else [how.start for how in preprocessing]
    held = [
        judged(
            model,
            estimate.values,
            one,
            preprocessing_for(robot, one, wanted, start),
            _reader(report, "Checking"),
        )
        for one, start in zip(check, modes, strict=True)
    ]
    by_held_out = verdict_of(held, repeats=not others)
    impossible = unphysical(model, observations, estimate)
    if by_held_out.grade != "trustworthy" or impossible:
        try:
            check_columns(model, fit[0], preprocessing[0])
        except LogError as error:
            raise _with_findings(error, whole) from None
    hidden, too_many = unseen(model, estimate.deviations)
    if too_many:
        raise _with_findings(_too_little(model, hidden, estimate, preprocessing, fit[0]), whole)
    report("Looking for faults", 0, 0)
    shown = trial(model, estimate, fit, preprocessing, _reflected(rotors))
    verdict = verdict_of(held, shown, repeats=not others, limits=limits)
    fitted = tuple(
        predict(model, estimate.values, one.beginning(), how, _reader(report, "Predicting"))
        for one, how in zip(fit, preprocessing, strict=True)
    )

    # Find what the data show by themselves, and real bodies
    again = ESTIMATORS.get(estimator, weighted) if isinstance(estimator, str) else estimator
    essential = essential_parameters(observations, estimate, again)
    known = np.zeros(len(model.names))
    for name, mass in _reflected(rotors).items():
        known += model.share_of(name, mass)
    try:
        consistency, share, off, missing = _real_bodies(
            model, estimate, known, observations, drawn, bounds
        )
    except ModelError as error:
        raise _with_findings(error, whole) from None
    verdict = with_bodies(verdict, consistency, off)
    advice = doubts(model, estimate, known, consistency, drawn)
    if hidden or essential.dropped:
        weak = ", ".join(dict.fromkeys((*hidden, *essential.dropped)))
        advice.insert(
            0,
            f"Weak with this motion: {weak}. pteron excite ROBOT --out motion.csv writes a motion "
            "that shows more of them; the faster (--speed, --acceleration) and longer (--periods), "
            "the more.",
        )
    return Identification(
        robot=robot,
        model=model,
        estimate=estimate,
        essential=essential,
        consistency=consistency,
        consistency_share=share,
        fitted=fitted,
        held_out=tuple(held),
        preprocessing=preprocessing,
        trial=shown,
        verdict=replace(verdict, next_steps=(*verdict.next_steps, *advice)),
        unseen=hidden,
        findings=tuple(f for one in (*whole, *others) for f in one.findings),
        notes=(*_notes(model, estimate, _reflected(rotors)), *missing),
        rotors=rotors,
    )


def _sequence(logs: Logs, robot: Manipulator) -> list[Log | LogFile]:
    """Return the logs, with the names of the machine's joints where they have none."""
    symbols = tuple(leg.joint for leg in robot.legs)
    return [
        replace(one, symbols=symbols) if isinstance(one, Log) and one.symbols is None else one
        for one in ([logs] if isinstance(logs, Log | LogFile) else logs)
    ]


def _reader(report: Stage, task: str) -> Callable[[int], None]:
    done = 0

    def tell(rows: int) -> None:
        nonlocal done
        done += rows
        report(task, done, done)

    return tell


def _rotors(robot: Manipulator, fit: Sequence[Recording]) -> tuple[tuple[float, float], ...] | None:
    """Return inertia and ratio of each joint's motor, by the log or else by the machine's file."""
    description = fit[0].head().description
    if description.rotor_inertia is not None and description.ratio is not None:
        return tuple(zip(description.rotor_inertia, description.ratio, strict=True))
    drives = [leg.drive or Drive() for leg in robot.legs]
    if any(drive.rotor_inertia for drive in drives):
        return tuple((drive.rotor_inertia, drive.gear) for drive in drives)
    return None


def _reflected(rotors: tuple[tuple[float, float], ...] | None) -> dict[str, float]:
    """Return what rotors weigh on the joints, J r^2, by name."""
    return {f"J_m{i}": inertia * r**2 for i, (inertia, r) in enumerate(rotors or (), start=1)}


def _with_findings(error: PteronError, whole: Sequence[Recording]) -> PteronError:
    """Return an error with what was noticed in the logs behind it, which may explain it."""
    findings = [said.rstrip(".") for one in whole for said in at_limits(one.head())]
    findings += [finding.message for one in whole for finding in one.findings]
    if findings:
        error.args = (f"{error} (noticed before: {'; '.join(findings[:3])})",)
    return error


def _too_little(
    model: Model,
    hidden: tuple[str, ...],
    estimate: Estimate,
    preprocessing: Sequence[Preprocessing],
    first: Recording,
) -> LogError:
    """Return the error for a motion that leaves most base parameters unseen."""
    rank = model.base.rank
    names = ", ".join(hidden) if len(hidden) < rank else "all"
    cause = left_over(estimate, preprocessing)
    return LogError(
        "too little motion",
        first.source,
        f"{cause or 'too little motion'}: {len(hidden)} of {rank} base parameters cannot be seen "
        f"({names}), their standard deviations are larger than their usual size; "
        f"{'mend that, or ' if cause else ''}move faster and along all coordinates, as the motion "
        "does that pteron excite ROBOT --out motion.csv writes",
    )


def _real_bodies(
    model: Model,
    estimate: Estimate,
    known: Array,
    observations: Observations,
    cad: Manipulator | None,
    bounds: Bounds | None,
) -> tuple[Consistency | None, float, float, tuple[str, ...]]:
    """Return real bodies, how far their forces are off, and why there are none if so.

    Their forces are off by so much over the residuals, and by so many percent of the forces.
    """
    rank = model.base.rank
    values = (estimate.values - known)[:rank]
    covariance = estimate.covariance[:rank, :rank]
    try:
        found = consistent_model(
            model.robot, model.base, values, covariance, cad=cad, bounds=bounds
        )
    except MissingSolver as error:
        return None, float("nan"), float("nan"), (f"No model of real bodies: {error}",)
    shift = np.zeros(len(estimate.values))
    shift[:rank] = found.base_values - values
    moved = np.sqrt(((observations.matrix @ shift) ** 2).mean())
    left = np.sqrt((estimate.residuals**2).mean())
    size, tiny = np.sqrt((observations.forces**2).mean()), np.finfo(float).tiny
    return found, float(moved / max(left, tiny)), float(100.0 * moved / max(size, tiny)), ()


def _notes(model: Model, estimate: Estimate, rotors: dict[str, float]) -> list[str]:
    """Return what else is to be known of an estimate."""
    notes, units = [], {term.name: term.unit for term in model.all_terms}
    if not estimate.converged:
        notes.append(
            f"The estimator {estimate.method} has not settled in {estimate.iterations} iterations: "
            "values and intervals may be off; choose another estimator, or record longer."
        )
    notes += [
        f"{name} = {mass:.6g} {units[name]} is known, and no part of the real bodies."
        for name, mass in rotors.items()
    ]
    for name, shares in model.joins.items():
        notes.append(f"{name} joins {' and '.join(shares) or 'nothing: it does not act'}.")
    return notes
