"""The contents of the HTML report on an identification, computed before the page is written.

They are the verdict with its reasons, the recordings with the stretches to draw, parameters and
bodies, findings about the logs, residuals and their autocorrelations.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from pteron.identification import Identification, Prediction
from pteron.identification.estimators.estimate import autocorrelations
from pteron.kernels import Array
from pteron.report.identification.values import (
    ReportedBody,
    ReportedParameter,
    body_rows,
    parameter_rows,
)

_MOST_PICTURES = 3
"""Held-out recordings, the worst ones, that are drawn; the page's table has them all."""

_STRETCH = 3.0
"""Seconds of a recording that are drawn: few enough to tell measured from predicted."""

_FEWEST = 300
"""Samples that are drawn at least, though they last longer."""

_LAGS = 40
"""Samples of delay, at most, to which residuals' autocorrelation is computed."""


@dataclass(frozen=True)
class PageRecording:
    """A recording: its displayed name, its predicted forces, and the stretch to draw.

    The stretch is where the predictions miss the measured forces most.
    """

    name: str
    prediction: Prediction
    stretch: slice

    @property
    def seconds(self) -> tuple[float, float]:
        """Beginning and end of the stretch, s."""
        time = self.prediction.time[self.stretch]
        return float(time[0]), float(time[-1])


@dataclass(frozen=True)
class Contents:
    """The contents of the page of an identification; n is the number of actuators.

    The messages of `result` call recordings as the page does. `drawn` are the worst of the held-out
    recordings; `repeats` says whether these are no logs of their own, but the ends of the fitted
    ones. The residuals (R, n), N or N m, are
    NaN where an equation is not used; `correlations` (L, n) are their autocorrelations at lags of 1
    to L samples, whose size white noise keeps below `bound` (n,) nineteen times in twenty.
    """

    result: Identification
    held_out: tuple[PageRecording, ...]
    fitted: tuple[PageRecording, ...]
    drawn: tuple[PageRecording, ...]
    repeats: bool
    parameters: tuple[ReportedParameter, ...]
    bodies: tuple[ReportedBody, ...]
    residuals: Array
    correlations: Array
    bound: Array

    @property
    def worst(self) -> float:
        """Largest held-out error of an actuator, percent."""
        return max(float(shown.prediction.nrms.max()) for shown in self.held_out)

    @property
    def worst_floor(self) -> float:
        """The part of the largest held-out error due to noise alone, percent."""
        shown = max(self.held_out, key=lambda recording: float(recording.prediction.nrms.max()))
        return float(shown.prediction.floor[int(np.argmax(shown.prediction.nrms))])

    @property
    def essential(self) -> int:
        """Number of values that the data determine."""
        return sum(not row.weak for row in self.parameters)


def short_sources(identification: Identification) -> dict[str, str]:
    """Return display names of recordings: without folders, unless names coincide."""
    every = list(
        dict.fromkeys(p.source for p in (*identification.fitted, *identification.held_out))
    )
    names = [PurePath(source).name or source for source in every]
    return {
        source: name if names.count(name) == 1 else source
        for source, name in zip(every, names, strict=True)
    }


def shorten_sources(texts: Iterable[str], sources: Mapping[str, str]) -> tuple[str, ...]:
    """Return messages with the recordings' paths replaced by their short names."""
    short_texts = []
    for text in texts:
        for source in sorted(sources, key=len, reverse=True):
            text = text.replace(source, sources[source])
        short_texts.append(text)
    return tuple(short_texts)


def contents(identification: Identification) -> Contents:
    """Return the contents of the page of an identification."""
    names, verdict = short_sources(identification), identification.verdict
    said = [shown.message for shown in identification.findings]
    reasons, steps, notes, messages = (
        shorten_sources(texts, names)
        for texts in (verdict.reasons, verdict.next_steps, identification.notes, said)
    )
    findings = zip(identification.findings, messages, strict=True)
    held_out, fitted = (
        tuple(_page_recording(prediction, names) for prediction in predictions)
        for predictions in (identification.held_out, identification.fitted)
    )
    worst = sorted(held_out, key=lambda shown: -float(shown.prediction.nrms.max()))
    residuals = _residuals(identification)
    used = np.isfinite(residuals)
    return Contents(
        result=replace(
            identification,
            verdict=replace(verdict, reasons=reasons, next_steps=steps),
            notes=notes,
            findings=tuple(replace(shown, message=text) for shown, text in findings),
        ),
        held_out=held_out,
        fitted=fitted,
        # A single sample is nothing to draw.
        drawn=tuple(shown for shown in worst if len(shown.prediction.time) > 1)[:_MOST_PICTURES],
        repeats={shown.name for shown in held_out} <= {shown.name for shown in fitted},
        parameters=parameter_rows(identification),
        bodies=body_rows(identification),
        residuals=residuals,
        correlations=autocorrelations(residuals, used, _LAGS)[0],
        bound=np.asarray(1.96 / np.sqrt(np.maximum(used.sum(axis=0), 1))),
    )


def _page_recording(prediction: Prediction, names: dict[str, str]) -> PageRecording:
    """Return a prediction of forces for the page, with the samples that its figure shows.

    They are those of some seconds in which measured and predicted forces differ most; `names` are
    the names of recordings by their source.
    """
    time = prediction.time
    step = float(time[-1] - time[0]) / max(len(time) - 1, 1)
    length = min(max(int(_STRETCH / max(step, 1e-9)), _FEWEST), len(time))
    missed = ((prediction.measured - prediction.predicted) / prediction.size) ** 2
    power = np.cumsum(np.r_[0.0, np.where(prediction.used, missed, 0.0).sum(axis=1)])
    start = int(np.argmax(power[length:] - power[:-length])) if length < len(time) else 0
    return PageRecording(names[prediction.source], prediction, slice(start, start + length))


def _residuals(identification: Identification) -> Array:
    """Return the residuals of the equations; NaN for unused equations."""
    residuals = identification.estimate.residuals
    if not residuals.size:
        return np.full((0, len(identification.robot.legs)), np.nan)
    return np.where(residuals == 0.0, np.nan, residuals)
