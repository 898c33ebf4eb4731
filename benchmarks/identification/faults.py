"""Logs with one fault each: what `identify` says, and how far a pick-and-place cycle is off.

A machine 20 % off its drawing moves along random Fourier series; its joints have friction, encoders
round and 1 % of each force is noise. One fault is put in, the log is identified with another motion
held out, and the model file's forces are compared with the machine's on a cycle as fast as the
motion. Printed, and written to docs/faults.md: grades, what was named, that error, and what the log
cannot tell by its own words.

    python benchmarks/identification/faults.py [--seeds 1] [--jobs 1] [MACHINE ...]
    python benchmarks/identification/faults.py --simulated|--play [MACHINE ...]

The second line simulates machines as drawn, without noise: all of the catalog, or some; with
`--play` in its place their drives bend, once without and once with play, and the logs are noisy.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import interp1d  # type: ignore[import-untyped]
from scipy.signal import lfilter  # type: ignore[import-untyped]

import pteron
from pteron import atomic
from pteron.bodies.parameters import body_places
from pteron.controllers import ComputedTorque, FeedForwardPD
from pteron.identification import (
    Limits,
    Log,
    LogError,
    States,
    Terms,
    identify,
    random_excitation,
)
from pteron.identification.excitation import FourierMotion
from pteron.identification.faults.cycle import Extent, ReferenceCycle
from pteron.identification.logs import Description, KnownPayload
from pteron.kernels import Array
from pteron.legs import Drive, Elastic, Stribeck
from pteron.manipulator import parameter_data
from pteron.motion import simulate, with_payload
from pteron.workspace import home_pose

_RATE = 400.0
_PERIODS = 2
_NOISE = 0.01
"""Standard deviation, as a share of each force's root mean square."""

_COLOUR = 0.9
"""Correlation of coloured noise over 1 ms."""

_SMALL = 1e-6
"""Inertia of a payload at P, over its mass, m^2."""

_SIZE = 0.9
"""Size of the cycle over the largest: a machine that is 1 mm off must reach all of it."""

_TWENTY_BITS = 2.0 * np.pi / 2**20


@dataclass(frozen=True)
class Usual:
    """Drives of a machine: dry and viscous friction, encoder, and limits of its joints."""

    dry: float
    viscous: float
    encoder: float
    speed: float
    acceleration: float
    period: float


MACHINES = {
    "quadrupteron": Usual(6.0, 4.0, 1e-6, 0.8, 8.0, 5.0),
    "delta": Usual(4.0, 1.0, _TWENTY_BITS, 6.0, 80.0, 5.0),
    "par4": Usual(0.2, 0.05, _TWENTY_BITS, 10.0, 120.0, 4.0),
    "five-bar": Usual(0.001, 0.0001, _TWENTY_BITS, 8.0, 80.0, 4.0),
}


@dataclass
class Case:
    """A machine as built and what it records; a fault changes some of it."""

    usual: Usual
    rng: np.random.Generator
    robot: pteron.Manipulator
    motion: FourierMotion
    time: Array
    joints: Array
    forces: Array
    seed: int
    carried: float = 0.0
    drawn: pteron.Manipulator | None = None

    @property
    def phase(self) -> NDArray[np.int64]:
        """When a payload is carried: in the second half, if there is one."""
        later = np.arange(len(self.time)) >= len(self.time) // 2
        return (later & (self.carried > 0.0)).astype(np.int64)

    @property
    def actuator(self) -> int:
        """The actuator that a fault of one is of."""
        return int(self.seed % self.forces.shape[1])


def as_built(name: str, seed: int) -> pteron.Manipulator:
    """Return a machine whose bodies are up to 20 % denser or lighter than drawn, with friction."""
    robot, usual = pteron.load(name), MACHINES[name]
    rng = np.random.default_rng(seed)
    sizes = [len(place) for place in body_places(parameter_data(robot)).values()]
    factors = rng.uniform(0.8, 1.2, len(sizes)).repeat(sizes)
    built = pteron.with_parameters(robot, pteron.parameters(robot) * factors)
    return with_friction(built, usual)


