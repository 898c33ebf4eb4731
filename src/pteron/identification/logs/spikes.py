"""Spikes: samples, or some in a row, that jump away from a channel and back; they are left out."""

from __future__ import annotations

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.identification.logs.findings import Finding

LONGEST = 16
"""Samples in a row that are a spike at most: what stays away longer is a step, and no spike."""
MARGIN = 64
"""Rows to each side that a search looks at."""
_WINDOW = 21
"""Differences whose median is the motion's own: the jumps of a group are fewer than half."""
_USUAL = 20.0
"""Least jump of a spike, as a multiple of the 95th percentile of all differences."""
_SHARE_OF_JOINT, _SHARE_OF_FORCE = 0.01, 0.5
"""Least jump, as a share of a channel's span; friction and stops make forces jump."""
_FASTER = 3.0
"""Least jump of a joint, as a multiple of the differences nearby: a fast move is no jump."""
_BACK = 0.25
"""Largest distance from the motion after a spike, as a share of the largest in it."""
_SUDDEN = 0.5
"""Least first and last jump of a spike, as a share of its largest distance from the motion: an
edge, not a slope."""
_REVERSING = 0.05
"""Speed, as a share of a joint's usual one, below which friction may turn."""
_BEYOND = 0.1
"""How far a force must lie beyond its usual values, as a share of their span, to stand out where
friction may turn."""
_UNUSUAL = 3.0
"""Least acceleration of an emergency stop, as a multiple of its 90th percentile."""
_RESTS, _MOVES = 0.1, 0.2
"""Joints rest below the first share of their usual travel, and move above the second."""
_MOST = 0.01
"""Largest share of the rows that is left out: where spikes are more, they are no exception."""

_SPAN = (1.0, 99.0)
"""Percentiles between which a channel's usual values lie."""

_LISTED = 5
"""Groups of spikes whose rows a message names."""

Values = NDArray[np.float64]
"""Values of a channel, row by row."""

Mask = NDArray[np.bool_]
"""Whether each row counts."""


def joint_spikes(coordinates: Values) -> Mask:
    """Return which samples (T,) of a joint coordinate stand out.

    A group jumps away from the motion within one sample, at most `LONGEST` samples later back onto
    it, each time by far more than the joint moves in a sample.
    """
    steps = np.abs(np.diff(coordinates))
    nearby = scipy.ndimage.median_filter(steps, _WINDOW, mode="nearest")
    return _spike_groups(coordinates, _SHARE_OF_JOINT, _FASTER * nearby)


def force_spikes(forces: Values, joints: Values, joint: int) -> Mask:
    """Return which samples (T,) of a force stand out that no motion explains.

    Forces may jump where an acceleration does, as in an emergency stop, and where friction turns
    with the joint itself: the motion (T, n) says so, in which `joint` is that of this force.
    """
    is_spike = _spike_groups(forces, _SHARE_OF_FORCE, 0.0)
    if not is_spike.any():
        return is_spike
    speed = np.abs(np.gradient(joints[:, joint]))
    turns = speed < _REVERSING * np.percentile(speed, 95.0)
    low, high = np.percentile(forces, _SPAN)
    far = _BEYOND * (high - low)
    usual = (forces > low - far) & (forces < high + far)
    turns = scipy.ndimage.maximum_filter1d(turns.astype(np.int8), 5) > 0
    motion = _JointMotion(joints)
    for start, stop in runs(is_spike):
        group = slice(start, stop)
        turned = turns[group].any() and usual[group].all()
        if turned or motion.accelerates(start, stop):
            is_spike[group] = False
    return is_spike


class _JointMotion:
    """The motion of a piece's joints (T, n), and its usual sizes."""

    def __init__(self, joints: Values) -> None:
        self._steps = np.diff(joints, axis=0)
        self._joints = joints
        self._usual: dict[int, Values] = {}
        travel = np.percentile(np.abs(joints[LONGEST:] - joints[:-LONGEST]), 90.0, axis=0)
        self._travel = np.maximum(travel, np.finfo(float).tiny)

    def accelerates(self, start: int, stop: int) -> bool:
        """Return whether joints accelerate in rows `start` to `stop` unlike before and after.

        They may stop in them, or start.
        """
        length = stop - start
        if length not in self._usual:
            self._usual[length] = np.percentile(_speed_gains(self._steps, length), 90.0, axis=0)
        # Derivatives and forces may be a sample apart.
        first = max(start - length - 2, 0)
        pushes = _speed_gains(self._steps[first : first + 3 * length + 3], length)
        if (pushes > _UNUSUAL * self._usual[length]).any():
            return True
        # Noise of the positions may hide that, but not that all joints rest.
        last = len(self._joints) - 1
        travel_before = self._travel_between(max(start - 1 - LONGEST, 0), max(start - 1, 0))
        travel_after = self._travel_between(min(stop, last), min(stop + LONGEST, last))
        return min(travel_before, travel_after) < _RESTS < _MOVES < max(travel_before, travel_after)

    def _travel_between(self, start: int, stop: int) -> float:
        """Return the largest travel of a joint between two rows, in units of its usual travel."""
        return float((np.abs(self._joints[stop] - self._joints[start]) / self._travel).max())


