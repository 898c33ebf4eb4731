"""The place of a workspace that floats: the feasible one at which the objective is best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.design.spec import FAILED, ROUNDING
from pteron.kernels import Array
from pteron.kernels.one_thread import one_thread
from pteron.kinematics.sampling import search_ball
from pteron.workspace.exchange import POINTS, SemiInfiniteProgram
from pteron.workspace.fit import Fit
from pteron.workspace.shape_samples import shape_samples

_SPARE = 1e-3
"""Share by which a workspace is larger while its place is sought, so that the proof can decide.
Chosen: a place moves by no more than half this share of the workspace's side."""

_QUICK, _THOROUGH = 8, 20
"""Evaluations of the quantities for each coordinate of the place: while designs are sought, and
from each of two starts for a design that is proved."""

_COARSE, _FINE, _MOST = 15, 7, 30
"""Places along each side of the box of all positions in reach, and of the box of the feasible ones;
most of the latter at which quantities are evaluated."""


@one_thread()
def best_place(design: Any, fit: Fit, failing: Array, *, thorough: bool) -> Fit:
    """Return the place at which the first objective that depends on the place is best.

    The conditions hold there, and requirements that depend on the place come first. Nelder and
    Mead's method starts from a fit with room to move and, in a thorough search, also from the best
    of a lattice of feasible places.

    Parameters
    ----------
    design : Design
        The design.
    fit : Fit
        The place where its workspace could be largest.
    failing : array, shape (F, m)
        Poses that are known to fail.
    thorough : bool
        Whether all of the machine's reach is searched, or what is near the fit.
    """
    task = design.task
    shape, least = task.shape
    count, edge = len(fit.center), (1.0 + _SPARE) * least
    program = SemiInfiniteProgram(
        task.conditions,
        fit.side,
        np.append(fit.center, edge),
        design.geometry,
        np.zeros((len(design.geometry), 0)),
        np.zeros(count + 1),
        np.zeros((count + 1, 2)),
        shape,
        task.orientations,
        failing=failing,
    )
    dense = shape_samples(shape, task.orientations, POINTS)
    named = [objective.quantity for objective in task.spec.objectives]
    objective = next((k for k, name in enumerate(named) if name in task.place_quantities), None)
    free = np.full(len(named), np.inf)

    def placed(center: Array) -> Fit:
        """Return the fit of the workspace at a centre (k,)."""
        return replace(fit, center=center, edge=edge)

    def cost(center: Array) -> float:
        """Return the cost of a centre (k,): infinite where the workspace is infeasible."""
        z = np.append(center, edge)
        if not program.keeps(dense, z) or len(program.failing_samples(z).inside):
            return np.inf
        return sampled_cost(replace(design, known=placed(center), refined=False), objective, free)

    step = np.maximum(0.25 * (fit.edge - edge), _SPARE * least) * shape.half
    starts, evaluations = [fit.center], count * (_THOROUGH if thorough else _QUICK)
    if thorough:
        starts.append(min([fit.center, *_feasible_lattice(design, program, edge)], key=cost))
    places = (nelder_mead(cost, start, step, evaluations, 1e-3 * least) for start in starts)
    center, value = min(places, key=lambda place: place[1])
    return placed(center) if np.isfinite(value) else fit


def nelder_mead(
    cost: Callable[[Array], float], start: Array, step: Array, evaluations: int, accuracy: float
) -> tuple[Array, float]:
    """Return the best unknowns (v,) near a start, and their cost, by Nelder and Mead's method.

    An infinite cost marks unknowns that are infeasible.
    """
    simplex = start + np.vstack([np.zeros(len(start)), np.diag(step)])
    first = cost(start)
    tolerance = 1e-4 * abs(first) if np.isfinite(first) else 1e-9
    options = {"initial_simplex": simplex, "maxfev": evaluations, "fatol": tolerance}
    with np.errstate(invalid="ignore"):
        answer = scipy.optimize.minimize(
            cost, start, method="Nelder-Mead", options=options | {"xatol": accuracy}
        )
    return answer.x, float(answer.fun)


def sampled_cost(design: Any, objective: int | None, most: Array) -> float:
    """Return an objective's cost in a design; what is missed by requirements comes before it.

    `most` are the greatest costs of all objectives (M,). Without an objective the cost is 0.
    """
    spec = design.task.spec
    missed = sum(r.violation(design.quantity(r.quantity), 1.0) for r in spec.requirements)
    for k in np.flatnonzero(np.isfinite(most)).tolist():
        excess = spec.objectives[k].sign * design.quantity(spec.objectives[k].quantity) - most[k]
        missed += max(excess, 0.0) / (abs(most[k]) or 1.0)
    if not missed <= ROUNDING:
        return FAILED * (1.0 + float(np.nan_to_num(missed, nan=1.0)))
    if objective is None:
        return 0.0
    target = spec.objectives[objective]
    return float(np.nan_to_num(target.sign * design.quantity(target.quantity), nan=FAILED))


def _feasible_lattice(design: Any, program: SemiInfiniteProgram, edge: float) -> Array:
    """Return centres (P, k) at which a lattice of the workspace keeps the conditions."""
    center, radius = search_ball(design.robot)
    few = shape_samples(program.shape, program.orientations, 3)
    low, high = center - radius, center + radius
    for along in (_COARSE, _FINE):
        axes = np.linspace(low, high, along).T
        centers = np.array(list(product(*axes)))
        poses = np.concatenate([few.shape_poses(at, edge) for at in centers])
        rows = program.conditions.rows(design.geometry, poses, program.side)
        kept = (rows >= 0.0).all(axis=-1).reshape(len(centers), -1).all(axis=1)
        if not kept.any():
            break
        step = (high - low) / (along - 1)
        low, high = centers[kept].min(axis=0) - step, centers[kept].max(axis=0) + step
    return centers[kept][:: max(1, -(-int(kept.sum()) // _MOST))]
