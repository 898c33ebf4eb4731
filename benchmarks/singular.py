"""Singular machines and poses: none is answered or proved, and the type-II measure is 0 there.

One leg of random machines of every kind and mixture is made useless, or singular with another: the
machine must be refused when it is made, or flagged by `architecture` and refused by dynamics,
random poses, proofs, paths, reserves and base parameters. And at poses at which J is singular, by
formulas of the tests' own, to the last digit, the measure must be below 1e-12, and at a distance d
at most 10 d over the machine's size; planar machines with rods across their plane are among them.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import numpy as np
from measuring import Array, quick

import pteron

os.environ.setdefault("PTERON_KERNELS", "vm")  # each machine is asked a few times
sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

import degraded
import mechanisms
import singular_poses

_MACHINES, _POSES = (6, 6) if quick() else (200, 500)
_AT, _SLOPE = 1e-12, 10.0


def main() -> None:
    """Print what became of the machines, and how large the measure is at and near the poses."""
    if faults := [*machines(), *poses()]:
        sys.exit("\n".join(faults))


def machines() -> list[str]:
    """Print what became of machines with one leg degraded; return what answered for which."""
    said, done, faults = Counter[str](), Counter[str](), []
    for name, make in degraded.makers(_MACHINES):
        verdict = degraded.judged(make)
        said[verdict] += 1
        done[name.split(", ")[1]] += 1
        if verdict not in ("refused", "flagged"):
            faults.append(f"{name}: {verdict}")
    print(f"{_MACHINES} machines with one leg degraded: {told(said)}")
    print(f"by what was done: {told(done)}")
    return faults


def poses() -> list[str]:
    """Print how large the measure is at and near singular poses; return where it is too large."""
    at, slopes, faults, across = [], [], [], 0
    for robot, pose, made in singular():
        size, slope = singular_poses.slopes(robot, pose, np.random.default_rng(1))
        at.append(size)
        slopes.append(slope)
        across += made
        if not (size < _AT and slope <= _SLOPE):
            faults.append(f"{robot.name}: {size:.1e} at a singular pose, {slope:.3g} d / size")
    print(
        f"{_POSES} singular poses of random machines, {across} with a rod across the plane: "
        f"type-II measure {max(at):.1e} there at most, {max(slopes):.2f} d / size near it at most "
        f"(median {np.median(slopes):.2f})"
    )
    return faults


def singular() -> Iterator[tuple[pteron.Manipulator, Array, bool]]:
    """Yield machines, poses at which they are singular, and whether a rod was put across there."""
    made = 0
    for seed in count():
        for kinds in singular_poses.KINDS:
            robot = mechanisms.random_machine(seed, kinds)
            rng = np.random.default_rng(seed)
            for one, pose in singular_poses.found(robot, rng):
                yield one, pose, one is not robot
                made += 1
                if made == _POSES:
                    return


def told(counts: Counter[str]) -> str:
    """Return counts in words, the largest first."""
    return ", ".join(f"{n} {name}" for name, n in counts.most_common())


if __name__ == "__main__":
    main()
