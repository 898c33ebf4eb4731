"""Rounds of a fit: its equations, values, held-out predictions, and the faults that show.

A first round whose residuals show a delay of the forces is followed by one that corrects it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pteron.identification.drawn_values import DrawnValues
from pteron.identification.errors import LogError, name_cause
from pteron.identification.estimators import Estimate, weighted_least_squares
from pteron.identification.faults import FaultIsolation, delay_of, isolate_faults
from pteron.identification.faults.assumptions import find_contradiction
from pteron.identification.faults.log_faults import LogFault, log_faults, lost_share
from pteron.identification.fit_task import FitTask
from pteron.identification.fitting import (
    append_findings,
    check_columns,
    check_motion,
    choose_preprocessing,
    estimate_values,
)
from pteron.identification.model import Model
from pteron.identification.observation import Observations
from pteron.identification.plausibility import excess_residual_cause, unphysical
from pteron.identification.prediction import Prediction
from pteron.identification.signals import Preprocessing, Processing
from pteron.identification.unknowns import Unknowns, fit_nonlinear_terms, search_speeds
from pteron.identification.verdict import predict_held_out, verdict_of
from pteron.kernels import Array


@dataclass(frozen=True)
class FitEquations:
    """The equations of a fit, linear in its p values.

    Attributes
    ----------
    model : Model
        The model, with the speeds of Stribeck's friction.
    observations : Observations
        Regressor and forces of the rows to fit.
    preprocessing : tuple of Preprocessing
        Preprocessing of each recording to fit.
    processing : Processing
        Choices for the preprocessing of others.
    unknowns : Unknowns
        The speeds and the delay, in which the equations are not linear.
    covariance : array, shape (p, p) or ()
        The part of the values' covariance that comes from those.
    """

    model: Model
    observations: Observations
    preprocessing: tuple[Preprocessing, ...]
    processing: Processing
    unknowns: Unknowns
    covariance: Array


@dataclass(frozen=True)
class FittedValues:
    """The values of a fit.

    Attributes
    ----------
    equations : FitEquations
        Its equations, with rows of drawn values where the log does not determine all values.
    known : array, shape (p,)
        The part of the values that known rotors make.
    without_drawing : Estimate
        The estimate by the log alone, where it determines all values.
    estimate : Estimate
        The estimate by the log, and by drawn values that it does not show.
    drawn_values : DrawnValues
        Those drawn values.
    """

    equations: FitEquations
    known: Array
    without_drawing: Estimate
    estimate: Estimate
    drawn_values: DrawnValues


@dataclass(frozen=True)
class FitRound:
    """A fit, its predictions of held-out rows, and the faults that show.

    Attributes
    ----------
    fit : FittedValues
        The values.
    held_out : tuple of Prediction
        Predictions of the rows to judge by.
    trusted : bool
        Whether the model is trustworthy by these.
    log_faults : tuple of LogFault
        Faults of the logs as such.
    faults : FaultIsolation
        Faults that the residuals show.
    fits_delay : bool
        Whether the delay of the forces was fitted.
    """

    fit: FittedValues
    held_out: tuple[Prediction, ...]
    trusted: bool
    log_faults: tuple[LogFault, ...]
    faults: FaultIsolation
    fits_delay: bool

    @property
    def is_distorted(self) -> bool:
        """Whether a fault of a log may pass for faults of the machine."""
        return _distort(self.log_faults)


def fit_in_rounds(task: FitTask) -> FitRound:
    """Return the last round of a fit: the first, or one with a delay that the first one shows."""
    delay = task.processing.delay
    first = _run_round(task, _stack_equations(task), fits_delay=delay == "auto")
    if delay is not None or not first.faults.late:
        return first
    # A delay changes values: fit again with it.
    return _run_round(task, first.fit.equations, fits_delay=True)


def _stack_equations(task: FitTask) -> FitEquations:
    """Return the equations of the rows to fit; Stribeck speeds are the best of a coarse grid."""
    robot, model, processing = task.robot, task.model, task.processing
    preprocessing = tuple(choose_preprocessing(robot, log, processing) for log in task.motions.fit)
    observe, unknowns = partial(task.observe, preprocessing), Unknowns()
    if model.terms.stribeck == "auto":
        usual = np.max([how.usual for how in preprocessing], axis=0)
        unknowns = Unknowns(search_speeds(model, observe, usual))
        model = model.with_speeds(np.asarray(unknowns.speeds))
    return FitEquations(model, observe(model), preprocessing, processing, unknowns, np.zeros(()))


def _run_round(task: FitTask, equations: FitEquations, *, fits_delay: bool) -> FitRound:
    """Return a fit with its predictions, verdict and faults."""
    motions = task.motions
    known = equations.model.known_values(task.known_rotors)
    with append_findings(motions.recordings):
        if fits_delay or equations.unknowns.speeds is not None:
            equations = _fit_unknowns(task, equations, fits_delay=fits_delay)
        fit = _fit_values(task, equations, known)

    # Judge by held-out data, which show exchanged columns
    held_out = _predict_checks(task, fit)
    trusted = verdict_of(held_out, repeats=not motions.separate).grade == "trustworthy"
    heads = [log.head() for log in motions.fit]
    lost = [lost_share(log) for log in motions.originals]
    find_log_faults = partial(log_faults, heads, fit.equations.preprocessing, lost, fits=trusted)
    of_log = find_log_faults()
    with append_findings(motions.recordings):
        _check_log(task, fit, trusted=trusted, distorted=_distort(of_log))
    task.steps.report("Looking for faults")
    faults = _isolate(task, fit)
    if faults.matters and not _distort(of_log):
        of_log = find_log_faults(doubtful=True)
    return FitRound(fit, held_out, trusted, of_log, faults, fits_delay)


def _distort(faults: tuple[LogFault, ...]) -> bool:
    """Return whether a fault of the log may pass for a fault of the machine."""
    return any(fault.distorts for fault in faults)


def _fit_unknowns(task: FitTask, equations: FitEquations, *, fits_delay: bool) -> FitEquations:
    """Return the equations with the best Stribeck speeds, and the best delay where it is fitted."""
    model, preprocessing = equations.model, equations.preprocessing
    first = weighted_least_squares(equations.observations)
    if fits_delay:
        begin = delay_of(model, first, task.motions.fit, preprocessing)
    else:
        begin = float(task.processing.delay or 0)
    model, observations, unknowns, covariance = fit_nonlinear_terms(
        model,
        partial(task.observe, preprocessing),
        replace(equations.unknowns, delay=begin),
        first.values,
        late=fits_delay,
    )
    return FitEquations(
        model,
        observations,
        tuple(replace(how, delay=unknowns.delay) for how in preprocessing),
        replace(task.processing, delay=unknowns.delay),
        unknowns,
        covariance,
    )


def _fit_values(task: FitTask, equations: FitEquations, known: Array) -> FittedValues:
    """Return the values, with those of the drawing where the log does not show them."""
    model, observations = equations.model, equations.observations
    preprocessing = equations.preprocessing
    solve = partial(estimate_values, task.estimator, model, task.motions.fit, preprocessing)
    try:
        alone = solve(observations)
    except LogError as error:
        # The log does not determine all values: with those of the drawing it may.
        noise = np.mean([how.force_noise for how in preprocessing], axis=0)
        drawn_values = DrawnValues.from_model(model, known)
        observations = drawn_values.append_drawn_values(observations, noise)
        estimate = _estimate_with_drawing(solve, observations, error)
        equations = replace(equations, observations=observations)
        return FittedValues(
            equations, known, estimate, estimate, drawn_values.name_undetermined(estimate)
        )
    alone = replace(alone, covariance=alone.covariance + equations.covariance)
    drawn_values = DrawnValues.from_estimate(model, alone, known)
    estimate = drawn_values.update_estimate(alone, observations)
    return FittedValues(equations, known, alone, estimate, drawn_values)


def _estimate_with_drawing(
    solve: Callable[[Observations], Estimate], observations: Observations, error: LogError
) -> Estimate:
    """Return the fit of a log, with drawn values where it determines too little; or raise."""
    if error.reason != "too little motion":
        raise error
    try:
        return solve(observations)
    except LogError:
        raise error from None


def _predict_checks(task: FitTask, fit: FittedValues) -> tuple[Prediction, ...]:
    """Return the predictions of held-out rows; ends of fitted logs have their assembly modes."""
    motions, equations = task.motions, fit.equations
    starts: list[tuple[float, ...] | None] = [None] * len(motions.held_out)
    if not motions.separate:
        starts = [how.start for how in equations.preprocessing]
    recordings = task.with_progress(motions.held_out, "Checking")
    return tuple(
        predict_held_out(
            equations.model,
            fit.estimate.values,
            log,
            choose_preprocessing(task.robot, log, equations.processing, start),
        )
        for log, start in zip(recordings, starts, strict=True)
    )


def _check_log(task: FitTask, fit: FittedValues, *, trusted: bool, distorted: bool) -> None:
    """Raise where a log contradicts the machine's file, in columns too, or moves too little."""
    equations, first = fit.equations, task.motions.fit[0]
    model, preprocessing = equations.model, equations.preprocessing
    if not trusted or unphysical(model, equations.observations, fit.estimate):
        rotors = task.rotors or [(0.0, 1.0)] * task.robot.joint_count
        reflected = np.array([inertia * ratio**2 for inertia, ratio in rotors])
        assumption = find_contradiction(task.robot, first.head(), preprocessing[0], reflected)
        if assumption is not None:
            raise first.log.fault("contradicted", assumption.message.rstrip("."))
        check_columns(model, first, preprocessing[0], decisive=distorted)
    try:
        check_motion(model, fit.without_drawing, preprocessing, first)
    except LogError as error:
        if excess_residual_cause(fit.without_drawing, preprocessing):
            name_cause(error, _isolate(task, fit).causes)
        raise


def _isolate(task: FitTask, fit: FittedValues) -> FaultIsolation:
    """Return the faults that a fit's residuals show."""
    return isolate_faults(
        fit.equations.model,
        fit.estimate,
        task.motions.fit,
        fit.equations.preprocessing,
        task.known_rotors,
        drawn=fit.drawn_values,
    )
