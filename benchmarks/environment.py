"""The Gymnasium environment: steps a second, alone and many at once.

A step is an action kept for 10 ms, 20 steps of Runge and Kutta's method of 0.5 ms, with the reward,
the ends and the starts of new episodes. Actions are random, within 5 % of the drives' forces, so
that episodes last.
"""

from __future__ import annotations

from time import perf_counter

import gymnasium
import numpy as np
from measuring import quick

from pteron.environments import REACH

SIZES = (1, 64, 1024, 10_000)
SHARE = np.float32(0.05)


def main() -> None:
    """Print a row a machine."""
    sizes = SIZES[:2] if quick() else SIZES
    print(f"{'steps a second':<14}{''.join(f'{size:>10}' for size in sizes)}")
    for name in ("five-bar",) if quick() else ("quadrupteron", "delta", "five-bar"):
        print(f"{name:<14}{''.join(f'{_rate(name, size):>10.0f}' for size in sizes)}")


def _rate(name: str, size: int) -> float:
    """Return the steps a second of so many environments together, the best of three rounds."""
    environments = gymnasium.make_vec(REACH, num_envs=size, robot=name)
    environments.reset(seed=0)
    environments.action_space.seed(0)
    actions = [SHARE * environments.action_space.sample() for _ in range(5)]
    count = 10 if quick() else max(10_000 // size, 10)
    best = 0.0
    for _ in range(4):  # the first one compiles
        begin = perf_counter()
        for k in range(count):
            environments.step(actions[k % len(actions)])
        best = max(best, size * count / (perf_counter() - begin))
    return best


if __name__ == "__main__":
    main()
