"""Rows that are set aside before a calibration's first fit, and why.

Rows that the fit explains are used again after it. A row far under a plane that other rows touch is
not: no fit moves it out of the plate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.calibration import thresholds
from pteron.calibration.guess import Guess, UnknownBlock
from pteron.calibration.measurements import Measurements
from pteron.calibration.mistake import travel_ends
from pteron.calibration.raw_faults import row_misfits
from pteron.calibration.residuals import MachineSlopes

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_FACTORS = {
    0.5: "half",
    2.0: "twice",
    0.25: "a quarter of",
    4.0: "four times",
    0.1: "a tenth of",
    10.0: "ten times",
    1e-3: "a thousandth of (mm for m)",
    1e3: "a thousand times (m for mm)",
    float(np.pi / 180.0): "pi/180 of (degrees for radians)",
    1 / 25.4: "1/25.4 of (inches)",
    -1.0: "minus",
}
"""Factors of readings, as wrong step units make them, and how they are called."""

_PUT_BACK = 0.1
"""Greatest residual with a factor on the readings, as a share of the residual without it, at which
the factor explains the row."""

_TELLING = 2
"""Least number of measured values in a row: with one, some factor of many fits by chance."""


class SetAside(NamedTuple):
    """Rows that a first fit leaves out, those that stay out (barred), and why, by row."""

    aside: Mask
    barred: Mask
    reasons: dict[int, str]


def rows_set_aside(
    start: Guess, measurements: Measurements, blocks: Sequence[UnknownBlock], poses: Array
) -> SetAside:
    """Return the rows out of reach, beyond limits or far off on the drawn machine, with reasons."""
    reasons: dict[int, str] = {}
    lost: Mask = np.asarray(np.isnan(poses).any(axis=1))
    depths = _depths_under_planes(start, measurements, poses)
    barred = depths > thresholds.UNDER_PLANE
    squares = row_misfits(start, measurements, blocks, poses)
    finite = np.isfinite(squares)
    middle = float(np.median(squares[finite])) if finite.any() else 0.0
    far = finite & (squares > thresholds.FAR_ROW**2 * max(1.0, middle))
    if far.sum() > thresholds.FEW_LEFT_OUT * len(measurements):  # no rows, but the log, is far off
        far[:] = False
    beyond = dict(_limit_excesses(start, measurements))
    if len(beyond) > thresholds.MANY_LEFT_OUT * len(measurements):  # the limits are wrong
        beyond = {}
    factors = _Factors(start, measurements, blocks, poses, squares)
    for i in np.flatnonzero(lost | barred | far):
        k = int(i)
        reason = beyond.get(k, "its readings lead to no pose as drawn")
        if barred[k]:
            reason = f"{1e3 * depths[k]:.3g} mm under the plane that other rows touch"
        elif far[k]:
            reason = beyond.get(k, "far off on the machine as drawn")
        reasons[k] = reason + factors.factor_clause(k)
    for k, reason in beyond.items():
        reasons.setdefault(k, reason)
    aside = lost | barred | far
    aside[list(beyond)] = True
    from_barred = measurements.origins >= 0
    from_barred &= barred[measurements.origins] | lost[measurements.origins]
    return SetAside(
        aside | from_barred, barred | (from_barred & barred[measurements.origins]), reasons
    )


def _depths_under_planes(start: Guess, measurements: Measurements, poses: Array) -> Array:
    """Return the depths (N,) of rows without a height under a known plane that others touch."""
    depths = np.zeros(len(measurements))
    names = np.array(measurements.planes, dtype=object)
    heights = np.abs(measurements.heights)
    points = start.points(measurements.marks, np.nan_to_num(poses))
    for name, (*normal, offset) in start.planes.items():
        plane = measurements.setup.planes.get(name)
        touched = (names == name) & (heights < thresholds.UNDER_PLANE)
        if (plane is not None and not plane.known) or not touched.any():
            continue
        under = offset - points @ np.array(normal)
        depths = np.where(np.isnan(measurements.heights), np.maximum(depths, under), depths)
    depths[np.isnan(poses).any(axis=1)] = 0.0
    return depths


def _limit_excesses(start: Guess, measurements: Measurements) -> Iterator[tuple[int, str]]:
    """Yield rows whose readings are beyond a joint's limits, and by how much."""
    joints = start.joints(measurements.readings)
    for j, (leg, name) in enumerate(zip(start.robot.legs, start.robot.joint_names, strict=True)):
        if leg.limits is None:
            continue
        low, high = leg.limits
        excess = np.maximum(low - joints[:, j], joints[:, j] - high)
        unit = "mm" if leg.joint.unit == "m" else "mrad"
        for i in np.flatnonzero(excess > thresholds.BEYOND_LIMITS * (high - low)):
            yield int(i), f"{name} is {1e3 * excess[i]:.3g} {unit} beyond its limits"


