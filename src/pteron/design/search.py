"""`search`: generations of designs, the best improved by gradients, until the front settles.

Each generation is a sweep of its own (`pteron.maps.sweep`) into a folder of its own. A run that was
interrupted and is started again evaluates the same designs, finds the finished ones in the folder,
and goes on: it ends in the same front as a run that was not interrupted.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from pteron.design.evolution import Evolution, count_tolerances, latin_hypercube
from pteron.design.front import Front, ProvedRows
from pteron.design.improvement import improve_design
from pteron.design.rows import design_table, violations
from pteron.design.spec import FAILED, SearchTable, Spec
from pteron.design.task import Task
from pteron.errors import DataError, ModelError
from pteron.kernels import Array
from pteron.kernels.one_thread import one_thread
from pteron.maps import TableStore, sweep
from pteron.processes import WorkerPool, result_of
from pteron.progress import Progress
from pteron.shapes import Workers

if TYPE_CHECKING:
    import polars as pl

_FIRST = 3
"""Size of the first generation, as a multiple of the others': it finds where designs are good."""

_CHUNK = 4
"""Designs that one worker takes at a time."""

Job: TypeAlias = tuple[list[float], int, bool]
"""A design, the objective to improve or -1, and whether the other objectives are held."""


def search(
    spec: Spec,
    *,
    folder: str | Path | None = None,
    seed: int | None = None,
    workers: Workers | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Front:
    """Search for the Pareto-optimal designs of a machine and return their front.

    The first generation, of three times the population, is a Latin hypercube that includes the
    initial machine; NSGA-II makes the others, and the best designs of each are improved. The same
    spec and seed give the same front, on any computer, also after interruptions.

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
        evaluation = DesignRows(task, Path(generations_folder), scheduler=scheduler, pool=pool)
        return _generations(evaluation, progress)


@dataclass(frozen=True)
class DesignRows:
    """Evaluates designs by a cluster, by processes or here; the rows stay in a folder.

    Attributes
    ----------
    task : Task
        The search.
    folder : Path
        Folder of the folders of rows.
    scheduler : str, optional
        Address of a Dask scheduler.
    workers : int, optional
        Number of Dask workers of this computer.
    pool : WorkerPool, optional
        Processes that share the task.
    """

    task: Task
    folder: Path
    scheduler: str | None = None
    workers: int | None = None
    pool: WorkerPool | None = None

    def rows(
        self,
        function: Callable[[Task, Sequence[Any]], pl.DataFrame],
        jobs: Sequence[Any],
        name: str,
        plan: dict[str, Any],
        progress: Progress | None = None,
    ) -> pl.DataFrame:
        """Return the table rows that `function` computes for jobs, in order.

        Rows already stored in the folder `name` are reused.
        """
        store = TableStore(self.folder / name, {**self.task.plan, **plan})
        chunks = [jobs[k : k + _CHUNK] for k in range(0, len(jobs), _CHUNK)]
        if self.pool is None:
            sweep(
                partial(function, self.task),
                chunks,
                store,
                scheduler=self.scheduler,
                workers=self.workers,
                progress=progress,
            )
            return store.scan().collect()
        # Each job goes to the process that is free next, those of the last chunk first: it has the
        # designs that take longest.
        numbers = sorted({*range(len(chunks))} - store.finished_chunks(), reverse=True)
        pending = {k: [self.pool.start(function, [job]) for job in chunks[k]] for k in numbers}
        sweep(lambda k: _await_rows(pending[k]), range(len(chunks)), store, progress=progress)
        return store.scan().collect()

    def prove(self, designs: list[list[float]]) -> pl.DataFrame:
        """Return the rows (variables, quantities, violations) of designs after proving them."""
        digest = _digest(np.array(designs))
        return self.rows(proved_table, designs, f"proofs-{digest}", {"designs": digest})


def _await_rows(pending: Sequence[Future[pl.DataFrame]]) -> pl.DataFrame:
    """Wait for all pending evaluations and return their rows in a single table."""
    import polars as pl

    rows: pl.DataFrame = pl.concat(map(result_of, pending), rechunk=True)
    return rows


def _generations(evaluation: DesignRows, progress: Progress | None) -> Front:
    """Run the generations of a search; return the front of all designs, each of it proved."""
    task = evaluation.task
    settings, (low, high) = task.spec.search, task.ranges
    first = first_designs(task, _FIRST * settings.population, settings.seed)
    evolution = Evolution(
        (first[: settings.population] - low) / (high - low),
        len(task.spec.objectives),
        1 + len(task.spec.requirements),
        settings.seed,
    )
    tables: list[pl.DataFrame] = []
    proofs = ProvedRows(task, evaluation.prove)
    front: Front | None = None
    used: set[tuple[bytes, int, bool]] = set()
    for number in range(1, settings.generations + 1):
        designs = low + evolution.ask() * (high - low)
        if number == 1:
            designs = np.vstack([designs, first[settings.population :]])
        jobs = [(point, -1, True) for point in designs.tolist()]
        if front is not None:
            jobs += _designs_to_improve(front, tables, number, used)
        plan = {"generation": number, "designs": _digest(designs)}
        report = None if progress is None else partial(_report, progress, number, settings)
        tables.append(evaluation.rows(evaluate_designs, jobs, f"{number:04d}", plan, report))
        front = None
        with suppress(ModelError):  # until a design keeps all that is asked
            front = proofs.front(lambda: tables)
        proved = proofs.replace_rows(tables[-1])
        costs = task.costs(proved)
        costs = np.where(np.isfinite(costs), costs, FAILED)
        evolution.tell((task.points(proved) - low) / (high - low), costs, violations(proved))
    return proofs.front(lambda: tables)


def _report(progress: Progress, number: int, settings: SearchTable, share: float) -> None:
    """Report to `progress` the finished share of all generations, 0 to 1."""
    progress((number - 1 + share) / settings.generations)


def first_designs(task: Task, count: int, seed: int) -> Array:
    """Return a Latin hypercube of designs (count, V); row 0 is the initial machine's."""
    low, high = task.ranges
    units = latin_hypercube(np.random.default_rng(seed), count, len(low))
    designs: Array = low + units * (high - low)
    designs[0] = task.start
    return designs


def evaluate_designs(task: Task, jobs: Sequence[Job]) -> pl.DataFrame:
    """Return rows of (point, objective, hold) jobs, improved in their objective unless it is -1."""
    import polars as pl

    plain = [point for point, k, _ in jobs if k < 0]
    with one_thread():
        better = [improve_design(task, p, k, hold=hold) for p, k, hold in jobs if k >= 0]
    parts = [design_table(task, part, thorough=part is better) for part in (plain, better) if part]
    rows: pl.DataFrame = pl.concat(parts)
    return rows


def proved_table(task: Task, designs: Sequence[list[float]]) -> pl.DataFrame:
    """Return the rows (variables, quantities, violations) of designs after proving them."""
    return design_table(task, designs, proofs=True)


def _designs_to_improve(
    front: Front, tables: Sequence[pl.DataFrame], number: int, used: set[tuple[bytes, int, bool]]
) -> list[Job]:
    """Return improvements of designs: of the best in each objective, and spread over the front.

    Each is new in `used`. The best in an objective is improved in it at the cost of the others. A
    front of few designs, as with one objective, is joined by the next best feasible designs.
    """
    spec = front.task.spec
    settings, objectives = spec.search, len(spec.objectives)
    count = settings.refined
    if number == settings.generations and count:
        count = settings.population  # the last word on the whole front
    spread = np.unique(np.linspace(0, len(front) - 1, count).round().astype(int))
    best = list(front.selection.values())[:objectives] if count else []
    candidates = [(front.values[at], k, False) for k, at in enumerate(best)]
    points = list(front.values[spread])
    if len(spread) < count:
        feasible = [table.filter(violations(table).sum(axis=1) == 0.0) for table in tables]
        costs = np.vstack([front.task.costs(table) for table in feasible])
        others = np.vstack([front.task.points(table) for table in feasible])
        sums = np.nan_to_num(count_tolerances(np.nan_to_num(costs, nan=FAILED)).sum(axis=1))
        points += list(others[np.argsort(sums, kind="stable")][: count - len(spread)])
    candidates += [(point, (number + k) % objectives, True) for k, point in enumerate(points)]
    jobs = []
    for point, objective, hold in candidates:
        if (key := (point.tobytes(), objective, hold)) not in used:
            used.add(key)
            jobs.append((point.tolist(), objective, hold))
    return jobs


def _digest(designs: Array) -> str:
    """Return the digest of designs (N, v), 16 hexadecimal digits."""
    return hashlib.sha256(np.ascontiguousarray(designs).tobytes()).hexdigest()[:16]
