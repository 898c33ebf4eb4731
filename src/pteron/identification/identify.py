"""`identify`: from logs to identified parameters, a model of real bodies, and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from pteron.errors import DataError, ModelError, PteronError
from pteron.identification.conditional_values import conditional_shift
from pteron.identification.consistency import Bounds, Consistency, MissingSolver, consistent_model
from pteron.identification.drawn_values import DrawnValues
from pteron.identification.errors import LogError
from pteron.identification.estimators import (
    ESTIMATORS,
    Estimate,
    essential_parameters,
    weighted,
)
from pteron.identification.faults import delay_of, isolate_faults
from pteron.identification.faults.assumptions import contradicted, hidden_orders
from pteron.identification.faults.fault import is_half, of_held_forces
from pteron.identification.faults.log_faults import log_faults, lost_share, of_delay
from pteron.identification.fitting import (
    METHODS,
    balanced,
    check_columns,
    check_motion,
    check_payload,
    check_recordings,
    estimated,
    findings_told,
    fit_observations,
    in_newtons,
    preprocessing_for,
)
from pteron.identification.logs import Log, LogFile
from pteron.identification.model import Model, Terms, identification_model
from pteron.identification.observation import LinearModel, Observations
from pteron.identification.plausibility import (
    common_factor,
    friction_below_zero,
    left_over,
    plausibility_warnings,
    unphysical,
)
from pteron.identification.prediction import predict
from pteron.identification.recordings import Recording, divided, recording
from pteron.identification.result import Identification, reflected_inertia
from pteron.identification.signals import Processing, preprocessing_of
from pteron.identification.unknowns import Unknowns, searched_speeds, settled
from pteron.identification.verdict import judged, verdict_of, with_bodies, with_hidden_first
from pteron.kernels import Array
from pteron.legs import Drive
from pteron.manipulator import Manipulator, RobotLike, as_manipulator, parameter_data, parameters
from pteron.reduction import BaseParameters, base_parameters
from pteron.reduction.sharing import Sharing

Logs = Log | LogFile | Sequence[Log | LogFile]

_SLOWLY = (
    "It shows where joints move slowly: pteron excite ROBOT --stribeck --out motion.csv writes "
    "motion-slow.csv too; record it, and give its log with the others."
)

_OF_ASSUMPTIONS = ("no pose", "singular", "too little motion")
"""Reasons for which a log is refused that a wrong assumption of the file may have."""

_SINGULAR = 1e-12
"""Least eigenvalue of a correlation matrix, over its greatest: below it rounding makes them."""

_ALIKE = 1e-3
"""Difference of the legs' parameters, relative, that is rounding of a drawing's numbers."""

Stage = Callable[[str, int, int], None]
"""A callback of progress: it gets the step, the number of its rows done, and of all its rows."""


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
        Called with the step, the number of its rows done, and of all its rows.

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
        return _identified(
            robot, logs, held_out, terms, shared, estimator, processing, cad, bounds, progress
        )
    except (DataError, ModelError) as error:
        # No pose, or values that are no machine's: an assumption of its file may be wrong.
        because = _refusal_cause(robot, logs, processing or Processing(), error)
        _name_cause(error, [because] if because else [])
        raise


def _name_cause(error: DataError | ModelError, causes: Sequence[str]) -> None:
    """Put the first of causes at the beginning of an error's message, if there is one."""
    for cause in causes[:1]:
        place = f"{error.place}: " if isinstance(error, LogError) else ""
        error.args = (f"{place}{cause.rstrip('.')} ({str(error).removeprefix(place)})",)


def _determined(
    method: Callable[[Observations], Estimate], observations: Observations, error: LogError
) -> Estimate:
    """Return a fit of a log that does not determine all values by itself, or raise its error."""
    if error.reason != "too little motion":
        raise error
    try:
        return method(observations)
    except LogError:
        raise error from None


def _refusal_cause(
    robot: Manipulator, logs: Logs, wanted: Processing, error: DataError | ModelError
) -> str:
    """Return the assumption of a machine's file that makes a log impossible; empty if none does."""
    of_log = isinstance(error, LogError) and error.reason in _OF_ASSUMPTIONS
    of_poses = isinstance(error, ModelError) and "poses" in str(error)
    if not (of_log or of_poses):
        return ""
    try:
        log = recording(_sequence(logs, robot)[0]).head()
        start = (0.0,) * robot.freedom if of_poses else None
        how = preprocessing_of(robot, log, wanted, start=start)
        reflected = np.array([(leg.drive or Drive()).inertia for leg in robot.legs])
        assumption = contradicted(robot, log, how, reflected)
    except PteronError:
        return ""
    return assumption.message.rstrip(".") if assumption else ""


