"""Semi-infinite programs by the exchange method: largest shapes, better geometry, by gradients.

Conditions must hold at every point of a shape. They are asked at a few points, the program is
solved, and the points where the solution fails are added (R. Hettich and K. O. Kortanek, SIAM
Review 35(3), 1993). Within a round the geometry is taken as affine in the variables, which it is
for lengths and points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.kernels import Array
from pteron.kernels.bisection import bisect_condition
from pteron.kernels.one_thread import one_thread
from pteron.tolerances import EXACT
from pteron.workspace.boxes import vary_coordinates
from pteron.workspace.lattice_minima import failing_places
from pteron.workspace.shape_samples import Samples, Shape, lattice
from pteron.workspace.smooth_conditions import SmoothConditions

_PER_ROW = 3
"""Points added in a round for each condition, where it is least."""

_ROUNDS = 12
"""Most rounds; after them the best unknowns so far, which keep all conditions, are the result."""

_FIRST_STEP = 0.25
"""Step of the first round, as a share of the unknowns' bounds."""

_FULL = 0.95
"""Share of its step that a round must be able to take for the next to have a longer one."""

_GAIN = 1e-5
"""Gain, over the objective, below which the rounds end."""

_HALVINGS = 12
"""Bisections for the longest step that keeps all conditions."""

_CUTS = 8
"""Most times that a step is shortened because points between the samples fail."""

POINTS = 13
"""Points along each edge of a shape's box at which its conditions are tested."""


@dataclass(frozen=True)
class SemiInfiniteProgram:
    """A semi-infinite program: an affine objective, conditions at all points, affine bounds.

    The unknowns are variables of the geometry (V,), perhaps none, then the shape's centre (k,) and
    edge.

    Attributes
    ----------
    conditions : SmoothConditions
        The rows.
    side : float
        Sign of the type-II measure.
    start : array, shape (V + k + 1,)
        The unknowns to begin with.
    geometry, slopes : array, shape (G,) and (G, V)
        The geometry at the start, and its slopes by the variables.
    objective : array, shape (V + k + 1,)
        Its product with the unknowns is minimised.
    bounds : array, shape (V + k + 1, 2)
        Bounds of each unknown.
    shape : Shape
        The shape.
    orientations : array, shape (A, m)
        Poses with the shape's orientations; none where none is sought.
    above : tuple of (array, float)
        Each: a row (V + k + 1,) whose product with the unknowns is at least a number.
    failing : array, shape (F, m), optional
        Poses at which some geometry is known to fail.
    """

    conditions: SmoothConditions
    side: float
    start: Array
    geometry: Array
    slopes: Array
    objective: Array
    bounds: Array
    shape: Shape
    orientations: Array
    above: tuple[tuple[Array, float], ...] = ()
    failing: Array | None = None

    def parts(self, z: Array) -> tuple[Array, Array, float]:
        """Return the geometry (G,), and the shape's centre (k,) and edge, at unknowns z."""
        count = self.slopes.shape[1]
        return self.geometry + self.slopes @ (z - self.start)[:count], z[count:-1], float(z[-1])

    def rows(self, samples: Samples, z: Array) -> Array:
        """Return the rows (N, R) at unknowns z."""
        geometry, center, edge = self.parts(z)
        return self.conditions.rows(geometry, samples.shape_poses(center, edge), self.side)

    def keeps(self, samples: Samples, z: Array) -> bool:
        """Return whether all rows are kept; a NaN row, out of reach, is not."""
        return bool((self.rows(samples, z) >= -EXACT).all())

    def failing_samples(self, z: Array) -> Samples:
        """Return points of the shape that fail between the points of a lattice.

        Known ones are among them, where the shape holds them and they still fail.
        """
        geometry, center, edge = self.parts(z)
        units, poses = [np.empty((0, len(center)))], [self.orientations[:0]]
        for fixed in self.orientations if edge > 0.0 else ():
            axes = list(center[:, None] + 0.5 * edge * lattice(self.shape, POINTS))
            _, places = self.test_lattice(geometry, axes, fixed)
            at = (places - center) / (0.5 * edge)
            units.append(at[self.shape.gauge(at) <= 1.0])
            poses.append(vary_coordinates(fixed, np.zeros_like(units[-1])))
        every = np.concatenate(units)
        return Samples(np.concatenate(poses), every, np.ones(len(every)))

    def test_lattice(
        self, geometry: Array, axes: Sequence[Array], fixed: Array
    ) -> tuple[Array, Array]:
        """Return the rows (n1, ..., nk, R) on a lattice, and positions (F, k) that fail.

        Those are between its points, or known. Its orientation is that of a pose.
        """
        count = len(axes)

        def slopes(places: Array) -> tuple[Array, Array]:
            """Return conditions' rows (F, R) at places (F, k), and their slopes (F, R, k)."""
            poses = vary_coordinates(fixed, places)
            rows, slopes = self.conditions.slopes(geometry, poses, self.side)
            return rows, slopes[..., :count]

        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        rows = self.conditions.rows(geometry, vary_coordinates(fixed, grid), self.side)
        known = self.failing if self.failing is not None else self.orientations[:0]
        known = known[(known[:, count:] == fixed[count:]).all(axis=1)]
        fails = self.conditions.rows(geometry, known, self.side) > EXACT
        known = known[~fails.all(axis=-1), :count]
        return rows, np.concatenate([failing_places(slopes, axes, rows), known])


