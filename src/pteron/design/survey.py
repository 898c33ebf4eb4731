"""`survey`: evaluates designs that are spread evenly over the variables' ranges, into Parquet."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.design.front import Front, ProvedRows
from pteron.design.rows import design_table
from pteron.design.search import DesignRows
from pteron.design.spec import Spec
from pteron.design.task import Task
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.maps import TableStore, sweep
from pteron.progress import Progress
from pteron.shapes import Workers

if TYPE_CHECKING:
    import polars as pl

_CHUNK = 256
"""Designs that one worker takes at a time, and rows of a file."""


def survey(
    spec: Spec,
    count: int,
    folder: str | Path,
    *,
    workers: Workers | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Front:
    """Evaluate many designs, spread by a Sobol sequence, and return their Pareto front.

    The designs are points of a Sobol sequence, shifted by a random vector from the spec's seed:
    they cover the ranges more evenly than random points, and a larger count continues a smaller
    one.

    Parameters
    ----------
    spec : Spec
        The search; see `read_spec`.
    count : int
        Number of designs.
    folder : str or Path
        Folder of Parquet files, one for every 256 designs; a run that was ended goes on.
    workers : int, optional
        Processes of this computer that do the work; by default this one does.
    scheduler : str, optional
        Address of a Dask scheduler whose workers do the work; they must reach the folder.
    progress : callable, optional
        Takes the share of the work that is done.

    Returns
    -------
    Front

    Raises
    ------
    DataError
        If the spec does not suit its machine, or the count is not above zero.
    ModelError
        If no design keeps all that is asked, or an extra is not installed.
    OutputError
        If the folder holds another survey, or cannot be written.
    """
    if count < 1:
        raise DataError(f"count: {count} given, 1 or more expected")
    task = Task.from_spec(spec)
    store = TableStore(folder, {**task.plan, "survey": _CHUNK})
    chunks = range(0, count, _CHUNK)
    sweep(
        partial(_evaluate_chunk, task),
        chunks,
        store,
        scheduler=scheduler,
        workers=workers,
        progress=progress,
    )
    evaluation = DesignRows(task, Path(folder), scheduler, workers)
    proofs = ProvedRows(task, evaluation.prove)
    return proofs.front(lambda: _parts(store, chunks))


def _evaluate_chunk(task: Task, first: int) -> pl.DataFrame:
    """Return the rows of the designs number `first` to `first + _CHUNK` of the survey."""
    return design_table(task, survey_designs(task, first, _CHUNK))


def survey_designs(task: Task, first: int, count: int) -> Array:
    """Return designs (count, V) of the shifted Sobol sequence, from number `first` on."""
    low, high = task.ranges
    sequence = scipy.stats.qmc.Sobol(len(low), scramble=False)
    if first:
        sequence.fast_forward(first)
    shift = np.random.default_rng(task.spec.search.seed).random(len(low))
    return np.asarray(low + (sequence.random(count) + shift) % 1.0 * (high - low))


def _parts(store: TableStore, chunks: range) -> Iterable[pl.DataFrame]:
    """Return the store's rows as tables of one chunk each, read lazily."""
    table = store.scan()
    return (table.slice(first, _CHUNK).collect() for first in chunks)
