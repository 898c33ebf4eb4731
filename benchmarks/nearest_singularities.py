"""No singular pose is found nearer than told, nor nearer than the bound that intervals prove.

For every machine of the catalog, 50 random poses each, moved and turned: a search of its own looks
for singular poses in a grid of the ball, or the angles, up to the distance that is told, between
neighbours of either sign and, where a function may touch zero, from the least of its values. None
may be more than 1 % nearer than told, or nearer than `lower_bound`. Poses that a machine's symmetry
makes equal must be told the same. `--quick` takes two machines, three poses each.
"""

from __future__ import annotations

import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from measuring import catalog, quick
from scipy.optimize import minimize  # type: ignore[import-untyped]
from scipy.spatial import cKDTree  # type: ignore[import-untyped]

import pteron
from pteron.kernels import Array, numeric
from pteron.workspace import NearestSingularity, nearest_singularities

_NEARER = 0.01
_CELLS = 28
"""Cells of the grid along each side of the ball."""

_PAIRS = 2000
_WHAT = {"II": "type_ii", "constraint": "constraint"}


@dataclass
class Account:
    """Distances found at a machine's poses."""

    name: str
    told: int = 0
    overstated: float = -np.inf
    broken: int = 0
    """Bounds that a pose found is nearer than."""
    apart: float = 0.0
    """Largest relative difference between poses that symmetry makes equal."""
    shares: list[float] = field(default_factory=list)
    """Proved bounds over distances."""
    seconds: float = 0.0


def main() -> None:
    """Print what is found for each machine."""
    names = ["3-prr", "five-bar"] if quick() else catalog()
    given = [int(part) for part in sys.argv[1:] if part.isdigit()]
    count = given[0] if given else 3 if quick() else 50
    print(f"nearest singular poses, told and looked for otherwise, at {count} poses a machine")
    print(
        f"{'':<22}{'told':>6}{'nearer by':>11}{'bounds broken':>15}{'bound/told: median':>20}"
        f"{'least':>7}{'symmetry':>10}{'a pose':>9}"
    )
    with ProcessPoolExecutor(2) as pool:
        for found in pool.map(partial(account, count=count), names):
            shares = np.array(found.shares)
            print(
                f"{found.name:<22}{found.told:>6}{max(found.overstated, 0.0):>11.3%}"
                f"{found.broken:>15}{np.median(shares):>20.4f}{shares.min():>7.3f}"
                f"{found.apart:>10.1e}{found.seconds / count:>7.1f} s",
                flush=True,
            )
            assert found.broken == 0, found.name
            assert found.overstated <= _NEARER, found.name
            assert found.apart <= _NEARER, found.name


def account(name: str, count: int) -> Account:
    """Return what is found at random poses of a machine."""
    robot, total = pteron.load(name), Account(name)
    for pose in pteron.random_poses(robot, count, seed=21, type_i=0.02, type_ii=0.02):
        begin = time.process_time()
        found = nearest_singularities(robot, pose)
        total.seconds += time.process_time() - begin
        for one in found:
            nearest = looked_for(robot, pose, one)
            total.told += 1
            total.broken += nearest < one.lower_bound
            if np.isfinite(one.distance):
                total.shares.append(one.lower_bound / one.distance)
                total.overstated = max(total.overstated, one.distance / nearest - 1.0)
        total.apart = max(total.apart, difference(robot, pose, found))
    return total


def looked_for(robot: pteron.Manipulator, pose: Array, one: NearestSingularity) -> float:
    """Return the distance of the nearest singular pose in a grid up to the distance told.

    Where none is told, up to the bound within which none is.
    """
    lengths = len(robot.platform.lengths)
    moving = np.arange(lengths) if one.by == "translation" else np.array([lengths])
    most = min(one.distance, 1e3) if np.isfinite(one.distance) else one.lower_bound

    def poses_of(ways: Array) -> Array:
        found = np.broadcast_to(pose, (*ways.shape[:-1], len(pose))).copy()
        found[..., moving] += ways
        return found

    def values(ways: Array) -> Array:
        squares = numeric(robot, "squared_type_i")(poses_of(ways))[0]
        if one.kind == "I":
            others = np.delete(squares, one.leg - 1, axis=-1)
            return np.where((others >= 0.0).all(axis=-1), squares[..., one.leg - 1], np.nan)
        measure = numeric(robot, _WHAT[one.kind])(poses_of(ways))[0]
        return np.where((squares >= 0.0).all(axis=-1), measure, np.nan)

    cells = {1: 4000, 2: 150, 3: _CELLS}[len(moving)]
    axis = most * (2.0 * np.arange(cells) + 1.0 - cells) / cells
    ways = np.stack(np.meshgrid(*[axis] * len(moving), indexing="ij"), -1).reshape(-1, len(moving))
    ways = ways[np.linalg.norm(ways, axis=-1) < most * (1.0 + 1e-9)]
    known = values(ways)
    ways, known = ways[~np.isnan(known)], known[~np.isnan(known)]
    least = most
    low, high = ways[known < 0.0], ways[known > 0.0]
    if len(low) and len(high):
        partner = cKDTree(high).query(low)[1]
        # Those that may cross within the ball, the nearest to the pose first.
        order = np.argsort(np.linalg.norm(low, axis=-1))[:_PAIRS]
        low, high = low[order], high[partner[order]]
        for _ in range(50):
            middle = 0.5 * (low + high)
            below = (values(middle) < 0.0)[:, None]
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        # Else a gap in the reach lies between the two.
        good = np.abs(values(low)) <= 1e-9
        least = min(least, float(np.linalg.norm(low[good], axis=-1).min(initial=most)))
    if one.kind == "constraint":
        for k in np.argsort(np.abs(known))[:3]:
            run = minimize(
                lambda way: float(np.nan_to_num(np.abs(values(way)), nan=1.0)),
                ways[k],
                method="Nelder-Mead",
                options={"maxfev": 400, "fatol": 1e-14, "xatol": 1e-12},
            )
            if run.fun <= 1e-9:
                least = min(least, float(np.linalg.norm(run.x)))
    return least


def difference(
    robot: pteron.Manipulator, pose: Array, found: tuple[NearestSingularity, ...]
) -> float:
    """Return by how much the same is told otherwise at the pose turned by 120 degrees.

    0 where that turn about the base's z is no symmetry: it is one if the squares of type-I measures
    are the same, and their changes, but for the order of the legs.
    """
    if len(robot.legs) != 3:
        return 0.0
    ahead = np.eye(len(pose))[0]
    around = np.array([pose, pose + 1e-3 * ahead])
    here, there = (
        np.sort(numeric(robot, "squared_type_i")(poses)[0], axis=-1)
        for poses in (around, turned(around))
    )
    if np.abs(here - there).max() > 1e-9:
        return 0.0
    apart = 0.0
    again = nearest_singularities(robot, turned(pose))
    for kind in ("I", "II", "constraint"):
        one, other = (
            np.array([it.distance for it in told if (it.kind, it.by) == (kind, "translation")])
            for told in (found, again)
        )
        known = np.isfinite(one) | np.isfinite(other)  # both are beyond all that was looked at
        apart = max([apart, *np.abs(other[known] / one[known] - 1.0)])
    return apart


def turned(poses: Array) -> Array:
    """Return poses turned by 120 degrees about the base's z."""
    found, c, s = poses.copy(), -0.5, 0.5 * np.sqrt(3.0)
    x, y = poses[..., 0], poses[..., 1]
    found[..., 0], found[..., 1] = c * x - s * y, s * x + c * y
    return found


if __name__ == "__main__":
    main()
