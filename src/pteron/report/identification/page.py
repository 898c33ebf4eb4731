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
    svg,
)
from pteron.report.identification.contents import Contents, PageRecording, contents
from pteron.report.quantities import force, nouns
from pteron.report.typeset import measured, template


def page(result: Identification, model_file: str | None = None) -> str:
    """Return the page as HTML without reference to another file but the machine's, beside it."""
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
    """Return the pictures as SVG; those of residuals are None where an estimator keeps none."""
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
        "certainty": svg(
            certainty_figure(names, ratios, weak, found.result.model.base.rank),
            name="certainty",
            title="Size of each value over its standard deviation",
        ),
        "correlation": svg(
            correlation_figure(names, found.result.estimate.correlation),
            name="correlation",
            title="Correlations of the identified values",
            widest=np.inf,  # it scrolls
        ),
    }
    if np.isfinite(found.residuals).any():
        figure = histogram_figure(found.residuals)
        title = "Distribution of the residuals against the normal one"
        made["histogram"] = svg(figure, name="histogram", title=title)
        figure = autocorrelation_figure(found.correlations, found.bound)
        title = "Autocorrelation of the residuals"
        made["autocorrelation"] = svg(figure, name="autocorrelation", title=title)
    return made


def _panels(
    shown: PageRecording, name: str, joints: Sequence[ActuatedJoint], *, speed: bool
) -> dict[str, Any]:
    """Return the pictures of one recording; those over speed only where they are asked for."""
    p, part = shown.prediction, shown.stretch
    rest = p.measured - p.predicted
    series = p.measured[part], p.predicted[part], p.without_friction[part]
    forces, over_speed = [], []
    for i in range(p.measured.shape[1]):
        given, predicted, rigid = (one[:, i] for one in series)
        used = p.used[part, i]
        look: Any = {"leg": i, "joint": joints[i]}
        figure = comparison_figure(p.time[part], given, predicted, rigid, used, **look)
        title = f"Measured and predicted force of actuator {i + 1} in {shown.name}"
        forces.append(svg(figure, name=f"{name}forces{i + 1}", title=title))
        if speed:
            over = p.speed[:, i], rest[:, i], p.used[:, i]
            figure = residual_speed_figure(*over, **look)
            title = f"Residual of actuator {i + 1} over its joint's speed in {shown.name}"
            over_speed.append(svg(figure, name=f"{name}speed{i + 1}", title=title))
    errors = errors_figure(p.nrms, p.nrms_without_friction, p.floor)
    time = residual_time_figure(p.time, rest, p.used, joints)
    title = f"Errors of the prediction of {shown.name}"
    over_time = f"Residuals of all actuators over time in {shown.name}"
    return {
        "shown": shown,
        "forces": forces,
        "speed": over_speed,
        "errors": svg(errors, name=f"{name}errors", title=title),
        "time": svg(time, name=f"{name}time", title=over_time),
    }
