"""Largest cubes and better geometry by gradients, with conditions at ever more points of a region.

A cube's conditions are infinitely many, a row for every point in it. They are asked at a few
points, the program is solved, and the points where the solution fails join them: the exchange
method for semi-infinite programs (R. Hettich and K. O. Kortanek, SIAM Review 35(3), 1993). Within
a round the geometry is taken as affine in the variables, which it is for lengths and points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import minimize  # type: ignore[import-untyped]

from pteron.design.conditions import Conditions
from pteron.design.holes import holes
from pteron.kernels import Array

_PER_ROW = 3
"""Points at which a round's worst values of each row join its conditions."""

_ROUNDS = 12
_KEPT = 1e-12
"""How far below 0 a row may be where it counts as kept, for rounding."""

_FIRST_STEP = 0.25
"""Share of the unknowns' bounds within which the first round looks."""

_MOST_OF_IT = 0.95
"""A round that may go so far of its way may go further in the next."""

_GAIN = 1e-5
"""A smaller gain, over the objective, ends the rounds."""

_HALVINGS = 12
_SHORTER = 8
"""How often a way that leads over what fails between the points is cut."""

LATTICE = 13
"""Points along each edge of a cube at which it is looked at."""

_OPTIONS = {"maxiter": 60, "ftol": 1e-10}


@dataclass(frozen=True)
class Samples:
    """Points of a moving cube and of a fixed region.

    Attributes
    ----------
    poses : array, shape (N, m)
        The fixed part of each pose; of a point of the cube its orientation.
    units : array, shape (N, k)
        Where the point is in the cube, from -1 to 1 along each axis.
    inside : array, shape (N,)
        1 for a point of the cube, 0 for a fixed one.
    """

    poses: Array
    units: Array
    inside: Array

    def at(self, center: Array, edge: float) -> Array:
        """Return the poses (N, m) for a cube."""
        found = self.poses.copy()
        lengths = self.units.shape[1]
        found[:, :lengths] += self.inside[:, None] * (center + 0.5 * edge * self.units)
        return found

    def joined(self, other: Samples) -> Samples:
        """Return both, one after the other."""
        return Samples(
            np.vstack([self.poses, other.poses]),
            np.vstack([self.units, other.units]),
            np.append(self.inside, other.inside),
        )


def cube_samples(orientations: Array, lengths: int, count: int) -> Samples:
    """Return a lattice of `count` points along each edge of a cube, at every orientation (A, m)."""
    line = np.linspace(-1.0, 1.0, count)
    units = np.array(list(product(line, repeat=lengths)))
    poses = np.repeat(orientations, len(units), axis=0)
    poses[:, :lengths] = 0.0
    return Samples(poses, np.tile(units, (len(orientations), 1)), np.ones(len(poses)))


def fixed_samples(poses: Array, lengths: int) -> Samples:
    """Return points that do not move."""
    return Samples(poses, np.zeros((len(poses), lengths)), np.zeros(len(poses)))


