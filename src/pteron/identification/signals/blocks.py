"""A log cut into overlapping blocks, so that filters run through it in bounded memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np

from pteron.identification.logs import Log, joined

_GAP = 1.5
"""Steps of time between two samples that miss none; beyond it a new stretch begins."""


def blocks(pieces: Iterable[Log], margin: int, size: int, rate: float) -> Iterator[Log]:
    """Yield overlapping blocks of a log, of at most `size` + 2 `margin` rows.

    Without their margins they tile each stretch of the log that has no gap and one payload, except
    its first and last `margin` rows: a filter's edges are dropped, never bridged. Shorter stretches
    yield nothing.

    Parameters
    ----------
    pieces : iterable of Log
        The log, or its parts in order.
    margin, size : int
        Rows.
    rate : float
        Samples per second.
    """
    held: Log | None = None
    for piece in pieces:
        for stretch in _stretches(piece, rate):
            if held is not None and not _continues(held, stretch, rate):
                yield from _rest(held, margin)
                held = None
            held = stretch if held is None else joined([held, stretch])
            while held.rows >= size + 2 * margin:
                yield held.part(0, size + 2 * margin)
                held = held.part(size, held.rows)
    if held is not None:
        yield from _rest(held, margin)


def _rest(held: Log, margin: int) -> Iterator[Log]:
    if held.rows > 2 * margin:
        yield held


def _stretches(piece: Log, rate: float) -> Iterator[Log]:
    """Yield the parts of a piece between gaps and changes of the payload."""
    # Not `piece.segments`: the usual step of a few rows may be that of a gap.
    ends = np.diff(piece.time) * rate > _GAP
    if piece.payload is not None:
        ends |= np.diff(piece.payload) != 0
    edges = [0, *(np.flatnonzero(ends) + 1).tolist(), piece.rows]
    for start, stop in pairwise(edges):
        if stop > start:
            yield piece.part(start, stop)


def _continues(held: Log, following: Log, rate: float) -> bool:
    step = float(following.time[0] - held.time[-1])
    same = held.payload is None or (
        following.payload is not None and held.payload[-1] == following.payload[0]
    )
    return same and step * rate <= _GAP
