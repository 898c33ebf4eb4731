"""Travel from random poses of ten machines, held against sampling and bisection.

Run: python benchmarks/travels.py [POSES]   (poses of each machine, 100 by default); with --quick
three poses of two machines.

For every coordinate and direction the farthest pose is found by 3001 samples and 40 bisections of
the conditions in floating point. A travel beyond it, or more than 1 % short of it, is counted.
"""

import math
import sys
import time

import numpy as np
from numpy.typing import NDArray

import pteron
from pteron.kernels import Array, numeric
from pteron.kernels.functions import TYPE_II
from pteron.manipulator import Manipulator
from pteron.workspace import conditions, travel
from pteron.workspace.conditions import keeps

MACHINES = (
    *("delta", "quadrupteron", "3-rrr", "wrist", "stewart", "par4", "five-bar", "hexapteron"),
    *("hexa", "pentapteron"),
)


def farthest(robot: Manipulator, pose: Array, way: Array, known: float) -> float:
    """Return how far a machine goes from a pose along a way, by samples and bisection."""
    required = conditions(robot)
    sign = np.sign(numeric(robot, "type_ii")(pose)[0])

    def serve(distances: Array) -> NDArray[np.bool_]:
        """Return which poses at these distances keep the conditions."""
        poses = pose + distances[:, None] * way
        held = sign * numeric(robot, "type_ii")(poses)[0] > TYPE_II
        return np.asarray(keeps(robot, required, poses) & held)

    distances = np.linspace(0.0, 1.5 * known, 3001)
    good = serve(distances)
    if good.all():
        return math.inf
    first = int((~good).argmax())
    low, high = distances[max(first - 1, 0)], distances[first]
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if serve(np.array([middle]))[0] else (low, middle)
    return float(low)


def main(machines: tuple[str, ...], count: int) -> None:
    """Print a row for each machine."""
    print(f"{'machine':14} poses  travels  beyond  > 1 % short  worst short  s a pose")
    for name in machines:
        robot = pteron.load(name)
        poses = pteron.random_poses(robot, 4 * count, seed=11, type_i=0.05, type_ii=0.05)
        poses = poses[keeps(robot, conditions(robot, type_ii=TYPE_II), poses)][:count]
        beyond = short = travels = 0
        worst = spent = 0.0
        for pose in poses:
            start = time.perf_counter()
            found = travel(robot, pose)
            spent += time.perf_counter() - start
            for i, way in enumerate(np.eye(robot.freedom)):
                for sign, distance in ((-1.0, -found.low[i]), (1.0, found.high[i])):
                    if not np.isfinite(distance):
                        continue
                    true = farthest(robot, pose, sign * way, distance + 1e-6)
                    travels += 1
                    beyond += distance > true * (1.0 + 1e-9) + 1e-12
                    share = 0.0 if true < 1e-5 else 1.0 - distance / true
                    short, worst = short + (share > 0.01), max(worst, share)
        mean = spent / max(len(poses), 1)
        print(
            f"{name:14} {len(poses):5} {travels:8} {beyond:7} {short:12} {worst:12.2%} {mean:9.2f}",
            flush=True,
        )


if __name__ == "__main__":
    if "--quick" in sys.argv:
        main(MACHINES[:2], 3)
    else:
        main(MACHINES, int(sys.argv[1]) if len(sys.argv) > 1 else 100)
