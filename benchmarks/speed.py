"""Speed of inverse dynamics of machines of every family beside other engines, in one run.

Three contests each: one state a call from Python; one state a call in C, each waiting for the last;
and a batch. The contestants of a contest take turns, round by round, and ratios are of the same
round. Each has to give the right forces first. Times are of this machine; ratios carry further.
Names of machines take the place of those below.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

import numpy as np
from measuring import (
    Array,
    Contestant,
    States,
    a_call,
    a_sweep,
    compiled,
    contest,
    print_ratio,
    print_times,
    quick,
    random_states,
    relative_error,
)
from measuring.exported import FORMS, LEVELS, exported
from peers import Peer, peers

import pteron
from pteron.export import Real
from pteron.kernels import Kernel
from pteron.kernels.c import compiler

_MACHINES = ("quadrupteron", "delta", "linear-delta", "par4", "five-bar", "stewart")
_SHORT = ("quadrupteron", "five-bar")
"""Those of a short run."""

_PART = 500
"""States of a batch that a peer is timed on at a time."""

_CPP = "Pinocchio, C++, usual flags"
_CPP_PLAIN = "Pinocchio, C++, -O3"
_GENERATED = "Pinocchio, C, CasADi's code"
_CPP_TUNED = "Pinocchio, C++, tuned"
_PYTHON = "Pinocchio, Python, usual calls"
_PYTHON_TUNED = "Pinocchio, Python, tuned"
_MUJOCO = "MuJoCo, Python, tuned"
_MUJOCO_C = "MuJoCo, C, tuned"
_MUJOCO_CLOSED = "MuJoCo, C, loops closed by constraints"

_PUBLIC = "pteron.inverse_dynamics"
_UNDER_IT = "pteron c, parametric"
"""The kernel that the public function evaluates."""


def main() -> None:
    """Run the three contests of each machine."""
    if compiler() is None:
        print("target c and the exported C: left out, no C compiler")
    named = [word for word in sys.argv[1:] if not word.startswith("--")]
    for name in named or (_SHORT if quick() else _MACHINES):
        robot = pteron.load(name)
        print(f"\nInverse dynamics of the {name}")
        others = peers(robot, quick=quick())
        single_calls(robot, others)
        exported_calls(robot)
        batches(robot, others)


def single_calls(robot: pteron.Manipulator, others: list[Peer]) -> None:
    """One state a call, from Python, NumPy arrays in and out."""
    states = random_states(robot, 200)
    expected = reference(robot, states)
    contestants = []
    ours: dict[str, Callable[..., Array]] = dict(
        kernels(robot, ("vm", "numba", "c", "c, parametric", "c, base"))
    )
    ours[_PUBLIC] = compiled(robot, pteron.inverse_dynamics)
    for name, function in ours.items():
        forces = np.array([function(*state) for state in zip(*states, strict=True)])
        error = relative_error(forces, expected)
        contestants.append(Contestant(name, a_call(function, states), error))
    lists = tuple([value[0].tolist()] for value in states)
    contestants.append(Contestant("pteron c, lists", a_call(ours["pteron c"], lists), 0.0))
    for peer in others:
        if peer.call is not None:
            error = relative_error(peer.forces(*states), expected)
            contestants.append(Contestant(peer.name, a_call(peer.call, states), error))
    times = run("Single calls from Python", contestants, rounds=3 if quick() else 40)
    for slow in (_PYTHON, _PYTHON_TUNED, _MUJOCO):
        print_ratio(times, slow, "pteron c")
    print_ratio(times, _PUBLIC, _UNDER_IT)


def exported_calls(robot: pteron.Manipulator) -> None:
    """One state a call in C, every call waiting for the one before: a controller's latency."""
    command = compiler()
    if command is None:
        return
    states = random_states(robot, 64)
    expected = reference(robot, states)
    reals: tuple[Real, ...] = ("double", "float")
    forms = list(FORMS)[: 1 if quick() else None]
    levels = LEVELS[: 1 if quick() else None]
    with tempfile.TemporaryDirectory() as scratch:
        contestants = []
        for real in reals:
            for form in forms:
                for level in levels:
                    folder = Path(tempfile.mkdtemp(dir=scratch))
                    made = exported(robot, command, folder, form, real, level, states, expected)
                    contestants.append(made)
        title = "Exported C99, a call that waits for the last"
        run(title, contestants, rounds=3 if quick() else 40)


