"""A user's own regressor and forces, of any robot, checked and turned into `Observations`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pteron.arguments import expect
from pteron.errors import DataError
from pteron.identification.observation import Observations
from pteron.kernels import Array


def checked_observations(
    regressor: ArrayLike,
    forces: ArrayLike,
    *,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    kinds: Sequence[str] | None = None,
    time: ArrayLike | None = None,
    used: ArrayLike | None = None,
    place: str = "",
) -> Observations:
    """Return observations of a regressor and forces as `estimate` takes them, after checking them.

    Messages begin with `place`, if there is one.
    """
    start = f"{place}: " if place else ""
    f = finite(forces, f"{start}forces")
    w = finite(regressor, f"{start}regressor")
    shaped = f.ndim in (1, 2) and f.size
    expect(shaped, f"{start}forces", f"shape {f.shape}", "(R, n) or (R,)")
    f = f.reshape(len(f), -1)
    rows, n = f.shape
    if w.ndim == 2 and len(w) == rows * n:
        w = w.reshape(rows, n, -1)
    if w.ndim != 3 or w.shape[:2] != f.shape or not w.shape[2]:
        raise DataError(
            f"{start}regressor: shape {w.shape} given, ({rows}, {n}, p) or ({rows * n}, p) "
            f"expected for forces of shape {f.shape}"
        )
    p = w.shape[2]
    called = _texts(names, p, f"{start}names") or tuple(f"beta{k}" for k in range(1, p + 1))
    if len(set(called)) < p:
        twice = next(name for name in called if called.count(name) > 1)
        raise DataError(f"{start}names: {twice!r} stands twice; each value needs its own")
    t = np.arange(float(rows)) if time is None else finite(time, f"{start}time")
    if t.shape != (rows,) or (np.diff(t) <= 0.0).any():
        raise DataError(f"{start}time: {rows} rising numbers expected, one for each sample, in s")
    counts = np.ones(f.shape, dtype=bool) if used is None else np.asarray(used, dtype=bool)
    expect(counts.size == f.size, f"{start}used", f"shape {counts.shape}", f.shape)
    counts = counts.reshape(f.shape)
    return Observations(
        called,
        _texts(units, p, f"{start}units") or ("",) * p,
        np.ascontiguousarray(w * counts[..., None]),
        f * counts,
        t,
        counts.astype(float),
        np.zeros(rows, dtype=np.int64),
        place or "the samples",
        kinds=_texts(kinds, p, f"{start}kinds") or (),
    )


def finite(array: ArrayLike, place: str) -> Array:
    """Return an array of finite numbers; messages call it `place`."""
    try:
        numbers = np.asarray(array, dtype=float)
    except (TypeError, ValueError):
        raise DataError(f"{place}: an array of numbers expected") from None
    if not np.isfinite(numbers).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(numbers))[0])
        raise DataError(
            f"{place}: {numbers[where]} at {list(where)}, a finite number expected; leave out "
            "samples that are not known, of regressor and forces"
        )
    return numbers


def _texts(labels: Sequence[str] | None, count: int, place: str) -> tuple[str, ...]:
    """Return the labels of columns; raise where their number differs from that of the columns."""
    texts = () if labels is None else tuple(labels)
    if labels is not None and (isinstance(labels, str) or len(texts) != count):
        raise DataError(f"{place}: {len(texts)} given, {count} expected, one for each column")
    return texts
