"""The verdict on a model, how far to trust it: by its errors on held-out data and its residuals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from pteron.identification.consistency import Consistency
from pteron.identification.faults import FaultIsolation
from pteron.identification.faults.log_faults import LogFault
from pteron.identification.model import Model
from pteron.identification.prediction import Prediction, predict
from pteron.identification.recordings import Recording
from pteron.identification.signals import Preprocessing
from pteron.kernels import Array
from pteron.verdict import Grade, Opinion, Verdict

AT_THE_FLOOR = 1.5
"""Held-out error, over the noise floor, up to which it counts as noise."""

DROWNED = 50.0
"""Held-out error, percent, beyond which the model explains nothing, whatever the noise."""

SMALL = 5.0
"""Held-out error beyond the noise, percent of a force's standard deviation, up to which a model is
trusted."""

LARGE = 15.0
"""The same error beyond which a model is not trusted."""

CYCLE = 3.0
"""Error in a pick-and-place cycle, percent of its forces, up to which a model is trusted."""

_LOWER = (0.7, 0.5)
"""Lower cut-offs that are tried too, as shares of that of the whole recording."""

FAR = 5.0
"""Distance from values of real bodies, in standard deviations, beyond which values are not
trusted."""

_SEEN = 0.5
"""Difference of the nearest real bodies' forces, percent, from which that distance counts: without
noise the standard deviations are near zero."""

_TAKEN_IN = "an error that the log does not show distorts the other values"
"""The harm of a fault that a log cannot show."""

_HIDDEN: dict[str, tuple[str, str]] = {
    "gain": (
        "These logs cannot show a common factor of all forces (gains, rated torque, gear ratio): "
        "it scales all values alike, and no known mass or inertia fixes the scale.",
        "Carry a payload of known mass in a second phase (--payload, and [payload] in the log's "
        "description): it gives the scale of the forces.",
    ),
    "clock": (
        "These logs cannot show a log's clock that runs too fast or too slow: the weight on "
        "the drives does not fix the scale of their inertia.",
        "Compare the duration of the log with another clock.",
    ),
    "scale": (
        "These logs cannot show a scale error of a few per cent in one force: it scales that "
        "drive's own values, and what they share with other drives is below the noise.",
        "Check the gain of each drive separately, or move more coordinates at once, and faster.",
    ),
    "ratio": (
        "These logs cannot show an error of 5 % in a gear ratio, lead or pulley of the joints.",
        f"Measure how far the joints move for a number of turns or counts: {_TAKEN_IN}.",
    ),
    "zero": (
        "These logs cannot show an error of 3 degrees, or 2 % of a leg's size, in a joint's zero.",
        f"Check the joints' zeros, or record a larger or faster motion: {_TAKEN_IN}.",
    ),
    "geometry": (
        "These logs cannot show errors of 1 % in lengths or points of the geometry.",
        f"Measure the geometry, or record a larger or faster motion: {_TAKEN_IN}.",
    ),
    "elasticity": (
        "These logs cannot show elastic drives (a resonance at 10 Hz).",
        f"Measure positions behind the drives, or record a faster motion: {_TAKEN_IN}.",
    ),
    "load": (
        "These logs cannot show load-dependent friction of 5 % of the load.",
        f"Record a longer motion, or forces with less noise: {_TAKEN_IN}.",
    ),
    "passive": (
        "These logs cannot show friction of 5 % of the load in the passive joints.",
        f"Record a faster or longer motion, or forces with less noise: {_TAKEN_IN}.",
    ),
    "play": (
        "Play (backlash) in the drives would not be seen: no drive's load changes its direction "
        "often enough, four times while the joint moves. While loads keep their direction, play "
        "does no harm.",
        "To see play, record a motion whose accelerations load the drives in both directions.",
    ),
}
"""Faults that a log may hide: the reason, and a remedy."""

_STEPS = (
    "Look at the residuals over time and speed: what repeats there is a missing term, such as "
    "friction in the passive joints (--joints each).",
    "Friction of joints explains little of the error: check the drive gains, the geometry and the "
    "signs of forces and joints.",
)
"""Remedies for an error beyond the noise, where friction explains some of it and where little."""

_GENERAL = ("Look at the residuals", "Friction of joints explains")
"""How advice begins that is of no use beside a cause that is named."""

_CANNOT = "These logs cannot show"
"""How sentences begin on what logs cannot show."""

_MANY = 100.0
"""Ratio from which only "more than" is printed."""


def verdict_of(
    held_out: Sequence[Prediction],
    faults: FaultIsolation | None = None,
    *,
    repeats: bool,
    log: Sequence[LogFault] = (),
    factor: float = 1.0,
    hidden_orders: str = "",
    followed: frozenset[str] = frozenset(),
    residual_cause: str = "",
) -> Verdict:
    """Return the verdict on a model.

    Parameters
    ----------
    held_out : sequence of Prediction
        Predictions of recordings that were not fitted.
    faults : FaultIsolation, optional
        The faults that the residuals of the fit show.
    repeats : bool
        Whether what was held out repeats the motion that was fitted.
    log : sequence of LogFault
        Faults of the logs as such. Where forces stay at their limit, or samples are taken at other
        times than their stamps say, the grade is "usable with care" at best.
    factor : float
        Forces of the bodies over those of the drawing; other than 1 it is "usable with care" at
        best.
    hidden_orders : str
        A sentence on orders of the legs that the logs do not show; empty without any.
    followed : frozenset of str
        Options whose advice is followed already, and not given again.
    residual_cause : str
        How far what the model leaves is above the noise, said where no cause shows.
    """
    opinion = Opinion()
    if faults is not None:
        # Beside the drawing a common factor shows, if only to some per cent.
        hidden = tuple(name for name in faults.hidden if name != "gain" or factor == 1.0)
        faults = replace(faults, log=tuple(log), factor=factor, hidden=hidden)
    if any(fault.distorts for fault in log):
        opinion.lower("usable with care")
    if factor != 1.0:
        opinion.lower("usable with care")
    opinions = [_judge_prediction(prediction) for prediction in held_out]
    if faults is not None:
        opinions.append(_judge_faults(faults))
    for part in opinions:
        opinion.lower(part.grade)
        opinion.reasons += part.reasons
        opinion.steps += part.steps
    has_causes = faults is not None and bool(faults.causes)
    if residual_cause and opinion.grade != "trustworthy" and not has_causes:
        opinion.add(f"{residual_cause[0].upper()}{residual_cause[1:]}.")
    if hidden_orders:
        opinion.add(hidden_orders)
    if repeats:
        opinion.add(
            "The held-out data repeat the motion that was fitted: they show noise and drift, but "
            "hardly how well the model predicts other motions.",
            "Record another motion, such as a pick-and-place cycle, and hold it out (--held-out): "
            "pteron excite ROBOT --out motion.csv writes one too, motion-held-out.csv.",
        )
    unwanted = followed if faults is None or not faults.causes else {*followed, *_GENERAL}
    opinion.steps = [step for step in opinion.steps if not any(name in step for name in unwanted)]
    return opinion.verdict()


def with_hidden_first(verdict: Verdict) -> Verdict:
    """Return the verdict with what its logs cannot show merged into one first reason."""
    hidden = [reason for reason in verdict.reasons if reason.startswith(_CANNOT)]
    others = [reason for reason in verdict.reasons if not reason.startswith(_CANNOT)]
    if not hidden:
        return verdict
    together = "; ".join(reason.removeprefix(_CANNOT).strip().rstrip(".") for reason in hidden)
    return replace(verdict, reasons=(f"{_CANNOT} {together}.", *others))


def with_bodies(verdict: Verdict, consistency: Consistency | None, off: float) -> Verdict:
    """Return the verdict, lowered to "not trustworthy" with the reason if no real bodies are near.

    `off` is the difference of the forces of the nearest real bodies from those of the fit, percent.
    """
    if consistency is None or consistency.metric != "covariance":
        return verdict
    if not (consistency.distance > FAR and off > _SEEN):
        return verdict
    reason = (
        f"No real bodies have these values: the nearest are {consistency.distance:.2g} standard "
        f"deviations away (up to {FAR:g} is trustworthy), and their forces differ by {off:.2g} %."
    )
    return replace(verdict, grade="not trustworthy", reasons=(reason, *verdict.reasons))


def predict_held_out(
    model: Model, beta: Array, recording: Recording, preprocessing: Preprocessing
) -> Prediction:
    """Return the prediction by a model with values (p,) of a recording that was not fitted.

    If its error is too large, lower cut-offs of the positions' filter are tried: the cut-off was
    chosen for the whole recording, whose samples at rest have less noise but do not count. No value
    is fitted to the recording, and a wrong model stays wrong at every cut-off.
    """
    prediction = predict(model, beta, recording, preprocessing)
    if preprocessing.cutoff is None or preprocessing.derivatives == "periodic":
        return prediction
    for share in _LOWER:
        if _judge_prediction(prediction).grade == "trustworthy":
            break
        lower = replace(preprocessing, cutoff=share * preprocessing.cutoff)
        other = predict(model, beta, recording, lower)
        prediction = min(prediction, other, key=lambda p: float(p.robust_nrms.max()))
    return prediction


def _grade_error(percent: float, small: float) -> Grade:
    """Return the grade of an error in percent; up to `small` it is trustworthy."""
    if percent <= small:
        return "trustworthy"
    return "usable with care" if percent <= LARGE else "not trustworthy"


def _judge_prediction(prediction: Prediction) -> Opinion:
    """Return the opinion on a prediction of held-out forces, by its error beyond the noise."""
    ratio = prediction.robust_nrms / np.maximum(prediction.floor, 1e-12)
    missed = prediction.unexplained_error
    # The worst actuator is the one farthest beyond both limits.
    worst = int(np.argmax(np.where(ratio <= AT_THE_FLOOR, 0.0, missed)))
    opinion = Opinion()
    drowned = int(np.argmax(prediction.robust_nrms))
    if not (prediction.robust_nrms <= DROWNED).all():
        opinion.add(
            f"The forces of actuator {drowned + 1} are not explained: the residual is "
            f"{prediction.robust_nrms[drowned]:.0f} % of what was measured.",
            "Look for what else acts on the forces, or move faster, so that forces exceed noise.",
            grade="not trustworthy",
        )
    elif ratio[worst] > AT_THE_FLOOR:
        opinion.grade = _grade_error(float(missed[worst]), SMALL)
    opinion.add(
        f"{prediction.source} (held out): error of the predicted forces, by actuator: "
        f"{percentages(prediction.nrms)} (NRMS); noise alone: {percentages(prediction.floor)}."
    )
    if (share := float(prediction.outliers.max())) > 0.0:
        opinion.add(
            f"{prediction.source}: up to {100.0 * share:.2g} % of a force's samples are outliers; "
            f"without them, as graded, the NRMS is {percentages(prediction.robust_nrms)}.",
            "Forces have outliers: --estimator huber gives such samples less weight.",
        )
    if opinion.grade == "trustworthy" and ratio[worst] > AT_THE_FLOOR:
        opinion.add(
            f"Beyond the noise the model misses {percentages([missed[worst]], 1)} of the force of "
            f"actuator {worst + 1}; up to {SMALL:g} % is trustworthy (the error is "
            f"{times(ratio[worst])} the noise)."
        )
    elif opinion.grade != "trustworthy":
        friction = prediction.nrms_without_friction[worst] - prediction.nrms[worst]
        opinion.add(
            f"Actuator {worst + 1} is the worst: beyond the noise the model misses "
            f"{missed[worst]:.1f} % of its force; up to {SMALL:g} % is trustworthy, above "
            f"{LARGE:g} % is not.",
            _STEPS[bool(friction < 0.1 * prediction.nrms_without_friction[worst])],
        )
    return opinion


def _judge_faults(shown: FaultIsolation) -> Opinion:
    """Return the opinion on the isolated faults, and on the errors expected in a fast cycle."""
    opinion = Opinion(reasons=list(shown.causes))
    if shown.matters:
        opinion.grade = "usable with care"
    if shown.understates:
        opinion.add("The stated errors of the values do not allow for that.")
    if not shown.tried:
        opinion.add(f"Fault isolation was not run: {shown.why_not}.", grade="usable with care")
    elif not shown.causes:
        opinion.add(f"{shown.small_faults_text}; tested: {', '.join(shown.tested)}.")
    for fault in shown.hidden:
        opinion.add(*_HIDDEN[fault])
    if np.isnan(shown.expected_error).any():
        return opinion
    worst = int(np.argmax(shown.expected_error))
    off = float(shown.expected_error[worst])
    size = percentages([off]) if off < 0.01 else f"up to {off:.2g} %"
    opinion.add(
        f"Expected error of the forces in a pick-and-place cycle or another motion as fast: {size} "
        f"(actuator {worst + 1}); up to {CYCLE:g} % is trustworthy, above {LARGE:g} % is not.",
        grade=_grade_error(off, CYCLE),
    )
    if opinion.grade != "trustworthy" and shown.uncertain[worst] > shown.spoiled[worst]:
        opinion.steps.append(
            "The motion does not determine the forces of such a cycle: record a motion from pteron "
            "excite, faster or longer."
        )
    return opinion


def percentages(percents: Iterable[float], places: int = 2) -> str:
    """Return percentages as text with `places` decimals, or that all are less than the last one.

    Examples
    --------
    >>> percentages([1.234, 0.0]), percentages([3e-10, 1e-12])
    ('1.23, 0.00 %', 'less than 0.01 %')
    """
    shown, least = list(percents), 10.0**-places
    if all(0.0 <= percent < least for percent in shown):
        return f"less than {least:g} %"
    return f"{', '.join(f'{percent:.{places}f}' for percent in shown)} %"


def times(ratio: float) -> str:
    """Return the ratio of two values as text, such as "3.1 times".

    Examples
    --------
    >>> times(3.14159), times(3.1e3)
    ('3.1 times', 'more than 100 times')
    """
    return f"more than {_MANY:g} times" if ratio > _MANY else f"{ratio:.2g} times"
