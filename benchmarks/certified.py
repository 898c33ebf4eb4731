"""Certified workspaces: bounds on volumes, 10 million random poses, largest cubes.

For the Quadrupteron at phi = 0 the proved bounds on the volume must be less than 1 % apart within a
minute, for the Delta 3 %; the quadrature, which knows nothing of intervals, must lie between them,
for every machine of the catalog. No random pose may be judged otherwise by ordinary evaluation.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from measuring import catalog, quick

import pteron
from pteron.kernels import Array
from pteron.workspace import Paving, cube_bound, home_pose, largest_cube, paving, quadrature_volume
from pteron.workspace.conditions import keeps

_SECONDS = 60.0
_CHUNK = 500_000


def main() -> None:
    """Print the table of the catalog, then the two fine pavings and the random poses."""
    names = ["quadrupteron", "five-bar"] if quick() else catalog()
    print(
        "proved bounds on volumes (m^3, areas m^2) at the home orientation, and largest cubes (m)"
    )
    print(
        f"{'':<22}{'inner':>10}{'quadrature':>12}{'outer':>10}{'s':>6}"
        f"{'cube, proved':>15}{'at most':>9}{'s':>6}"
    )
    for name in names:
        robot = pteron.load(name)
        pose = home_pose(robot)
        found, taken = timed(robot, pose, 0.5 if quick() else 0.1)
        lines = 20 if quick() else 100
        volume = quadrature_volume(robot, pose, lines=lines).volume
        checked(found, volume, name)
        start = time.perf_counter()
        cube = largest_cube(robot, pose)
        spent = time.perf_counter() - start
        if cube.proof is None or not cube.proof.holds:
            sys.exit(f"{name}: the cube is not proved")
        print(
            f"{name:<22}{found.inner_volume:>10.5f}{volume:>12.5f}{found.outer_volume:>10.5f}"
            f"{taken:>6.1f}{cube.edge:>15.4f}{cube_bound(found):>9.4f}{spent:>6.1f}"
        )

    for name, tolerance in (("quadrupteron", 0.01), ("delta", 0.03)):
        robot = pteron.load(name)
        pose = np.zeros(4) if name == "quadrupteron" else home_pose(robot)
        found, taken = timed(robot, pose, 0.2 if quick() else tolerance)
        total, error = quadrature_volume(robot, pose, lines=20 if quick() else 400)
        checked(found, total, name)
        print(
            f"\n{name}: {found.inner_volume:.6f} <= {total:.6f} (quadrature, within {error:.0e}) "
            f"<= {found.outer_volume:.6f} m^3: {100.0 * found.gap:.2f} % apart, "
            f"{len(found.inner)} boxes inside, {len(found.boundary)} undecided, {taken:.1f} s"
        )
        if not quick() and (found.gap > tolerance or taken > _SECONDS):
            sys.exit(f"{name}: {100.0 * tolerance:g} % in {_SECONDS:g} s was asked for")
        compare(found, 10_000 if quick() else 5_000_000, name)


def timed(robot: pteron.Manipulator, pose: Array, tolerance: float) -> tuple[Paving, float]:
    """Return a paving and the seconds that it took."""
    start = time.perf_counter()
    found = paving(robot, pose, tolerance=tolerance)
    return found, time.perf_counter() - start


def checked(found: Paving, volume: float, name: str) -> None:
    """End with a message where a volume is not between the bounds."""
    if not found.inner_volume <= volume <= found.outer_volume:
        sys.exit(f"{name}: the quadrature {volume} is not between the bounds")


def compare(found: Paving, count: int, name: str) -> None:
    """Print how random poses are judged: half of them anywhere, half about the workspace."""
    rng = np.random.default_rng(0)
    boxes = np.concatenate([found.inner, found.boundary])
    near = found.box.copy()
    near[:, :3] = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    totals, wrong = np.zeros(3, int), 0
    while totals.sum() < count:
        low, high = near if totals.sum() < count // 2 else found.box
        poses = rng.uniform(low, high, (min(_CHUNK, count - int(totals.sum())), len(low)))
        where, serves = found.locate(poses), keeps(found.robot, found.conditions, poses)
        wrong += int((serves & (where < 0)).sum() + (~serves & (where > 0)).sum())
        totals += [(where == value).sum() for value in (1, 0, -1)]
    inside, undecided, outside = totals
    print(
        f"{name}: {count} random poses: {inside} proved inside, {outside} outside, {undecided} in "
        f"undecided boxes; {wrong} judged otherwise by ordinary evaluation"
    )
    if wrong:
        sys.exit(f"{name}: the paving is wrong")


if __name__ == "__main__":
    main()
