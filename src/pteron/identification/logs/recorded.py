"""Faults of a log's columns: impossible or constant forces, wrapped encoders, saturated drives.

They are looked for in a log in memory, or in the pieces of a file; what shows only over all pieces,
such as a channel that freezes, in `channels`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.gaps import gaps
from pteron.identification.logs.log import Log
from pteron.identification.logs.spikes import LONGEST
from pteron.tolerances import ROUNDING

_STRONGEST = 1e9
"""Largest force that a cell may hold, N."""

_SPAN = 0.9
"""Least jump where an encoder wraps, as a share of the joint's span."""

_STILL = 0.1
"""Largest of all other steps, over the jump: a joint that is as fast as that does not wrap."""

_ALIKE = 0.02
"""Largest difference between the jumps of one encoder, or between a jump and a turn, over the
jump."""

_LEAST = 0.005
"""Least share of the samples at the extreme value, for a force to be at its limit."""

_LEVEL = 8.0
"""Least number of samples at the extreme value, over those at the next value: at the round top of a
coarsely recorded channel this is about 2."""

_MOVES = 0.02
"""Speed, over the joint's largest, above which the joint counts as moving."""


def check_forces(
    forces: NDArray[np.float64], columns: tuple[str, ...], source: str, first_row: int
) -> None:
    """Raise a `DataError` where forces, (rows, n), are larger than any actuator's."""
    beyond = ~(np.abs(forces) <= _STRONGEST)
    if beyond.any():
        i, j = (int(k) for k in np.argwhere(beyond)[0])
        raise DataError(
            f"{source}: row {first_row + i + 1}, column {columns[j]}: {forces[i, j]:g} is no "
            f"force; up to {_STRONGEST:g} is expected; correct the value, or leave the row out"
        )


def check_recorded(log: Log) -> None:
    """Raise LogError where forces never change, or else where encoders wrap."""
    constant = [
        f"{name} is {force[0]:g} throughout"
        for name, force in zip(log.force_names, log.forces.T, strict=True)
        if len(force) > 1 and np.ptp(force) <= ROUNDING * np.abs(force).max(initial=0.0)
    ]
    if constant:
        raise log.fault(
            "constant",
            f"{'; '.join(constant)}: no force of a drive that moves a machine; look at the "
            "channel, and record it again, or correct which columns are read",
        )
    wraps = []
    for i, (name, joint) in enumerate(zip(log.joint_names, log.joints.T, strict=True)):
        turns = log.symbols is not None and log.symbols[i].unit == "rad"
        for size, row in _jump(log, joint, turns):
            unit = "rad" if turns else "m"
            turn = ", a turn," if turns and _is_turn(size) else ""
            wraps.append(
                f"{name} jumps by {size:.4g} {unit}{turn} at row {row + log.first_row + 1}"
            )
    if wraps:
        raise log.fault(
            "wrapped",
            f"{'; '.join(wraps)}: an encoder that wraps; unwrap it, such as with "
            "numpy.unwrap(joint, period=...), and identify that",
        )


def saturation_sentences(log: Log) -> tuple[str, ...]:
    """Return a sentence for each force that stays at its largest or least value while it moves."""
    sentences = []
    speeds = np.abs(np.diff(log.joints, axis=0, append=log.joints[-1:]))
    for name, force, speed in zip(log.force_names, log.forces.T, speeds.T, strict=True):
        moving = force[speed > _MOVES * speed.max(initial=0.0)]
        if not moving.size:
            continue
        for word, signed in (("largest", moving), ("least", -moving)):
            levels, counts = np.unique(signed, return_counts=True)
            first = levels >= levels[-1] - ROUNDING * np.ptp(force)
            top, below = int(counts[first].sum()), counts[~first]
            if top < _LEAST * len(moving) or not below.size or top < _LEVEL * below[-1]:
                continue
            extreme = levels[-1] if word == "largest" else -levels[-1]
            share = 100.0 * top / len(moving)
            sentences.append(
                f"{name} stays at its {word} value, {extreme:.4g}, in {share:.2g} % of the samples "
                f"of {log.source}: the drive or what measures it is at its limit (saturation), and "
                "forces there need not be those that act; move more slowly, or leave such "
                "stretches out."
            )
    return tuple(sentences)


def _jump(log: Log, joint: NDArray[np.float64], turns: bool) -> list[tuple[float, int]]:
    """Return the size and row, from 0, of the jumps of a joint whose encoder wraps."""
    if len(joint) < 2 * LONGEST:
        return []
    steps = np.diff(joint)
    steps[gaps(log.time, 1.0 / log.rate)] = 0.0  # it may move in a gap
    size = float(np.abs(steps).max())
    far = np.abs(steps) > (1.0 - _ALIKE) * size
    if size < _SPAN * np.ptp(joint) or np.abs(steps[~far]).max(initial=0.0) > _STILL * size:
        return []
    rows = np.flatnonzero(far)
    turn = turns and _is_turn(size)
    side = joint > joint.min() + 0.5 * size
    # What is away for some samples and back is a spike.
    if not turn and min(side.sum(), (~side).sum()) <= LONGEST:
        return []
    return [(size, int(rows[0]) + 1)]


def _is_turn(size: float) -> bool:
    """Return whether the size of a jump is a full turn, rad."""
    return abs(size - 2.0 * np.pi) <= _ALIKE * size
