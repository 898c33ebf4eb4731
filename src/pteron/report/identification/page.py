"""The page of an identification: one HTML file that needs nothing else."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape
from matplotlib.figure import Figure

import pteron
from pteron.identification import Identification
from pteron.identification.verdict import AT_THE_FLOOR, LARGE, SMALL
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
from pteron.report.identification.contents import Contents, Shown, contents
from pteron.report.identification.values import measured
from pteron.report.typeset import resource, significant, template


def page(result: Identification, model_file: str | None = None) -> str:
    """Return the page of an identification, as HTML without any reference to another file.

    `model_file` names the file of the machine with its identified bodies, beside the page.
    """
    made = template(
        "identification/page.html.j2",
        measured=lambda row: measured(row.value, row.half),
        percent=_percent,
        prose=_prose,
    )
    found = contents(result)
    return made.render(
        found=found,
        result=result,
        robot=result.robot,
        estimate=result.estimate,
        bodies=result.consistency,
        legs=range(len(result.robot.legs)),
        limits=(AT_THE_FLOOR, SMALL, LARGE),
        figures=figures(found),
        model_file=model_file,
        version=pteron.__version__,
        style=resource("page.css") + resource("identification/page.css"),
    )


def _prose(text: str) -> Markup:
    """Return a message with true minus signs, and options of the command line kept in one piece."""
    signed = re.sub(r"(?<![\w.-])-(?=\d)", "\u2212", str(escape(text)))
    return Markup(re.sub(r"--[a-z][a-z-]*(?: each)?", r"<code>\g<0></code>", signed))


def _percent(share: float) -> str:
    """Return a share in percent; what is nothing to speak of has no digits."""
    return "less than 0.01 %" if 0.0 <= share < 1e-4 else f"{significant(100.0 * share, 2)} %"


@dataclass(frozen=True)
class Panels:
    """The pictures of one recording; those over speed only where they are asked for."""

    shown: Shown
    errors: Markup
    forces: tuple[Markup, ...]
    time: Markup
    speed: tuple[Markup, ...]


@dataclass(frozen=True)
class Figures:
    """The pictures; those of residuals are None where an estimator keeps none."""

    held_out: tuple[Panels, ...]
    fitted: Panels
    histogram: Markup | None
    autocorrelation: Markup | None
    certainty: Markup
    correlation: Markup


def figures(found: Contents) -> Figures:
    """Return the pictures of a page."""
    rows, estimate = found.parameters, found.result.estimate
    names = [row.name for row in rows]
    certainty = certainty_figure(
        names,
        np.array([row.ratio for row in rows]),
        np.array([row.weak for row in rows]),
        found.result.model.base.rank,
    )
    histogram = autocorrelation = None
    if np.isfinite(found.residuals).any():
        histogram = _inline(
            histogram_figure(found.residuals),
            "histogram",
            "Distribution of the residuals against the normal one",
        )
        autocorrelation = _inline(
            autocorrelation_figure(found.correlations, found.bound),
            "autocorrelation",
            "Autocorrelation of the residuals",
        )
    return Figures(
        held_out=tuple(
            _panels(one, f"held{k}", speed=k == 1) for k, one in enumerate(found.drawn, start=1)
        ),
        fitted=_panels(found.fitted[0], "fitted", speed=not found.drawn),
        histogram=histogram,
        autocorrelation=autocorrelation,
        certainty=_inline(certainty, "certainty", "Size of each value over its standard deviation"),
        correlation=_inline(
            correlation_figure(names, estimate.correlation),
            "correlation",
            "Correlations of the identified values",
        ),
    )


def _panels(shown: Shown, name: str, *, speed: bool) -> Panels:
    p, part = shown.prediction, shown.stretch
    legs = range(p.measured.shape[1])
    rest = p.measured - p.predicted
    forces = (
        _inline(
            comparison_figure(
                p.time[part],
                p.measured[part, i],
                p.predicted[part, i],
                p.without_friction[part, i],
                p.used[part, i],
                leg=i,
            ),
            f"{name}forces{i + 1}",
            f"Measured and predicted force of actuator {i + 1} in {shown.name}",
        )
        for i in legs
    )
    over_speed = (
        _inline(
            residual_speed_figure(p.speed[:, i], rest[:, i], p.used[:, i], leg=i),
            f"{name}speed{i + 1}",
            f"Residual of actuator {i + 1} over its slider's speed in {shown.name}",
        )
        for i in (legs if speed else ())
    )
    return Panels(
        shown,
        _inline(
            errors_figure(p.nrms, p.nrms_without_friction, p.floor),
            f"{name}errors",
            f"Errors of the prediction of {shown.name}",
        ),
        tuple(forces),
        _inline(
            residual_time_figure(p.time, rest, p.used),
            f"{name}time",
            f"Residuals of all actuators over time in {shown.name}",
        ),
        tuple(over_speed),
    )


def _inline(figure: Figure, name: str, title: str) -> Markup:
    return Markup(svg(figure, name=name, title=title))
