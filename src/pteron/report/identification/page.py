"""The HTML page of the report on an identification: one file that needs no other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pteron.equations.machine import closure_of
from pteron.identification import Identification
from pteron.identification.verdict import AT_THE_FLOOR, CYCLE, LARGE, SMALL
from pteron.legs.kind import ActuatedJoint
from pteron.plots import (
    autocorrelation_figure,
    certainty_figure,
    comparison_figure,
    correlation_figure,
    errors_figure,
    histogram_figure,
    residual_speed_figure,
    residual_time_figure,
)
from pteron.report.identification.contents import Contents, PageRecording, contents
from pteron.report.quantities import force, nouns
from pteron.report.typeset import measured, template


def page(result: Identification, model_file: str | None = None) -> str:
    """Return the page as HTML, with a link to the machine's file beside it and to no other."""
    made = template(
        "identification/page.html.j2",
        measured=lambda row: measured(row.value, row.half),
    )
    found = contents(result)
    joints = [leg.joint for leg in result.robot.legs]
    return made.render(
        found=found,
        result=found.result,
        robot=result.robot,
        estimate=result.estimate,
        bodies=result.consistency,
        legs=range(len(joints)),
        joints=joints,
        modes=closure_of(result.robot).modes,
        force=force(joints),
        nouns=nouns(joints),
        limits=(AT_THE_FLOOR, SMALL, LARGE, CYCLE),
        figures=figures(found),
        model_file=model_file,
    )


def figures(found: Contents) -> dict[str, Any]:
    """Return the pictures by name; those of residuals are None if the estimator keeps none."""
    rows = found.parameters
    joints = [leg.joint for leg in found.result.robot.legs]
    names = [row.name for row in rows]
    ratios, weak = np.array([row.ratio for row in rows]), np.array([row.weak for row in rows])
    made: dict[str, Any] = {
        "held_out": [
            _panels(one, f"held{k}", joints, speed=k == 1)
            for k, one in enumerate(found.drawn, start=1)
        ],
        "fitted": _panels(found.fitted[0], "fitted", joints, speed=not found.drawn),
        "histogram": None,
        "autocorrelation": None,
        "certainty": certainty_figure(names, ratios, weak, found.result.model.base.rank),
        "correlation": correlation_figure(names, found.result.estimate.correlation),
    }
    if np.isfinite(found.residuals).any():
        made["histogram"] = histogram_figure(found.residuals)
        made["autocorrelation"] = autocorrelation_figure(found.correlations, found.bound)
    return made


def _panels(
    shown: PageRecording, name: str, joints: Sequence[ActuatedJoint], *, speed: bool
) -> dict[str, Any]:
    """Return the pictures of one recording, with those over joint speed if `speed` is set."""
    p, part = shown.prediction, shown.stretch
    rest = p.measured - p.predicted
    series = p.measured[part], p.predicted[part], p.without_friction[part]
    forces, over_speed = [], []
    for i in range(p.measured.shape[1]):
        given, predicted, rigid = (one[:, i] for one in series)
        look: Any = {"leg": i, "joint": joints[i]}
        used = p.used[part, i]
        forces.append(comparison_figure(p.time[part], given, predicted, rigid, used, **look))
        if speed:
            over = p.speed[:, i], rest[:, i], p.used[:, i]
            over_speed.append(residual_speed_figure(*over, **look))
    return {
        "shown": shown,
        "name": name,
        "forces": forces,
        "speed": over_speed,
        "errors": errors_figure(p.nrms, p.nrms_without_friction, p.floor),
        "time": residual_time_figure(p.time, rest, p.used, joints),
    }