def with_friction(
    robot: pteron.Manipulator, usual: Usual, *, share: float = 1.0, stribeck: bool = False
) -> pteron.Manipulator:
    """Return the machine with friction, `share` of the usual dry friction, that falls or not."""
    legs = []
    for k, leg in enumerate(robot.legs):
        dry = share * usual.dry * (1.0 + 0.15 * k)
        law = Stribeck(0.5 * dry, 0.05 * usual.speed) if stribeck else None
        drive = Drive(dry, usual.viscous * (1.0 + 0.2 * k), 0.1 * k * usual.dry, stribeck=law)
        legs.append(replace(leg, drive=drive))
    return replace(robot, legs=tuple(legs))


@lru_cache
def excitation(name: str, seed: int) -> FourierMotion:
    """Return a random motion within the machine's limits."""
    usual = MACHINES[name]
    limits = Limits(usual.speed, usual.acceleration, type_i=0.3)
    return random_excitation(
        pteron.load(name), harmonics=5, period=usual.period, limits=limits, seed=seed
    )


# Faults of the machine, put in before it moves -------------------------------------------------


def other_geometry(robot: pteron.Manipulator, rng: np.random.Generator) -> pteron.Manipulator:
    """Return the machine with every length and point 1 mm off, in a direction at random."""
    legs = []
    for leg in robot.legs:
        changed = {}
        for name, key in leg.every_key().items():
            one_point = name == "platform_point" and robot.coordinates == ("x", "y")
            if getattr(leg, name) is None or one_point:
                continue
            if key.role == "point" and name != "fixed_offset":
                way = rng.normal(size=3)
                changed[name] = tuple(getattr(leg, name) + 1e-3 * way / np.linalg.norm(way))
            elif key.role == "length":
                changed[name] = getattr(leg, name) + 1e-3 * rng.choice((-1, 1))
        legs.append(replace(leg, **changed))
    return replace(robot, legs=tuple(legs))


def tilted(robot: pteron.Manipulator, rng: np.random.Generator) -> pteron.Manipulator:
    """Return the machine with gravity 2 degrees off, towards anywhere."""
    g = np.array(robot.gravity)
    across = np.cross(g, rng.normal(size=3))
    across *= np.linalg.norm(g) / np.linalg.norm(across)
    angle = np.radians(2.0)
    return replace(robot, gravity=tuple(np.cos(angle) * g + np.sin(angle) * across))


MACHINE_FAULTS: dict[str, Callable[[pteron.Manipulator, Case], pteron.Manipulator]] = {
    "geometry 1 mm off": lambda robot, case: other_geometry(robot, case.rng),
    "gravity 2 degrees off": lambda robot, case: tilted(robot, case.rng),
    "Stribeck friction": lambda robot, case: with_friction(robot, case.usual, stribeck=True),
}


# Faults of the log, put into what was recorded -------------------------------------------------


def late(milliseconds: float) -> Callable[[Case], None]:
    """Return what makes the forces of a log late."""

    def change(case: Case) -> None:
        ends = case.forces[0], case.forces[-1]
        at = interp1d(case.time, case.forces, axis=0, bounds_error=False, fill_value=ends)
        case.forces = at(case.time - 1e-3 * milliseconds)

    return change


def scaled(case: Case) -> None:
    """Make one force 7 % too large."""
    case.forces[:, case.actuator] *= 1.07


def drifting(case: Case) -> None:
    """Let dry friction begin 30 % higher than it ends."""
    more = forces_of(with_friction(case.robot, case.usual, share=1.3), case)
    later = (case.time / case.time[-1])[:, None]
    case.forces += (more - forces_of(case.robot, case)) * (1.0 - later)


def elastic(case: Case) -> None:
    """Measure motors whose drives give, so that they swing at 25 Hz while the joints are held."""
    pose, velocity, acceleration = states_of(case.robot, case)
    load = pteron.inverse_dynamics(case.robot, pose, velocity, acceleration)
    seconds = np.gradient(np.gradient(case.joints, case.time, axis=0), case.time, axis=0)
    inertia = load.std(axis=0) / seconds.std(axis=0)
    case.joints = case.joints + load / (inertia * (2.0 * np.pi * 25.0) ** 2)


