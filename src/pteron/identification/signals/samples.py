"""A log as states and forces, sample by sample, block by block."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d  # type: ignore[import-untyped]

from pteron.errors import DataError
from pteron.identification.logs import Log
from pteron.identification.signals.blocks import blocks
from pteron.identification.signals.differences import LOST, central_differences
from pteron.identification.signals.fourier import fitted_series
from pteron.identification.signals.lowpass import SETTLING, smoothed
from pteron.identification.signals.spline import fitted_spline, spline_motion
from pteron.identification.signals.states import States
from pteron.identification.signals.treatment import Treatment
from pteron.identification.signals.uniform import uniform
from pteron.kernels import Array
from pteron.manipulator import Manipulator

__all__ = ["Samples", "samples"]

_AGREES = 1e-7
"""Relative difference of two second derivatives that is their error on a smooth motion."""

_FEW = 0.5
_ROUNDING = 1e-14
_SMEARED = 24
"""Samples to each side of a jump that a spline of degree 7 spreads it over, to 1e-7 of it."""

_BLOCK = 1 << 15
"""Rows of a block: a regressor of 40 columns takes 40 MB of it."""

_SPLINE_SETTLING = 20.0
"""Knots at a block's ends that feel where it ends; the feeling halves from each to the next."""


@dataclass(frozen=True)
class Samples:
    """States and measured forces at the log's own samples.

    Attributes
    ----------
    states : States
        R of them.
    forces : array, shape (R, n)
        As they were measured, N.
    fresh : slice
        The samples that no other block has.
    source : str
        What messages call the log.
    smooth : array of bool, shape (R,)
        False where positions without noise have a jump in a derivative, which a spline smears.
    """

    states: States
    forces: Array
    fresh: slice
    source: str
    smooth: NDArray[np.bool_]


def samples(
    robot: Manipulator, log: Log | Iterable[Log], treatment: Treatment, *, margin: int = 0
) -> Iterator[Samples]:
    """Yield the states and forces of a log, in blocks that overlap by `margin` rows at each end.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    log : Log or iterable of Log
        The log, or its pieces in order.
    treatment : Treatment
        How positions are smoothed and differentiated.
    margin : int
        Rows at each end of a block that the next filter will lose.

    Raises
    ------
    DataError
        If a sample has no pose or is next to a singularity, or if every stretch without a gap is
        shorter than the filters' edges.
    """
    if treatment.derivatives == "periodic":
        assert isinstance(log, Log)  # `treatment_of` takes no other for periodic
        yield _periodic(robot, log, treatment)
        return
    pieces = [log] if isinstance(log, Log) else log
    edge = _edge(treatment)
    step = treatment.decimation.factor
    # Blocks begin at the same phase of the decimation.
    edge, size = step * ceil((edge + margin) / step) - margin, step * ceil(_BLOCK / step)
    found = False
    source, rows = "log", 0
    for block in blocks(pieces, edge + margin, size, treatment.rate):
        found = True
        yield _block(robot, block, treatment, edge, margin)
        source, rows = block.source, rows + block.rows
    if not found:
        source = log.source if isinstance(log, Log) else source
        raise DataError(
            f"{source}: every stretch without a gap is shorter than the {2 * (edge + margin)} rows "
            "that the filters' edges take; record longer, or choose a higher cutoff and band"
        )


def _edge(treatment: Treatment) -> int:
    """Return the rows at each end that smoothing and differentiation lose."""
    if treatment.derivatives == "spline":
        knot = 1.0 / (2.0 * treatment.cutoff) if treatment.cutoff else 1.0 / treatment.rate
        return ceil(_SPLINE_SETTLING * knot * treatment.rate)
    if treatment.cutoff is None:
        return LOST
    return LOST + ceil(SETTLING * treatment.rate / treatment.cutoff)


def _block(robot: Manipulator, block: Log, treatment: Treatment, edge: int, margin: int) -> Samples:
    time, forces = block.time, block.forces
    inner = slice(edge, block.rows - edge)
    smooth = np.ones(block.rows - 2 * edge, dtype=bool)
    if treatment.derivatives == "spline":
        motion = spline_motion(time, block.sliders, treatment.cutoff)
        if treatment.cutoff is None:
            smooth = _smooth(time, block.sliders)[inner]
        motion = motion[0][inner], motion[1][inner], motion[2][inner]
    else:
        time, sliders = uniform(time, block.sliders)
        if time is not block.time and sliders is not block.sliders:
            _, forces = uniform(block.time, forces)
        rate = (len(time) - 1) / float(time[-1] - time[0])
        if treatment.cutoff is not None:
            sliders = smoothed(sliders, rate, treatment.cutoff)
        first, second = central_differences(sliders, rate)
        lost = slice(edge - LOST, len(first) - (edge - LOST))
        motion = sliders[inner], first[lost], second[lost]
    states = States.of_sliders(
        robot,
        motion,
        time[inner],
        treatment.mode,
        payload=None if block.payload is None else block.payload[inner],
        source=block.source,
        first_row=block.first_row + edge,
    )
    return Samples(states, forces[inner], slice(margin, len(states) - margin), block.source, smooth)


def _smooth(time: Array, sliders: Array) -> NDArray[np.bool_]:
    """Return where a spline through samples without noise agrees with central differences.

    They err in different ways next to a jump in a derivative, as at the ends of a rest. Jumps are
    few: where most samples are apart it is for another reason, such as the rounding of the stamps.
    """
    spline = fitted_spline(time, sliders, None)
    even = np.linspace(time[0], time[-1], len(time))
    rate = (len(even) - 1) / float(even[-1] - even[0])
    _, second = central_differences(spline(even), rate)
    rounding = _ROUNDING * np.abs(sliders).max() * rate**2
    least = _AGREES * np.abs(second).max(axis=0) + rounding
    apart = (np.abs(spline(even[LOST:-LOST], 2) - second) > least).any(axis=1)
    if apart.mean() > _FEW:
        return np.ones(len(time), dtype=bool)
    apart = maximum_filter1d(np.pad(apart, LOST).astype(int), 2 * _SMEARED + 1) > 0
    return np.asarray(~apart)


def _periodic(robot: Manipulator, log: Log, treatment: Treatment) -> Samples:
    assert treatment.period is not None
    series = fitted_series(log.time, log.sliders, treatment.period, highest=treatment.cutoff)
    motion = series.at(log.time), series.at(log.time, 1), series.at(log.time, 2)
    states = States.of_sliders(
        robot,
        motion,
        log.time,
        treatment.mode,
        payload=log.payload,
        source=log.source,
        first_row=log.first_row,
    )
    return Samples(
        states, log.forces, slice(0, len(states)), log.source, np.ones(len(states), dtype=bool)
    )
