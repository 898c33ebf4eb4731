"""Lost samples bridged, where one or a few are missing here and there.

A filter loses its edges at each gap. Where gaps are rare that is little, and nothing is bridged;
where they come every few rows nothing would be left.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.identification.logs.log import Finding, Log, gaps, rows_of, stretches

_LONGEST = 3
"""Samples, at most, that are bridged: a gap of four steps is short for any motion that the sampling
resolves (ten samples a period of its fastest part), and splines do not swing in it."""

_OFTEN = 1e-3
"""Gaps a row from which they are bridged: each costs a filter's edges, some hundred rows, so that
fewer take less than a tenth of the log."""

_AROUND = 6
"""Rows of a stretch, at least, that a spline of degree 5 goes through."""


def bridged(log: Log) -> Log:
    """Return a log with short gaps filled by splines and a finding; unchanged if they are rare.

    Positions get a spline of degree 5, forces one of degree 3, which passes on less noise.
    """
    if log.rows < 2:
        return log
    step = 1.0 / log.rate
    apart = gaps(log.time, step)
    missing = np.where(apart, np.rint(np.diff(log.time) / step).astype(int) - 1, 0)
    short = (missing >= 1) & (missing <= _LONGEST)
    if log.payload is not None:
        short &= np.diff(log.payload) == 0
    if short.sum() <= _OFTEN * log.rows:
        return log
    parts = []
    for start, stop in stretches(apart & ~short):
        part = log.part(start, stop)
        lost = (missing * short)[start : stop - 1]
        parts.append(part if part.rows < _AROUND else _filled(part, lost))
    if any(part.rows_in_file is not None for part in parts):
        parts = [replace(part, rows_in_file=rows_of(part)) for part in parts]
    count = int(missing[short].sum())
    message = (
        f"{log.source}: {count} samples that are missing ({100.0 * count / (log.rows + count):.2g} "
        f"%), at most {int(missing[short].max())} one after the other, are bridged by splines"
    )
    names = ("time", "joints", "forces", "pose", "payload", "rows_in_file")
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in names
        if getattr(parts[0], name) is not None
    }
    finding = Finding("gap", message, count=count)
    return replace(log, **joined, findings=(*log.findings, finding), step=step)


def _filled(log: Log, missing: np.ndarray) -> Log:
    """Return a stretch with `missing` (T - 1,) samples put in between its rows."""
    places = np.repeat(np.arange(log.rows - 1), missing)
    nth = np.concatenate([np.arange(1, k + 1) for k in missing[missing > 0]] or [np.zeros(0)])
    share = nth / (missing[places] + 1.0)
    instants = log.time[places] + share * (log.time[places + 1] - log.time[places])
    time = np.concatenate([log.time, instants])
    order = np.argsort(time, kind="stable")
    rows = rows_of(log)

    def between(values: np.ndarray, degree: int) -> np.ndarray:
        spline = scipy.interpolate.make_interp_spline(log.time, values, k=degree)
        return np.asarray(np.concatenate([values, spline(instants)])[order])

    return replace(
        log,
        time=time[order],
        joints=between(log.joints, 5),
        forces=between(log.forces, 3),
        pose=None if log.pose is None else between(log.pose, 5),
        payload=None if log.payload is None else np.r_[log.payload, log.payload[places]][order],
        rows_in_file=np.concatenate([rows, rows[places]])[order],
    )
