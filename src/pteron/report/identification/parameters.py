"""The identified values one by one: how well each is known, and why some hardly are."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, isfinite, log10
from typing import Literal

import numpy as np

from pteron.identification import Identification
from pteron.kernels import Array
from pteron.report.digits import fixed, significant

__all__ = ["Parameter", "measured", "parameter_rows"]

_STRONG = 0.95
"""Correlation from which two values can hardly be told apart."""

_NORMAL = 1.959963984540054
"""Standard deviations to each side that hold 95 %."""


@dataclass(frozen=True)
class Parameter:
    """One value of the model.

    Attributes
    ----------
    name, expression, unit : str
        What it is.
    value, half : float
        The value, and half of its 95 % interval.
    relative : float
        Standard deviation over the value's size; infinite for a value of zero.
    ratio : float
        The value's size over its standard deviation.
    cad : float or None
        What the CAD model says of it; None for friction and other terms.
    status : {"essential", "dropped", "unseen"}
        Whether the data show it.
    partner : str or None
        The value it is most strongly correlated with, where it is above 0.95.
    correlation : float
        With that value.
    """

    name: str
    expression: str
    unit: str
    value: float
    half: float
    relative: float
    ratio: float
    cad: float | None
    status: Literal["essential", "dropped", "unseen"]
    partner: str | None
    correlation: float

    @property
    def weak(self) -> bool:
        """Whether the data hardly show it."""
        return self.status != "essential"

    @property
    def unseen(self) -> bool:
        """Whether its standard deviation is larger than its usual size."""
        return self.status == "unseen"


def parameter_rows(result: Identification) -> tuple[Parameter, ...]:
    """Return the values of an identification, in the model's order."""
    estimate, model = result.estimate, result.model
    deviations, values = estimate.deviations, estimate.values
    base = model.base.values(result.robot)
    partners, strengths = _partners(estimate.correlation)
    found = []
    for k, name in enumerate(estimate.names):
        strong = abs(strengths[k]) > _STRONG
        size, deviation = abs(float(values[k])), float(deviations[k])
        found.append(
            Parameter(
                name=name,
                expression=model.expressions[k],
                unit=estimate.units[k],
                value=float(values[k]),
                half=_NORMAL * deviation,
                relative=deviation / size if size > 0.0 else float("inf"),
                ratio=size / deviation if deviation > 0.0 else float("inf"),
                cad=float(base[k]) if k < model.base.rank else None,
                status="unseen"
                if name in result.unseen
                else "dropped"
                if name in result.essential.dropped
                else "essential",
                partner=estimate.names[partners[k]] if strong else None,
                correlation=float(strengths[k]),
            )
        )
    return tuple(found)


def _partners(correlation: Array) -> tuple[Array, Array]:
    """Return for each value which other one goes with it most, and how much."""
    p = len(correlation)
    off = np.where(np.eye(p, dtype=bool), 0.0, np.nan_to_num(correlation))
    partners = np.argmax(np.abs(off), axis=1)
    return partners, off[np.arange(p), partners]


def measured(value: float, half: float) -> tuple[str, str]:
    """Return a value and half its interval, to the second digit of the latter.

    Examples
    --------
    >>> measured(1.2361326, 0.012752), measured(-0.004113744, 4.4e-05)
    (('1.236', '0.013'), ('−0.004114', '0.000044'))
    """
    if not isfinite(half) or half <= 0.0:
        return significant(value, 6), significant(half, 2)
    # 0.0996 is 0.10 in two digits: the size counts after rounding.
    places = max(1 - floor(log10(float(f"{half:.1e}"))), 0)
    return fixed(value, places), fixed(half, places)
