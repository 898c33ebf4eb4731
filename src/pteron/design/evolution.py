"""Parts of searches: Latin hypercubes, Pareto fronts, and NSGA-II by pymoo, an optional extra."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pteron.extras import import_extra
from pteron.kernels import Array


def _pymoo(module: str) -> Any:
    """Import `pymoo.<module>`; raise with the name of the extra to install where it is missing."""
    return import_extra("design", f"pymoo.{module}", "a search needs pymoo")


EQUAL = 1e-3
"""Share of a value by which two values of an objective may differ and count as equal. Chosen:
tables show four digits, and no builder holds an index or all of a machine's lengths to 0.1 %."""


def count_tolerances(costs: Array) -> Array:
    """Return costs (N, M) as multiples of `EQUAL`, so that equal values differ by at most 1.

    They are logarithms; values below a thousandth of the objective's largest are taken linearly.
    """
    floor = EQUAL * np.abs(costs).max(axis=0)
    return np.asarray(np.arcsinh(costs / np.where(floor > 0.0, floor, 1.0)) / EQUAL)


def distinct_front(costs: Array) -> NDArray[np.int_]:
    """Return the indices of the Pareto-optimal rows of costs (N, M) that differ, sorted by costs.

    A row is left out if another one is worse by more than the tolerance `EQUAL` in no cost, and in
    all costs together loses no more than it gains.
    """
    front = pareto_front(costs)
    counts = count_tolerances(costs[front])
    chosen: list[int] = []
    for k in np.argsort(counts.sum(axis=1), kind="stable").tolist():
        if not (counts[chosen] <= counts[k] + 1.0).all(axis=1).any():
            chosen.append(k)
    return np.asarray(front[np.sort(chosen)])


def lexicographic_best(costs: Array, order: Sequence[int]) -> int:
    """Return the index of the row of costs (N, M) that is least in the first cost of an order.

    Of rows that are equal in it, up to the tolerance `EQUAL`, the next cost decides.
    """
    counts, rows = count_tolerances(costs), np.arange(len(costs))
    for k in order:
        rows = rows[counts[rows, k] <= counts[rows, k].min() + 1.0]
    return int(rows[0])


def pareto_front(costs: Array) -> NDArray[np.int_]:
    """Return the indices of the distinct non-dominated rows of costs (N, M), sorted by costs."""
    rows, first = np.unique(costs, axis=0, return_index=True)
    dominated = [((rows <= row).all(axis=1) & (rows < row).any(axis=1)).any() for row in rows]
    return np.asarray(first[~np.array(dominated, dtype=bool)])


def latin_hypercube(rng: np.random.Generator, count: int, size: int) -> Array:
    """Return Latin hypercube points (count, size) in the unit cube."""
    strata = rng.permuted(np.tile(np.arange(count)[:, None], size), axis=0)
    return np.asarray((strata + rng.random(strata.shape)) / count)


class Evolution:
    """NSGA-II (Deb et al., IEEE Trans. Evolutionary Computation 6(2), 2002), as pymoo has it.

    Parameters
    ----------
    first : array, shape (P, V)
        The first generation, each variable from 0 to 1.
    objectives, constraints : int
        Numbers of values that are minimised, and of those that must be 0 or less.
    seed : int
        Seed of all chance: the same seed and the same answers give the same designs.
    """

    def __init__(self, first: Array, objectives: int, constraints: int, seed: int) -> None:
        self._problem = _pymoo("core.problem").Problem(
            n_var=first.shape[1], n_obj=objectives, n_ieq_constr=constraints, xl=0.0, xu=1.0
        )
        self._algorithm = _pymoo("algorithms.moo.nsga2").NSGA2(pop_size=len(first), sampling=first)
        # The loop that asks decides when to end.
        self._algorithm.setup(self._problem, termination=("n_gen", 1 << 30), seed=seed)
        self._asked: Any = None

    def ask(self) -> Array:
        """Return the designs (P, V) of the next generation, for evaluation."""
        self._asked = self._algorithm.ask()
        return np.array(self._asked.get("X"), dtype=float)

    def tell(self, designs: Array, costs: Array, misses: Array) -> None:
        """Record designs with costs (N, M) and violations (N, C); those of `ask` come first."""
        from pymoo.core.evaluator import Evaluator
        from pymoo.core.population import Population
        from pymoo.problems.static import StaticProblem

        population = Population.merge(self._asked, Population.new("X", designs[len(self._asked) :]))
        Evaluator().eval(StaticProblem(self._problem, F=costs, G=misses), population)
        self._algorithm.tell(infills=population)
