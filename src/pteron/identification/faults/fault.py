"""A fault that the residuals of a fit show: its name, its size, a sentence about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.renamed import former_attribute
from pteron.result import Result

FaultName = Literal[
    "delay",
    "scale",
    "ratio",
    "zero",
    "gain",
    "gravity",
    "clock",
    "geometry",
    "stribeck",
    "elasticity",
    "payload",
    "drift",
    "load",
    "passive",
    "rotors",
    "play",
]
"""Faults by name: forces that are late, the scale of one force, the gear ratio of one joint or of
all, the zero of one, the scale of all forces, the direction of gravity, its size or the rate of the
clock, lengths, friction that falls with speed, elastic drives, a payload that is picked up or put
down, drifting friction or offsets, friction that grows with load, friction in passive joints,
motors' inertia, drives with play."""

ORDER: tuple[FaultName, ...] = (
    *("delay", "clock", "gain", "scale", "ratio", "zero", "gravity", "geometry"),
    *("play", "elasticity", "rotors", "payload", "drift", "stribeck", "load", "passive"),
)
"""The order in which faults are corrected and named: an earlier one distorts the later ones."""

_SHIFT = 1.0
"""Change of a value by a fault, in standard deviations, above which the fault matters: a smaller
one is within the interval that is stated anyway."""

_CYCLE = 1.0
"""Error in a reference cycle's forces, percent, above which a fault matters: a third of what an
engineer who feeds forces forward would notice beside friction."""

_HALF_STEP = (0.4, 0.6)
"""Steps of the log between which a delay is half a step, as where forces are held: one that is held
from one sample to the next belongs to the instant between them. What is less is of sampling too."""

_CYCLE_OF_SAMPLING = 3.0
"""Percent of a reference cycle's forces above which a delay of sampling matters all the same: the
limit of what `identify` trusts."""

_SAMPLING = (
    "The {late} are half a sample ({size_ms:.3g} ms) late for the {early}, as where "
    "forces are held from sample to sample"
)

_SENTENCES = {
    "delay": "The {late} are {size_ms:.3g} ms (+- {error_ms:.1g}) late for the {early}",
    "sampling": _SAMPLING,
    "scale": "{label} is {percent:.2g} % (+- {error:.1g}) too {more} beside the others",
    "ratio": "{label_moves} {percent:.2g} % (+- {error:.1g}) {less} than the log says, as if "
    "a gear ratio, a lead or a pulley were wrong by that",
    "zero": "The zero of {label} is wrong by about {shown_size}",
    "gravity": "Gravity is {tilt:.2g} degrees (+- {tilt_error:.1g}) off the direction in the model",
    "gain": "All forces are {percent:.3g} % (+- {error:.1g}) too {more} for what is known",
    "clock": "The weight is {percent:.2g} % (+- {error:.1g}) too {more} for the inertia, as if the "
    "log's clock ran {clock:.2g} % {pace}",
    "sign": "The weight acts the other way: gravity has the wrong sign",
    "geometry": "Lengths or points of the geometry are wrong, most clearly in {clearest}, by about "
    "{shown_leg}",
    "stribeck": "Friction falls with speed, most clearly at {clearest}",
    "elasticity": "The drives are elastic, most clearly under {clearest}",
    "payload": "The platform carries about {mass:.2g} kg more in {most} of the log than in "
    "{least}, as an undeclared payload",
    "drift": "Friction or offset changes during the log, most clearly at {clearest}",
    "load": "Friction grows with the load, most clearly at {clearest}",
    "passive": "Passive joints have friction, most clearly in {clearest}",
    "rotors": "The motors' own inertia acts, most clearly {clearest}, and the model has none of it",
    "play": "Residuals of {labels} are {times:.2g} times as large where the load changes "
    "direction, as if a drive had play (backlash)",
}
"""Sentences on the faults, on a delay of sampling, and on gravity that acts the other way."""