def _identified(
    robot: Manipulator,
    logs: Logs,
    held_out: Logs,
    terms: Terms | None,
    shared: Sharing,
    estimator: str | Callable[[Observations], Estimate],
    processing: Processing | None,
    cad: RobotLike | Literal["robot"] | None,
    bounds: Bounds | None,
    progress: Stage | None,
) -> Identification:
    """Return the identification; see `identify`."""
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
    check_recordings(robot, whole, others, wanted)
    n, raw = robot.joint_count, _raw_logs(logs)
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
    preprocessing = tuple(preprocessing_for(robot, one, wanted) for one in fit)

    def observe(columns: LinearModel, delay: float | None = None) -> Observations:
        late = [how if delay is None else replace(how, delay=delay) for how in preprocessing]
        told = zip(_told(fit, report, "Filtering"), late, strict=True)
        return balanced([fit_observations(columns, one, how) for one, how in told])

    found, more = Unknowns(), np.zeros(())
    if model.terms.stribeck == "auto":
        usual = np.max([how.usual for how in preprocessing], axis=0)
        found = Unknowns(searched_speeds(model, observe, usual))
        model = model.falling(np.asarray(found.speeds))
    observations = observe(model)
    used, late, given = wanted, wanted.delay == "auto", wanted.delay
    while True:
        known = model.known_values(reflected_inertia(rotors))
        with findings_told(whole):
            if late or found.speeds is not None:
                first = weighted(observations)
                begin = delay_of(model, first, fit, preprocessing) if late else float(given or 0)
                model, observations, found, more = settled(
                    model, observe, replace(found, delay=begin), first.values, late=late
                )
                used = replace(wanted, delay=found.delay)
                preprocessing = tuple(replace(how, delay=found.delay) for how in preprocessing)
            method = partial(estimated, estimator, model, fit, preprocessing)
            try:
                bare = method(observations)
            except LogError as error:
                # The log does not determine all values: with those of the drawing it may.
                noise = np.mean([how.force_noise for how in preprocessing], axis=0)
                drawn_values = DrawnValues.of_all(model, known)
                observations = drawn_values.rows_beside(observations, noise)
                estimate = bare = _determined(method, observations, error)
                drawn_values = drawn_values.told_of(estimate)
            else:
                bare = replace(bare, covariance=bare.covariance + more)
                drawn_values = DrawnValues.of(model, bare, known)
                estimate = drawn_values.added_to(bare, observations)

        # Judge by held-out data, which show exchanged columns
        modes = [None] * len(check) if others else [how.start for how in preprocessing]
        held = [
            judged(model, estimate.values, one, preprocessing_for(robot, one, used, start))
            for one, start in zip(_told(check, report, "Checking"), modes, strict=True)
        ]
        trusted = verdict_of(held, repeats=not others).grade == "trustworthy"
        heads = [one.head() for one in fit]
        lost = [lost_share(one) for one in raw]
        of_log = log_faults(heads, preprocessing, lost, fits=trusted)
        distorted = any(one.distorts for one in of_log)
        with findings_told(whole):
            if not trusted or unphysical(model, observations, estimate):
                reflected = np.array([j * r**2 for j, r in rotors or [(0.0, 1.0)] * n])
                assumption = contradicted(robot, fit[0].head(), preprocessing[0], reflected)
                if assumption is not None:
                    raise fit[0].log.fault("contradicted", assumption.message.rstrip("."))
                check_columns(model, fit[0], preprocessing[0], decisive=distorted)
            isolate = partial(
                isolate_faults, model, estimate, fit, preprocessing, reflected_inertia(rotors)
            )
            try:
                check_motion(model, bare, preprocessing, fit[0])
            except LogError as error:
                if left_over(bare, preprocessing):
                    _name_cause(error, isolate(drawn=drawn_values).causes)
                raise
        report("Looking for faults", 0, 0)
        faults = isolate(drawn=drawn_values)
        if faults.matters and not distorted:
            of_log = log_faults(heads, preprocessing, lost, fits=trusted, doubtful=True)
            distorted = any(one.distorts for one in of_log)
        if late or given is not None or not faults.late:
            break
        # A delay changes values: fit again with it.
        late = True
    step = 1.0 / heads[0].rate
    half = is_half(found.delay, found.delay_deviation, step)
    if late and given is None and not half:
        of_log = (*of_log, of_delay(found.delay, found.delay_deviation))
    fitted = tuple(
        predict(model, estimate.values, one.beginning(), how)
        for one, how in zip(_told(fit, report, "Predicting"), preprocessing, strict=True)
    )

    # Find what the data show by themselves, and real bodies
    report("Finding real bodies", 0, 0)
    again = ESTIMATORS.get(estimator, weighted) if isinstance(estimator, str) else estimator
    essential = essential_parameters(observations, estimate, again)
    with findings_told(whole):
        consistency, share, off, missing = _real_bodies(
            model, estimate, known, observations, drawn, bounds
        )
    pushed = friction_below_zero(model, observations, estimate)
    factor = common_factor(model, estimate, known, drawn, observations) if trusted else 1.0
    verdict = verdict_of(
        held,
        faults,
        repeats=not others,
        log=of_log,
        factor=factor,
        hidden_orders=hidden_orders(robot, heads[0], preprocessing[0]),
        followed=_followed(model.terms, estimator),
        left=left_over(estimate, preprocessing),
    )
    verdict = with_bodies(replace(verdict, reasons=(*pushed, *verdict.reasons)), consistency, off)
    verdict = with_hidden_first(verdict)
    advice = plausibility_warnings(model, estimate, known, consistency, drawn, factor)
    if essential.dropped:
        advice[:0] = _more_motion(model, list(essential.dropped))
    if drawn_values.names:
        clean = trusted and not faults.faults and not distorted
        advice[:0] = _what_shows_more(base, drawn_values.names, clean=clean)
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
        fault_isolation=replace(faults, log=of_log, factor=factor),
        verdict=replace(verdict, next_steps=(*verdict.next_steps, *advice)),
        unseen=drawn_values.names,
        findings=tuple(f for one in (*whole, *others) for f in one.findings),
        notes=(
            *_notes(model, estimate, reflected_inertia(rotors)),
            *_unknowns_notes(found, model, default=late and given is None, half=half),
            *missing,
        ),
        rotors=rotors,
        unknowns=found,
    )


