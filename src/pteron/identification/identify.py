"""`identify`: from logs to parameters, a model of real bodies, and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pteron.errors import DataError, ModelError
from pteron.identification.consistency import Bounds, Consistency, consistent_model
from pteron.identification.diagnosis import (
    column_fault,
    exchanged_sliders,
    has_negative_inertia,
    unseen,
)
from pteron.identification.equations import Equations, equations_of, stacked
from pteron.identification.estimators import (
    ESTIMATORS,
    Essential,
    Estimate,
    essential_parameters,
    weighted,
)
from pteron.identification.estimators.column_errors import column_errors
from pteron.identification.estimators.likelihood import maximum_likelihood
from pteron.identification.estimators.total import total
from pteron.identification.logs import Finding, Log, LogFile
from pteron.identification.model import Model, Terms, identification_model
from pteron.identification.prediction import Prediction, predict
from pteron.identification.recordings import Recording, divided, recording
from pteron.identification.signals import Processing, Treatment, treatment_of
from pteron.identification.verdict import Verdict, verdict_of
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.reduction import base_parameters
from pteron.reduction.sharing import Sharing

__all__ = ["METHODS", "Identification", "identify"]

METHODS = (*ESTIMATORS, "likelihood")
"""Names of the estimators that `identify` knows."""

Stage = Callable[[str, int, int], None]
"""Told what is being done, how many rows of it are done, and how many there are."""

_LOOK = 30_000
"""Rows that are tried in other orders."""


@dataclass(frozen=True)
class Identification:
    """What a log says about a machine.

    Attributes
    ----------
    robot : Manipulator
        The machine as it was drawn.
    model : Model
        What was identified: names, units and expressions of the values.
    estimate : Estimate
        The values, their standard deviations, and what was left of the forces.
    essential : Essential
        The values that the data can show, and the fit of these alone.
    consistency : Consistency or None
        Real bodies with these base parameters; None where cvxpy is not installed.
    consistency_share : float
        Root mean square of what the real bodies' forces differ from those of the fit, over that of
        its residuals.
    fitted, held_out : tuple of Prediction
        How well the values predict the recordings that were fitted, and those that were not.
    treatments : tuple of Treatment
        How the fitted recordings were treated.
    verdict : Verdict
        Whether the model can be trusted, from held-out data alone.
    unseen : tuple of str
        Base parameters that are less well known than their usual size.
    findings : tuple of Finding
        What was noticed in the logs.
    notes : tuple of str
        What else is to be known.
    """

    robot: Manipulator
    model: Model
    estimate: Estimate
    essential: Essential
    consistency: Consistency | None
    consistency_share: float
    fitted: tuple[Prediction, ...]
    held_out: tuple[Prediction, ...]
    treatments: tuple[Treatment, ...]
    verdict: Verdict
    unseen: tuple[str, ...]
    findings: tuple[Finding, ...]
    notes: tuple[str, ...] = ()

    @property
    def base_values(self) -> Array:
        """The identified base parameters (rank,)."""
        return self.estimate.values[: self.model.base.rank]

    def as_dict(self) -> dict[str, Any]:
        """Return everything but samples and residuals as plain data."""
        consistency = self.consistency
        return {
            "robot": self.robot.name,
            "verdict": self.verdict.as_dict(),
            "expressions": list(self.model.expressions),
            "left_out": list(self.model.left_out),
            "estimate": self.estimate.as_dict(),
            "essential": {
                "names": list(self.essential.names),
                "dropped": list(self.essential.dropped),
                "p_value": self.essential.p_value,
                "level": self.essential.level,
                "values": self.essential.estimate.values.tolist(),
                "standard_deviations": self.essential.estimate.deviations.tolist(),
            },
            "unseen": list(self.unseen),
            "real_bodies": None
            if consistency is None
            else {
                "feasible": consistency.feasible,
                "distance": consistency.distance,
                "p_value": consistency.p_value,
                "at_border": list(consistency.at_border),
                "cad_feasible": consistency.cad_feasible,
                "cad_violations": list(consistency.cad_violations),
                "share_of_residual": self.consistency_share,
                "parameters": consistency.parameters.tolist(),
                "summary": consistency.summary().splitlines(),
            },
            "fitted": [prediction.as_dict() for prediction in self.fitted],
            "held_out": [prediction.as_dict() for prediction in self.held_out],
            "treatments": [_plain(treatment) for treatment in self.treatments],
            "findings": [
                {"kind": f.kind, "row": f.row, "column": f.column, "message": f.message}
                for f in self.findings
            ],
            "notes": list(self.notes),
        }


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
    for one in (*whole, *others):
        _check_forces(one)
    wanted = processing or Processing()
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
    treatments = [_treatment(robot, one, wanted) for one in fit]
    parts = [
        _equations(model, one, treatment, report)
        for one, treatment in zip(fit, treatments, strict=True)
    ]
    equations = stacked(parts)
    estimate = _estimated(estimator, model, fit, treatments, equations)
    hidden, too_many = unseen(model, estimate.deviations)
    held = [
        predict(
            model, estimate.values, one, _treatment(robot, one, wanted), _reader(report, "Checking")
        )
        for one in check
    ]
    # What was held out betrays columns that are not what they are called.
    verdict = verdict_of(held, repeats=not others)
    if verdict.grade != "trustworthy" or has_negative_inertia(model, estimate.values):
        _refuse_faults(model, fit[0], treatments[0])
    if too_many:
        raise DataError(
            f"{fit[0].source}: too little motion: {len(hidden)} of {base.rank} base parameters "
            f"cannot be seen ({', '.join(hidden)}), their standard deviations are larger than "
            "their usual size; move faster and along all coordinates, as pteron excite proposes"
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
    advice = _advice(hidden, essential)
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


def _check_forces(one: Recording) -> None:
    unit = one.head().description.force_unit
    if unit != "N":
        raise DataError(
            f"{one.source}: its forces are in {unit}; declare gains (N per {unit}) in its "
            "description, or find them with identify_drive_gains"
        )


def _treatment(robot: Manipulator, one: Recording, wanted: Processing) -> Treatment:
    head = one.head()
    rows = one.rows
    period = wanted.period or head.description.period
    # What lasts less than a period is no periodic log.
    if wanted.derivatives is None and period is not None and head.duration < 0.999 * period:
        head = replace(head, description=replace(head.description, period=None))
        wanted = replace(wanted, period=None)
    if not isinstance(one.log, Log):
        rows = max(rows, 1 << 30)  # a file that is read in pieces is never fitted in one
    return treatment_of(robot, head, wanted, rows=rows)


def _equations(model: Model, one: Recording, treatment: Treatment, report: Stage) -> Equations:
    try:
        return equations_of(model, one.samples(_reader(report, "Filtering")), treatment)
    except DataError as error:
        if "no pose" not in str(error):
            raise
        head = one.head()
        swap = exchanged_sliders(model, head.part(0, min(head.rows, _LOOK)), treatment)
        if swap is None:
            raise
        raise DataError(f"{error}; or {swap.message()}: then every row has a pose") from None


def _estimated(
    name: str,
    model: Model,
    fit: Sequence[Recording],
    treatments: Sequence[Treatment],
    equations: Equations,
) -> Estimate:
    if name in ("likelihood", "total"):
        one = fit[0]
        if len(fit) > 1 or not isinstance(one.log, Log):
            raise DataError(
                f"estimator: {name} takes one log of at most some million rows; choose weighted, "
                "or give one log"
            )
        log = one.head()
        if name == "likelihood":
            return maximum_likelihood(model, log, treatments[0])
        return total(equations, column_errors(model, log, treatments[0]))
    return ESTIMATORS[name](equations)


def _refuse_faults(model: Model, one: Recording, treatment: Treatment) -> None:
    """Refuse a log whose columns, exchanged or with other signs, would be explained far better."""
    head = one.head()
    head = head.part(0, min(head.rows, _LOOK))
    fault = column_fault(model, head, treatment)
    if fault is None:
        return
    if fault.after < fault.before:
        why = f": mended so, the error of the fit falls {fault.before / fault.after:.1f} times"
    else:
        why = ": as they are, the machine would have negative inertia"
    raise DataError(
        f"{one.source}: {fault.message()}{why}; correct the columns, or declare their order and "
        "gains in the log's description"
    )


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
    except ModelError as error:
        if "pteron[consistency]" not in str(error):
            raise
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


def _plain(treatment: Treatment) -> dict[str, Any]:
    return {
        key: value.tolist() if isinstance(value, np.ndarray) else value
        for key, value in vars(treatment).items()
    }
