"""`search`: generations of designs, the best improved by gradients, until the front settles.

Each generation is a sweep of its own (`pteron.maps.sweep`) into a folder of its own. A run that was
interrupted and is started again evaluates the same designs, finds the finished ones in the folder,
and goes on: it ends in the same front as a run that was not interrupted.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from pteron.design.evolution import Evolution, latin_hypercube
from pteron.design.front import Front, ProvedRows
from pteron.design.improvement import improve_design
from pteron.design.rows import FAILED, MISSES, design_table
from pteron.design.spec import Spec
from pteron.design.task import Task
from pteron.errors import DataError, ModelError
from pteron.kernels import Array
from pteron.kernels.one_thread import one_thread
from pteron.maps import TableStore, sweep
from pteron.processes import WorkerPool, result_of
from pteron.shapes import Workers

if TYPE_CHECKING:
    import polars as pl

_CHUNK = 4
"""Designs that one worker takes at a time."""


def search(
    spec: Spec,
    *,
    folder: str | Path | None = None,
    seed: int | None = None,
    workers: Workers | None = None,
    scheduler: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Front:
    """Search for the best designs of a machine.

    The first generation is a Latin hypercube with the machine to begin with; NSGA-II makes the
    others, and the best designs of each are improved by gradients. The same spec and seed give the
    same front, whoever computes it and however often the run was ended meanwhile.

    Parameters
    ----------
    spec : Spec
        The search; see `read_spec`.
    folder : str or Path, optional
        Folder of the results; the same call goes on where it was ended.
    seed : int, optional
        Seed of all chance, in place of the spec's.
    workers : int, optional
        Processes of this computer that do the work; by default this one does. A script that asks
        for them does so under ``if __name__ == "__main__":``.
    scheduler : str, optional
        Address of a Dask scheduler whose workers do the work; they must reach the folder.
    progress : callable, optional
        Takes the share of the work that is done, at first and after every few designs.

    Returns
    -------
    Front

    Raises
    ------
    DataError
        If the spec does not suit its machine.
    ModelError
        If no design keeps all that is asked: the message names the nearest; or if an extra is not
        installed.
    OutputError
        If the folder holds another search, or cannot be written.
    """
    if seed is not None:
        spec = spec.with_seed(seed)
    task = Task.from_spec(spec)
    if workers is not None and scheduler is not None:
        raise DataError("workers and scheduler given; a scheduler has its own workers: give one")
    with ExitStack() as opened:
        generations_folder = folder or opened.enter_context(
            TemporaryDirectory(prefix="pteron-design-")
        )
        pool = None
        if workers is not None and workers > 1:
            # The same for all generations: a process compiles what it needs once.
            pool = opened.enter_context(WorkerPool(workers, task))
        return _generations(task, Path(generations_folder), scheduler, pool, progress)


def _generations(
    task: Task,
    folder: Path,
    scheduler: str | None,
    pool: WorkerPool | None,
    progress: Callable[[float], None] | None,
) -> Front:
    """Return the front of all designs that were evaluated, each design of it proved."""
    settings = task.spec.search
    low, high = task.ranges
    evolution = Evolution(
        (first_designs(task, settings.population, settings.seed) - low) / (high - low),
        len(task.spec.objectives),
        1 + len(task.spec.requirements),
        settings.seed,
    )
    tables: list[pl.DataFrame] = []
    proofs = ProvedRows(task, partial(swept_proofs, task, folder, scheduler, pool=pool))
    front: Front | None = None
    used: set[tuple[bytes, int]] = set()
    for number in range(1, settings.generations + 1):
        designs = low + evolution.ask() * (high - low)
        jobs = [(point, -1) for point in designs.tolist()]
        if front is not None:
            jobs += _designs_to_improve(front, number, used)
        plan = {**task.plan, "generation": number, "designs": _digest(designs)}
        store = TableStore(folder / f"{number:04d}", plan)
        chunks = [jobs[k : k + _CHUNK] for k in range(0, len(jobs), _CHUNK)]
        tell = None if progress is None else partial(_tell, progress, number, settings.generations)
        _swept(task, evaluate_designs, chunks, store, pool, scheduler=scheduler, progress=tell)
        tables.append(store.scan().collect())
        front = _proved_front(proofs, tables)
        proved_rows = proofs.replace_rows(tables[-1])
        points = task.points(proved_rows)
        evolution.tell((points - low) / (high - low), *_costs(task, proved_rows))
    return proofs.front(lambda: tables)


def _swept(
    task: Task,
    function: Callable[..., pl.DataFrame],
    chunks: Sequence[Any],
    store: TableStore,
    pool: WorkerPool | None,
    **options: Any,
) -> None:
    """Compute the missing chunks of a store, in the pool's processes if there is one."""
    if pool is None:
        sweep(partial(function, task), chunks, store, **options)
        return
    # Each job goes to the process that is free next, those of the last chunk first: it has the
    # designs that take longest.
    numbers = sorted({*range(len(chunks))} - store.finished_chunks(), reverse=True)
    pending = {k: [pool.start(function, [job]) for job in chunks[k]] for k in numbers}
    sweep(lambda k: _concatenate(map(result_of, pending[k])), range(len(chunks)), store, **options)


