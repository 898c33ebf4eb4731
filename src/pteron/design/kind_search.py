"""The search for the best design of one kind: spread evenly, then evolved, then refined."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.design.evolution import latin_hypercube, pareto_front
from pteron.design.kind_evaluator import KindEvaluator
from pteron.design.rating import Rating
from pteron.kernels import Array, sharing_programs
from pteron.progress import Progress

_POPULATION = 3
"""Size of the population, for each number that a design has."""

_SPREAD = 6
"""Random designs at the start, for each member of the population."""

_REFINED = 0.25
"""Share of the evaluations for Nelder and Mead's method."""

_WEIGHT, _CROSSING = (0.4, 0.9), 0.8
"""Range of the weight of differences, and the share of numbers that they change."""


def search_kind(
    evaluator: KindEvaluator,
    evaluations: int,
    seed: int,
    progress: Progress | None = None,
) -> list[Rating]:
    """Search designs of a kind, in equal shares for each objective; return all their ratings.

    For each objective a Latin hypercube of designs gives the first population of differential
    evolution (Storn and Price, Journal of Global Optimization 11, 1997); then the links are cut
    from the next stock up and down, and Nelder and Mead's method improves the other numbers.
    `progress` is called with the share of the evaluations that is done.
    """
    ratings: list[Rating] = []
    low, high = evaluator.kind.ranges
    counts = evaluator.kind.counts
    objectives = evaluator.job.objectives

    def rate(units: Array) -> Rating:
        """Rate a design given by unit coordinates (V,) within its bounds; record the rating."""
        ratings.append(evaluator.rate(low + np.clip(units, 0.0, 1.0) * (high - low)))
        if progress is not None:
            progress(len(ratings) / evaluations)
        return ratings[-1]

    with sharing_programs(evaluator.kind.like):
        for k, objective in enumerate(objectives):
            rng = np.random.default_rng((seed, k))
            end = evaluations * (k + 1) // len(objectives)
            _evolve(rate, ratings, rng, end, objective, (low, high))
            start = min(ratings, key=lambda rating: rating.cost(objective))
            _refine(rate, ratings, (start.values - low) / (high - low), end, objective, counts)
    return ratings


def _evolve(
    rate: Callable[[Array], Rating],
    ratings: list[Rating],
    rng: np.random.Generator,
    end: int,
    objective: str,
    ranges: tuple[Array, Array],
) -> None:
    """Rate designs by differential evolution, leaving `_REFINED` of the `end` evaluations.

    The population begins with the best designs rated so far, also for other objectives.
    """
    size = len(ranges[0])
    count = _POPULATION * size
    first = min(_SPREAD * count, (end - len(ratings)) // 2)
    for units in latin_hypercube(rng, max(first, 1), size):
        rate(units)
    # The best so far, whichever objective they were sought for.
    known = sorted(ratings, key=lambda rating: rating.cost(objective))[:count]
    low, high = ranges
    units = np.array([(rating.values - low) / (high - low) for rating in known])
    costs = np.array([rating.cost(objective) for rating in known])
    start = len(ratings)
    while len(units) > 1 and len(ratings) < end - int(_REFINED * (end - start)):
        for i in range(len(units)):
            a, b = units[rng.choice(len(units), 2, replace=False)]
            weight = rng.uniform(*_WEIGHT)
            trial = units[i] + weight * (units[costs.argmin()] - units[i]) + weight * (a - b)
            crossed = rng.random(size) < _CROSSING
            crossed[rng.integers(size)] = True
            trial = np.where(crossed, trial, units[i])
            trial = np.where((trial < 0.0) | (trial > 1.0), rng.random(size), trial)
            cost = rate(trial).cost(objective)
            if cost <= costs[i]:
                units[i], costs[i] = trial, cost


def _refine(
    rate: Callable[[Array], Rating],
    ratings: list[Rating],
    start: Array,
    end: int,
    objective: str,
    counts: Array,
) -> None:
    """Improve the design `start` by stock of the next size and Nelder-Mead, up to `end` ratings.

    `counts` are the numbers of choices of the coordinates of a design, 0 for continuous ones.
    """

    def cost(units: Array) -> float:
        """Rate a design given by unit coordinates (V,); return its cost for the objective."""
        return rate(units).cost(objective)

    free, best = counts == 0, start
    least = cost(best) if len(ratings) < end else np.inf
    improves = True
    while improves and len(ratings) < end:
        improves = False
        for i, step in product(np.flatnonzero(~free), (1.0, -1.0)):
            trial = best.copy()
            trial[i] += step / counts[i]
            if 0.0 < trial[i] < 1.0 and len(ratings) < end and (found := cost(trial)) < least:
                least, best, improves = found, trial, True
    while len(ratings) < end:
        simplex = best[free] + np.vstack(
            [
                np.zeros(free.sum()),
                0.05 * np.where(best[free] > 0.5, -1.0, 1.0) * np.eye(free.sum()),
            ]
        )

        def with_choices(units: Array, best: Array = best) -> Array:
            """Return the unit coordinates (V,) of `best`, its continuous ones set to `units`."""
            trial = best.copy()
            trial[free] = np.clip(units, 0.0, 1.0)
            return trial

        options = {"maxfev": end - len(ratings), "initial_simplex": simplex, "xatol": 1e-4}
        answer = scipy.optimize.minimize(
            lambda units, with_choices=with_choices: cost(with_choices(units)),
            best[free],
            method="Nelder-Mead",
            options=options | {"fatol": 1e-6},
        )
        best = with_choices(answer.x)


def pareto_ratings(ratings: list[Rating], objectives: list[str]) -> list[Rating]:
    """Return the ratings of the feasible designs that are Pareto-optimal in the objectives."""
    good = [rating for rating in ratings if not rating.misses]
    costs = np.array([[rating.figures[name] for name in objectives] for rating in good])
    return [good[k] for k in pareto_front(costs)]