IN_WORDS: dict[FaultName, str] = {
    "delay": "a delay",
    "scale": "a scale error of one force",
    "ratio": "a wrong gear ratio",
    "zero": "a wrong joint zero",
    "gain": "a scale error of all forces",
    "gravity": "a wrong direction of gravity",
    "clock": "a wrong clock",
    "geometry": "a wrong length or point of the geometry",
    "stribeck": "friction that falls with speed",
    "elasticity": "elasticity of a drive",
    "payload": "a payload in a part of the log",
    "drift": "friction that changes during the log",
    "load": "load-dependent friction",
    "passive": "friction of passive joints",
    "rotors": "the motors' inertia",
    "play": "play of a drive",
}
"""Faults as nouns."""

_REMEDY: dict[FaultName, str] = {
    "delay": "--delay auto corrects it",
    "scale": "check that drive's gain, or its torque constant",
    "ratio": "check the ratio, lead or pulley that positions are computed with",
    "zero": "home that joint again, or calibrate its zero",
    "gravity": "level the machine, or correct gravity in its file",
    "gain": "check gains, rated torque and gear ratio, and the payload's mass",
    "clock": "check the log's time, and gravity and the unit of lengths in the machine's file",
    "geometry": "measure them again, or calibrate",
    "stribeck": "--stribeck auto finds its speeds, and adds it to the model; slow passages, which "
    "pteron excite --stribeck writes, show them best. It hides a delay: take --delay auto with it",
    "elasticity": "measure positions behind the drive, or move more slowly",
    "payload": "declare it in a payload column (--payload), or record without it",
    "drift": "warm the machine up, or record a shorter log",
    "load": "the model has no term for it: keep to loads like those of the log",
    "passive": "--joints each adds it to the model",
    "rotors": "--rotors adds it to the model",
    "play": "remove the play of that drive, or keep to motions whose load does not change "
    "direction; the faults named after it may be effects of it",
}


def _format_size(size: float, angle: bool = False) -> str:
    """Return a size, m or rad, as text in mm or degrees, rounded as an estimate is."""
    number = np.degrees(size) if angle else 1e3 * size
    text = f"{number:.0f}" if number >= 10.0 else f"{number:.2g}"
    return f"{text} {'degrees' if angle else 'mm'}"


def is_half(delay: float, deviation: float, step: float) -> bool:
    """Return whether a delay of forces, or of positions (below 0), is half a step; all in s.

    It may be off by two standard deviations, but not so far that none or a whole step is nearer.
    """
    off = max((_HALF_STEP[1] - 0.5) * step, min(2.0 * deviation, 0.25 * step))
    return abs(abs(delay) - 0.5 * step) <= off


def describe_held_forces(delay: float) -> str:
    """Return the clause on a delay, s, by zero-order hold of the forces."""
    late, early = ("forces", "positions")[:: 1 if delay > 0.0 else -1]
    return _SAMPLING.format(late=late, early=early, size_ms=1e3 * abs(delay))