class _Factors:
    """A search for the factor of a row's readings that explains its outlying measurement."""

    def __init__(
        self,
        start: Guess,
        measurements: Measurements,
        blocks: Sequence[UnknownBlock],
        poses: Array,
        squares: Array,
    ) -> None:
        self.start, self.measurements, self.blocks = start, measurements, blocks
        good = ~np.isnan(poses).any(axis=1)
        self.middle = np.median(poses[good], axis=0)
        self.slopes = MachineSlopes(start.robot, ())
        self.squares = squares
        self.poses = poses

    def factor_clause(self, row: int) -> str:
        """Return a clause naming the factor of readings that explains a row; "" for none."""
        joints = self.start.joints(self.measurements.readings[row])
        candidates = []
        for origin, end in travel_ends(self.start.robot):
            for factor, words in _FACTORS.items():
                tried = end + factor * (joints - end)
                pose = self.slopes.poses(self.start, tried[None], self.middle[None])
                if np.isfinite(pose).all():
                    off = self._error_at(row, tried, pose)
                    if off is not None:
                        candidates.append((*off, factor, words + " its way" + origin))
        if not candidates:
            return ""
        _, where, factor, words = min(candidates)
        return f"; {words}, factor {factor:.3g}, would put it {where}"

    def _error_at(self, row: int, joints: Array, pose: Array) -> tuple[float, str] | None:
        """Return a row's error at other joint coordinates, with its words; None if large."""
        is_row = np.arange(len(self.measurements)) == row
        poses = self.poses.copy()
        poses[is_row] = pose
        depth, old_depth = (
            _heights_over_planes(self.start, self.measurements, row, at)
            for at in (pose, self.poses[is_row])
        )
        if np.isnan(self.measurements.heights[row]) and depth is not None and old_depth is not None:
            # Nothing says where it was, but that it is on the plane.
            if abs(depth) < _PUT_BACK * abs(old_depth):
                return abs(depth), f"{1e3 * abs(depth):.2g} mm from it"
            return None
        readings = self.measurements.readings.copy()
        readings[row] = self.start.readings(joints)
        measured = self.measurements.rows(is_row)
        numbers = np.isfinite(np.hstack([*measured.parts.values()])).sum()
        if len(measured) > 1 or numbers < _TELLING:
            return None
        square = row_misfits(self.start, measured, self.blocks, pose)[0]
        limit = thresholds.FAR_ROW**2
        if np.isfinite(square) and square < min(limit, _PUT_BACK * self.squares[row]):
            return float(square), "where it was measured"
        return None


def _heights_over_planes(
    start: Guess, measurements: Measurements, row: int, pose: Array
) -> float | None:
    """Return a row's height over its known plane at a pose (1, m), m; None without a plane."""
    name = measurements.planes[row]
    plane = measurements.setup.planes.get(name)
    if (plane is not None and not plane.known) or name not in start.planes:
        return None
    if not np.isfinite(pose).all():
        return None
    *normal, offset = start.planes[name]
    return float((start.points([measurements.marks[row]], pose) @ np.array(normal))[0] - offset)