def flipped(case: Case) -> None:
    """Give one force the other sign."""
    case.forces[:, case.actuator] *= -1.0


def swapped(values: Array) -> Array:
    """Return columns of which the first two are swapped."""
    return values[:, [1, 0, *range(2, values.shape[1])]]


def swapped_forces(case: Case) -> None:
    """Swap two forces."""
    case.forces = swapped(case.forces)


def swapped_joints(case: Case) -> None:
    """Swap two positions."""
    case.joints = swapped(case.joints)


def times(factor: float) -> Callable[[Case], None]:
    """Return what multiplies all forces."""

    def change(case: Case) -> None:
        case.forces = factor * case.forces

    return change


def slow_clock(case: Case) -> None:
    """Let the log's clock run 3 % slow."""
    case.time = 0.97 * case.time


def saturated(case: Case) -> None:
    """Cut the range of all forces to 60 %."""
    low, high = case.forces.min(axis=0), case.forces.max(axis=0)
    case.forces = np.clip(case.forces, 0.8 * low + 0.2 * high, 0.2 * low + 0.8 * high)


def wrapping(case: Case) -> None:
    """Let one encoder wrap in the middle of its joint's range: a turn, or its count range."""
    joint = case.joints[:, case.actuator]
    crank = case.robot.legs[case.actuator].joint.unit == "rad"
    size = 2.0 * np.pi if crank else 1.2 * np.ptp(joint)
    case.joints = case.joints.copy()
    case.joints[:, case.actuator] = np.mod(joint - joint.mean(), size)


def upside_down(case: Case) -> None:
    """Draw gravity upwards."""
    x, y, z = case.motion.robot.gravity
    case.drawn = replace(case.motion.robot, gravity=(-x, -y, -z))


LOG_FAULTS: dict[str, Callable[[Case], None]] = {
    "one force flipped": flipped,
    "two forces swapped": swapped_forces,
    "two positions swapped": swapped_joints,
    "all forces halved": times(0.5),
    "all forces 10 % up": times(1.1),
    "all forces halved, known payload": times(0.5),
    "all forces 10 % up, known payload": times(1.1),
    "clock 3 % slow": slow_clock,
    "clock 3 % slow, known payload": slow_clock,
    "saturation": saturated,
    "encoder wraps": wrapping,
    "gravity upside down": upside_down,
    "delay 3 ms": late(3.0),
    "delay 8 ms": late(8.0),
    "one force 7 % too large": scaled,
    "friction drifts by 30 %": drifting,
    "elastic drives": elastic,
}
CASES = (*LOG_FAULTS, *MACHINE_FAULTS, "1 % outliers")
"""Cases with a fault."""

CORRECT = ("none", "no noise", "coloured noise", "noise, known payload", "no noise, known payload")
"""Cases without one."""

PAYLOAD = ", known payload"

HIDDEN = {
    "all forces 10 % up": "gain",
    "all forces halved": "gain",
    "clock 3 % slow": "clock",
    "one force 7 % too large": "scale",
}
"""Faults that some logs cannot tell."""


