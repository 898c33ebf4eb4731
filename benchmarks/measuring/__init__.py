"""Timing: contests whose rounds take turns, and tables of their times."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from timeit import Timer
from typing import Any

import numpy as np
from numpy.typing import NDArray

import pteron
from pteron.kernels import numeric
from pteron.kernels.c import compiler

__all__ = [
    "Array",
    "Contestant",
    "States",
    "a_call",
    "a_sweep",
    "catalog",
    "compiled",
    "contest",
    "print_ratio",
    "print_times",
    "quick",
    "random_states",
    "relative_error",
]

Array = NDArray[np.float64]
"""Floats of any shape."""

_SECONDS = 0.02
"""Length of a round of single calls from Python."""

States = tuple[Array, Array, Array]
"""Pose, velocity and acceleration, each (B, m)."""


@dataclass(frozen=True)
class Contestant:
    """Something whose time is measured.

    Parameters
    ----------
    name : str
        What it is.
    seconds : callable
        Runs it once and returns the seconds a state.
    error : float
        Largest relative error of its forces, seen before any timing.
    """

    name: str
    seconds: Callable[[], float]
    error: float


def quick() -> bool:
    """Return whether the run is to be short, and its times but a sign that all works."""
    return "--quick" in sys.argv[1:]


def catalog() -> list[str]:
    """Return the machines of the catalog that long runs take: those with one angle or none."""
    return [name for name in pteron.catalog() if not pteron.load(name).platform.tilts]


def random_states(robot: pteron.Manipulator, count: int, seed: int = 0) -> States:
    """Return random states: poses in reach, rates of order one, accelerations of order ten."""
    rng = np.random.default_rng(seed)
    pose = pteron.random_poses(robot, count, seed=rng)
    return pose, rng.normal(size=pose.shape), 10.0 * rng.normal(size=pose.shape)


def relative_error(found: Array, expected: Array) -> float:
    """Return the largest error of any state, relative to the state's largest force."""
    scale = np.abs(expected).max(axis=-1, keepdims=True)
    return float((np.abs(found - expected) / scale).max())


def compiled(robot: pteron.Manipulator, function: Callable[..., Array]) -> Callable[..., Array]:
    """Return a public function of this machine; once it runs C code, but in a short run."""
    states = random_states(robot, 2_000)[: 3 if function is pteron.inverse_dynamics else 1]
    deadline = perf_counter() + (60.0 if compiler() and not quick() else 0.0)
    while not numeric(robot, function.__name__).is_compiled and perf_counter() < deadline:
        function(robot, *states)
    return partial(function, robot)


def a_call(function: Callable[..., Any], inputs: Sequence[Any]) -> Callable[[], float]:
    """Return what times a round of calls with one state."""
    names = {"f": function} | {f"x{i}": value[0] for i, value in enumerate(inputs)}
    timer = Timer(f"f({', '.join(list(names)[1:])})", globals=names)
    timer.timeit(100)
    count = max(1, int(_SECONDS / (timer.timeit(100) / 100)))
    return lambda: timer.timeit(count) / count


def a_sweep(kernel: Callable[..., Any], given: Sequence[Array]) -> Callable[[], float]:
    """Return what times one call with the whole batch, its result's memory included."""

    def seconds() -> float:
        begin = perf_counter()
        kernel(*given)
        return (perf_counter() - begin) / len(given[0])

    return seconds


def contest(contestants: Sequence[Contestant], rounds: int) -> dict[str, Array]:
    """Return the seconds a state of each contestant in every round; they take turns.

    What slows the machine for a while then slows all of them. A first round warms up, unseen.
    """
    for contestant in contestants:
        contestant.seconds()
    times = [[contestant.seconds() for contestant in contestants] for _ in range(rounds)]
    table = np.array(times).reshape(rounds, len(contestants))
    return {contestant.name: table[:, k] for k, contestant in enumerate(contestants)}


def print_times(contestants: Sequence[Contestant], times: dict[str, Array]) -> None:
    """Print median, quartiles and range in nanoseconds, and how right the forces are."""
    print(f"{'ns a state':<62}{'median':>9}{'quartiles':>17}{'min..max':>17}{'error':>9}")
    for contestant in contestants:
        least, low, middle, high, most = np.quantile(
            1e9 * times[contestant.name], [0.0, 0.25, 0.5, 0.75, 1.0]
        )
        print(
            f"{contestant.name:<62}{_short(middle):>9}{_short(low) + '..' + _short(high):>17}"
            f"{_short(least) + '..' + _short(most):>17}{contestant.error:>9.0e}"
        )


def print_ratio(times: dict[str, Array], slow: str, fast: str) -> None:
    """Print how many times as long one takes as the other: the median of paired rounds."""
    missing = [name for name in (slow, fast) if name not in times]
    if missing:
        print(f"{fast} against {slow}: not measured, no {', '.join(missing)}")
        return
    ratio = times[slow] / times[fast]
    low, middle, high = np.quantile(ratio, [0.25, 0.5, 0.75])
    print(f"{fast} against {slow}: {middle:.1f} times as fast ({low:.1f}..{high:.1f})")


def _short(nanoseconds: float) -> str:
    return f"{nanoseconds:.0f}" if nanoseconds >= 100.0 else f"{nanoseconds:.1f}"