@dataclass(frozen=True)
class Program:
    """What is to be as small as can be: an affine objective, rows, and affine bounds.

    The unknowns are the variables (V,), perhaps none, then the cube's centre (k,) and edge.

    Attributes
    ----------
    conditions : Conditions
        The rows.
    side : float
        Sign of the type-II measure.
    geometry, slopes : array, shape (G,) and (G, V)
        Of the machine, at the variables' start.
    objective : array, shape (V + k + 1,)
        What is minimised is its product with the unknowns.
    bounds : list of (float, float)
        Of each unknown.
    orientations : array, shape (A, m)
        Of the cube; none where none is sought.
    above : tuple of (array, float)
        Each: a row (V + k + 1,) whose product with the unknowns is at least a number.
    failing : array, shape (F, m), optional
        Poses at which some geometry is known to fail.
    """

    conditions: Conditions
    side: float
    geometry: Array
    slopes: Array
    objective: Array
    bounds: list[tuple[float, float]]
    orientations: Array
    above: tuple[tuple[Array, float], ...] = ()
    failing: Array | None = None

    def geometry_at(self, z: Array, z0: Array) -> Array:
        """Return the geometry (G,) at unknowns z; its start belongs to z0."""
        return self.geometry + self.slopes @ (z - z0)[: self.slopes.shape[1]]

    def rows(self, samples: Samples, z: Array, z0: Array) -> Array:
        """Return the rows (N, R) at unknowns z; the geometry's start belongs to z0."""
        poses = samples.at(z[self.slopes.shape[1] : -1], z[-1])
        return self.conditions.rows(self.geometry_at(z, z0), poses, self.side)

    def between(self, z: Array, z0: Array) -> Samples:
        """Return points of the cube that fail between those of a lattice that do not.

        Known ones are among them, where the cube holds them and they still fail.
        """
        center, half = z[self.slopes.shape[1] : -1], 0.5 * z[-1]
        lengths = len(center)
        line, geometry = np.linspace(-1.0, 1.0, LATTICE), self.geometry_at(z, z0)
        found = fixed_samples(np.empty((0, self.orientations.shape[1])), lengths)
        if half <= 0.0:
            return found
        axes = [middle + half * line for middle in center]
        for orientation in self.orientations:
            samples = cube_samples(orientation[None], lengths, LATTICE)
            rows = self.conditions.rows(geometry, samples.at(center, z[-1]), self.side)
            lattice = rows.reshape(*(LATTICE,) * lengths, -1)
            places = np.concatenate(
                [
                    holes(self.conditions, geometry, self.side, orientation, axes, lattice),
                    self._known(geometry, orientation, center, half),
                ]
            )
            poses = np.tile(orientation, (len(places), 1))
            poses[:, :lengths] = 0.0
            units = (places - center) / half
            found = found.joined(Samples(poses, units, np.ones(len(places))))
        return found

    def _known(self, geometry: Array, orientation: Array, center: Array, half: float) -> Array:
        """Return positions (F, k) of poses known to fail that a cube holds and that do fail."""
        lengths = len(center)
        if self.failing is None:
            return np.empty((0, lengths))
        inside = (np.abs(self.failing[:, :lengths] - center) <= half).all(axis=1)
        inside &= (self.failing[:, lengths:] == orientation[lengths:]).all(axis=1)
        poses = self.failing[inside]
        rows = self.conditions.rows(geometry, poses, self.side)
        return np.asarray(poses[~(rows > _KEPT).all(axis=-1), :lengths])


def improved(program: Program, samples: Samples, dense: Samples, z0: Array) -> Array:
    """Return unknowns of a smaller objective, which keep the conditions at all samples.

    Each round goes towards the solution of a program with few conditions as far as all of them are
    kept, so that what it has reached can always be used.

    Parameters
    ----------
    program : Program
        What is minimised, and its conditions.
    samples, dense : Samples
        Where conditions are asked at first, and where the solution is looked at.
    z0 : array, shape (V + k + 1,)
        The start.

    Returns
    -------
    array, shape (V + k + 1,)
        The start, where that does not keep the conditions itself.
    """
    everywhere = samples.joined(dense)
    start = program.rows(everywhere, z0, z0)
    if not _kept(start):
        return z0
    good, pairs, share = z0, _worst(start), _FIRST_STEP
    for _ in range(_ROUNDS):
        z = _solved(program, everywhere, sorted(pairs), good, z0, share)
        values = program.rows(everywhere, z, z0)
        pairs |= _worst(values)
        way = _feasible_way(program, everywhere, good, z, z0)
        missed = program.between(good + way * (z - good), z0)
        if len(missed.inside):
            known = len(everywhere.inside)
            everywhere = everywhere.joined(missed)
            failing = program.rows(missed, good + way * (z - good), z0).argmin(axis=1)
            pairs |= {(known + i, int(row)) for i, row in enumerate(failing)}
            way = _whole_way(program, everywhere, good, z, z0, way)
        gain = float(program.objective @ (good - z))
        good = good + way * (z - good)
        share = min(2.0 * share, 1.0) if way > _MOST_OF_IT else 0.5 * share
        if way > _MOST_OF_IT and gain < _GAIN * abs(float(program.objective @ good)):
            break
    return good


