"""States and forces at a log's samples, in overlapping blocks so that memory stays bounded."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from pteron.identification.errors import LogError
from pteron.identification.logs import Log, join_logs
from pteron.identification.logs.gaps import are_apart, gaps, stretches
from pteron.identification.signals.preprocessing import Preprocessing
from pteron.identification.signals.states import States
from pteron.kernels import Array
from pteron.manipulator import Manipulator

BLOCK = 1 << 15
"""Rows of a block: a regressor of 40 columns takes 40 MB of it."""


@dataclass(frozen=True)
class SampleBlock:
    """States and measured forces (R, n), N, at a log's samples; `fresh` rows are in no other block.

    `smooth` (R,) is that of `Differentiated`.
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
) -> Iterator[SampleBlock]:
    """Yield the states and forces of a log, in blocks that overlap by `margin` rows at each end.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    log : Log or iterable of Log
        The log, or its pieces in order; a periodic one is taken as a whole.
    preprocessing : Preprocessing
        The plan by which positions are smoothed and differentiated.
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
    parts: Iterable[Log] = [log] if isinstance(log, Log) else log
    if differentiator.whole:
        assert isinstance(log, Log)  # `preprocessing_for_log` takes no other for these
        edge = margin = 0
    else:
        # Blocks begin at the same phase of the decimation.
        step = preprocessing.decimation.factor
        edge = step * ceil((differentiator.edge + margin) / step) - margin
        parts = blocks(parts, edge + margin, step * ceil(block / step), preprocessing.rate)
    part, pose = None, preprocessing.start
    for part in parts:
        derived = differentiator.differentiate(part, edge)
        inner = replace(part.part(edge, part.rows - edge), time=derived.time)
        states = States.from_log(robot, inner, derived.motion, pose)
        # The next block overlaps this one by its margins.
        pose = tuple(states.pose[-1 - 2 * margin].tolist())
        fresh = slice(margin, len(states) - margin)
        yield SampleBlock(states, derived.forces, fresh, part.source, derived.smooth)
    if part is None:
        raise LogError(
            "too short",
            log.source if isinstance(log, Log) else "log",
            f"every stretch without a gap is shorter than the {2 * (edge + margin)} rows that the "
            "filters' edges take; record longer, or choose a higher cutoff and band",
        )


def blocks(pieces: Iterable[Log], margin: int, size: int, rate: float) -> Iterator[Log]:
    """Yield overlapping blocks of a log, of at most `size` + 2 `margin` rows.

    Without their margins they tile each stretch of the log that has no gap and one payload, except
    its first and last `margin` rows: a filter's edges are dropped, never bridged. Shorter stretches
    yield nothing. `pieces` are the log's parts in order, `rate` is in samples per second.
    """
    buffer: Log | None = None
    for piece in pieces:
        for stretch in _stretches(piece, rate):
            if buffer is not None and _continues(buffer, stretch, rate):
                buffer = join_logs([buffer, stretch])
            else:
                yield from _flush_buffer(buffer, margin)
                buffer = stretch
            while buffer.rows >= size + 2 * margin:
                yield buffer.part(0, size + 2 * margin)
                buffer = buffer.part(size, buffer.rows)
    yield from _flush_buffer(buffer, margin)


def _flush_buffer(buffer: Log | None, margin: int) -> Iterator[Log]:
    """Yield the buffer if it exceeds the margins at both ends."""
    if buffer is not None and buffer.rows > 2 * margin:
        yield buffer


def _stretches(piece: Log, rate: float) -> Iterator[Log]:
    """Yield the parts of a piece between gaps and changes of the payload."""
    # Not `piece.segments`: the usual step of a few rows may be that of a gap.
    ends = gaps(piece.time, 1.0 / rate)
    if piece.payload is not None:
        ends |= np.diff(piece.payload) != 0
    for start, stop in stretches(ends) if piece.rows else ():
        yield piece.part(start, stop)


def _continues(buffer: Log, following: Log, rate: float) -> bool:
    """Return whether samples follow the buffer without a gap or a change of payload."""
    same = buffer.payload is None or (
        following.payload is not None and buffer.payload[-1] == following.payload[0]
    )
    return same and not are_apart(buffer.time, following.time, 1.0 / rate)