@dataclass(frozen=True, eq=False, repr=False)
class IsolatedFault(Result):
    """A fault that the residuals show.

    Attributes
    ----------
    fault : str
        One of `FaultName`.
    labels : tuple of str
        The force or the leg of each size.
    sizes, deviations : array, shape (k,)
        Errors, in s, rad, m, N, kg or m/N, and their standard deviations; of play how many times as
        large the residuals are, and NaN.
    chance : float
        Probability that residuals show it so clearly without it.
    shift : float
        Error of the value that it changes most, in standard deviations.
    cycle : array, shape (n,)
        Error that it makes in a pick-and-place cycle's forces, percent of their standard deviation;
        NaN where no cycle fits into the machine's workspace.
    speeds : array, shape (n,), optional
        Speeds of the joints with which Stribeck's friction falls.
    step : float
        From one sample of the log to the next, s.
    as_well : tuple of str
        Other faults that explain the residuals as well.
    """

    ROWS = "labels sizes deviations"

    fault: FaultName
    labels: tuple[str, ...]
    sizes: Array
    deviations: Array
    chance: float
    shift: float
    cycle: Array
    speeds: Array | None = None
    step: float = 0.0
    as_well: tuple[FaultName, ...] = ()

    @property
    def is_half_sample_delay(self) -> bool:
        """Whether the delay is the half step by which a zero-order hold shifts forces."""
        return self.fault == "delay" and abs(self.sizes[0]) <= _HALF_STEP[1] * self.step

    @property
    def understates(self) -> bool:
        """Whether the fault shifts a value by more than its stated error."""
        return self.matters or self.shift > _SHIFT

    @property
    def matters(self) -> bool:
        """Whether the fault lowers the grade of the verdict."""
        if self.is_half_sample_delay:
            return bool((self.cycle > _CYCLE_OF_SAMPLING).any())
        # Play is no error of a value: what it makes is in the residuals, wherever it is.
        return self.fault == "play" or self.shift > _SHIFT or bool((self.cycle > _CYCLE).any())

    @property
    def message(self) -> str:
        """The fault, and its remedy, in a sentence."""
        return f"{self._sentence()}{self._equivalents()}; {_REMEDY[self.fault]}."

    @property
    def text_without_remedy(self) -> str:
        """The sentence without a remedy: the fault may be an effect of the fault before it."""
        return (
            f"{self._sentence()}{self._equivalents()}, or the fault named before causes this: "
            "mend that first."
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the fault as plain data."""
        return {
            **json_fields(
                fault=self.fault, message=self.message, labels=self.labels, sizes=self.sizes
            ),
            "standard_deviations": [None if np.isnan(v) else float(v) for v in self.deviations],
            **json_fields(
                chance=self.chance, shift=self.shift, matters=self.matters, as_well=self.as_well
            ),
            "cycle_percent": [None if np.isnan(v) else float(v) for v in self.cycle],
            **json_fields(speeds=self.speeds),
        }

    def _equivalents(self) -> str:
        """Return, in parentheses, the other faults that explain the residuals equally well."""
        if not self.as_well:
            return ""
        return f" (explained equally well by: {', '.join(IN_WORDS[name] for name in self.as_well)})"

    def _leg_size(self, label: str) -> float:
        """Return the Euclidean norm of all sizes with a label."""
        parts = [size for size, name in zip(self.sizes, self.labels, strict=False) if name == label]
        return float(np.linalg.norm(parts))

    def _sentence(self) -> str:
        """Return a sentence that states the fault with its size and error."""
        first = float(self.sizes[0])
        key = "sampling" if self.is_half_sample_delay else str(self.fault)
        if key == "clock" and first <= -1.0:
            key = "sign"
        size, error = abs(first), float(self.deviations[0])
        late, early = ("forces", "positions")[:: 1 if first > 0.0 else -1]
        clock = max(1.0 + first, 1e-300) ** -0.5 - 1.0
        all_joints = self.labels[0] == "all joints"
        clearest = int(np.argmax(np.abs(self.sizes) / np.maximum(self.deviations, 1e-300)))
        # Of the eighths of a log that filters cut off nothing is known.
        seen = np.flatnonzero(self.deviations) if self.fault == "payload" else np.array([0])
        return _SENTENCES[key].format(
            label=self.labels[0],
            labels=", ".join(self.labels),
            times=float(self.sizes.max()),
            mass=float(np.ptp(self.sizes[seen])),
            most=self.labels[int(seen[np.argmax(self.sizes[seen])])],
            least=self.labels[int(seen[np.argmin(self.sizes[seen])])],
            clearest=self.labels[clearest],
            late=late,
            early=early,
            size_ms=1e3 * size,
            error_ms=1e3 * error,
            percent=100.0 * size,
            error=100.0 * error,
            more="large" if first > 0.0 else "small",
            label_moves="All joints move" if all_joints else f"{self.labels[0]} moves",
            less="less" if first > 0.0 else "more",
            shown_size=_format_size(size, self.labels[0].startswith("theta")),
            shown_leg=_format_size(self._leg_size(self.labels[clearest])),
            tilt=np.degrees(np.linalg.norm(self.sizes)),
            tilt_error=np.degrees(self.deviations.max()),
            clock=100.0 * abs(clock),
            pace="slow" if clock < 0.0 else "fast",
        )

    of_sampling = former_attribute("of_sampling", "is_half_sample_delay")
    beside_another = former_attribute("beside_another", "text_without_remedy")
