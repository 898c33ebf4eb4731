"""Faults of a log as such, told without a model: lost samples, jitter, saturation, coarse forces.

They come before all faults of the machine: what a log distorts looks like those.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Literal

import numpy as np

from pteron.identification.logs import Log
from pteron.identification.logs.gaps import gaps
from pteron.identification.logs.recorded import saturation_sentences
from pteron.identification.signals import Preprocessing
from pteron.identification.signals.derivatives import uniform
from pteron.identification.signals.filters import DIFFERENCE, lowpass, quantisation_steps
from pteron.json_values import json_fields
from pteron.kernels import Array

_LOST = 0.01
"""Share of missing samples from which they are reported: fewer cost less than a tenth of the
precision, and change no value beyond its interval."""

_SURE = 6.0
"""Size of jitter, in standard deviations, to be reported: by chance in one of 10^9 logs."""

_LIKELY = 3.0
"""The same where a fault of the machine shows, such as drives that give: 5 % of a step made up to
8 % of a cycle's forces of it (own plants)."""

_FELT = 0.5
"""Position errors by jitter, over the positions' other noise, from which it is reported: below it
adds less than an eighth to the noise."""

_UNEVEN = 0.05
"""Jitter, over the time step, from which it is reported. Chosen: 1 %, as of a usual clock, leaves
the forces of a cycle within 0.2 %."""

_COARSE = 0.02
"""Step of the forces' values, over their standard deviation, from which it is reported: it is
rounding by 0.6 % of the deviation, more than the usual noise of 0.5 %."""

_EXTREME, _SHARE, _LEVEL = 0.01, 0.06, 5.0
"""Criteria of a plateau: the share of samples with the extreme value, the least share of samples
within six deviations of it, and how many times as many they are as the next six. A sine has 2.4
times as many, random motions without limits up to 0.1 and 4.8 (own plants), with limits 0.07 and 5
or more."""

_LOOK = 60_000
"""Most rows that are examined for jitter."""

_ALIKE = (comb(32, 16) / comb(16, 8) ** 2) ** 0.5
"""Deviation of a sum of squares of eighth differences, over that of independent ones."""

LogFaultName = Literal["lost", "jitter", "delay", "saturation", "steps"]


@dataclass(frozen=True)
class LogFault:
    """A fault of a log as such.

    Attributes
    ----------
    fault : {"lost", "jitter", "delay", "saturation", "steps"}
        Lost samples, sampling at other times than the stamps say, forces that are late, or stay at
        a limit, or are recorded in coarse steps.
    message : str
        The fault and its remedy, in a sentence.
    size : float
        Share of samples lost, jitter or delay in s, NaN of saturation, steps over the force's
        deviation.
    distorts : bool
        Whether faults of the machine that show too may be its own.
    """

    fault: LogFaultName
    message: str
    size: float
    distorts: bool

    def as_dict(self) -> dict[str, object]:
        """Return the fault as plain data."""
        return json_fields(
            fault=self.fault, message=self.message, size=self.size, distorts=self.distorts
        )


def log_faults(
    logs: Sequence[Log],
    preprocessing: Sequence[Preprocessing],
    lost: Sequence[float],
    *,
    fits: bool = True,
    doubtful: bool = False,
) -> tuple[LogFault, ...]:
    """Return the faults of logs, each once.

    `lost` are the shares of samples that they miss; `fits` says that a model explains the forces,
    which then are not at their limits, whatever plateaus they have. `doubtful` says that residuals
    show a fault of the machine, which any likely jitter may be the cause of.
    """
    faults: list[LogFault] = []
    if (share := max(lost, default=0.0)) > _LOST:
        worst = logs[int(np.argmax(lost))]
        message = (
            f"{100.0 * share:.2g} % of the samples of {worst.source} are missing (lost); record "
            "with a buffer, or at a lower rate"
        )
        faults.append(LogFault("lost", f"{message}.", share, False))
    for log, how in zip(logs, preprocessing, strict=True):
        jitter, clear, noise = sampling_jitter(log, how)
        sure = clear > _SURE and jitter * log.rate > _UNEVEN
        if noise > _FELT and (sure or (doubtful and clear > _LIKELY)):
            message = (
                f"Samples of {log.source} are taken {1e3 * jitter:.2g} ms (rms) off their time "
                "stamps, at random (jitter): record with stamps of the drives' own clock, or at "
                "the cycle of the bus"
            )
            faults.append(LogFault("jitter", f"{message}.", jitter, True))
            break
    for log, how in zip(logs, preprocessing, strict=True):
        said = saturation_sentences(log) or (() if fits else _plateaus(log, how.force_noise))
        if said:
            message = _merge_limit_sentences(said)
            faults.append(LogFault("saturation", message, float("nan"), True))
    for log in logs:
        steps = quantisation_steps(log.forces) / np.maximum(log.forces.std(axis=0), 1e-300)
        if (coarse := float(steps.max(initial=0.0))) > _COARSE:
            name = log.force_names[int(np.argmax(steps))]
            message = (
                f"{name} is recorded in steps of {100.0 * coarse:.2g} % of its deviation "
                f"(quantised): record it with more digits"
            )
            faults.append(LogFault("steps", f"{message}.", coarse, False))
            break
    return tuple(faults)


