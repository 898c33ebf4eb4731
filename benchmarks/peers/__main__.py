"""Print each peer's difference from `pteron.inverse_dynamics`, and its time a state.

Run it from the folder above with `python -m peers [name of a machine or path of its file]`.
"""

from __future__ import annotations

import sys

import numpy as np

import pteron
from peers import Array, peers

_STATES = 1000
_ROUNDS = 30


def main() -> None:
    """Print the table; the rounds of the timings take turns."""
    robot = pteron.load(sys.argv[1] if len(sys.argv) > 1 else "quadrupteron")
    rng = np.random.default_rng(0)
    pose = pteron.random_poses(robot, _STATES, seed=rng)
    state = pose, rng.normal(size=pose.shape), 10.0 * rng.normal(size=pose.shape)
    expected = pteron.inverse_dynamics(robot, *state)
    built = peers(robot)
    times = np.array([[peer.seconds(*state) for peer in built] for _ in range(_ROUNDS)])
    print(f"{robot.name}, {_STATES} random states, least of {_ROUNDS} rounds")
    print(f"{'':<40}{'largest relative error':>24}{'ns a state':>12}")
    for peer, least in zip(built, times.min(axis=0, initial=np.inf), strict=True):
        error = _relative_error(peer.forces(*state), expected)
        print(f"{peer.name:<40}{error:>24.1e}{1e9 * least:>12.0f}")
        if not error < 1e-9:
            sys.exit(f"{peer.name}: the forces are wrong")


def _relative_error(found: Array, expected: Array) -> float:
    """Return the largest error of any state, relative to the state's largest force."""
    scale = np.abs(expected).max(axis=-1, keepdims=True)
    return float((np.abs(found - expected) / scale).max())


if __name__ == "__main__":
    main()
