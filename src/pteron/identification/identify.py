"""`identify`: from logs to parameters, a model of real bodies, and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from pteron.errors import DataError, ModelError
from pteron.identification.consistency import Bounds, Consistency, MissingSolver, consistent_model
from pteron.identification.diagnosis import has_negative_inertia, unseen
from pteron.identification.doubts import doubts, left_over
from pteron.identification.equations import Equations, stacked
from pteron.identification.estimators import (
    ESTIMATORS,
    Essential,
    Estimate,
    essential_parameters,
    weighted,
)
from pteron.identification.fitting import (
    METHODS,
    check_columns,
    check_payload,
    check_recordings,
    estimated,
    fit_equations,
    treatment_for,
)
from pteron.identification.logs import Log, LogFile
from pteron.identification.model import Model, Terms, identification_model
from pteron.identification.prediction import predict
from pteron.identification.recordings import Recording, divided, recording
from pteron.identification.result import Identification
from pteron.identification.signals import Processing
from pteron.identification.verdict import verdict_of
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.reduction import base_parameters
from pteron.reduction.sharing import Sharing

__all__ = ["identify"]

Stage = Callable[[str, int, int], None]
"""Told what is being done, how many rows of it are done, and how many there are."""


def identify(
    robot: Manipulator,
    logs: Log | LogFile | Sequence[Log | LogFile],
    *,
    held_out: Log | LogFile | Sequence[Log | LogFile] = (),
    terms: Terms | None = None,
    shared: Sharing = False,
    estimator: str = "weighted",
    processing: Processing | None = None,
    cad: Manipulator | Literal["robot"] | None = "robot",
    bounds: Bounds | None = None,
    progress: Stage | None = None,
) -> Identification:
    """Identify a machine from recorded motions.

    Positions are smoothed and differentiated, poses follow by direct kinematics, the equations
    F = W beta are filtered and solved, real bodies are found that have these base parameters, and
    the result is judged on motions that were held out.

    Parameters
    ----------
    robot : Manipulator
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
    estimator : str
        One of `METHODS`: ordinary, weighted (the default), huber, total, likelihood.
    processing : Processing, optional
        How positions are differentiated and filtered; by default the data decide.
    cad : Manipulator, "robot" or None
        What real bodies are to be nearest to.
    bounds : Bounds, optional
        What is known about the bodies.
    progress : callable, optional
        Told what is being done, how many rows of it are done and how many there are.

    Returns
    -------
    Identification

    Raises
    ------
    DataError
        If a log does not fit the machine or its motion does not show the parameters, if forces have
        their sign flipped or columns are swapped; the message says what was found.
    ModelError
        If the estimator is not known, or the bounds contradict each other.
    """
    if estimator not in METHODS:
        raise ModelError(f"estimator: {estimator!r} is not one of {', '.join(METHODS)}")
    report = progress or (lambda task, done, total: None)
    read = _reader(report, "Reading")
    whole = [recording(log, read) for log in _sequence(logs)]
    others = [recording(log, read) for log in _sequence(held_out)]
    wanted = processing or Processing()
    check_recordings(whole, others, wanted)
    fit, check = list(whole), others
    if not others:
        periods = [wanted.period or one.head().description.period for one in whole]
        pairs = [divided(one, period) for one, period in zip(whole, periods, strict=True)]
        fit, check = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    base = base_parameters(robot, shared=shared)
    rotors = _reflected(fit)
    model = identification_model(
        robot, replace(terms or Terms(), rotors=True) if rotors else terms, base=base
    )
    if model.terms.payload:
        check_payload(fit)
    treatments = [treatment_for(robot, one, wanted) for one in fit]
    parts = [
        fit_equations(model, one, treatment, _reader(report, "Filtering"))
        for one, treatment in zip(fit, treatments, strict=True)
    ]
    equations = stacked(parts)
    try:
        estimate = estimated(estimator, model, fit, treatments, equations)
    except DataError as error:
        raise DataError(f"{error}{_noticed(whole)}") from None
    hidden, too_many = unseen(model, estimate.deviations)
    held = [
        predict(
            model,
            estimate.values,
            one,
            treatment_for(robot, one, wanted),
            _reader(report, "Checking"),
        )
        for one in check
    ]
    # What was held out betrays columns that are not what they are called.
    verdict = verdict_of(held, repeats=not others)
    if verdict.grade != "trustworthy" or has_negative_inertia(model, estimate.values):
        check_columns(model, fit[0], treatments[0])
    if too_many:
        names = ", ".join(hidden) if len(hidden) < base.rank else "all"
        cause = left_over(estimate, treatments)
        raise DataError(
            f"{fit[0].source}: {cause or 'too little motion'}: {len(hidden)} of {base.rank} base "
            f"parameters cannot be seen ({names}), their standard deviations are larger than their "
            f"usual size; {'mend that, or ' if cause else ''}move faster and along all "
            f"coordinates, as pteron excite proposes{_noticed(whole)}"
        )
    fitted = tuple(
        predict(model, estimate.values, one.beginning(), treatment, _reader(report, "Predicting"))
        for one, treatment in zip(fit, treatments, strict=True)
    )
    essential = essential_parameters(equations, estimate, ESTIMATORS.get(estimator, weighted))
    notes: list[str] = []
    known = np.zeros(len(model.names))
    for name, mass in rotors.items():
        known += model.share_of(name, mass)
        notes.append(f"{name} = {mass:.6g} kg is known, and no part of the real bodies.")
    consistency, share = _real_bodies(model, estimate, known, equations, cad, bounds, notes)
    for name, shares in model.joins.items():
        notes.append(f"{name} joins {' and '.join(shares) or 'nothing: it does not act'}.")
    advice = [*_advice(hidden, essential), *doubts(model, estimate, known, consistency, cad)]
    return Identification(
        robot=robot,
        model=model,
        estimate=estimate,
        essential=essential,
        consistency=consistency,
        consistency_share=share,
        fitted=fitted,
        held_out=tuple(held),
        treatments=tuple(treatments),
        verdict=replace(verdict, next_steps=(*verdict.next_steps, *advice)),
        unseen=hidden,
        findings=tuple(f for one in (*whole, *others) for f in one.findings),
        notes=tuple(notes),
    )


def _sequence(logs: Log | LogFile | Sequence[Log | LogFile]) -> list[Log | LogFile]:
    return [logs] if isinstance(logs, Log | LogFile) else list(logs)


def _noticed(whole: Sequence[Recording]) -> str:
    """Return what was noticed in the logs, to stand behind an error that it may explain."""
    findings = [finding.message for one in whole for finding in one.findings]
    return f" (noticed before: {'; '.join(findings[:3])})" if findings else ""


def _reader(report: Stage, task: str) -> Callable[[int], None]:
    done = 0

    def tell(rows: int) -> None:
        nonlocal done
        done += rows
        report(task, done, done)

    return tell


def _reflected(fit: Sequence[Recording]) -> dict[str, float]:
    """Return what the rotors of known drives weigh on the sliders, J r^2 in kg, by name."""
    description = fit[0].head().description
    if description.rotor_inertia is None or description.ratio is None:
        return {}
    pairs = zip(description.rotor_inertia, description.ratio, strict=True)
    return {f"J_m{i}": inertia * ratio**2 for i, (inertia, ratio) in enumerate(pairs, start=1)}


def _real_bodies(
    model: Model,
    estimate: Estimate,
    known: Array,
    equations: Equations,
    cad: Manipulator | Literal["robot"] | None,
    bounds: Bounds | None,
    notes: list[str],
) -> tuple[Consistency | None, float]:
    base = model.base
    values = (estimate.values - known)[: base.rank]
    covariance = estimate.covariance[: base.rank, : base.rank]
    try:
        found = consistent_model(model.robot, base, values, covariance, cad=cad, bounds=bounds)
    except MissingSolver as error:
        notes.append(f"No model of real bodies: {error}")
        return None, float("nan")
    shift = np.zeros(len(estimate.values))
    shift[: base.rank] = found.base_values - values
    moved = np.sqrt(((equations.matrix @ shift) ** 2).mean())
    left = np.sqrt((estimate.residuals**2).mean())
    return found, float(moved / max(left, np.finfo(float).tiny))


def _advice(hidden: tuple[str, ...], essential: Essential) -> tuple[str, ...]:
    if not hidden and not essential.dropped:
        return ()
    weak = ", ".join(dict.fromkeys((*hidden, *essential.dropped)))
    return (
        f"Weak with this motion: {weak}. A motion from pteron excite, faster or longer, would "
        "show more of them.",
    )
