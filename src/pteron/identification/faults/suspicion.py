"""A fault that the residuals of a fit show: its name, its size, and the sentence a person reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pteron.kernels import Array

Fault = Literal[
    "delay",
    "scale",
    "gain",
    "gravity",
    "clock",
    "geometry",
    "stribeck",
    "elasticity",
    "drift",
    "load",
    "passive",
]
"""What is told by name: forces that are late, one force's scale, that of all forces, gravity's
direction, its size or the rate of the clock, lengths, friction that falls with speed, drives that
give, what drifts, friction that grows with the load, friction in passive joints."""

_SHIFT = 1.0
_CYCLE = 1.0
"""Standard deviations of a value, and percent of a cycle's forces, above which a fault matters."""

_HALF = 0.6
"""Steps of the log up to which a delay is one of sampling: a force that is held from one sample to
the next belongs to the instant between them."""
_SAMPLING = 3.0
"""Percent of a cycle's forces above which such a delay matters all the same."""


@dataclass(frozen=True)
class Suspicion:
    """A fault that the residuals show.

    Attributes
    ----------
    fault : str
        One of `Fault`.
    labels : tuple of str
        What the sizes are of: forces or legs.
    sizes, deviations : array, shape (k,)
        By how much they are off, in s, rad, m, N or m/N, and its standard deviation.
    chance : float
        That residuals show it so clearly without it.
    shift : float
        By how much the value that it changes most is off, in its standard deviations.
    cycle : array, shape (n,)
        What it spoils of a pick-and-place cycle's forces, percent of their standard deviation; NaN
        where the machine has no room for one.
    speeds : array, shape (n,), optional
        Of Stribeck's friction: the speed of each joint with which it falls.
    step : float
        From one sample of the log to the next, s.
    """

    fault: Fault
    labels: tuple[str, ...]
    sizes: Array
    deviations: Array
    chance: float
    shift: float
    cycle: Array
    speeds: Array | None = None
    step: float = 0.0

    @property
    def of_sampling(self) -> bool:
        """Whether it is the half step by which forces that are held differ from positions."""
        return self.fault == "delay" and abs(self.sizes[0]) <= _HALF * self.step

    @property
    def matters(self) -> bool:
        """Whether values or forces are off by more than their stated errors allow for."""
        limit = _SAMPLING if self.of_sampling else _CYCLE
        if (self.cycle > limit).any():
            return True
        return self.shift > _SHIFT and not self.of_sampling

    @property
    def message(self) -> str:
        """What is wrong, and what to do, in a sentence."""
        return f"{self._what()}; {_REMEDY[self.fault]}."

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "fault": self.fault,
            "message": self.message,
            "labels": list(self.labels),
            "sizes": self.sizes.tolist(),
            "standard_deviations": self.deviations.tolist(),
            "chance": self.chance,
            "shift": self.shift,
            "matters": self.matters,
            "cycle_percent": [None if np.isnan(v) else float(v) for v in self.cycle],
            "speeds": None if self.speeds is None else self.speeds.tolist(),
        }

    def _what(self) -> str:
        if self.fault == "delay":
            late, early = (
                ("forces", "positions") if self.sizes[0] > 0.0 else ("positions", "forces")
            )
            size, error = 1e3 * abs(self.sizes[0]), 1e3 * self.deviations[0]
            if self.of_sampling:
                return (
                    f"The {late} are half a sample ({size:.3g} ms) late for the {early}, as where "
                    "forces are held from sample to sample"
                )
            return f"The {late} are {size:.3g} ms (+- {error:.1g}) late for the {early}"
        if self.fault == "scale":
            size, error = 100.0 * abs(self.sizes[0]), 100.0 * self.deviations[0]
            more = "large" if self.sizes[0] > 0.0 else "small"
            return f"{self.labels[0]} is {size:.2g} % (+- {error:.1g}) too {more} beside the others"
        if self.fault == "gravity":
            tilt, error = np.degrees([np.linalg.norm(self.sizes), self.deviations.max()])
            return f"Gravity is {tilt:.2g} degrees (+- {error:.1g}) off the direction in the model"
        if self.fault == "gain":
            size, error = 100.0 * abs(self.sizes[0]), 100.0 * self.deviations[0]
            more = "large" if self.sizes[0] > 0.0 else "small"
            return f"All forces are {size:.3g} % (+- {error:.1g}) too {more} for what is known"
        if self.fault == "clock":
            return self._clock()
        k = int(np.argmax(np.abs(self.sizes) / np.maximum(self.deviations, 1e-300)))
        if self.fault == "geometry":
            return f"Lengths or points of the geometry are off, most clearly in {self.labels[k]}"
        if self.fault == "stribeck":
            return f"Friction falls with speed, most clearly at {self.labels[k]}"
        if self.fault == "elasticity":
            return f"The drives give, most clearly under {self.labels[k]}"
        if self.fault == "drift":
            return f"Friction or offset changes during the log, most clearly at {self.labels[k]}"
        if self.fault == "load":
            return f"Friction grows with the load, most clearly at {self.labels[k]}"
        return f"Passive joints have friction, most clearly in {self.labels[k]}"

    def _clock(self) -> str:
        more, error = float(self.sizes[0]), 100.0 * self.deviations[0]
        if more <= -1.0:
            return "The weight acts the other way: gravity has the wrong sign"
        rate = (1.0 + more) ** -0.5 - 1.0
        return (
            f"The weight is {100.0 * abs(more):.2g} % (+- {error:.1g}) too "
            f"{'large' if more > 0.0 else 'small'} for the inertia, as where the log's clock runs "
            f"{100.0 * abs(rate):.2g} % {'slow' if rate < 0.0 else 'fast'}"
        )


_REMEDY: dict[Fault, str] = {
    "delay": "--delay auto takes it out",
    "scale": "check that drive's gain, or its torque constant",
    "gravity": "level the machine, or correct gravity in its file",
    "gain": "check gains, rated torque and gear ratio, and the payload's mass",
    "clock": "check the log's time, and gravity and the unit of lengths in the machine's file",
    "geometry": "measure them again, or calibrate",
    "stribeck": "--stribeck auto finds its speeds, and adds it to the model; slow passages, which "
    "pteron excite --stribeck writes, show them best. It hides a delay: take --delay auto with it",
    "elasticity": "measure positions behind the drive, or move more slowly",
    "drift": "warm the machine up, or record shorter",
    "load": "no term of the model has it: keep to loads like those of the log",
    "passive": "--joints each adds it to the model",
}
