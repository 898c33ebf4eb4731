"""Platforms that tilt: ten random machines of each platform with each of its legs, by three ways.

Machines are oblique, under any gravity. 200 states of each are given to MuJoCo, whose loops are
closed, and to Lagrange's equations of energies that CasADi differentiates (tests/lagrange.py): they
share nothing with pteron's equations. Forward dynamics must give the accelerations back. MuJoCo
sees every other working mode at ten states as well, by programs whose geometry is an input: those
of 64 modes of ten hexapods would take an hour to build. `base` are the base parameters of one
machine, upright, by three methods, as it is and turned as a whole. Names such as `1T2R-RPS` choose
rows; `--quick` takes one machine of two combinations.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from measuring import Array, States, quick

import pteron
from pteron.kernels import numeric, sharing_programs

os.environ.setdefault("PTERON_KERNELS", "vm")  # each machine is asked a few times
sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

import lagrange  # type: ignore[import-not-found]
import tilting  # type: ignore[import-not-found]
import trees  # type: ignore[import-not-found]
from mechanisms import relative_error

_MACHINES, _STATES = (1, 20) if quick() else (10, 200)
_FEWEST = _STATES // 2
"""States of a machine: one that reaches less of its surroundings is drawn anew."""

_TYPE_I, _TYPE_II = 0.1, 1e-3
"""Measures of a state, at least: at 0.07 from a crank that is stretched ten digits are left."""

_BOUNDS = {"loops": 1e-13, "J": 1e-10, "MuJoCo": 1e-8, "Lagrange": 1e-8, "forward": 1e-10}
_METHODS: tuple[Literal["exact", "svd", "qr"], ...] = ("exact", "svd", "qr")
_COUNTS = {
    "3T3R UPS": 28,
    "3T3R PSS": 22,
    "3T3R RSS": 34,
    "1T2R RPS": 25,
    "1T2R RRS": 25,
    "1T2R PRS": 19,
    "3R UPS": 18,
    "2R RSS": 17,
}
"""Of the literature, or of regressors in 50 digits."""


@dataclass
class Worst:
    """The largest differences of one platform with one kind of leg."""

    machines: int = 0
    states: int = 0
    modes: int = 0

    def __post_init__(self) -> None:
        self.of = dict.fromkeys(_BOUNDS, 0.0)

    def take(self, **found: float) -> None:
        """Keep what is larger than before."""
        for name, value in found.items():
            self.of[name] = max(self.of[name], value)


def main() -> None:
    """Print a row for each combination; exit with 1 if a bound is broken or counts differ."""
    # Those with few legs first; machines of five freedoms are in `test_multipteron`.
    motions = [motion for motion in reversed(tilting.LEGS) if motion != "3T2R"]
    cases = [(motion, kind) for motion in motions for kind in tilting.LEGS[motion]]
    named = [case for case in cases if "-".join(case) in sys.argv]
    faults = []
    print(f"{'':10}machines states modes", *(f"{name:>8}" for name in _BOUNDS), " base", flush=True)
    for motion, kind in named or ([cases[0], cases[3]] if quick() else cases):
        name, worst = f"{motion} {kind}", Worst()
        for seed in range(3 * _MACHINES):
            if worst.machines < _MACHINES:
                look(motion, kind, seed, worst)
        ranks = counts(motion, kind)
        sizes = " ".join(f"{value:8.1e}" for value in worst.of.values())
        told = "/".join(map(str, sorted(ranks)))
        print(
            f"{name:10}{worst.machines:8}{worst.states:7}{worst.modes:6} {sizes} {told:>5}",
            flush=True,
        )
        over = [key for key, bound in _BOUNDS.items() if not worst.of[key] < bound]
        faults += [f"{name}: {key} {worst.of[key]:.1e}" for key in over]
        if worst.machines < _MACHINES:
            faults.append(f"{name}: {worst.machines} machines only")
        if len(ranks) > 1 or _COUNTS.get(name, min(ranks)) not in ranks:
            faults.append(f"{name}: {told} base parameters, {_COUNTS.get(name)} expected")
    if faults:
        sys.exit("\n".join(faults))


def look(motion: str, kind: str, seed: int, worst: Worst) -> None:
    """Compare one machine in all of its working modes."""
    angles = "xyz" if seed % 2 and "3R" in motion else "rpy"
    robot, home = tilting.machine(motion, (kind,), seed, angles)
    states = drawn(robot, home, _STATES, seed)
    if len(states[0]) < _FEWEST:
        return
    worst.machines += 1
    worst.states += len(states[0])
    compare(robot, states, worst)
    oracle, forces = lagrange.Lagrange(robot), pteron.inverse_dynamics(robot, *states)
    back = pteron.forward_dynamics(robot, states[0], states[1], forces)
    worst.take(
        Lagrange=relative_error(oracle.forces(*states), forces),
        J=relative_error(oracle.jacobian(states[0]), pteron.jacobian(robot, states[0])),
        forward=relative_error(back, states[2]),
    )
    first = tilting.machine(motion, (kind,), seed % 2, angles)[0]
    likes = {elbows(like): like for like in pteron.working_modes(first)}
    for mode in pteron.working_modes(robot):
        if mode != robot:
            with sharing_programs(likes[elbows(mode)]):
                compare(mode, drawn(mode, home, 10, seed), worst)


def elbows(robot: pteron.Manipulator) -> tuple[int, ...]:
    """Return the signs of a working mode."""
    return tuple(leg.elbow for leg in robot.legs)


def drawn(robot: pteron.Manipulator, home: Array, count: int, seed: int) -> States:
    """Draw states that are not next to a singularity, where all ways lose digits."""
    states = tilting.states(robot, home, count, seed)
    bent = numeric(robot, "squared_type_i")(states[0])[0].min(axis=-1)
    far = (np.abs(numeric(robot, "type_ii")(states[0])[0]) > _TYPE_II) & (bent > _TYPE_I**2)
    return states[0][far], states[1][far], states[2][far]


def compare(robot: pteron.Manipulator, states: States, worst: Worst) -> None:
    """Compare one working mode with MuJoCo, where it reaches."""
    if not len(states[0]):
        return
    worst.modes += 1
    engine = trees.MuJoCo(robot, states[0][0], spin=False)
    forces, jacobian, gap = trees.projected(robot, engine, *states)
    worst.take(
        loops=gap,
        J=relative_error(jacobian, pteron.jacobian(robot, states[0])),
        MuJoCo=relative_error(forces, pteron.inverse_dynamics(robot, *states)),
    )


def counts(motion: str, kind: str) -> set[int]:
    """Return the numbers of base parameters that the methods find, gravity along the axis."""
    robot = tilting.machine(motion, (kind,), 3)[0]
    up = np.array(robot.platform.axis)
    if motion == "2R":
        up = np.cross(up, robot.platform.second_axis)
    robot = replace(robot, gravity=tuple(-9.81 * up / np.linalg.norm(up)))
    turned = pteron.turned(robot, tilting.rotation(np.random.default_rng(1)))
    return {pteron.base_parameters(r, method).rank for r in (robot, turned) for method in _METHODS}


if __name__ == "__main__":
    main()
