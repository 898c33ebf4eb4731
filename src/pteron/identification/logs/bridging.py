"""Lost samples bridged, where one or a few are missing here and there.

A filter loses its edges at each gap. Where gaps are rare that is little, and nothing is bridged;
where they come every few rows nothing would be left.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.identification.logs.findings import Finding
from pteron.identification.logs.gaps import gaps, stretches
from pteron.identification.logs.log import Log, rows_of
from pteron.kernels import Array

_LONGEST = 3
"""Samples, at most, that are bridged: a gap of four steps is short for any motion that the sampling
resolves (ten samples a period of its fastest part), and polynomials do not swing in it."""

_OFTEN = 1e-3
"""Gaps a row from which they are bridged: each costs a filter's edges, some hundred rows, so that
fewer take less than a tenth of the log."""

_SIDES = (8, 5, 3)
"""Rows on each side of a gap that a polynomial is fitted to: those that predict known rows best."""

_AROUND = 40
"""Rows of a stretch, at least, that is filled: shorter ones are left to the filters' edges."""


def fill_gaps(log: Log) -> Log:
    """Return a log with short gaps filled, and a finding of it; unchanged where gaps are rare.

    Positions get polynomials of degree 5, forces of degree 3, which passes on less noise.
    """
    if log.rows < 2:
        return log
    step = 1.0 / log.rate
    is_gap = gaps(log.time, step)
    missing = np.where(is_gap, np.rint(np.diff(log.time) / step).astype(int) - 1, 0)
    short = (missing >= 1) & (missing <= _LONGEST)
    if log.payload is not None:
        short &= np.diff(log.payload) == 0
    if short.sum() <= _OFTEN * log.rows:
        return log
    parts = []
    for start, stop in stretches(is_gap & ~short):
        part = log.part(start, stop)
        lost = (missing * short)[start : stop - 1]
        parts.append(part if part.rows < _AROUND else _insert_samples(part, lost))
    if any(part.rows_in_file is not None for part in parts):
        parts = [replace(part, rows_in_file=rows_of(part)) for part in parts]
    count = int(missing[short].sum())
    message = (
        f"{log.source}: {count} samples that are missing ({100.0 * count / (log.rows + count):.2g} "
        f"%), at most {int(missing[short].max())} one after the other, are bridged by polynomials"
    )
    names = ("time", "joints", "forces", "pose", "payload", "rows_in_file")
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in names
        if getattr(parts[0], name) is not None
    }
    finding = Finding("gap", message, count=count)
    return replace(log, **joined, findings=(*log.findings, finding), step=step)


def _insert_samples(log: Log, missing: NDArray[np.int64]) -> Log:
    """Return a stretch with `missing` (T - 1,) samples inserted between its rows."""
    places = np.repeat(np.arange(log.rows - 1), missing)
    nth = np.concatenate([np.arange(1, k + 1) for k in missing[missing > 0]] or [np.zeros(0)])
    share = nth / (missing[places] + 1.0)
    instants = log.time[places] + share * (log.time[places + 1] - log.time[places])
    time = np.concatenate([log.time, instants])
    order = np.argsort(time, kind="stable")
    rows = rows_of(log)

    def interpolate(samples: Array, degree: int) -> Array:
        """Return values (T, k) with missing samples filled in by local polynomials of a degree."""
        filled = _interpolate_locally(log.time, samples, places, instants, degree)
        return np.asarray(np.concatenate([samples, filled])[order])

    return replace(
        log,
        time=time[order],
        joints=interpolate(log.joints, 5),
        forces=interpolate(log.forces, 3),
        pose=None if log.pose is None else interpolate(log.pose, 5),
        payload=None if log.payload is None else np.r_[log.payload, log.payload[places]][order],
        rows_in_file=np.concatenate([rows, rows[places]])[order],
    )


def _interpolate_locally(
    time: Array, samples: Array, places: NDArray[np.int64], instants: Array, degree: int
) -> Array:
    """Return values (K, n) at instants behind rows `places` (K,), of polynomials fitted around.

    Through more rows than they have coefficients: an interpolated noise is no white one, and
    filters and their cut-offs are made for white noise.
    """
    step = float(np.median(np.diff(time)))
    side = _best_side(time / step, samples, degree)
    predictions = np.empty((len(places), samples.shape[1]))
    for k, (row, at) in enumerate(zip(places.tolist(), instants.tolist(), strict=True)):
        start = min(max(row + 1 - side, 0), max(len(time) - 2 * side, 0))
        rows = slice(start, start + 2 * side)
        powers = np.vander((time[rows] - at) / step, degree + 1, increasing=True)
        predictions[k] = np.linalg.lstsq(powers, samples[rows], rcond=None)[0][0]
    return predictions


def _best_side(ticks: Array, samples: Array, degree: int) -> int:
    """Return the number of rows on each side with which polynomials predict a row best.

    Many rows make less of the noise, few follow a motion that is fast for its sampling.
    """
    errors = {}
    for side in _SIDES:
        offsets = np.r_[-side:0, 1 : side + 1].astype(float)
        weights = np.linalg.pinv(np.vander(offsets, degree + 1, increasing=True))[0]
        kernel = np.insert(weights, side, 0.0)
        predicted = scipy.ndimage.correlate1d(samples, kernel, axis=0)[side:-side]
        is_even = ticks[2 * side :] - ticks[: -2 * side] < 2 * side + 0.5
        if is_even.any():
            errors[side] = np.median(np.abs(predicted - samples[side:-side])[is_even], axis=0)
    if not errors:
        return _SIDES[-1]
    least = np.min([*errors.values()], axis=0)
    tiny = np.finfo(float).tiny
    return min(errors, key=lambda side: float((errors[side] / np.maximum(least, tiny)).max()))
