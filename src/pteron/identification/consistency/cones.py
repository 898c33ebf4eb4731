"""The cone programs, with cvxpy and Clarabel: each body is a second-order cone.

I m >= hx^2 + hy^2 with m, I >= 0 is |(2 hx, 2 hy, m - I)| <= m + I, in parameters scaled by a mass
and a length of the body, so that the three numbers are of one size.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from pteron.errors import ModelError
from pteron.extras import install_command
from pteron.identification.consistency.bodies import Bodies
from pteron.kernels import Array

_TOLERANCES = (1e-10, 1e-9, 1e-8)
"""The solver's, each where it gives up at the one before: the caller checks the answer alike."""

_SOLVED = ("optimal", "optimal_inaccurate")


@dataclass(frozen=True)
class RealBodies:
    """The set of scaled free parameters z that real bodies can have, where matrix @ z <= right.

    Times the depth asked for, `margins` (bodies,) are how far inside its cone each body shall be.
    """

    bodies: Bodies
    margins: Array
    matrix: Array
    right: Array

    def hold(self, cp: Any, z: Any, depth: Any) -> list[Any]:
        """Return the constraints that hold z in the set."""
        turning, *rows = self.bodies.cones
        m, hx, hy, inertia = (row @ z for row in rows)
        inside = self.margins[turning] * depth
        constraints = [
            z[self.bodies.masses] >= self.margins * depth,
            cp.SOC(m + inertia - 2 * inside, cp.vstack([2 * hx, 2 * hy, m - inertia])),
        ]
        if len(self.right):
            constraints.append(self.matrix @ z <= self.right)
        return constraints


def widest(real: RealBodies, start: Array, free: Array, most: float) -> float | None:
    """Return how deep in the set z = start + free @ y can be, at most `most`; None if nowhere."""
    cp = _cvxpy()
    y, depth = cp.Variable(free.shape[1]), cp.Variable()
    constraints = [*real.hold(cp, start + free @ y, depth), depth <= most]
    if not _solve(cp, cp.Problem(cp.Maximize(depth), constraints)):
        return None
    return float(depth.value)


def nearest(
    real: RealBodies, start: Array, free: Array, depth: float, matrix: Array, right: Array
) -> Array | None:
    """Return z = start + free @ y in the set with the least |matrix @ z - right|, or None."""
    cp = _cvxpy()
    y = cp.Variable(free.shape[1])
    objective = cp.sum_squares((matrix @ free) @ y - (right - matrix @ start))
    problem = cp.Problem(cp.Minimize(objective), real.hold(cp, start + free @ y, depth))
    return np.asarray(start + free @ y.value) if _solve(cp, problem) else None


def closest(
    real: RealBodies, matrix: Array, values: Array, spread: Array, depth: float
) -> tuple[Array, Array] | None:
    """Return z in the set with the least |r|, where matrix @ z = values + spread @ r, or None.

    With z comes how hard each body, then each limit, holds r back: the multipliers' sizes.
    """
    cp = _cvxpy()
    size = np.linalg.norm(matrix, axis=1)
    # Relative to what the solver starts from, so that a distance of 1e5 deviations is no problem.
    unit = max(1.0, float(np.linalg.norm(np.linalg.solve(spread, values))) * 1e-4)
    z, r = cp.Variable(matrix.shape[1]), cp.Variable(len(values))
    equal = (matrix / size[:, None]) @ z == values / size + (unit * spread / size[:, None]) @ r
    hold = real.hold(cp, z, depth)
    if not _solve(cp, cp.Problem(cp.Minimize(cp.sum_squares(r)), [equal, *hold])):
        return None
    masses, cones, *limits = (constraint.dual_value for constraint in hold)
    bodies = np.abs(masses)
    bodies[real.bodies.cones[0]] += np.abs(cones[0])
    forces = np.concatenate([bodies, *limits])
    return np.asarray(z.value), np.abs(forces)


def _solve(cp: Any, problem: Any) -> bool:
    """Solve, and tell whether there is a solution; the caller checks it, not the solver."""
    for tolerance in _TOLERANCES:
        options = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                problem.solve(solver=cp.CLARABEL, **options)
            except cp.SolverError:
                continue
        return problem.status in _SOLVED
    return False


class MissingSolver(ModelError):
    """The packages that find real bodies are not installed."""


def _cvxpy() -> Any:
    try:
        import clarabel  # type: ignore[import-untyped]  # noqa: F401

        with _without_jax():
            import cvxpy
    except ImportError:
        raise MissingSolver(
            "consistency needs cvxpy and Clarabel, which are not installed; "
            + install_command("consistency")
        ) from None
    return cvxpy


@contextmanager
def _without_jax() -> Iterator[None]:
    """Keep JAX from being imported, which cvxpy tries for a solver of its own: a second or two."""
    missing = "jax" not in sys.modules
    if missing:
        sys.modules["jax"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        if missing:
            del sys.modules["jax"]