def _concatenate(tables: Iterable[pl.DataFrame]) -> pl.DataFrame:
    import polars as pl

    return pl.concat(tables, rechunk=True)


def _tell(progress: Callable[[float], None], number: int, count: int, share: float) -> None:
    """Report the share of all generations that is done."""
    progress((number - 1 + share) / count)


def _proved_front(proofs: ProvedRows, tables: list[pl.DataFrame]) -> Front | None:
    """Return the current front; None without a feasible design."""
    try:
        return proofs.front(lambda: tables)
    except ModelError:
        return None


def swept_proofs(
    task: Task,
    folder: Path,
    scheduler: str | None,
    designs: list[list[float]],
    *,
    workers: int | None = None,
    pool: WorkerPool | None = None,
) -> pl.DataFrame:
    """Return the rows of designs after their proofs, which are stored in a folder."""
    digest = _digest(np.array(designs))
    store = TableStore(folder / f"proofs-{digest}", {**task.plan, "designs": digest})
    chunks = [designs[k : k + _CHUNK] for k in range(0, len(designs), _CHUNK)]
    _swept(task, proved_table, chunks, store, pool, scheduler=scheduler, workers=workers)
    return store.scan().collect()


def first_designs(task: Task, count: int, seed: int) -> Array:
    """Return a Latin hypercube of designs (count, V), the first the machine to begin with."""
    low, high = task.ranges
    units = latin_hypercube(np.random.default_rng(seed), count, len(low))
    designs: Array = low + units * (high - low)
    designs[0] = task.start
    return designs


def evaluate_designs(task: Task, jobs: Sequence[tuple[list[float], int]]) -> pl.DataFrame:
    """Return the rows of designs, of which those with an objective are improved in it first."""
    with one_thread():
        designs = [point if k < 0 else improve_design(task, point, k) for point, k in jobs]
    return design_table(task, designs)


def proved_table(task: Task, designs: Sequence[list[float]]) -> pl.DataFrame:
    """Return the rows of designs after their proofs."""
    return design_table(task, designs, proofs=True)


def _designs_to_improve(
    front: Front, number: int, used: set[tuple[bytes, int]]
) -> list[tuple[list[float], int]]:
    """Return designs to improve, spread over the current front, each in one objective."""
    spec = front.task.spec
    settings, objectives = spec.search, len(spec.objectives)
    count = settings.refined
    if number == settings.generations and count:
        count = settings.population  # the last word on the whole front
    jobs = []
    spread = np.linspace(0, len(front) - 1, count).round().astype(int)
    for k, at in enumerate(np.unique(spread)):
        candidate = front.values[at], (number + k) % objectives
        if (key := (candidate[0].tobytes(), candidate[1])) not in used:
            used.add(key)
            jobs.append((candidate[0].tolist(), candidate[1]))
    return jobs


def _costs(task: Task, table: pl.DataFrame) -> tuple[Array, Array]:
    """Return costs (N, M) and violations (N, C) of designs."""
    costs = task.costs(table)
    misses = table.select([c for c in table.columns if c.startswith(MISSES)]).to_numpy()
    return np.where(np.isfinite(costs), costs, FAILED), misses


def _digest(designs: Array) -> str:
    return hashlib.sha256(np.ascontiguousarray(designs).tobytes()).hexdigest()[:16]
