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
from pteron.report.typeset import template, value_with_uncertainty


def page(identification: Identification, model_file: str | None = None) -> str:
    """Return the page as HTML; its only link is to the machine's file beside it."""
    document = template(
        "identification/page.html.j2",
        measured=lambda row: value_with_uncertainty(row.value, row.half),
    )
    page_contents = contents(identification)
    joints = [leg.joint for leg in identification.robot.legs]
    return document.render(
        contents=page_contents,
        result=page_contents.result,
        robot=identification.robot,
        estimate=identification.estimate,
        bodies=identification.consistency,
        legs=range(len(joints)),
        joints=joints,
        modes=closure_of(identification.robot).modes,
        force=force(joints),
        nouns=nouns(joints),
        limits=(AT_THE_FLOOR, SMALL, LARGE, CYCLE),
        figures=figures(page_contents),
        model_file=model_file,
    )


def figures(page_contents: Contents) -> dict[str, Any]:
    """Return the pictures by name; residual pictures are None if the estimator has none."""
    rows = page_contents.parameters
    joints = [leg.joint for leg in page_contents.result.robot.legs]
    names = [row.name for row in rows]
    ratios, weak = np.array([row.ratio for row in rows]), np.array([row.weak for row in rows])
    figures_by_name: dict[str, Any] = {
        "held_out": [
            _panels(recording, f"held{k}", joints, speed=k == 1)
            for k, recording in enumerate(page_contents.drawn, start=1)
        ],
        "fitted": _panels(page_contents.fitted[0], "fitted", joints, speed=not page_contents.drawn),
        "histogram": None,
        "autocorrelation": None,
        "certainty": certainty_figure(names, ratios, weak, page_contents.result.model.base.rank),
        "correlation": correlation_figure(names, page_contents.result.estimate.correlation),
    }
    if np.isfinite(page_contents.residuals).any():
        figures_by_name["histogram"] = histogram_figure(page_contents.residuals)
        figures_by_name["autocorrelation"] = autocorrelation_figure(
            page_contents.correlations, page_contents.bound
        )
    return figures_by_name


def _panels(
    shown: PageRecording, name: str, joints: Sequence[ActuatedJoint], *, speed: bool
) -> dict[str, Any]:
    """Return the pictures of one recording, with those over joint speed if `speed` is set."""
    p, part = shown.prediction, shown.stretch
    residuals = p.measured - p.predicted
    series = p.measured[part], p.predicted[part], p.without_friction[part]
    forces, over_speed = [], []
    for i in range(p.measured.shape[1]):
        measured, predicted, rigid = (array[:, i] for array in series)
        look: Any = {"leg": i, "joint": joints[i]}
        used = p.used[part, i]
        forces.append(comparison_figure(p.time[part], measured, predicted, rigid, used, **look))
        if speed:
            over = p.speed[:, i], residuals[:, i], p.used[:, i]
            over_speed.append(residual_speed_figure(*over, **look))
    return {
        "shown": shown,
        "name": name,
        "forces": forces,
        "speed": over_speed,
        "errors": errors_figure(p.nrms, p.nrms_without_friction, p.floor),
        "time": residual_time_figure(p.time, residuals, p.used, joints),
    }
