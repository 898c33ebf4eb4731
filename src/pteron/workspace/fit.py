"""The largest shape, as a cube or cylinder, in which a machine works: found, then proved."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.kernels import Array
from pteron.workspace.exchange import POINTS, SemiInfiniteProgram, improve_unknowns
from pteron.workspace.proofs import Proof
from pteron.workspace.shape_samples import Shape, shape_samples
from pteron.workspace.smooth_conditions import SmoothConditions

_COARSE = 25
"""Steps of a search grid along its longest side."""

_FIRST = 5
"""Points along each edge of the shape at which conditions are asked at first."""

_SHRINKINGS = 30
"""Most times that a shape from the grid is made smaller until it keeps the conditions."""

UNKNOWN = -1e-6
"""Value, just below 0, for a condition that is NaN or that no proof decides."""

_RIM = 0.98
"""Share of the half edge within which a counterexample sends the search back; nearer to the rim the
shape is only made smaller."""

_EXCHANGES = 20
"""Most counterexamples that send the search back; after them the shape is only made smaller."""


@dataclass(frozen=True)
class Fit:
    """The place and size of a shape in a workspace.

    Attributes
    ----------
    center : array, shape (k,)
        m.
    edge : float
        m; 0 where there is none.
    side : float
        Sign of the type-II measure in it.
    margin : float
        The least row at its points; below 0 where there is none: how far the best pose fails.
    """

    center: Array
    edge: float
    side: float
    margin: float


def largest_fit(
    conditions: SmoothConditions,
    geometry: Array,
    orientations: Array,
    ball: tuple[Array, float],
    failing: Array,
    shape: Shape,
    starts: int = 1,
) -> Fit:
    """Return the largest shape whose poses keep all conditions at every orientation.

    A grid finds where it is and about how large; then its centre and edge are unknowns of a program
    with exact slopes. At 13 points along each edge all conditions are kept, and so far as slopes
    tell between them.

    Parameters
    ----------
    conditions : SmoothConditions
        The conditions.
    geometry : array, shape (G,)
        The machine's geometry.
    orientations : array, shape (A, m)
        Poses whose orientations count.
    ball : (array, float)
        Centre (k,) and radius that hold every position in reach, m.
    failing : array, shape (F, m)
        Poses that are known to fail, which it must not hold: counterexamples of its proof.
    shape : Shape
        The shape.
    starts : int
        Places of the grid from which the program is solved.
    """
    lengths, size = len(ball[0]), ball[1]

    def program(fit: Fit) -> SemiInfiniteProgram:
        """Return the semi-infinite program of the largest shape that starts from a fit."""
        return SemiInfiniteProgram(
            conditions,
            fit.side,
            np.append(fit.center, fit.edge),
            geometry,
            np.zeros((len(geometry), 0)),
            np.append(np.zeros(lengths), -1.0),
            np.append(fit.center, size)[:, None] + [-size, size],
            shape,
            orientations,
            failing=failing,
        )

    fits = [fit for side in conditions.sides for fit in _fits_on_grid(program, ball, side, starts)]
    fits.sort(key=lambda fit: (fit.edge, fit.margin), reverse=True)
    samples, dense = (shape_samples(shape, orientations, n) for n in (_FIRST, POINTS))

    def grow(fit: Fit) -> Fit:
        """Return the largest fit near a start, which is shrunk until its samples do not fail."""
        for _ in range(_SHRINKINGS):
            attempt = program(fit)
            if _least(attempt.rows(dense, attempt.start)) >= 0.0 and not len(
                attempt.failing_samples(attempt.start).inside
            ):
                break
            fit = replace(fit, edge=0.8 * fit.edge)
        else:
            attempt = program(replace(fit, edge=0.0))
        z = improve_unknowns(attempt, samples, dense)
        return Fit(z[:-1], float(z[-1]), fit.side, _least(attempt.rows(dense, z)))

    if fits[0].edge == 0.0:
        return fits[0]
    return max(map(grow, fits[:starts]), key=lambda fit: fit.edge)


def proved_fit(
    search: Callable[[Array], Fit],
    prove: Callable[[Fit], tuple[Proof, ...]],
    shape: Shape,
    shares: Iterable[float],
    freedom: int,
) -> tuple[Fit, tuple[Proof, ...]] | None:
    """Return the largest fit that is proved, with its proofs; None if there is none.

    `search` takes poses (F, m) that fail, and returns the largest fit that holds none of them;
    `prove` takes a fit and returns its proofs, of which the last one does not hold, or all do.
    Shares of the edge that was found are tried, the largest first: at all of it a condition is zero
    somewhere, and undecided. `freedom` is the size of a pose.
    """
    failing = np.empty((0, freedom))
    fit = search(failing)
    while fit.edge > 0.0:
        counterexample = None
        for share in shares:
            smaller = replace(fit, edge=share * fit.edge)
            proofs = prove(smaller)
            if all(proof.holds for proof in proofs):
                return smaller, proofs
            counterexample = proofs[-1].counterexample
            if counterexample is not None and len(failing) < _EXCHANGES:
                away = counterexample[: len(fit.center)] - fit.center
                if shape.gauge(away) < 0.5 * _RIM * fit.edge:
                    break
        else:
            return None
        failing = np.vstack([failing, counterexample])
        fit = search(failing)
    return None


def _least(rows: Array) -> float:
    """Return the least of all rows; a NaN, out of reach, counts as -1."""
    return float(np.nan_to_num(rows, nan=-1.0).min())


def _fits_on_grid(
    program: Callable[[Fit], SemiInfiniteProgram], ball: tuple[Array, float], side: float, most: int
) -> list[Fit]:
    """Return approximate largest cubes, centred at the grid points with the largest margins."""
    low, high = ball[0] - ball[1], ball[0] + ball[1]
    fits = [Fit(ball[0], 0.0, side, -np.inf)]
    tested = program(fits[0])
    for _ in range(2):
        step = float((high - low).max()) / _COARSE
        axes = [
            a + step * np.arange(int(np.ceil((b - a) / step)) + 1)
            for a, b in zip(low, high, strict=True)
        ]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        least = np.full(grid.shape[:-1], np.inf)
        for fixed in tested.orientations:
            rows, failing = tested.test_lattice(tested.geometry, axes, fixed)
            # A row that is NaN fails, though not as clearly as one that says by how much.
            rows = np.where(np.isnan(rows), UNKNOWN, rows)
            least = np.minimum(least, rows.min(axis=-1))
            nearby = np.rint((failing - low) / step).astype(int)
            nearby = nearby[((nearby >= 0) & (nearby < least.shape)).all(axis=1)]
            index = tuple(nearby.T)
            least[index] = np.minimum(least[index], UNKNOWN)
        inside = least >= 0.0
        if not inside.any():
            # A thin region may lie between the points: look closer where they fail by least.
            index = np.unravel_index(int(least.argmax()), least.shape)
            fits = [Fit(grid[index], 0.0, side, float(least[index]))]
            low, high = grid[index] - 2.0 * step, grid[index] + 2.0 * step
            continue
        depths = scipy.ndimage.distance_transform_cdt(np.pad(inside, 1), metric="chessboard")
        depths = depths[(slice(1, -1),) * inside.ndim]
        fits = []
        while len(fits) < most and depths.any():
            index = np.unravel_index(int(depths.argmax()), depths.shape)
            depth = int(depths[index])
            edge = max(2.0 * (depth - 1.0), 0.5) * step
            fits.append(Fit(grid[index], edge, side, float(least[index])))
            depths[tuple(slice(max(i - depth, 0), i + depth + 1) for i in index)] = 0
        places = grid[inside]
        low, high = places.min(axis=0) - step, places.max(axis=0) + step
    return fits
