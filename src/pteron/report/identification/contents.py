"""What the page of an identification holds, computed once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.identification import Identification, Prediction
from pteron.kernels import Array
from pteron.report.identification.bodies import Body, body_rows
from pteron.report.identification.names import short_sources, shortened
from pteron.report.identification.parameters import Parameter, parameter_rows
from pteron.report.identification.treatment import TreatedLog, treated_logs

__all__ = ["Contents", "Shown", "contents"]

_MOST_PICTURES = 3
"""Held-out recordings that are drawn; all of them are in the table."""

_STRETCH = 3.0
_FEWEST = 300
"""Seconds, and samples, of the stretch that is drawn: few enough to tell two lines apart."""

_LAGS = 40


@dataclass(frozen=True)
class Shown:
    """A recording as the page shows it.

    Attributes
    ----------
    name : str
        What it is called there.
    prediction : Prediction
        How well it is predicted.
    stretch : slice
        Of its samples: where the model misses most.
    """

    name: str
    prediction: Prediction
    stretch: slice

    @property
    def seconds(self) -> tuple[float, float]:
        """Where the stretch begins and ends, s."""
        time = self.prediction.time[self.stretch]
        return float(time[0]), float(time[-1])


@dataclass(frozen=True)
class Contents:
    """All that a page says about an identification.

    Attributes
    ----------
    result : Identification
    tone : {"good", "care", "bad"}
        Of the verdict.
    reasons, steps, notes : tuple of str
        With recordings called as on the page.
    held_out, fitted : tuple of Shown
        Every recording.
    drawn : tuple of Shown
        Those held out that are drawn, the worst first.
    repeats : bool
        Whether what was held out is the end of what was fitted.
    parameters : tuple of Parameter
    bodies : tuple of Body
        Empty where there are no real ones.
    treated : tuple of TreatedLog
    findings : tuple of (str, str, str, str)
        Kind, row, column and message of each.
    residuals : array, shape (R, n)
        Of the equations, N; NaN where an equation is not used.
    correlations : array, shape (L, n)
        Of these, at lags 1 to L.
    bound : array, shape (n,)
        Size that white noise's keep below, nineteen times in twenty.
    """

    result: Identification
    tone: str
    reasons: tuple[str, ...]
    steps: tuple[str, ...]
    notes: tuple[str, ...]
    held_out: tuple[Shown, ...]
    fitted: tuple[Shown, ...]
    drawn: tuple[Shown, ...]
    repeats: bool
    parameters: tuple[Parameter, ...]
    bodies: tuple[Body, ...]
    treated: tuple[TreatedLog, ...]
    findings: tuple[tuple[str, str, str, str], ...]
    residuals: Array
    correlations: Array
    bound: Array

    @property
    def worst(self) -> float:
        """Largest held-out error of an actuator, percent."""
        return max(float(shown.prediction.nrms.max()) for shown in self.held_out)

    @property
    def worst_floor(self) -> float:
        """What noise alone makes of it, percent."""
        shown = max(self.held_out, key=lambda one: float(one.prediction.nrms.max()))
        return float(shown.prediction.floor[int(np.argmax(shown.prediction.nrms))])

    @property
    def essential(self) -> int:
        """How many values the data show."""
        return sum(not row.weak for row in self.parameters)


def contents(result: Identification) -> Contents:
    """Return what the page of an identification holds."""
    predictions = (*result.held_out, *result.fitted)
    names = short_sources(prediction.source for prediction in predictions)
    held = tuple(_shown(prediction, names) for prediction in result.held_out)
    fitted = tuple(_shown(prediction, names) for prediction in result.fitted)
    residuals = _residuals(result)
    correlations, bound = _correlations(residuals)
    tones = {"trustworthy": "good", "usable with care": "care", "not trustworthy": "bad"}
    return Contents(
        result=result,
        tone=tones[result.verdict.grade],
        reasons=tuple(shortened(text, names) for text in result.verdict.reasons),
        steps=tuple(shortened(text, names) for text in result.verdict.next_steps),
        notes=tuple(shortened(text, names) for text in result.notes),
        held_out=held,
        fitted=fitted,
        drawn=_drawn(held),
        repeats={one.name for one in held} <= {one.name for one in fitted},
        parameters=parameter_rows(result),
        bodies=body_rows(result),
        treated=treated_logs(result, names),
        findings=tuple(
            (
                finding.kind,
                "" if finding.row is None else str(finding.row),
                finding.column or "",
                shortened(finding.message, names),
            )
            for finding in result.findings
        ),
        residuals=residuals,
        correlations=correlations,
        bound=bound,
    )


def _drawn(held: tuple[Shown, ...]) -> tuple[Shown, ...]:
    # Of a single sample there is nothing to draw.
    several = [one for one in held if len(one.prediction.time) > 1]
    several.sort(key=lambda one: -float(one.prediction.nrms.max()))
    return tuple(several[:_MOST_PICTURES])


def _shown(prediction: Prediction, names: dict[str, str]) -> Shown:
    time = prediction.time
    step = float(time[-1] - time[0]) / max(len(time) - 1, 1)
    length = min(max(int(_STRETCH / max(step, 1e-9)), _FEWEST), len(time))
    missed = ((prediction.measured - prediction.predicted) / prediction.size) ** 2
    power = np.cumsum(np.r_[0.0, np.where(prediction.used, missed, 0.0).sum(axis=1)])
    start = int(np.argmax(power[length:] - power[:-length])) if length < len(time) else 0
    return Shown(names[prediction.source], prediction, slice(start, start + length))


def _residuals(result: Identification) -> Array:
    """Return the residuals of the equations; an equation that is not used has none."""
    found = result.estimate.residuals
    if not found.size:
        return np.full((0, len(result.robot.legs)), np.nan)
    return np.where(found == 0.0, np.nan, found)


def _correlations(residuals: Array) -> tuple[Array, Array]:
    """Return the autocorrelation at lags 1 to L, over pairs of which both are there."""
    there = np.isfinite(residuals)
    count = np.maximum(there.sum(axis=0), 1)
    mean = np.where(there, residuals, 0.0).sum(axis=0) / count
    centred = np.where(there, residuals - mean, 0.0)
    power = np.maximum((centred**2).sum(axis=0), np.finfo(float).tiny)
    lags = range(1, min(_LAGS, len(residuals) // 5) + 1)
    found = [(centred[k:] * centred[:-k]).sum(axis=0) / power for k in lags]
    return np.array(found).reshape(-1, residuals.shape[1]), np.asarray(1.96 / np.sqrt(count))
