"""Minimum of a nonlinear program of few variables and many rows, by SciPy's SLSQP."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.kernels import Array


@dataclass(frozen=True)
class NonlinearProgram:
    """A nonlinear program: its cost, and margins that must be 0 or more, of variables (v,).

    Attributes
    ----------
    cost : callable
        The value and its gradient (v,); NaN where there is none.
    margins : callable
        The rows (R,); NaN where there is none.
    slopes : callable
        Their derivatives (R, v).
    """

    cost: Callable[[Array], tuple[float, Array]]
    margins: Callable[[Array], Array]
    slopes: Callable[[Array], Array]


def sequential_minimum(
    program: NonlinearProgram,
    start: Array,
    *,
    tolerance: float,
    iterations: int,
    stop: Callable[[], bool],
) -> Array | None:
    """Return a local minimum (v,), or the last iterate; None if `start` has no value.

    Parameters
    ----------
    program : NonlinearProgram
        The program.
    start : array, shape (v,)
        The first iterate.
    tolerance : float
        Change of the cost at which the iteration has converged.
    iterations : int
        Greatest number of iterations.
    stop : callable
        Whether to end at once; evaluated once an iteration.

    References
    ----------
    D. Kraft, A software package for sequential quadratic programming, DFVLR-FB 88-28, 1988.
    """
    iterate = start

    @lru_cache(maxsize=1)
    def evaluate(x: bytes) -> tuple[float, Array, Array]:
        """Return cost, gradient (v,) and constraint margins at variables packed in bytes."""
        variables = np.frombuffer(x)
        return *program.cost(variables), program.margins(variables)

    def cost(x: Array) -> float:
        """Return the cost at variables (v,); infinite where it has no value."""
        # An infinite cost makes the line search shorten a step to where there is no value.
        size, _, margins = evaluate(x.tobytes())
        return size if np.isfinite(size + margins.sum()) else np.inf

    def gradient(x: Array) -> Array:
        """Return the gradient (v,) and note the iterate; raise StopIteration if `stop` says so."""
        nonlocal iterate
        iterate = x.copy()
        if stop():
            raise StopIteration
        return evaluate(x.tobytes())[1]

    def margins(x: Array) -> Array:
        """Return the margins of the constraints at variables (v,), 0 instead of NaN."""
        return np.nan_to_num(evaluate(x.tobytes())[2])

    if not np.isfinite(cost(start)):
        return None
    rows = {"type": "ineq", "fun": margins, "jac": program.slopes}
    options = {"ftol": tolerance, "maxiter": iterations}
    try:
        minimum = scipy.optimize.minimize(
            cost, start, jac=gradient, method="SLSQP", constraints=rows, options=options
        )
    except StopIteration:
        return iterate
    return np.asarray(minimum.x) if minimum.success else iterate
