"""Sequential quadratic programming within a trust region, for few variables and many rows.

An interior point method factors all rows in every iteration. Here an iteration solves a dense
problem as small as the variables, of the rows alone that the trust region can reach.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.kernels import Array

_SHRINK, _GROW = 0.25, 2.0
"""Factors by which the trust region's radius changes."""

_POOR, _GOOD = 0.1, 0.7
"""Actual over predicted decrease of the cost: below the first the trust region shrinks, above the
second it grows."""

_SMALLEST = 1e-7
"""Radius at which nothing more can be gained."""

_DAMPED = 0.2
"""Share of the model's own curvature that an update of it keeps at least (Powell)."""

_PENALTY = 2.0
"""Least weight of a violation, over the sum of the multipliers: then a violation never pays."""

_DEAREST = 1e6
"""Greatest weight of violations."""

_MENDED = 0.9
"""Share to which doubling the weight must reduce a violation, to be worth it."""

_FELT = 1e-3
"""Least curvature, over the gradient divided by the radius, that the model counts."""


@dataclass(frozen=True)
class NonlinearProgram:
    """A nonlinear program: its cost, and margins that must be 0 or more, of variables (v,).

    Attributes
    ----------
    cost : callable
        The value and its gradient (v,); NaN where there is none.
    margins : callable
        The rows (R,).
    slopes : callable
        Their derivatives (R, v).
    """

    cost: Callable[[Array], tuple[float, Array]]
    margins: Callable[[Array], Array]
    slopes: Callable[[Array], Array]


class Iterate(NamedTuple):
    """The values of a program at a place."""

    cost: float
    gradient: Array
    margins: Array

    @property
    def violation(self) -> float:
        """The largest violation of a row, 0 for none; NaN where the program has no value."""
        return float(np.maximum(-self.margins, 0.0).max(initial=0.0))


def sequential_minimum(
    program: NonlinearProgram,
    start: Array,
    *,
    radius: float,
    settled: float,
    iterations: int,
    stop: Callable[[], bool],
) -> Array | None:
    """Return a local minimum (v,), or how far the search came; None if it cannot begin at `start`.

    The step d of an iteration makes g d + d B d / 2 + w t small, where no row c + A d + t is below
    0, no component of d is above the trust region's radius, and t is 0 or more. B is the damped
    BFGS approximation of the Lagrangian's Hessian, w t the price of a violation.

    Parameters
    ----------
    program : NonlinearProgram
        The program.
    start : array, shape (v,)
        Where it begins.
    radius : float
        The first trust region's.
    settled : float
        Decrease that a step promises, below which the search has settled.
    iterations : int
        The most steps.
    stop : callable
        Says whether to end at once.

    References
    ----------
    J. Nocedal, S. J. Wright, Numerical optimization, 2006, chapter 18.
    C. L. Lawson, R. J. Hanson, Solving least squares problems, 1974, chapter 23.
    """
    here, x = _iterate(program, start), start
    if not np.isfinite(here.cost + here.violation):
        return None
    hessian: Array = np.eye(len(start))
    slopes, weight = program.slopes(x), 1.0
    for _ in range(iterations):
        if stop() or radius < _SMALLEST:
            break
        step, multipliers, remaining_violation = _step(here, slopes, hessian, radius, weight)
        while _PENALTY * multipliers.sum() > weight and weight < _DEAREST:
            dearer = _step(here, slopes, hessian, radius, 2.0 * weight)
            if remaining_violation > 0.0 and not dearer[2] < _MENDED * remaining_violation:
                break  # no step within the region does better
            step, multipliers, remaining_violation = dearer
            weight *= 2.0
        if not np.isfinite(step).all():
            radius *= _SHRINK
            continue
        model = here.gradient @ step + 0.5 * step @ hessian @ step
        promised = weight * (here.violation - remaining_violation) - model
        if promised < settled:
            break
        there = _iterate(program, x + step)
        gained = here.cost - there.cost + weight * (here.violation - there.violation)
        share = gained / promised if np.isfinite(gained) else -1.0
        if share < _POOR:
            radius = _SHRINK * min(radius, float(np.abs(step).max()))
        elif share > _GOOD and np.abs(step).max() > 0.5 * radius:
            radius *= _GROW
        if share <= 0.0:
            continue
        new = program.slopes(x + step)
        bent = there.gradient - here.gradient - multipliers @ (new - slopes)
        hessian = _updated(hessian, step, bent)
        x, here, slopes = x + step, there, new
    return x


def _iterate(program: NonlinearProgram, x: Array) -> Iterate:
    return Iterate(*program.cost(x), program.margins(x))


def _step(
    here: Iterate, slopes: Array, hessian: Array, radius: float, weight: float
) -> tuple[Array, Array, float]:
    """Return the step (v,), the rows' multipliers (R,), and the violation that the step leaves.

    A least distance problem of the variables (d, t), solved as Lawson and Hanson do: by a least
    squares problem whose unknowns, the multipliers, are 0 or more.
    """
    count = len(hessian)
    near = np.flatnonzero(here.margins < radius * np.abs(slopes).sum(axis=1))
    # Curvature that is not felt within the trust region would only cost digits.
    sizes, axes = np.linalg.eigh(hessian)
    felt = _FELT * float(np.linalg.norm(here.gradient)) / radius
    factor = np.linalg.cholesky((axes * np.maximum(sizes, felt)) @ axes.T)
    shift = scipy.linalg.solve_triangular(factor, here.gradient, lower=True)

    # Rows of c + A d + t >= 0, of the trust region, and of t >= 0, in y = L' d + L^-1 g, w t + 1
    box = np.vstack([np.eye(count), -np.eye(count)])
    rows = np.vstack([slopes[near], box])
    rows = scipy.linalg.solve_triangular(factor, rows.T, lower=True).T
    beyond = np.concatenate([-here.margins[near], np.full(2 * count, -radius)]) + rows @ shift
    slack = np.concatenate([np.full(len(near), 1.0 / weight), np.zeros(2 * count)])
    rows = np.vstack([np.column_stack([rows, slack]), np.append(np.zeros(count), 1.0)])
    beyond = np.append(beyond + slack, 1.0)

    target = np.zeros(count + 2)
    target[-1] = 1.0
    system = np.vstack([rows.T, beyond])
    found, _ = scipy.optimize.nnls(system, target, maxiter=10 * system.shape[1])
    rest = system @ found - target
    if rest[-1] >= 0.0:  # no step within the region is told apart from none, for want of digits
        return np.full(count, np.nan), np.zeros(len(here.margins)), 0.0
    y = -rest[:-1] / rest[-1]
    step = scipy.linalg.solve_triangular(factor.T, y[:-1] - shift, lower=False)
    multipliers = np.zeros(len(here.margins))
    multipliers[near] = found[: len(near)] / -rest[-1]
    return step, multipliers, max(float(y[-1]) - 1.0, 0.0) / weight


def _updated(hessian: Array, step: Array, bent: Array) -> Array:
    """Return the approximation after a step along which the Lagrangian's gradient bent so much."""
    own = hessian @ step
    curvature, known = step @ bent, step @ own
    if curvature < _DAMPED * known:
        share = (1.0 - _DAMPED) * known / (known - curvature)
        bent = share * bent + (1.0 - share) * own
        curvature = step @ bent
    updated: Array = hessian - np.outer(own, own) / known + np.outer(bent, bent) / curvature
    return 0.5 * (updated + updated.T)
