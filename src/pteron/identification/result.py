"""What `identify` returns: values, how far to trust them, and what was done to the data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pteron.identification.consistency import Consistency
from pteron.identification.estimators import Essential, Estimate
from pteron.identification.logs import Finding
from pteron.identification.model import Model
from pteron.identification.prediction import Prediction
from pteron.identification.signals import Treatment
from pteron.identification.verdict import Verdict
from pteron.kernels import Array
from pteron.manipulator import Manipulator

__all__ = ["Identification"]


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


def _plain(treatment: Treatment) -> dict[str, Any]:
    return {
        key: value.tolist() if isinstance(value, np.ndarray) else value
        for key, value in vars(treatment).items()
    }