def _kept(rows: Array) -> bool:
    """Say whether all rows are kept; one that is NaN, out of reach, is not."""
    return bool((rows >= -_KEPT).all())


def _feasible_way(
    program: Program, samples: Samples, good: Array, z: Array, origin: Array
) -> float:
    """Return how far one may go from good unknowns to others, as a share of the way."""

    def kept(share: float) -> bool:
        return _kept(program.rows(samples, good + share * (z - good), origin))

    if kept(1.0):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if kept(middle) else (low, middle)
    return low


def _whole_way(
    program: Program, samples: Samples, good: Array, z: Array, origin: Array, way: float
) -> float:
    """Return the same where it is looked at between the samples too; `way` is too far."""
    for _ in range(_SHORTER):
        way *= 0.6
        at = good + way * (z - good)
        if _kept(program.rows(samples, at, origin)) and not len(program.between(at, origin).inside):
            return way
    return 0.0


def _worst(values: Array) -> set[tuple[int, int]]:
    """Return points and rows: of each row the points where it is least."""
    ordered = np.argsort(np.nan_to_num(values, nan=np.inf), axis=0, kind="stable")[:_PER_ROW]
    return {(int(i), r) for r in range(values.shape[1]) for i in ordered[:, r]}


def _solved(
    program: Program,
    samples: Samples,
    pairs: Sequence[tuple[int, int]],
    start: Array,
    origin: Array,
    share: float,
) -> Array:
    """Return the solution with conditions at some points alone, near the start."""
    count, lengths = program.slopes.shape[1], samples.units.shape[1]
    points, where = np.unique([i for i, _ in pairs], return_inverse=True)
    rows = np.array([r for _, r in pairs])
    chosen = Samples(samples.poses[points], samples.units[points], samples.inside[points])
    given = [np.array([row for row, _ in program.above]).reshape(-1, len(start))]
    least = np.array([number for _, number in program.above])
    known: dict[bytes, tuple[Array, Array]] = {}

    def found(z: Array) -> tuple[Array, Array]:
        key = z.tobytes()
        if key not in known:
            known.clear()
            geometry = program.geometry + program.slopes @ (z - origin)[:count]
            poses = chosen.at(z[count : count + lengths], z[-1])
            values, by_geometry, by_pose = program.conditions.derivatives(
                geometry, poses, program.side
            )
            by_lengths = by_pose[..., :lengths] * chosen.inside[:, None, None]
            slopes = np.concatenate(
                [
                    by_geometry @ program.slopes,
                    by_lengths,
                    0.5 * np.einsum("irl,il->ir", by_lengths, chosen.units)[..., None],
                ],
                axis=-1,
            )
            known[key] = (
                np.append(values[where, rows], given[0] @ z - least),
                np.vstack([slopes[where, rows], given[0]]),
            )
        return known[key]

    low, high = np.array(program.bounds).T
    step = share * (high - low)
    low, high = np.maximum(low, start - step), np.minimum(high, start + step)
    solution = minimize(
        lambda z: float(program.objective @ z),
        start,
        jac=lambda z: program.objective,
        method="SLSQP",
        bounds=list(zip(low, high, strict=True)),
        constraints={
            "type": "ineq",
            "fun": lambda z: found(z)[0],
            "jac": lambda z: found(z)[1],
        },
        options=_OPTIONS,
    )
    z = np.clip(solution.x, low, high)
    return z if np.isfinite(z).all() else start