def noise(fault: str, shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Return noise of unit variance, coloured if that is the case, or with outliers."""
    white = rng.normal(size=shape) * ("no noise" not in fault)
    if fault == "coloured noise":
        kept = _COLOUR ** (1000.0 / _RATE)
        return np.asarray(lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], white, axis=0))
    if fault == "1 % outliers":
        sizes = rng.uniform(10.0, 60.0, shape) * rng.choice((-1.0, 1.0), shape)
        return np.asarray(white + (rng.random(shape) < 0.01) * sizes)
    return white


# A log, and what is made of it -----------------------------------------------------------------


def commanded(case: Case) -> tuple[Array, Array, Array]:
    """Return coordinates, rates and accelerations of the joints, by the drawn geometry."""
    moved, drawn = case.motion.at(case.time), case.motion.robot
    rates = pteron.kinematics.joint_rates(drawn, moved.pose, moved.velocity)
    seconds = pteron.kinematics.joint_accelerations(
        drawn, moved.pose, moved.velocity, moved.acceleration
    )
    return pteron.inverse_kinematics(drawn, moved.pose), rates.actuated, seconds.actuated


def states_of(robot: pteron.Manipulator, case: Case) -> tuple[Array, Array, Array]:
    """Return the platform's motion on a machine whose joints move as commanded."""
    states = States.from_joints(robot, commanded(case), case.time, home_pose(robot))
    return states.pose, states.velocity, states.acceleration


def forces_of(robot: pteron.Manipulator, case: Case) -> Array:
    """Return the drives' forces along the case's motion."""
    return pteron.drive_forces(robot, *states_of(robot, case))


def recorded(name: str, fault: str, seed: int, *, other: bool = False) -> tuple[Log, Case]:
    """Return a log with a fault, or another motion of the same machine, and the case."""
    usual = MACHINES[name]
    rng = np.random.default_rng((seed, (*CASES, *CORRECT).index(fault)))
    motion = excitation(name, seed + 50 * other)
    time = np.arange(round(_PERIODS * usual.period * _RATE)) / _RATE
    joints = pteron.inverse_kinematics(motion.robot, motion.at(time).pose)
    case = Case(usual, rng, as_built(name, seed), motion, time, joints, joints, seed)
    if fault in MACHINE_FAULTS:
        case.robot = MACHINE_FAULTS[fault](case.robot, case)
    case.forces = forces_of(case.robot, case)
    if PAYLOAD in fault:
        case.carried = 0.5 * case.robot.platform.inertia.mass
        carrying = forces_of(with_payload(case.robot, case.carried), case)
        case.forces = np.where(case.phase[:, None] > 0, carrying, case.forces)
    size = np.sqrt((case.forces**2).mean(axis=0))
    coarse = 0.0 if "no noise" in fault else usual.encoder
    case.rng = np.random.default_rng((seed, other))
    case.forces = case.forces + _NOISE * size * noise(fault, case.forces.shape, case.rng)
    if fault in LOG_FAULTS:
        LOG_FAULTS[fault](case)
    coded = np.round(case.joints / coarse) * coarse if coarse else case.joints
    source = "held-out.csv" if other else "log.csv"
    symbols = tuple(leg.joint for leg in motion.robot.legs)
    phase, about = None, Description()
    if case.carried:
        loaded = with_payload(case.robot, case.carried)
        # The tool carries it, which need not be at P.
        mass, x, y, inertia = (pteron.parameters(loaded) - pteron.parameters(case.robot))[-4:]
        about = Description(payload=KnownPayload(mass, (x, y), max(inertia, _SMALL * mass)))
        phase = case.phase
    log = Log(
        source, case.time, coded, case.forces, symbols=symbols, payload=phase, description=about
    )
    return log, case


@dataclass(frozen=True)
class Said:
    """Verdict on one log, and how far a cycle's forces are off (%)."""

    grade: str
    faults: tuple[str, ...]
    off: float
    hidden: tuple[str, ...] = ()


def judged(name: str, fault: str, seed: int) -> Said:
    """Identify a log, and compare the model file's forces with the machine's."""
    log, case = recorded(name, fault, seed)
    held, _ = recorded(name, fault, seed, other=True)
    terms = Terms(payload=bool(case.carried))
    try:
        found = identify(case.drawn or pteron.load(name), log, held_out=held, terms=terms)
    except LogError as error:
        return Said("refused", (error.reason,), np.nan)
    case.time = np.arange(len(case.time)) / _RATE
    _, rates, seconds = commanded(case)
    pose = case.motion.at(case.time).pose.mean(axis=0)
    extent = Extent(pose, np.abs(rates).max(axis=0), np.abs(seconds).max(axis=0))
    cycle = ReferenceCycle.from_mean_pose(case.motion.robot, extent, size=_SIZE)
    assert cycle is not None
    s = cycle.states
    joints = s.joints, s.joint_rates, s.joint_accelerations
    true = States.from_joints(case.robot, joints, s.time, home_pose(case.robot))
    forces = pteron.drive_forces(case.robot, true.pose, true.velocity, true.acceleration)
    off = np.nan
    if found.machine is not None:
        told = pteron.drive_forces(found.machine, s.pose, s.velocity, s.acceleration)
        off = float(cycle.share(told - forces, forces).max())
    shown = found.fault_isolation
    named: tuple[str, ...] = tuple(one.fault for one in shown.log)
    named += tuple(one.fault for one in shown.faults if one.matters)
    if shown.factor != 1.0:
        named = ("factor", *named)
    if any((one.outliers > 0.0).any() for one in found.held_out):
        named = (*named, "outliers")
    return Said(found.verdict.grade, named, off, found.fault_isolation.hidden)


def with_play(robot: pteron.Manipulator, play: float) -> pteron.Manipulator:
    """Return a machine whose motors are as heavy as it is at its joints, and swing at 50 Hz.

    The play, if any, is 2 mrad at cranks, 0.2 mm at sliders.
    """
    home = home_pose(robot)
    inverse = np.linalg.pinv(pteron.jacobian(robot, home))
    masses = np.diag(inverse.T @ pteron.mass_matrix(robot, home) @ inverse)
    legs = []
    for leg, mass in zip(robot.legs, masses.tolist(), strict=True):
        stiffness = mass * (2.0 * np.pi * 50.0) ** 2
        soft = Elastic(
            stiffness,
            0.002 * stiffness,
            backlash=play * (2e-3 if leg.joint.unit == "rad" else 2e-4),
        )
        legs.append(replace(leg, drive=Drive(rotor_inertia=mass, elastic=soft)))
    return replace(robot, legs=tuple(legs))


def simulated(name: str, play: float | None = None) -> Said:
    """Identify a machine as drawn that a simulated controller moves, without noise.

    With a play, 0 or more times `with_play`, its drives bend, and forces are noisy.
    """
    robot = pteron.load(name)
    built = robot if play is None else with_play(robot, play)
    logs, noisy = [], np.random.default_rng(0)
    for seed in (0, 1):
        limits = Limits(2.0, 10.0, type_i=0.3)
        motion = random_excitation(robot, limits=limits, seed=seed)
        law = ComputedTorque(period=1e-3) if play is None else FeedForwardPD(period=1e-3)
        found = simulate(built, motion.at(np.arange(8001) / 1000.0), law)
        symbols = tuple(leg.joint for leg in robot.legs)
        forces = found.forces
        if play is not None:
            size = _NOISE * np.sqrt((forces**2).mean(axis=0))
            forces = forces + size * noisy.normal(size=forces.shape)
        logs.append(Log(f"log-{seed}", found.time, found.motors, forces, symbols=symbols))
    try:
        result = identify(robot, logs[0], held_out=logs[1])
    except LogError as error:
        return Said("refused", (error.reason,), np.nan)
    named = tuple(one.fault for one in result.fault_isolation.faults if one.matters)
    return Said(
        result.verdict.grade,
        named,
        float(result.fault_isolation.expected_error.max()),
        result.fault_isolation.hidden,
    )


def cell(said: list[Said]) -> str:
    """Return what was said of some logs, in short."""
    grades = Counter(one.grade for one in said)
    faults = Counter(fault for one in said for fault in one.faults)
    parts = [", ".join(f"{count} {grade}" for grade, count in grades.items())]
    if faults:
        parts.append(", ".join(f"{fault} {count}" for fault, count in faults.items()))
    if not np.isnan(off := [one.off for one in said]).all():
        ends = [f"{end:.2g}" for end in (np.nanmin(off), np.nanmax(off))]
        parts.append(f"{' to '.join(dict.fromkeys(ends))} %")
    if hidden := sorted({fault for one in said for fault in one.hidden}):
        parts.append(f"cannot tell: {', '.join(hidden)}")
    return "<br>".join(parts)


Key = tuple[str, str, int]


def misjudged(said: dict[Key, Said]) -> list[str]:
    """Return lines on what should not be: bad logs trusted, good ones accused, wrong excuses."""
    trusted = [k for k, one in said.items() if one.grade == "trustworthy" and one.off > 3.0]
    untold = [k for k in trusted if HIDDEN.get(plain(k[1])) not in said[k].hidden]
    accused = [k for k, one in said.items() if k[1] in CORRECT and one.faults]
    wrong = []
    for fault, kind in HIDDEN.items():
        for key, one in said.items():
            # A log of the machine with that fault in it says whether it can be told.
            other = said.get((key[0], fault + PAYLOAD * (PAYLOAD in key[1]), 0))
            if other is not None and kind in one.hidden and kind in other.faults:
                wrong.append((key, kind))
    count = sum(k[1] in CORRECT for k in said)
    return [
        f"{len(said) - count} logs with a fault, {count} without.",
        f"Logs graded trustworthy although the error in the cycle is above 3 %: {len(trusted)}.",
        f"Among these, verdicts that do not say that the fault cannot show: {untold or 'none'}.",
        f"Logs without a fault that were refused, or with a fault named: {accused or 'none'}.",
        'Verdicts that say "cannot tell" although a fault of this kind was found in a similar log: '
        f"{wrong or 'none'}.",
    ]


def plain(fault: str) -> str:
    """Return a fault without the payload."""
    return fault.removesuffix(PAYLOAD)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machines", nargs="*", default=list(MACHINES))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--simulated", action="store_true")
    parser.add_argument("--play", action="store_true")
    asked = parser.parse_args()
    if asked.simulated or asked.play:
        every = asked.machines if asked.machines != list(MACHINES) else pteron.catalog()
        for name in every:
            for play in (0.0, 1.0) if asked.play else (None,):
                told = "" if play is None else f"with {'' if play else 'no '}play "
                print(name, f"{told}{simulated(name, play)}", flush=True)
        return
    keys = [
        (machine, fault, seed)
        for machine in asked.machines
        for fault in (*CASES, *CORRECT)
        for seed in range(asked.seeds * (1 + (fault in CORRECT)))
    ]
    with ProcessPoolExecutor(asked.jobs) as pool:
        said = {}
        for key, one in zip(keys, pool.map(judged, *zip(*keys, strict=True)), strict=True):
            said[key] = one
            print(*key, one, file=sys.stderr, flush=True)
    text = table(said, asked.machines)
    print(text)
    if asked.machines == list(MACHINES):
        path = Path(__file__).parents[2] / "docs" / "faults.md"
        atomic.write_text(path, _HEAD.format(asked.seeds) + text + "\n")