@one_thread()
def improve_unknowns(program: SemiInfiniteProgram, samples: Samples, dense: Samples) -> Array:
    """Return unknowns with a smaller objective that keep the conditions at all samples.

    Each round goes towards the solution of a program with few conditions as far as all of them are
    kept, so that what it has reached can always be used.

    Conditions are asked at `samples` at first, and the solution is tested at `dense`. It is the
    start where that does not keep the conditions itself. The same is found whatever the number of
    threads: a proof of it can be done again.
    """
    everywhere, feasible = samples.join(dense), program.start
    if not program.keeps(everywhere, feasible):
        return feasible
    pairs, share = _worst_rows(program.rows(everywhere, feasible)), _FIRST_STEP
    for _ in range(_ROUNDS):
        z = _solve_subproblem(program, everywhere, sorted(pairs), feasible, share)
        pairs |= _worst_rows(program.rows(everywhere, z))
        length = _feasible_step(program, everywhere, feasible, z)
        failing_samples = program.failing_samples(feasible + length * (z - feasible))
        if len(failing_samples.inside):
            sample_count = len(everywhere.inside)
            everywhere = everywhere.join(failing_samples)
            failing = program.rows(failing_samples, feasible + length * (z - feasible)).argmin(
                axis=1
            )
            pairs |= {(sample_count + i, int(row)) for i, row in enumerate(failing)}
            length = _cut_step(program, everywhere, feasible, z, length)
        gain = float(program.objective @ (feasible - z))
        feasible = feasible + length * (z - feasible)
        share = min(2.0 * share, 1.0) if length > _FULL else 0.5 * share
        if length > _FULL and gain < _GAIN * abs(float(program.objective @ feasible)):
            break
    return feasible


def _feasible_step(
    program: SemiInfiniteProgram, samples: Samples, feasible: Array, z: Array
) -> float:
    """Return the feasible fraction of a step from feasible unknowns, by bisection."""
    if program.keeps(samples, z):
        return 1.0
    step = z - feasible
    shares = bisect_condition(
        lambda share: program.keeps(samples, feasible + share * step), 0.0, 1.0, _HALVINGS
    )
    return float(shares[0])


def _cut_step(
    program: SemiInfiniteProgram, samples: Samples, feasible: Array, z: Array, length: float
) -> float:
    """Return a shorter step's fraction, at whose end nothing fails between the samples either."""
    for _ in range(_CUTS):
        length *= 0.6
        shorter = feasible + length * (z - feasible)
        if program.keeps(samples, shorter) and not len(program.failing_samples(shorter).inside):
            return length
    return 0.0


def _worst_rows(rows: Array) -> set[tuple[int, int]]:
    """Return (point, row) pairs: for each row the points where it is least."""
    sortable = np.where(np.isnan(rows), np.inf, rows).T
    count = min(_PER_ROW, sortable.shape[1])
    last = np.partition(sortable, count - 1, axis=1)[:, count - 1]
    worst = set()
    for r, (row, most) in enumerate(zip(sortable, last, strict=True)):
        low = np.flatnonzero(row <= most)
        low = low[np.argsort(row[low], kind="stable")[:count]]
        worst |= {(i, r) for i in low.tolist()}
    return worst


def _solve_subproblem(
    program: SemiInfiniteProgram,
    samples: Samples,
    pairs: Sequence[tuple[int, int]],
    feasible: Array,
    share: float,
) -> Array:
    """Return the solution with the conditions at a subset of points, near feasible unknowns."""
    lengths = samples.units.shape[1]
    points, where = np.unique([i for i, _ in pairs], return_inverse=True)
    rows = np.array([r for _, r in pairs])
    chosen = Samples(samples.poses[points], samples.units[points], samples.inside[points])
    above = np.array([row for row, _ in program.above]).reshape(-1, len(feasible))
    least = np.array([number for _, number in program.above])

    @lru_cache(maxsize=1)
    def rows_and_slopes(key: bytes) -> tuple[Array, Array]:
        """Return constraints (C,), at least 0 where they hold, and their slopes (C, v)."""
        z = np.frombuffer(key)
        geometry, center, edge = program.parts(z)
        row_values, by_pose, *by_geometry = program.conditions.slopes(
            geometry,
            chosen.shape_poses(center, edge),
            program.side,
            by_geometry=program.slopes.size > 0,
        )
        by_center = by_pose[..., :lengths] * chosen.inside[:, None, None]
        by_edge = 0.5 * np.einsum("irl,il->ir", by_center, chosen.units)[..., None]
        by_variables = [part @ program.slopes for part in by_geometry]
        slopes = np.concatenate([*by_variables, by_center, by_edge], axis=-1)[where, rows]
        row_values = row_values[where, rows]
        # A row that is NaN counts as kept: a row before it says what is wrong.
        row_values = np.where(np.isfinite(row_values), row_values, 1.0)
        return np.append(row_values, above @ z - least), np.vstack([slopes, above])

    low, high = program.bounds.T
    step = share * (high - low)
    low, high = np.maximum(low, feasible - step), np.minimum(high, feasible + step)
    solution = scipy.optimize.minimize(
        lambda z: float(program.objective @ z),
        feasible,
        jac=lambda z: program.objective,
        method="SLSQP",
        bounds=np.column_stack([low, high]),
        constraints={
            "type": "ineq",
            "fun": lambda z: rows_and_slopes(z.tobytes())[0],
            "jac": lambda z: rows_and_slopes(z.tobytes())[1],
        },
        options={"maxiter": 60, "ftol": 1e-10},
    )
    z = np.clip(solution.x, low, high)
    return z if np.isfinite(z).all() else feasible
