"""`identify`: from logs to identified parameters, a model of real bodies, and a verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from pteron.errors import DataError, ModelError, PteronError
from pteron.identification.advice import (
    advice_on_hidden_values,
    advice_on_weak_values,
    notes_on_fit,
    notes_on_unknowns,
)
from pteron.identification.consistency import Bounds
from pteron.identification.errors import LogError, name_cause
from pteron.identification.estimators import (
    ESTIMATORS,
    Essential,
    Estimate,
    essential_parameters,
    weighted_least_squares,
)
from pteron.identification.faults.assumptions import find_contradiction, hidden_orders
from pteron.identification.faults.fault import is_half
from pteron.identification.faults.log_faults import delay_fault
from pteron.identification.fit_rounds import FitRound, FittedValues, fit_in_rounds
from pteron.identification.fit_task import STEPS, FitTask, Logs, logs_in_newtons, read_task
from pteron.identification.fitted_bodies import FittedBodies, fit_real_bodies
from pteron.identification.fitting import METHODS, append_findings
from pteron.identification.model import Terms
from pteron.identification.observation import Observations
from pteron.identification.plausibility import (
    common_factor,
    excess_residual_cause,
    friction_below_zero,
    plausibility_warnings,
)
from pteron.identification.prediction import Prediction, predict
from pteron.identification.recordings import read_recording
from pteron.identification.result import Identification
from pteron.identification.signals import Processing, preprocessing_for_log
from pteron.identification.verdict import verdict_of, with_bodies, with_hidden_first
from pteron.legs import Drive
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.progress import Progress, Steps
from pteron.reduction.sharing import Sharing
from pteron.verdict import Verdict

_OF_ASSUMPTIONS = ("no pose", "singular", "too little motion")
"""Reasons for which a log is refused that a wrong assumption of the file may have."""


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
    progress: Progress | None = None,
) -> Identification:
    """Identify a machine from recorded motions.

    Positions are smoothed and differentiated, poses follow by direct kinematics, the observations
    F = W beta are filtered and solved, real bodies are found that have these base parameters, and
    the result is judged on motions that were held out.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine as it is drawn: its geometry is used, and its inertial parameters start the
        search for real bodies.
    logs : Log, LogFile or a sequence of them
        The logs to fit.
    held_out : Log, LogFile or a sequence of them
        The logs to judge by; by default the last 30 % of each fitted log.
    terms : Terms, optional
        Friction, offsets and other terms beside the base parameters.
    shared : bool or groups of legs
        Whether legs share one parameter set; see `pteron.base_parameters`.
    estimator : str or callable
        One of `METHODS`: ordinary, weighted (the default), huber, total, instrumental, likelihood;
        or a function from observations to an estimate, such as
        `functools.partial(huber, threshold=2.0)`.
    processing : Processing, optional
        Choices about derivatives and filters; by default the data decide.
    cad : Manipulator, name or path, "robot" or None
        The machine that real bodies are to be nearest to.
    bounds : Bounds, optional
        Limits that the bodies are known to keep.
    progress : callable, optional
        Takes the share of the work that is done, a `Share` with the name of its step.

    Raises
    ------
    LogError
        If a log does not fit the machine or its motion does not show the parameters, if forces have
        their sign flipped or columns are swapped; the message says what was found.
    ModelError
        If the estimator is not known, or the bounds contradict each other.
    """
    robot = as_manipulator(robot)
    try:
        drawn = robot if cad == "robot" else None if cad is None else as_manipulator(cad)
        if isinstance(estimator, str) and estimator not in METHODS:
            raise ModelError(f"estimator: {estimator!r} is not one of {', '.join(METHODS)}")
        task = read_task(
            robot,
            logs,
            held_out,
            terms=terms,
            shared=shared,
            estimator=estimator,
            processing=processing or Processing(),
            steps=Steps(progress, STEPS),
        )
        identification = _judge_fit(task, fit_in_rounds(task), drawn, bounds)
        task.steps.end()
        return identification
    except (DataError, ModelError) as error:
        # No pose, or values that are no machine's: an assumption of its file may be wrong.
        because = _refusal_cause(robot, logs, processing or Processing(), error)
        name_cause(error, [because] if because else [])
        raise


def _refusal_cause(
    robot: Manipulator, logs: Logs, processing: Processing, error: DataError | ModelError
) -> str:
    """Return the wrong assumption of the machine's file that makes a log impossible; else ""."""
    of_log = isinstance(error, LogError) and error.reason in _OF_ASSUMPTIONS
    of_poses = isinstance(error, ModelError) and "poses" in str(error)
    if not (of_log or of_poses):
        return ""
    try:
        log = read_recording(logs_in_newtons(logs, robot)[0]).head()
        start = (0.0,) * robot.freedom if of_poses else None
        how = preprocessing_for_log(robot, log, processing, start=start)
        reflected = np.array([(leg.drive or Drive()).inertia for leg in robot.legs])
        assumption = find_contradiction(robot, log, how, reflected)
    except PteronError:
        return ""
    return assumption.message.rstrip(".") if assumption else ""