def table(said: dict[Key, Said], machines: Sequence[str]) -> str:
    """Return what was said of all logs as a table, and what should not have been."""
    lines = [f"| fault | {' | '.join(machines)} |", "| --- |" + " --- |" * len(machines)]
    for fault in (*CASES, *CORRECT):
        cells = [
            cell([one for key, one in said.items() if key[:2] == (machine, fault)])
            for machine in machines
        ]
        lines.append(f"| {fault} | {' | '.join(cells)} |")
    return "\n".join([*lines, "", *(f"- {line}" for line in misjudged(said))])


_HEAD = """# Verdicts on logs with a fault

This page shows, for each kind of fault in a recorded log, which verdict `pteron identify` gives and
how wrong the identified model is. It is for readers who want to know how far a verdict can be
trusted. Every log is simulated, so that the true machine is known.

`python benchmarks/identification/faults.py` makes the table: {} log per cell, twice as many in the
rows without a fault. A machine whose bodies differ by up to 20 % from the drawing moves along
random Fourier series for 10 s (Par4 and five-bar: 8 s) at 400 Hz.
It has friction, encoders (resolution 1 um, or 20 bits per turn) and noise of 1 % of each force. A
second motion is held out: it is not fitted but serves to judge the model.

Each cell has up to four lines:

1. the grade, with the number of logs that got it;
2. the faults that the verdict names, with the number of logs. If the grade is "refused",
   `identify` ended with an error, and this line has its reason: reversed or exchanged columns
   (columns), joint coordinates of which no pose exists (no pose), an encoder that wraps around
   (wrapped), or a log that contradicts the robot file (contradicted);
3. the error of the identified model in a pick-and-place cycle as fast as the motion: the root mean
   square error of a force, in per cent of the standard deviation of the force, for the worst
   actuator;
4. "cannot tell": quantities about which, according to the verdict, the logs contain no information.
   These are a common factor of all forces (gain), the scale of one force (scale), the rate of the
   clock (clock), and backlash (play).

"""

if __name__ == "__main__":
    main()