def _merge_limit_sentences(sentences: Sequence[str]) -> str:
    """Return the first sentence on a force at its limit, with the names of the other forces."""
    first = sentences[0].rstrip(".")
    names = dict.fromkeys(sentence.partition(" ")[0] for sentence in sentences[1:])
    others = ", ".join(name for name in names if not first.startswith(f"{name} "))
    return f"{first}; the same of {others}." if others else f"{first}."


def _plateaus(log: Log, noise: Array) -> tuple[str, ...]:
    """Return a sentence on forces that have far more samples within the noise of an extreme value.

    A smooth force that turns round has at most 2.4 times as many within six deviations of its
    extreme value as within the next six.
    """
    saturated = []
    for name, force, size in zip(log.force_names, log.forces.T, noise.tolist(), strict=True):
        for sign in (1.0, -1.0):
            signed = np.sort(sign * force)[::-1]
            top = signed[int(_EXTREME * len(signed))] + 1.5 * size
            within = int(((signed <= top) & (signed > top - 6.0 * size)).sum())
            below = int(((signed <= top - 6.0 * size) & (signed > top - 12.0 * size)).sum())
            if within >= _SHARE * len(signed) and within > _LEVEL * max(below, 1):
                saturated.append(name)
    if not saturated:
        return ()
    names = ", ".join(dict.fromkeys(saturated))
    return (
        f"{names} stay within the noise of an extreme value far more often than a force that only "
        f"turns round there: the drive may be at its limit in {log.source} (saturation); move more "
        "slowly, or leave such stretches out.",
    )


def delay_fault(delay: float, deviation: float) -> LogFault:
    """Return the fault that forces are late by a delay, s, which the fit has corrected."""
    late, early = ("forces", "positions")[:: 1 if delay > 0.0 else -1]
    said = (
        f"The {late} are {1e3 * abs(delay):.3g} ms (+- {2e3 * deviation:.1g}) late for the {early}"
    )
    return LogFault("delay", f"{said}; this is corrected (--delay 0 leaves it in).", delay, False)


def lost_share(log: Log) -> float:
    """Return the share of a log's samples that are missing."""
    if log.rows < 2:
        return 0.0
    step = 1.0 / log.rate
    steps = np.diff(log.time)
    missing = np.where(gaps(log.time, step), np.rint(steps / step) - 1.0, 0.0)
    # A pause between two recordings is no lost sample.
    few = missing[missing <= _PAUSE * log.rows].sum()
    return float(few / (log.rows + few))


_PAUSE = 0.02
"""Longest gap, as a share of the log, that counts as lost samples rather than as a pause."""


def sampling_jitter(log: Log, how: Preprocessing) -> tuple[float, float, float]:
    """Return the jitter of sampling times (s), its significance, and its share of the noise.

    Where samples are taken dt off, positions are v dt off: joints that move have it in common.
    Eighth differences e of positions keep that and nothing of a smooth motion. The mean of
    e_i e_j v_i v_j over pairs of joints is that of (v_i v_j)^2 dt^2; encoders' noise, which joints
    do not share, adds nothing. Clear: in standard deviations.
    """
    longest = max(log.segments, key=lambda part: part.stop - part.start)
    time, joints = uniform(*(part[longest][:_LOOK] for part in (log.time, log.joints)))
    n, edge = joints.shape[1], DIFFERENCE // 2
    if how.cutoff is None or n < 2 or len(time) < 20 * DIFFERENCE:
        return 0.0, 0.0, 0.0
    rate = (len(time) - 1) / float(time[-1] - time[0])
    noise = np.maximum(how.joint_noise, 1e-300)
    rates = np.gradient(lowpass(joints, rate, how.cutoff), 1.0 / rate, axis=0)[edge:-edge] / noise
    rough = (
        np.diff(joints, n=DIFFERENCE, axis=0) / np.sqrt(comb(2 * DIFFERENCE, DIFFERENCE)) / noise
    )
    first, second = np.triu_indices(n, 1)
    pairs = (rough[:, first] * rough[:, second] * rates[:, first] * rates[:, second]).sum(axis=1)
    sizes = ((rates[:, first] * rates[:, second]) ** 2).sum(axis=1)
    square = pairs.sum() / max(float(sizes.sum()), 1e-300)
    clear = pairs.sum() / max(_ALIKE * float(np.sqrt((pairs**2).sum())), 1e-300)
    jitter = float(np.sqrt(max(square, 0.0)))
    return jitter, float(clear), float((jitter * np.sqrt((rates**2).mean(axis=0))).max())
