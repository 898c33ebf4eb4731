"""Cone programs over real bodies, solved by Clarabel: the parameters of real bodies are a cone.

It is that of positive semidefinite matrices: each body has one, `Bodies.moments`, in parameters
scaled by a mass and a length of the body, so that its entries are of one size.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.errors import ModelError
from pteron.extras import install_command
from pteron.identification.consistency.bodies import Bodies
from pteron.kernels import Array

_TOLERANCES = (1e-10, 1e-9, 1e-8)
"""Tolerances of the solver, the next where it gives up at one: the caller checks all answers
alike."""

_UNITS = (1e-4, 1e-3, 1e-2)
"""Units of residuals, over the values' distance from zero: with the first 1e5 standard deviations
are no problem, and where the solver gives up one of the others is in its range."""


@dataclass(frozen=True)
class RealBodies:
    """The scaled free parameters z (k,) that real bodies can have, with matrix @ z <= right.

    Times the depth asked for, `margins` (bodies,) are how far inside its cone each body shall be.
    """

    bodies: Bodies
    margins: Array
    matrix: Array
    right: Array

    @property
    def counts(self) -> list[int]:
        """Number of constraint rows of each body: the entries of a symmetric matrix's triangle."""
        return [len(moments) * (len(moments) + 1) // 2 for moments in self.bodies.moments]

    @cached_property
    def rows(self) -> tuple[Array, Array, Array]:
        """Factors of z and of the depth, and constants, of the constraints' rows.

        Limits come first and are not negative; the matrix of each body follows as the solver has
        it: the columns of its upper triangle, entries off the diagonal times sqrt(2).
        """
        of_z, of_depth = [-self.matrix], [np.zeros(len(self.right))]
        for moments, margin in zip(self.bodies.moments, self.margins, strict=True):
            column, row = np.tril_indices(len(moments))
            on_diagonal = row == column
            of_z.append(moments[row, column] * np.where(on_diagonal, 1.0, np.sqrt(2.0))[:, None])
            of_depth.append(np.where(on_diagonal, -margin, 0.0))
        matrix = np.vstack(of_z)
        constant = np.zeros(len(matrix))
        constant[: len(self.right)] = self.right
        return matrix, np.concatenate(of_depth), constant


def deepest_point(real: RealBodies, start: Array, free: Array, most: float) -> tuple[float, Array]:
    """Return the greatest depth in the set for z = start + free @ y, at most `most`, and z.

    The depth is minus infinity where there is no such z.
    """
    of_z, of_depth, constant = real.rows
    rows = np.column_stack([of_z @ free, of_depth])
    last = np.eye(rows.shape[1])[-1]
    right = np.concatenate([[most], constant + of_z @ start])
    solution = _solve_cone_program(
        real, np.zeros(len(last)), -last, np.vstack([-last, rows]), right
    )
    if solution is None:
        return -np.inf, start
    return float(solution[0][-1]), start + free @ solution[0][:-1]


def nearest_to_target(
    real: RealBodies, start: Array, free: Array, depth: float, matrix: Array, right: Array
) -> Array | None:
    """Return z = start + free @ y in the set with the least |matrix @ z - right|, or None."""
    of_z, of_depth, constant = real.rows
    right_side = constant + of_z @ start + depth * of_depth
    solution = _least_squares(
        real, matrix @ free, matrix @ start - right, np.eye(len(right)), of_z @ free, right_side
    )
    return None if solution is None else np.asarray(start + free @ solution[0][: free.shape[1]])


def closest_to_values(
    real: RealBodies, matrix: Array, targets: Array, spread: Array, depth: float
) -> tuple[Array, Array] | None:
    """Return z in the set with the least |r|, where matrix @ z = values + spread @ r, or None.

    With z comes how hard each body, then each limit, holds r back: the multipliers' sizes.
    """
    of_z, of_depth, constant = real.rows
    size = np.linalg.norm(matrix, axis=1)
    distance = float(np.linalg.norm(np.linalg.solve(spread, targets)))
    for share in _UNITS:
        solution = _least_squares(
            real,
            matrix / size[:, None],
            -targets / size,
            max(1.0, share * distance) * spread / size[:, None],
            of_z,
            constant + depth * of_depth,
        )
        if solution is not None:
            break
    else:
        return None
    answer, multipliers = solution
    limits, cones = np.split(np.abs(multipliers[len(size) :]), [len(real.right)])
    # A body's multipliers are a matrix as well: its trace counts.
    traces = np.where(of_depth[len(real.right) :] < 0.0, cones, 0.0)
    bodies = np.add.reduceat(traces, np.cumsum([0, *real.counts[:-1]]))
    return answer[: matrix.shape[1]], np.concatenate([bodies, limits])


def _least_squares(
    real: RealBodies, matrix: Array, shift: Array, spread: Array, rows: Array, right: Array
) -> tuple[Array, Array] | None:
    """Return (y, r) with the least |r|, where matrix @ y + shift = spread @ r, and multipliers.

    What holds y in the set are the `rows` of y, and `right`.
    """
    count, residual_count = matrix.shape[1], spread.shape[1]
    squares = np.repeat([0.0, 1.0], [count, residual_count])
    constraints = np.block([[matrix, -spread], [rows, np.zeros((len(rows), residual_count))]])
    right = np.concatenate([shift, right])
    return _solve_cone_program(
        real, squares, np.zeros(count + residual_count), constraints, right, equal=len(shift)
    )


def _solve_cone_program(
    real: RealBodies, squares: Array, linear: Array, rows: Array, right: Array, *, equal: int = 0
) -> tuple[Array, Array] | None:
    """Return v with the least squares @ v^2 + linear @ v, and multipliers of the rows, or None.

    Of rows @ v + right the first are `equal` to zero, then come those that are not negative, and
    the cones. The caller checks the answer, not the solver.
    """
    try:
        import clarabel  # type: ignore[import-untyped]
    except ImportError:
        message = "consistency needs Clarabel, which is not installed"
        raise MissingSolver(f"{message}; {install_command('consistency')}") from None
    cones = [clarabel.PSDTriangleConeT(len(moments)) for moments in real.bodies.moments]
    positive = clarabel.NonnegativeConeT(len(rows) - equal - sum(real.counts))
    status = clarabel.SolverStatus
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for tolerance in _TOLERANCES:
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
        solution = clarabel.DefaultSolver(
            scipy.sparse.diags(2.0 * squares, format="csc"),
            linear,
            scipy.sparse.csc_matrix(-rows),
            right,
            [clarabel.ZeroConeT(equal), positive, *cones],
            settings,
        ).solve()
        if solution.status not in (status.NumericalError, status.InsufficientProgress):
            break
    if solution.status not in (status.Solved, status.AlmostSolved):
        return None
    return np.array(solution.x), np.array(solution.z)


class MissingSolver(ModelError):
    """The package that finds real bodies is not installed."""
