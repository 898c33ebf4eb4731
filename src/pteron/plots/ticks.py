"""Scales of figures: their ticks, tick labels and ranges."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import (
    AutoLocator,
    FixedLocator,
    FuncFormatter,
    MaxNLocator,
    NullLocator,
    ScalarFormatter,
)

from pteron.kernels import Array
from pteron.short_numbers import power_of_ten


class TickLocator(AutoLocator):
    """Ticks of a scale that does not magnify the rounding of constant values."""

    def nonsingular(self, v0: float, v1: float) -> tuple[float, float]:
        """Return limits whose difference is not negligible beside their size."""
        size = max(abs(v0), abs(v1))
        room = 0.05 * size if abs(v1 - v0) < 1e-6 * size else 0.0
        low, high = super().nonsingular(min(v0, v1) - room, max(v0, v1) + room)
        return float(low), float(high)


class TickLabels(ScalarFormatter):
    """Short tick labels: their common power of ten stands in the scale's label."""

    def __init__(self) -> None:
        super().__init__(useOffset=False)
        self.set_powerlimits((-3, 5))
        self._plain = self._written = ""

    def set_locs(self, locs: Any) -> None:
        """Set the ticks, and write their power of ten into the label."""
        super().set_locs(locs)
        axis: Any = self.axis
        label = axis.label
        if label.get_text() != self._written:
            self._plain = label.get_text()
        power = super().get_offset().replace("\u2212", "-").partition("e")[2]
        self._written = _label_with_power(self._plain, int(power or 0))
        label.set_text(self._written)

    def get_offset(self) -> str:
        """Return an empty text: the label has the power of ten."""
        return ""


def _label_with_power(label: str, power: int) -> str:
    """Return a label whose unit has a power of ten, if there is one."""
    if not power:
        return label
    name, bracket, unit = label.rpartition("(")
    ten = power_of_ten(power)
    return f"{name}({ten} {unit}" if bracket else f"{label} ({ten})".lstrip()


def log_scale(axes: Axes, low: float, high: float) -> None:
    """Make the scale along x logarithmic, with up to seven labelled ticks."""
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    first, last = np.ceil(np.log10(low) - 1e-9), np.floor(np.log10(high) + 1e-9)
    powers = np.arange(first, last + 1, max(np.ceil((last - first + 1) / 7), 1.0))
    ticks = 10.0**powers
    if len(ticks) < 3:
        fine = np.outer(10.0 ** np.arange(first - 1, last + 1), (1.0, 2.0, 5.0)).ravel()
        ticks = fine[(fine >= low) & (fine <= high)]
    if len(ticks) < 2:  # one number tells no scale
        fine = np.array(MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high))
        ticks = fine[(fine >= low) & (fine <= high)]
    axes.xaxis.set_major_locator(FixedLocator(ticks.tolist()))
    axes.xaxis.set_minor_locator(NullLocator())
    far = len(ticks) and (ticks[0] < 1e-3 or ticks[-1] > 1e4)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda number, _: _decade(number, bool(far))))


def _decade(number: float, as_power: bool) -> str:
    """Return a tick label: a power of ten where that is exact and `as_power`, else digits."""
    power = round(float(np.log10(number)))
    return power_of_ten(power) if as_power and np.isclose(number, 10.0**power) else f"{number:g}"


def fit_time_scale(axes: Axes, time: Array) -> None:
    """Set the scale along x to the range of times (T,); for a single time, a second about it."""
    first, last = float(time[0]), float(time[-1])
    room = 0.0 if last > first else 0.5
    axes.set_xlim(first - room, last + room)


def nice_step(least: float) -> float:
    """Return the least of 1, 2 and 5 times a power of ten that is no smaller than a step."""
    power = 10.0 ** np.floor(np.log10(least))
    return float(power * min(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least))
