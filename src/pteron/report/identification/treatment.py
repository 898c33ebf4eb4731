"""How recordings were treated, in sentences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pteron.identification import Identification, Preprocessing
from pteron.kernels import Array
from pteron.report.digits import fixed, significant

__all__ = ["TreatedLog", "treated_logs"]

_SLOW = 1e3
"""mm/s in a m/s."""


@dataclass(frozen=True)
class TreatedLog:
    """How one recording was treated.

    Attributes
    ----------
    name : str
    steps : tuple of (str, str, str)
        What, how much, and a sentence on why.
    slider_noise, force_noise, slow : array, shape (n,)
        µm, N and mm/s.
    """

    name: str
    steps: tuple[tuple[str, str, str], ...]
    slider_noise: Array
    force_noise: Array
    slow: Array


def treated_logs(result: Identification, names: Mapping[str, str]) -> tuple[TreatedLog, ...]:
    """Return how the fitted recordings of an identification were treated."""
    modes = 2 if result.robot.platform.turns else 1
    return tuple(
        TreatedLog(
            names[prediction.source],
            _steps(treatment, modes),
            1e6 * treatment.slider_noise,
            np.asarray(treatment.force_noise),
            _SLOW * treatment.slow,
        )
        for prediction, treatment in zip(result.fitted, result.preprocessing, strict=True)
    )


def _steps(treatment: Preprocessing, modes: int) -> tuple[tuple[str, str, str], ...]:
    band = significant(treatment.band)
    return (
        (
            "Rate",
            f"{significant(treatment.rate, 4)} Hz",
            "Samples a second, as the time stamps say.",
        ),
        ("Derivatives", treatment.derivatives, _DERIVATIVES[treatment.derivatives]),
        _cutoff(treatment),
        (
            "Parallel filter",
            f"{band} Hz",
            "Forces and every column of the regressor went through one and the same low-pass "
            "filter, so that it changes nothing but the noise, and were then thinned out to the "
            "rate that this band needs.",
        ),
        (
            "Period",
            "none" if treatment.period is None else f"{significant(treatment.period, 4)} s",
            "The motion is not taken as periodic."
            if treatment.period is None
            else "The motion repeats after that time; all periods are averaged."
            if treatment.derivatives == "periodic"
            else "The motion repeats after that time; the treatment made no use of it.",
        ),
        (
            "Assembly mode",
            f"{treatment.mode + 1} of {modes}",
            "Poses follow from the sliders by direct kinematics, which has one solution."
            if modes == 1
            else "Poses follow from the sliders by direct kinematics; of its two solutions the "
            "machine was in this one.",
        ),
        (
            "Left out",
            f"{fixed(1e3 * treatment.settling / treatment.rate, 0)} ms",
            "An actuator's equation is not fitted where its slider is slower than the speed below, "
            "nor so long before and after that: the positions' filter mixes it with the reversal. "
            "Errors of predicted forces leave out "
            f"{fixed(1e3 * treatment.turning / treatment.rate, 0)} ms.",
        ),
    )


_DERIVATIVES = {
    "periodic": "A Fourier series was fitted to the positions over whole periods; rates and "
    "accelerations are its exact derivatives.",
    "central": "Positions went through a low-pass filter without delay; rates and accelerations "
    "are central differences.",
    "spline": "A smoothing spline was fitted to the positions; rates and accelerations are its "
    "derivatives.",
}


def _cutoff(treatment: Preprocessing) -> tuple[str, str, str]:
    if treatment.cutoff is None:
        return (
            "Cut-off",
            "none",
            "The positions have no noise beyond the rounding of their last digit.",
        )
    amount = f"{fixed(treatment.cutoff, 1)} Hz"
    if treatment.derivatives == "periodic":
        return "Cut-off", amount, "The highest harmonic that stands above the noise."
    return (
        "Cut-off",
        amount,
        "Of the positions' filter: above it there is only white noise, unless it was given.",
    )
