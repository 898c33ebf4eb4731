"""Time-optimal motions on small corners take the time of an integration in the phase plane.

For each machine of the catalog, with drives that have friction and rotors: lines through four
random poses, rounded from a micrometre to a tenth of the machine's size, and random limits of
joints, drives and tool. Beside the worst duration over that of the phase plane
(`tests/phase_plane.py`, with 2000 to 4000 nodes on each path) stands the range of `bound` over it.
`--quick` takes two machines and one path each.
"""

from __future__ import annotations

import sys
import time
import zlib
from pathlib import Path

import numpy as np
from measuring import quick
from time_optimal import driven

import pteron
from pteron.motion import line_path, time_optimal
from pteron.workspace import home_pose

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from phase_plane import random_limits, random_poses, shortest_duration, size_of

_MICROMETRE = 1e-6
_SHARES = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)


def main() -> None:
    """Print the worst durations of each machine, by the size of the corners."""
    heads = "".join(f"{share:>9.0e}" for share in _SHARES)
    print(f"{'duration / least':<22}{'1 um':>9}{heads}{'bound / least':>20}{'search':>9}")
    names = ["tripteron", "3-rrr"] if quick() else pteron.catalog()
    worst, bounds, slowest = 0.0, [], 0.0
    for name in names:
        ratios, shares, took = measure(name, 1 if quick() else 3)
        cells = "".join(f"{ratio:>9.4f}" for ratio in ratios.max(axis=0))
        print(
            f"{name:<22}{cells}{shares.min():>11.4f} {shares.max():>7.5f}{took:>8.2f} s",
            flush=True,
        )
        worst, slowest = max(worst, ratios.max()), max(slowest, took)
        bounds.append(shares.max())
    print(f"{len(names)} machines: at most {worst - 1.0:.1%} longer, {slowest:.1f} s a search")
    assert worst <= 1.02
    assert max(bounds) <= 1.0 + 1e-4  # the phase plane's own error


def measure(name: str, count: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return durations and bounds over the least one (count, 6), and the longest search, s."""
    generator = np.random.default_rng(zlib.crc32(name.encode()))
    robot = driven(pteron.load(name))
    home, size = home_pose(name), size_of(robot)
    ratios, shares, took = [], [], 0.0
    for _ in range(count):
        poses = random_poses(robot, home, generator)
        limits = random_limits(robot, line_path(robot, poses, _SHARES[-1] * size), generator)
        for corner in (_MICROMETRE, *(share * size for share in _SHARES)):
            path = line_path(robot, poses, corner)
            begin = time.perf_counter()
            motion = time_optimal(robot, path, limits)
            took = max(took, time.perf_counter() - begin)
            least = shortest_duration(robot, path, limits)
            ratios.append(motion.duration / least)
            shares.append(motion.bound / least)
    shape = count, len(_SHARES) + 1
    return np.reshape(ratios, shape), np.reshape(shares, shape), took


if __name__ == "__main__":
    main()
