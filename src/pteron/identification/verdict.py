"""Whether an identified model can be trusted, from held-out data alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pteron.identification.prediction import Prediction

__all__ = ["Grade", "Verdict", "verdict_of"]

Grade = Literal["trustworthy", "usable with care", "not trustworthy"]

AT_THE_FLOOR = 1.5
"""Held-out error over the noise floor up to which noise is all there is."""

DROWNED = 50.0
"""Held-out error in percent beyond which nothing has been explained, whatever the noise."""

SMALL = 5.0
LARGE = 15.0
"""Percent of a force's standard deviation that the model misses beyond the noise."""


@dataclass(frozen=True)
class Verdict:
    """Whether a model can be trusted, and why.

    Attributes
    ----------
    grade : {"trustworthy", "usable with care", "not trustworthy"}
        Of its worst actuator: trustworthy where the held-out error is at most 1.5 times the noise
        floor, or what is missed beyond the noise is at most 5 % of the force; not trustworthy where
        that is more than 15 %, or where the error is more than half of the force.
    reasons : tuple of str
        What speaks for it and against it, in sentences.
    next_steps : tuple of str
        What would make it better.
    """

    grade: Grade
    reasons: tuple[str, ...]
    next_steps: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict as plain data."""
        return {
            "grade": self.grade,
            "reasons": list(self.reasons),
            "next_steps": list(self.next_steps),
        }


def verdict_of(held_out: list[Prediction], *, repeats: bool) -> Verdict:
    """Return the verdict on a model.

    Parameters
    ----------
    held_out : list of Prediction
        Of recordings that were not fitted.
    repeats : bool
        Whether they repeat the motion that was fitted.

    Returns
    -------
    Verdict
    """
    reasons: list[str] = []
    steps: list[str] = []
    grades: list[Grade] = []
    for prediction in held_out:
        ratio = prediction.nrms / np.maximum(prediction.floor, 1e-12)
        missed = prediction.unexplained
        # The worst actuator is the one farthest beyond both limits.
        worst = int(np.argmax(np.where(ratio <= AT_THE_FLOOR, 0.0, missed)))
        grade: Grade = "trustworthy"
        drowned = int(np.argmax(prediction.nrms))
        if not (prediction.nrms <= DROWNED).all():
            grades.append("not trustworthy")
            reasons.append(
                f"The forces of actuator {drowned + 1} are not explained: what is left of them is "
                f"{prediction.nrms[drowned]:.0f} % of what was measured."
            )
            steps.append("Look for what else acts on the forces, or move faster than their noise.")
        elif ratio[worst] > AT_THE_FLOOR and missed[worst] > SMALL:
            grade = "usable with care" if missed[worst] <= LARGE else "not trustworthy"
        grades.append(grade)
        errors = ", ".join(f"{value:.2f}" for value in prediction.nrms)
        floors = ", ".join(f"{value:.2f}" for value in prediction.floor)
        reasons.append(
            f"{prediction.source}: held-out NRMS of {errors} % where noise alone makes {floors} %."
        )
        if grade != "trustworthy":
            reasons.append(
                f"Actuator {worst + 1} is the worst: the model misses {missed[worst]:.1f} % of its "
                f"force beyond the noise; up to {SMALL:g} % is trusted, above {LARGE:g} % not."
            )
            friction = prediction.nrms_without_friction[worst] - prediction.nrms[worst]
            if friction < 0.1 * prediction.nrms_without_friction[worst]:
                steps.append(
                    "Friction of sliders explains little of the error: look at the drive gains, "
                    "the geometry and the signs of forces and sliders."
                )
            else:
                steps.append(
                    "Look at the residuals over time and speed: what repeats there is a missing "
                    "term, such as friction in the passive joints (--joints each)."
                )
    if repeats:
        reasons.append(
            "What was held out repeats the motion that was fitted: it tells of noise and drift, "
            "less of other motions."
        )
        steps.append("Record another motion, such as a pick-and-place cycle, and hold it out.")
    order = ("trustworthy", "usable with care", "not trustworthy")
    return Verdict(max(grades, key=order.index), tuple(reasons), tuple(dict.fromkeys(steps)))