def _sequence(logs: Logs, robot: Manipulator) -> list[Log | LogFile]:
    """Return the logs, with the names of the machine's joints where they have none, in newtons."""
    symbols = tuple(leg.joint for leg in robot.legs)
    named = [
        replace(one, symbols=symbols) if isinstance(one, Log) and one.symbols is None else one
        for one in ([logs] if isinstance(logs, Log | LogFile) else logs)
    ]
    return [in_newtons(one, robot) for one in named]


def _raw_logs(logs: Logs) -> list[Log]:
    """Return the logs that are in memory, or the beginning of their files, as they were given."""
    several = [logs] if isinstance(logs, Log | LogFile) else logs
    return [one if isinstance(one, Log) else next(iter(one.pieces())) for one in several]


def _followed(terms: Terms, estimator: str | Callable[[Observations], Estimate]) -> frozenset[str]:
    """Return the options whose advice is followed already."""
    options = {"--joints each": terms.passive == "each", "--estimator huber": estimator == "huber"}
    return frozenset(name for name, followed in options.items() if followed)


def _reader(report: Stage, task: str) -> Callable[[int], None]:
    done = 0

    def tell(rows: int) -> None:
        nonlocal done
        done += rows
        report(task, done, done)

    return tell


def _told(recordings: Sequence[Recording], report: Stage, task: str) -> list[Recording]:
    """Return recordings that report how many of their rows are read in a step."""
    return [replace(one, tell=_reader(report, task)) for one in recordings]


def _rotors(robot: Manipulator, fit: Sequence[Recording]) -> tuple[tuple[float, float], ...] | None:
    """Return inertia and ratio of each joint's motor, by the log or else by the machine's file."""
    description = fit[0].head().description
    if description.rotor_inertia is not None and description.ratio is not None:
        return tuple(zip(description.rotor_inertia, description.ratio, strict=True))
    drives = [leg.drive for leg in robot.legs]
    if not any(drive and drive.rotor_inertia for drive in drives):
        return None
    return tuple((d.rotor_inertia, d.gear) for d in (drive or Drive() for drive in drives))


def _what_shows_more(base: BaseParameters, hidden: Sequence[str], *, clean: bool) -> list[str]:
    """Return advice that shows values which a motion leaves open: shared legs, or more motion.

    Fewer values leave less room for a fault: legs are to be shared in a log that is `clean`.
    """
    robot, advice = base.robot, []
    if clean and not any(len(p.legs) > 1 for p in base.parameters) and _alike(robot):
        advice.append(
            "The legs are drawn alike: --shared identifies one set of parameters for all of them, "
            "which the same motion shows better."
        )
    return [
        *advice,
        f"Not shown by this motion and left near the drawing: {', '.join(hidden)}. pteron excite "
        "ROBOT --out motion.csv writes a motion that shows more; faster still with --speed and "
        "--acceleration.",
    ]


