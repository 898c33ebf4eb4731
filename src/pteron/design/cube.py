"""The largest cube in which a machine works at given orientations: found, not yet proved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_cdt  # type: ignore[import-untyped]

from pteron.design.conditions import Conditions
from pteron.design.exchange import LATTICE, Program, Samples, cube_samples, improved
from pteron.design.holes import holes
from pteron.kernels import Array

_COARSE = 25
"""Steps along the longest side of a grid."""

_FIRST = 5
_HALVINGS = 30

_UNKNOWN = -1e-6
"""What stands for a row that is NaN, or fails between two points."""


@dataclass(frozen=True)
class Cube:
    """A cube with edges along the axes.

    Attributes
    ----------
    center : array, shape (k,)
        m.
    edge : float
        m; 0 where there is none.
    side : float
        Sign of the type-II measure in it.
    reserve : float
        The least row at its points; below 0 where there is none: how far the best pose fails.
    """

    center: Array
    edge: float
    side: float
    reserve: float


def largest(
    conditions: Conditions,
    geometry: Array,
    orientations: Array,
    ball: tuple[Array, float],
    failing: Array,
) -> Cube:
    """Return the largest cube whose poses all keep the conditions, at every orientation.

    A grid finds where it is and about how large; then its centre and edge are unknowns of a program
    with exact slopes. At 13 points along each edge all conditions are kept, and so far as slopes
    tell between them.

    Parameters
    ----------
    conditions : Conditions
        What must hold.
    geometry : array, shape (G,)
        Of the design.
    orientations : array, shape (A, m)
        Poses whose angles count.
    ball : (array, float)
        Centre (k,) and radius that hold every position in reach, m.
    failing : array, shape (F, m)
        Poses that are known to fail, which it must not hold: counterexamples of its proof.
    """
    found = [
        _from_grid(conditions, geometry, orientations, ball, side, failing) for side in (1.0, -1.0)
    ]
    best = max(found, key=lambda cube: (cube.edge, cube.reserve))
    if best.edge == 0.0:
        return best
    lengths = len(best.center)
    size = ball[1]
    program = Program(
        conditions,
        best.side,
        geometry,
        np.zeros((len(geometry), 0)),
        np.append(np.zeros(lengths), -1.0),
        [(float(c) - size, float(c) + size) for c in best.center] + [(0.0, 2.0 * size)],
        orientations,
        failing=failing,
    )
    samples, dense = (cube_samples(orientations, lengths, n) for n in (_FIRST, LATTICE))
    z = improved(program, samples, dense, _shrunk(program, dense, best))
    return Cube(z[:-1], float(z[-1]), best.side, _least(program.rows(dense, z, z)))


def _shrunk(program: Program, dense: Samples, cube: Cube) -> Array:
    """Return centre and edge of the largest cube of the same centre that keeps the conditions."""
    share = 1.0

    def unknowns(share: float) -> Array:
        return np.append(cube.center, share * cube.edge)

    for _ in range(_HALVINGS):
        z = unknowns(share)
        if _least(program.rows(dense, z, z)) >= 0.0 and not len(program.between(z, z).inside):
            return z
        share *= 0.8
    return unknowns(0.0)


def _least(rows: Array) -> float:
    """Return the least row; a NaN, which is out of reach, is below 0."""
    return float(np.nan_to_num(rows, nan=-1.0).min())


def _from_grid(
    conditions: Conditions,
    geometry: Array,
    orientations: Array,
    ball: tuple[Array, float],
    side: float,
    failing: Array,
) -> Cube:
    """Return about the largest cube, by its middle: the grid's point furthest from what fails."""
    low, high = ball[0] - ball[1], ball[0] + ball[1]
    nearest = Cube(ball[0], 0.0, side, -np.inf)
    for _ in range(2):
        step = float((high - low).max()) / _COARSE
        axes = [
            a + step * np.arange(int(np.ceil((b - a) / step)) + 1)
            for a, b in zip(low, high, strict=True)
        ]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        lengths = grid.shape[-1]
        least = np.full(grid.shape[:-1], np.inf)
        for orientation in orientations:
            poses = np.broadcast_to(orientation, (*grid.shape[:-1], len(orientation))).copy()
            poses[..., :lengths] = grid
            rows = conditions.rows(geometry, poses, side)
            # A row that is NaN fails, though not as clearly as one that says by how much.
            rows = np.where(np.isnan(rows), _UNKNOWN, rows)
            least = np.minimum(least, rows.min(axis=-1))
            between = holes(conditions, geometry, side, orientation, axes, rows)
            known = failing[(failing[:, lengths:] == orientation[lengths:]).all(axis=1), :lengths]
            for place in (*between, *known):
                nearby = np.rint((place - low) / step).astype(int)
                if ((nearby >= 0) & (nearby < least.shape)).all():
                    least[tuple(nearby)] = min(least[tuple(nearby)], _UNKNOWN)
        inside = least >= 0.0
        at = np.unravel_index(int(least.argmax()), least.shape)
        if not inside.any():
            # What is thin may lie between the points: look closer where they fail by least.
            nearest = Cube(grid[at], 0.0, side, float(least[at]))
            low, high = grid[at] - 2.0 * step, grid[at] + 2.0 * step
            continue
        far = distance_transform_cdt(np.pad(inside, 1), metric="chessboard")
        far = far[tuple(slice(1, -1) for _ in range(lengths))]
        at = np.unravel_index(int(far.argmax()), far.shape)
        nearest = Cube(
            grid[at], max(2.0 * (float(far[at]) - 1.0), 0.5) * step, side, float(least[at])
        )
        places = grid[inside]
        low, high = places.min(axis=0) - step, places.max(axis=0) + step
    return nearest
