"""A log as states and forces, sample by sample, block by block."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from pteron.identification.errors import LogError
from pteron.identification.logs import Log
from pteron.identification.signals.blocks import blocks
from pteron.identification.signals.preprocessing import Preprocessing
from pteron.identification.signals.states import States
from pteron.kernels import Array
from pteron.manipulator import Manipulator

BLOCK = 1 << 15
"""Rows of a block: a regressor of 40 columns takes 40 MB of it."""


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
    robot: Manipulator,
    log: Log | Iterable[Log],
    preprocessing: Preprocessing,
    *,
    margin: int = 0,
    block: int = BLOCK,
) -> Iterator[Samples]:
    """Yield the states and forces of a log, in blocks that overlap by `margin` rows at each end.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    log : Log or iterable of Log
        The log, or its pieces in order; a periodic one is taken as a whole.
    preprocessing : Preprocessing
        How positions are smoothed and differentiated.
    margin : int
        Rows at each end of a block that the next filter will lose.
    block : int
        Rows of a block, about.

    Raises
    ------
    LogError
        If a sample has no pose or is next to a singularity, or if every stretch without a gap is
        shorter than the filters' edges.
    """
    differentiator = preprocessing.differentiator
    if differentiator.whole:
        assert isinstance(log, Log)  # `preprocessing_of` takes no other for these
        yield _samples(robot, log, preprocessing, 0, 0)
        return
    # Blocks begin at the same phase of the decimation.
    step = preprocessing.decimation.factor
    edge = step * ceil((differentiator.edge + margin) / step) - margin
    size = step * ceil(block / step)
    pieces = [log] if isinstance(log, Log) else log
    found = None
    for found in blocks(pieces, edge + margin, size, preprocessing.rate):
        yield _samples(robot, found, preprocessing, edge, margin)
    if found is None:
        raise LogError(
            "too short",
            log.source if isinstance(log, Log) else "log",
            f"every stretch without a gap is shorter than the {2 * (edge + margin)} rows that the "
            "filters' edges take; record longer, or choose a higher cutoff and band",
        )


def _samples(
    robot: Manipulator, log: Log, preprocessing: Preprocessing, edge: int, margin: int
) -> Samples:
    found = preprocessing.differentiator.differentiated(log, edge)
    states = States.of_joints(
        robot,
        found.motion,
        found.time,
        preprocessing.mode,
        payload=None if log.payload is None else log.payload[edge : log.rows - edge],
        source=log.source,
        first_row=log.first_row + edge,
    )
    fresh = slice(margin, len(states) - margin)
    return Samples(states, found.forces, fresh, log.source, found.smooth)