def _speed_gains(steps: Values, length: int) -> Values:
    """Return the gain of speed over `length` steps beyond that before and after, per joint."""
    gain = steps[length:] - steps[:-length]
    return np.abs(gain[length:-length] - (gain[: -2 * length] + gain[2 * length :]) / 2.0)


def _spike_groups(signal: Values, share: float, least: Values | float) -> Mask:
    """Return the mask of samples between a jump and the jump back; empty for short signals."""
    is_spike = np.zeros(len(signal), dtype=bool)
    if len(signal) < 2 * _WINDOW:
        return is_spike
    steps = np.diff(signal)
    jumps = steps - scipy.ndimage.median_filter(steps, _WINDOW, mode="nearest")
    usual = _USUAL * float(np.percentile(np.abs(jumps), 95.0))
    large = np.abs(jumps) > np.maximum(
        max(usual, share * np.ptp(np.percentile(signal, _SPAN))), least
    )
    places = np.flatnonzero(large)
    i = 0
    while i < len(places):
        first = places[i]
        away = farthest = 0.0
        i += 1
        for k in range(i - 1, len(places)):
            last = places[k]
            if last - first > LONGEST:
                break
            away += jumps[last]
            farthest = max(farthest, abs(away))
            if k >= i and abs(away) <= _BACK * farthest:
                edges = min(abs(jumps[first]), abs(jumps[last]))
                if edges >= _SUDDEN * farthest:
                    is_spike[first + 1 : last + 1] = True
                    i = k + 1
                break
    return is_spike


def runs(mask: Mask) -> list[tuple[int, int]]:
    """Return first row, and row behind the last, of each run that is true."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


class Spikes:
    """The spikes of all channels, by `columns`: first the n joints, then their forces."""

    def __init__(self, columns: tuple[str, ...], source: str) -> None:
        self._columns, self._source = columns, source
        self._spikes: dict[str, list[tuple[int, int, float]]] = {name: [] for name in columns}
        self._too_many = False

    def find(self, joints: Values, forces: Values, inner: slice, first_row: int) -> Mask:
        """Return the mask of a piece's rows to drop; none if there are too many.

        `joints` and `forces` (T, n) have up to `MARGIN` rows more at each end; `inner` are the
        piece's own, of which the first is row `first_row` of the file, from 0.
        """
        n = joints.shape[1]
        out = np.zeros(inner.stop - inner.start, dtype=bool)
        for j, (name, channel) in enumerate(
            zip(self._columns, np.hstack([joints, forces]).T, strict=True)
        ):
            is_spike = joint_spikes(channel) if j < n else force_spikes(channel, joints, j - n)
            out |= is_spike[inner]
            self._spikes[name] += [
                (first_row + a, first_row + b, float(channel[inner][a]))
                for a, b in runs(is_spike[inner])
            ]
        if out.mean() > _MOST:
            self._too_many = True
            out[:] = False
        return out

    def findings(self) -> tuple[Finding, ...]:
        """Return a finding for each channel with spikes, and whether they are left out."""
        findings = []
        fate = "left out like a gap, not repaired"
        if self._too_many:
            fate = f"left in, for over {_MOST:.0%} of the rows are spikes; record it again"
        for name, groups in self._spikes.items():
            count = sum(b - a for a, b, _ in groups)
            if not count:
                continue
            named = [f"{a + 1} to {b}" if b - a > 1 else f"{b}" for a, b, _ in groups[:_LISTED]]
            ellipsis = ", ..." if len(groups) > _LISTED else ""
            plural = "s" * (count > 1)
            what = "spikes" if plural else "a spike"
            message = (
                f"{self._source}: row{plural} {', '.join(named)}{ellipsis}, column {name}: {what} "
                f"of {count} sample{plural} that jump away and back (the first is "
                f"{groups[0][2]:g}); {fate}"
            )
            findings.append(Finding("spike", message, groups[0][0] + 1, name, count))
        return tuple(findings)
