"""What `identify` returns: values, a verdict on them, and what was done to the data."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from pteron.identification.consistency import Consistency
from pteron.identification.estimators import Essential, Estimate
from pteron.identification.logs import Finding
from pteron.identification.model import Model
from pteron.identification.prediction import Prediction
from pteron.identification.signals import Preprocessing
from pteron.kernels import Array
from pteron.legs import Drive
from pteron.manipulator import Manipulator

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
        The grade of the worst actuator: trustworthy where the held-out error is at most 1.5 times
        the noise floor, or what is missed beyond the noise is at most 5 % of the force; not
        trustworthy where that is more than 15 %, or where the error is more than half of the force.
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
    """Return the verdict on a model from its predictions of recordings that were not fitted.

    `repeats` says whether they repeat the motion that was fitted.
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
                    "Friction of joints explains little of the error: look at the drive gains, "
                    "the geometry and the signs of forces and joints."
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
    preprocessing : tuple of Preprocessing
        How the fitted recordings were preprocessed.
    verdict : Verdict
        Whether the model can be trusted, from held-out data alone.
    unseen : tuple of str
        Base parameters that are less well known than their usual size.
    findings : tuple of Finding
        What was noticed in the logs.
    notes : tuple of str
        What else is to be known.
    rotors : tuple of (float, float), optional
        Inertia and ratio of each joint's motor, where they are known: no part of the real bodies.
    """

    robot: Manipulator
    model: Model
    estimate: Estimate
    essential: Essential
    consistency: Consistency | None
    consistency_share: float
    fitted: tuple[Prediction, ...]
    held_out: tuple[Prediction, ...]
    preprocessing: tuple[Preprocessing, ...]
    verdict: Verdict
    unseen: tuple[str, ...]
    findings: tuple[Finding, ...]
    notes: tuple[str, ...] = ()
    rotors: tuple[tuple[float, float], ...] | None = None

    @cached_property
    def machine(self) -> Manipulator | None:
        """The machine as identified, real bodies and drives, which alone predicts the log.

        None without real bodies. Friction that the fit had not is none of it.
        """
        if self.consistency is None:
            return None
        robot = self.consistency.robot
        drives = [leg.drive or Drive() for leg in robot.legs]
        if self.rotors is not None:
            motors = zip(drives, self.rotors, strict=True)
            drives = [replace(d, rotor_inertia=j, ratio=r) for d, (j, r) in motors]
        for kind in ("coulomb", "viscous", "offset"):
            found = self.model.per_joint(kind, self.estimate.values)
            values = np.zeros(len(drives)) if found is None else found
            if kind != "offset":
                values = np.maximum(values, 0.0)  # below zero it is noise: no joint pushes itself
            each = zip(drives, values.tolist(), strict=True)
            drives = [replace(drive, **{kind: value}) for drive, value in each]
        legs = zip(robot.legs, drives, strict=True)
        return replace(robot, legs=tuple(replace(leg, drive=drive) for leg, drive in legs))

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
            "preprocessing": [
                {
                    key: value.tolist() if isinstance(value, np.ndarray) else value
                    for key, value in vars(one).items()
                }
                for one in self.preprocessing
            ],
            "findings": [
                {"kind": f.kind, "row": f.row, "column": f.column, "message": f.message}
                for f in self.findings
            ],
            "notes": list(self.notes),
        }