def _alike(robot: Manipulator) -> bool:
    """Say whether all legs have the same kind and the same inertial parameters as drawn."""
    groups: dict[tuple[str, str], list[float]] = {}
    for parameter, value in zip(parameter_data(robot), parameters(robot).tolist(), strict=True):
        if parameter.legs:
            groups.setdefault((parameter.kind, parameter.body), []).append(value)
    legs = len(robot.legs)
    return all(
        len(values) == legs and np.ptp(values) <= _ALIKE * np.max(np.abs(values))
        for values in groups.values()
    )


def _more_motion(model: Model, weak: Sequence[str]) -> list[str]:
    """Return advice on motions that show more of weak values: slow ones for Stribeck's friction."""
    kinds = dict(zip(model.names, model.kinds, strict=True))
    falls = [name for name in weak if kinds[name] == "stribeck"]
    others = [name for name in weak if name not in falls]
    advice = []
    if others:
        advice.append(
            f"Weak with this motion: {', '.join(others)}. pteron excite ROBOT --out motion.csv "
            "writes a motion that shows more of them; the faster (--speed, --acceleration) and "
            "longer (--periods), the more."
        )
    if falls:
        advice.append(f"Weak with this motion: {', '.join(falls)}. {_SLOWLY}")
    return advice


def _unknowns_notes(found: Unknowns, model: Model, *, default: bool, half: bool) -> list[str]:
    """Return notes on the delay and the speeds of Stribeck's friction that were found.

    `default` says that the delay was corrected by default, which the faults of the log tell but for
    `half` a sample: that is no fault.
    """
    notes = []
    if default and half:
        notes.append(f"{of_held_forces(found.delay)}; that is taken out (--delay 0 leaves it in).")
    elif found.delay_deviation and not default:
        notes.append(
            f"The forces are {1e3 * found.delay:.3g} ms (+- {2e3 * found.delay_deviation:.1g}) "
            "late for the positions; that is taken out."
        )
    if found.speeds is not None:
        low, high = found.speed_intervals()
        joints = [leg.joint for leg in model.robot.legs]
        seen = np.isfinite(found.speeds)
        parts = [
            f"{found.speeds[i]:.3g} ({low[i]:.3g} to {high[i]:.3g}) {joint.unit}/s"
            for i, joint in enumerate(joints)
            if seen[i]
        ]
        if parts:
            notes.append(f"Friction falls with these speeds (95 %): {', '.join(parts)}.")
        hidden = [name for name, one in zip(model.robot.force_names, seen, strict=True) if not one]
        if hidden:
            notes.append(f"Friction is not seen to fall at {', '.join(hidden)}. {_SLOWLY}")
    return notes


def _real_bodies(
    model: Model,
    estimate: Estimate,
    known: Array,
    observations: Observations,
    cad: Manipulator | None,
    bounds: Bounds | None,
) -> tuple[Consistency | None, float, float, tuple[str, ...]]:
    """Return real bodies or None, two errors of their forces, and why there are no bodies.

    The errors are relative to the residuals, and in percent of the forces.
    """
    rank = model.base.rank
    values = (estimate.values - known)[:rank]
    covariance = _positive(estimate.covariance[:rank, :rank])
    try:
        found = consistent_model(
            model.robot, model.base, values, covariance, cad=cad, bounds=bounds
        )
    except MissingSolver as error:
        return None, float("nan"), float("nan"), (f"No model of real bodies: {error}",)
    except ModelError as error:
        # Values too far from those of real bodies for the solver are no reason to say nothing; what
        # a user asks of bodies is.
        if bounds is not None:
            raise
        return None, float("nan"), float("nan"), (f"No model of real bodies: {error}",)
    # Friction and offsets follow, as in the model file.
    shift = conditional_shift(estimate.covariance, range(rank), found.base_values - values)
    moved = np.sqrt(((observations.matrix @ shift) ** 2).mean())
    left = np.sqrt((estimate.residuals**2).mean())
    size, tiny = np.sqrt((observations.forces**2).mean()), np.finfo(float).tiny
    return found, float(moved / max(left, tiny)), float(100.0 * moved / max(size, tiny)), ()


def _positive(covariance: Array) -> Array:
    """Return a covariance (p, p) without the negative eigenvalues that rounding gives it.

    Without noise many values are known alike, to rounding.
    """
    size = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    values, ways = np.linalg.eigh(covariance / np.outer(size, size))
    least = _SINGULAR * values[-1]
    if values[0] >= least:
        return covariance
    lifted = (ways * np.maximum(values, least)) @ ways.T
    return np.asarray(0.5 * (lifted + lifted.T) * np.outer(size, size))


def _notes(model: Model, estimate: Estimate, rotors: dict[str, float]) -> list[str]:
    """Return notes on convergence, rotors and terms that join others."""
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