def batches(robot: pteron.Manipulator, others: list[Peer]) -> None:
    """Many states; engines without batches loop over them in C or C++.

    What runs on several threads has a contest of its own, after that of one thread: its idle
    threads go on spinning for a while, on cores that the next contestant would use.
    """
    states = random_states(robot, 2_000 if quick() else 100_000)
    expected = reference(robot, states)
    contestants: list[Contestant] = []
    parallel: list[Contestant] = []
    options = ("", ", base", ", 2 threads", ", base, 2 threads", ", float32", ", base, float32")
    names = ("vm", "numba", "c, parametric", *(f"c{option}" for option in options))
    public = compiled(robot, pteron.inverse_dynamics)
    error = relative_error(public(*states), expected)
    contestants.append(Contestant(_PUBLIC, a_sweep(public, states), error))
    for name, kernel in kernels(robot, names).items():
        given = [np.ascontiguousarray(value, dtype=kernel.dtype) for value in states]
        error = relative_error(kernel(*given).astype(float), expected)
        contest = parallel if kernel.threads > 1 else contestants
        contest.append(Contestant(name, a_sweep(kernel, given), error))
    for peer in others:
        if peer.call is None:
            error = relative_error(peer.forces(*states), expected)
            contestants.append(Contestant(peer.name, partial(_in_parts, peer, states), error))
    title = f"Batches of {len(expected)} states"
    times = run(title, contestants, rounds=3 if quick() else 25)
    for slow in (_CPP_PLAIN, _CPP, _CPP_TUNED, _GENERATED, _MUJOCO_C, _MUJOCO_CLOSED):
        if not (quick() and slow.startswith("Pinocchio")):
            for fast in ("pteron c", "pteron c, base"):
                print_ratio(times, slow, fast)
    print_ratio(times, _PUBLIC, _UNDER_IT)
    if find_spec("jax") is None:
        print("pteron jax: left out, the package jax is not installed")
    else:
        parallel.append(jax_sweep(robot, states, expected))
    run(f"{title}, on several threads", parallel, rounds=3 if quick() else 25)


def _in_parts(peer: Peer, states: States) -> float:
    """Return the seconds a state of a peer, the median of parts of the batch.

    A part takes about as long as our whole batch, so that neighbours on the machine, which
    interrupt what takes long, are as much a burden to both.
    """
    parts = range(0, len(states[0]), _PART)
    return float(np.median([peer.seconds(*(x[k : k + _PART] for x in states)) for k in parts]))


def kernels(robot: pteron.Manipulator, names: Sequence[str]) -> dict[str, Kernel]:
    """Return the kernels that these names ask for; without a C compiler, those that need none."""
    found = {}
    no_numba = find_spec("numba") is None
    for name in names:
        target, *options = name.split(", ")
        if (target == "c" and compiler() is None) or (target == "numba" and no_numba):
            continue
        found[f"pteron {name}"] = pteron.compile(
            robot,
            "inverse_dynamics",
            target,
            base=pteron.reduction.cheapest_parameters(robot) if "base" in options else None,
            grade="parametric" if "parametric" in options else "specialised",
            dtype="float32" if "float32" in options else "float64",
            threads=2 if "2 threads" in options else 1,
        )
    return found


def reference(robot: pteron.Manipulator, states: States) -> Array:
    """Return the forces by the virtual machine, which the peers' own forces then confirm."""
    forces: Array = pteron.compile(robot, "inverse_dynamics", "vm")(*states)
    return forces


def jax_sweep(robot: pteron.Manipulator, states: States, expected: Array) -> Contestant:
    """Return JAX on the processor, with arrays of its own."""
    import jax

    kernel = pteron.compile(robot, "inverse_dynamics", "jax")
    kernel(*(value[:1] for value in states))  # switches JAX to 64 bits
    given = [jax.device_put(value, jax.devices("cpu")[0]) for value in states]

    def seconds() -> float:
        begin = perf_counter()
        kernel(*given).block_until_ready()
        return (perf_counter() - begin) / len(expected)

    error = relative_error(np.asarray(kernel(*given)), expected)
    return Contestant("pteron jax, processor, its own threads", seconds, error)


def run(title: str, contestants: list[Contestant], rounds: int) -> dict[str, Array]:
    """Check the forces, then time; print both."""
    for contestant in contestants:
        limit = 1e-2 if "float" in contestant.name else 1e-9
        if not contestant.error < limit:
            sys.exit(f"{contestant.name}: the forces are wrong, by {contestant.error:.0e}")
    times = contest(contestants, rounds)
    print(f"\n{title}: {rounds} rounds taking turns")
    print_times(contestants, times)
    return times


if __name__ == "__main__":
    main()