def _judge_fit(
    task: FitTask, last: FitRound, drawn: Manipulator | None, bounds: Bounds | None
) -> Identification:
    """Return the identification by the last round of a fit, with real bodies and a verdict."""
    motions, fit, equations = task.motions, last.fit, last.fit.equations
    model, unknowns = equations.model, equations.unknowns
    half = is_half(unknowns.delay, unknowns.delay_deviation, 1.0 / motions.fit[0].head().rate)
    by_default = last.fits_delay and task.processing.delay is None
    if by_default and not half:
        delay = delay_fault(unknowns.delay, unknowns.delay_deviation)
        last = replace(last, log_faults=(*last.log_faults, delay))
    fitted = _predict_fitted(task, fit)
    task.steps.report("Finding real bodies")
    essential = _fit_essential(task, fit)
    with append_findings(motions.recordings):
        bodies = fit_real_bodies(fit, drawn, bounds)
    factor = 1.0
    if last.trusted:
        factor = common_factor(model, fit.estimate, fit.known, drawn, equations.observations)
    verdict = _judge_round(task, last, bodies, factor)
    advice = _advice(last, essential, bodies, drawn, factor)
    return Identification(
        robot=task.robot,
        model=model,
        estimate=fit.estimate,
        essential=essential,
        consistency=bodies.consistency,
        consistency_share=bodies.residual_share,
        fitted=fitted,
        held_out=last.held_out,
        preprocessing=equations.preprocessing,
        fault_isolation=replace(last.faults, log=last.log_faults, factor=factor),
        verdict=replace(verdict, next_steps=(*verdict.next_steps, *advice)),
        unseen=fit.drawn_values.names,
        findings=motions.findings,
        notes=(
            *notes_on_fit(model, fit.estimate, task.known_rotors),
            *notes_on_unknowns(unknowns, model, default=by_default, half=half),
            *bodies.notes,
        ),
        rotors=task.rotors,
        unknowns=unknowns,
    )


def _predict_fitted(task: FitTask, fit: FittedValues) -> tuple[Prediction, ...]:
    """Return the predictions of the beginnings of the recordings that were fitted."""
    model, preprocessing = fit.equations.model, fit.equations.preprocessing
    recordings = task.with_progress(task.motions.fit, "Predicting")
    return tuple(
        predict(model, fit.estimate.values, log.first_rows(), how)
        for log, how in zip(recordings, preprocessing, strict=True)
    )


def _fit_essential(task: FitTask, fit: FittedValues) -> Essential:
    """Return the essential values, fitted without the others; weighted for unknown estimators."""
    estimator = task.estimator
    if isinstance(estimator, str):
        estimator = ESTIMATORS.get(estimator, weighted_least_squares)
    return essential_parameters(fit.equations.observations, fit.estimate, estimator)


def _judge_round(task: FitTask, last: FitRound, bodies: FittedBodies, factor: float) -> Verdict:
    """Return the verdict on a fit, without advice on its motion."""
    fit, equations = last.fit, last.fit.equations
    model, preprocessing = equations.model, equations.preprocessing
    pushed = friction_below_zero(model, equations.observations, fit.estimate)
    options = {
        "--joints each": model.terms.passive == "each",
        "--estimator huber": task.estimator == "huber",
    }
    verdict = verdict_of(
        last.held_out,
        last.faults,
        repeats=not task.motions.separate,
        log=last.log_faults,
        factor=factor,
        hidden_orders=hidden_orders(task.robot, task.motions.fit[0].head(), preprocessing[0]),
        followed=frozenset(name for name, chosen in options.items() if chosen),
        residual_cause=excess_residual_cause(fit.estimate, preprocessing),
    )
    verdict = replace(verdict, reasons=(*pushed, *verdict.reasons))
    return with_hidden_first(with_bodies(verdict, bodies.consistency, bodies.force_share))


def _advice(
    last: FitRound,
    essential: Essential,
    bodies: FittedBodies,
    drawn: Manipulator | None,
    factor: float,
) -> list[str]:
    """Return advice on hidden, weak and implausible values."""
    fit, model = last.fit, last.fit.equations.model
    advice = plausibility_warnings(
        model, fit.estimate, fit.known, bodies.consistency, drawn, factor
    )
    if essential.dropped:
        advice[:0] = advice_on_weak_values(model, list(essential.dropped))
    if fit.drawn_values.names:
        clean = last.trusted and not last.faults.faults and not last.is_distorted
        advice[:0] = advice_on_hidden_values(model.base, fit.drawn_values.names, clean=clean)
    return advice
