"""From a log to a running machine: excite, record, identify, export, and run the C on the machine.

The machine is simulated (`plant`), up to 20 % off what was drawn, with dry friction that sticks at
rest: in MuJoCo; in Pteron under the same controller, ten times in a sample of the log; and in
Pteron as drives are, under that controller at 1 kHz, with encoders and a delay. It records an
exciting motion and a pick-and-place cycle under a controller that knows the drawing and no
friction; encoders and forces are noisy. The fit is exported to C, which is compiled, and asked two
things: what the drives must give over the held-out cycle, against the noisy record of what they
gave; and to run the machine, beside feedback of position and rate, which is free of noise and delay
but in the last of the three.

It prints a table for each, and how far the first two machines' recordings are apart; `--quick` has
a shorter recording, of the Delta alone.
"""

from __future__ import annotations

import ctypes
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import plant

import pteron
from pteron.identification import Identification, Log, Processing, identify, preprocessing_for_log
from pteron.identification.excitation import FourierMotion, Limits, optimal_excitation
from pteron.identification.felt_forces import felt_part
from pteron.identification.observation import motion_mask
from pteron.identification.signals import samples
from pteron.kernels import Array
from pteron.kernels.c import compiler
from pteron.motion import pick_and_place
from pteron.motion.trajectories.cycle import Cycle
from pteron.report.identification import numbers

BANDWIDTH = 2.0 * np.pi * 10.0
"""Bandwidth of the feedback in the cycle, rad/s: both poles at 10 Hz, with the drawing's masses at
the joints."""

_NOISE = 0.01
"""Standard deviation, as a share of each force's root mean square."""

_JITTER = 1e-5
_REST = 0.2
"""Between two cycles, s."""

_DELAY = 2e-4
"""From a sample to the drives' force for it, where they have one, s."""


@dataclass(frozen=True)
class Case:
    """A machine of the catalog, with what brakes its joints and how they may move."""

    name: str
    friction: plant.Friction
    encoder: float
    """m or rad."""
    limits: Limits


CASES = (
    Case(
        "quadrupteron",
        plant.Friction((6.0, 7.0, 8.0, 9.0), (4.0, 5.0, 6.0, 7.0), (0.0, 0.3, 0.6, 0.9)),
        1e-6,
        Limits(speed=0.8, acceleration=8.0),
    ),
    Case(
        "delta",
        plant.Friction((4.0, 4.3, 4.6), (1.0, 1.1, 1.2), (0.0, 0.1, 0.2)),
        2.0 * np.pi / 2**20,
        Limits(speed=6.0, acceleration=80.0),
    ),
    Case(
        "3-rrr-point",
        plant.Friction((0.05, 0.06, 0.07), (0.02, 0.025, 0.03), (0.0, 0.01, 0.02)),
        2.0 * np.pi / 2**20,
        Limits(speed=8.0, acceleration=80.0),
    ),
    Case(
        "delta-redundant",
        plant.Friction((0.4, 0.45, 0.5, 0.55), (0.15, 0.16, 0.17, 0.18), (0.0, 0.05, 0.1, 0.15)),
        2.0 * np.pi / 2**20,
        Limits(speed=6.0, acceleration=80.0),
    ),
)


def twins(case: Case) -> dict[str, plant.Plant]:
    """Return the simulated machines of a case, by their simulation."""
    return {
        "MuJoCo": plant.simulate,
        "Pteron": plant.Own(),
        "as drives are": plant.Own(rate=1000.0, encoder=case.encoder, delay=_DELAY),
    }


@lru_cache
def exciting_motion(case: Case, seconds: float) -> FourierMotion:
    """Return the motion that all twins of a case record, after a search of `seconds`."""
    return optimal_excitation(
        pteron.load(case.name), limits=case.limits, seconds=seconds, draws=20, starts=4, workers=1
    ).motion


@dataclass(frozen=True)
class Excited:
    """An exciting motion as a reference of the joints."""

    motion: FourierMotion

    def __call__(self, time: Array) -> tuple[Array, Array, Array]:
        """Return joint coordinates, rates and accelerations, (T, n) each."""
        joints: tuple[Array, Array, Array] = self.motion.joints(time)
        return joints

    def __hash__(self) -> int:
        return id(self)


@dataclass(frozen=True)
class Cycles:
    """Pick-and-place cycles with a rest between them, as a reference of the joints."""

    robot: pteron.Manipulator

    @property
    def duration(self) -> float:
        """Duration of a cycle, s."""
        return self._whole.duration

    @property
    def _whole(self) -> pteron.motion.PickAndPlace:
        return pick_and_place(self.robot, pteron.workspace.home_pose(self.robot))

    def __call__(self, time: Array) -> tuple[Array, Array, Array]:
        """Return joint coordinates, rates and accelerations, (T, n) each."""
        robot, whole = self.robot, self._whole
        home = pteron.workspace.home_pose(robot)
        turn = whole.turn / whole.scale
        cycle = Cycle(robot.platform, home, whole.across, whole.up, turn, whole.scale)
        along = np.minimum(np.mod(time, whole.duration + _REST) / whole.duration, 1.0)
        pose, velocity, acceleration = cycle.at(along)
        state = pose, velocity / whole.duration, acceleration / whole.duration**2
        return (
            pteron.inverse_kinematics(robot, pose),
            pteron.kinematics.joint_rates(robot, *state[:2]).actuated,
            pteron.kinematics.joint_accelerations(robot, *state).actuated,
        )


class Controller:
    """The exported C, compiled: what the drives must give, of a motion of the joints.

    It is called sample by sample, each with the pose that the last one found.
    """

    def __init__(self, robot: pteron.Manipulator, base: Path, folder: Path) -> None:
        """Export, compile and load `joint_feed_forward_base`, with its tables as they are."""
        name = "joint_feed_forward_base"
        files = pteron.export_c(robot, name, folder, base=base, specialised=True)
        command = compiler()
        assert command is not None, "a C compiler is needed"
        library, source = folder / "controller.so", files[1]
        flags = ["-std=c99", "-O2", "-shared", "-fPIC"]
        subprocess.run([*command, *flags, str(source), "-o", str(library), "-lm"], check=True)
        self._called = getattr(ctypes.CDLL(str(library)), f"{source.stem}_{name}")
        self._robot = robot

    def __call__(self, joints: Array, rates: Array, accelerations: Array) -> Array:
        """Return the forces (T, n) of joint coordinates, rates and accelerations (T, n)."""
        motion = [np.ascontiguousarray(part) for part in (joints, rates, accelerations)]
        pose = np.array(pteron.workspace.home_pose(self._robot))
        pose = np.array(pteron.follow(self._robot, joints[:1], pose)[0])
        found, forces = pose.copy(), np.empty_like(motion[0])
        addresses = [part.ctypes.data for part in (*motion, forces)]
        for k in range(len(forces)):
            *given, out = (address + k * forces.strides[0] for address in addresses)
            inputs = (ctypes.c_void_p(address) for address in (*given, pose.ctypes.data, out))
            if self._called(*inputs, ctypes.c_void_p(found.ctypes.data)) != 0:
                raise ValueError(f"sample {k}: the joints have no pose next to the last")
            pose[:] = found
        return forces


@dataclass(frozen=True)
class Outcome:
    """Result of the chain for a machine."""

    found: Identification
    recordings: dict[str, plant.Recording]
    """What the machine did, by the motion's name."""
    prediction: Array
    """Error of the C's forces over the noise of the recorded ones (n,) on the held-out cycle, from
    the motion of the machine, where joints move."""
    everywhere: Array
    """The same over all samples (n,), those at which dry friction holds a joint among them."""
    sensed: Array
    """The same where joints move, from rates and accelerations as the encoders tell them."""
    left_out: float
    """The greatest share of samples at which a joint hardly moves."""
    tracking: dict[str, Array]
    """Root mean square of the joints' errors (n,), m or rad, by what the controller feeds
    forward."""

    @property
    def gains(self) -> Array:
        """Tracking error of each joint with PD alone, over that with the exported C."""
        return np.asarray(self.tracking["nothing"] / self.tracking["exported C"])


def run(
    case: Case, twin: str, folder: Path, *, duration: float, seconds: float, cycles: int
) -> Outcome:
    """Go the whole way with a machine, in one of its `twins`.

    The exciting motion, whose search takes `seconds`, is recorded for `duration` s.
    """
    drawn = pteron.load(case.name)
    built, n = plant.as_built(drawn), drawn.joint_count
    simulated = twins(case)[twin]
    exciting, placing = Excited(exciting_motion(case, seconds)), Cycles(drawn)
    length = cycles * (placing.duration + _REST)

    # Record: the controller has the drawing, and knows of no friction
    recordings = {
        name: simulated(
            built, reference, case.friction, duration=length, drawn=drawn, compensation=0.0
        )
        for name, reference, length in (
            ("exciting motion", exciting, duration),
            ("pick-and-place cycle", placing, length),
        )
    }
    seen = {
        name: plant.measured(
            one, encoder=case.encoder, force=_NOISE, jitter=_JITTER, seed=len(name)
        )
        for name, one in recordings.items()
    }
    log, held_out = (Log(name, one.time, one.joints, one.forces) for name, one in seen.items())

    # Identify: a force that is held from sample to sample is not of the instant of either
    sampled = isinstance(simulated, plant.Own) and simulated.delay > 0.0
    processing = Processing(delay="auto") if sampled else Processing()
    found = identify(drawn, log, held_out=held_out, processing=processing)
    path = folder / "identification.json"
    path.write_text(json.dumps(numbers(found)), encoding="utf-8")

    # Export, and predict the held-out cycle
    controller, noise = Controller(drawn, path, folder), seen["pick-and-place cycle"].noise
    preprocessing = replace(
        preprocessing_for_log(drawn, held_out), delay=found.preprocessing[0].delay
    )
    true = recordings["pick-and-place cycle"]
    moving = motion_mask(true.rates, preprocessing.slow, preprocessing.turning_rows)
    predicted = controller(true.joints, true.rates, true.accelerations)
    off = _felt(drawn, true.joints, predicted - held_out.forces) / noise
    (block,) = samples(drawn, held_out, preprocessing)
    states, forces = block.states.part(block.fresh), block.forces[block.fresh]
    known = motion_mask(states.joint_rates, preprocessing.slow, preprocessing.turning_rows)
    by_encoders = controller(states.joints, states.joint_rates, states.joint_accelerations)

    # Run the machine with it
    tracking = {}
    for name, feed_forward in (
        ("nothing", lambda q, dq, ddq: np.zeros((len(q), n))),
        ("the drawing", None),
        ("exported C", controller),
    ):
        followed = simulated(
            built,
            placing,
            case.friction,
            duration=length,
            drawn=drawn,
            compensation=0.0,
            bandwidth=BANDWIDTH,
            feed_forward=feed_forward,
        )
        behind = followed.joints - placing(followed.time)[0]
        tracking[name] = np.sqrt((behind**2).mean(axis=0))
    return Outcome(
        found,
        recordings,
        _rms(off, moving),
        _rms(off),
        _rms(felt_part(drawn, states.pose, by_encoders - forces) / noise, known),
        float((1.0 - moving.mean(axis=0)).max()),
        tracking,
    )


def _rms(values: Array, counted: Array | float = 1.0) -> Array:
    """Return the root mean square of columns (T, n), of what counts."""
    return np.asarray(
        np.sqrt((counted * values**2).sum(axis=0) / (counted + 0 * values).sum(axis=0))
    )


def _felt(robot: pteron.Manipulator, joints: Array, forces: Array) -> Array:
    """Return the part of forces (T, n) that the platform feels, at joints (T, n)."""
    if not robot.redundancy:
        return forces
    pose = pteron.follow(robot, joints, pteron.workspace.home_pose(robot))
    return felt_part(robot, pose, forces)


def main() -> None:
    """Print what each machine's chain gave."""
    quick = "--quick" in sys.argv[1:]
    named = [case for case in CASES if case.name in sys.argv[1:]]
    cases = named or (CASES[1:2] if quick else CASES)
    duration, seconds, cycles = (5.0, 2.0, 1) if quick else (20.0, 20.0, 3)
    print(
        f"{duration:g} s of an exciting motion at 1 kHz are recorded, and a pick-and-place cycle; "
        f"force noise {100 * _NOISE:g} %,\njitter 10 us, encoders 1 um (20 bits a turn on cranks). "
        f"Feedback while tracking: {BANDWIDTH / (2 * np.pi):g} Hz, K_p = m w^2,\nK_d = 2 m w, m of "
        "the drawing. The machine is up to 20 % off the drawing, and its friction sticks.\n"
    )
    outcomes = {}
    for case in cases:
        for twin in twins(case):
            with tempfile.TemporaryDirectory() as folder:
                outcomes[case.name, twin] = run(
                    case, twin, Path(folder), duration=duration, seconds=seconds, cycles=cycles
                )
    print(
        "Forces of the held-out cycle by the compiled C, worst joint: error over the noise of the "
        "sensors,\nwhere joints move, for dry friction holds them with any force else. By "
        "encoders: rates\nand accelerations are differences of noisy positions, as for the "
        "verdict; their noise is added"
    )
    print(
        f"{'':<30}{'verdict':<16}{'error':>12}{'left out':>10}{'with these':>12}{'by encoders':>14}"
    )
    for names, one in outcomes.items():
        print(
            f"{_row(names)}{one.found.verdict.grade:<16}{one.prediction.max():>12.2f}"
            f"{one.left_out:>10.0%}{one.everywhere.max():>12.2f}{one.sensed.max():>14.2f}"
        )
    print("\nTracking of that cycle: root mean square error of all joints (um or urad)")
    print(f"{'feed-forward:':<30}{'nothing':>12}{'the drawing':>14}{'exported C':>14}", end="")
    print(f"{'better than nothing':>24}{'worst joint':>14}")
    for names, one in outcomes.items():
        size = {key: float(np.sqrt((rms**2).mean())) for key, rms in one.tracking.items()}
        cells = [f"{1e6 * size[key]:.0f}" for key in size]
        gain = size["nothing"] / size["exported C"]
        print(
            f"{_row(names)}{cells[0]:>12}{cells[1]:>14}{cells[2]:>14}{gain:>22.1f} x"
            f"{one.gains.min():>12.1f} x"
        )
    print(
        "As drives are: rates are differences of encoders' steps, half a sample late, and feedback "
        "makes ripple\nin the forces of these steps, which no smoothed position shows: by "
        "encoders, that is an error"
    )
    print("\nPteron's motion less MuJoCo's: root mean squares, over MuJoCo's, worst joint")
    print(f"{'':<30}{'joints':>12}{'rates':>14}{'accelerations':>16}{'forces':>12}")
    for case in cases:
        theirs, ours = (outcomes[case.name, twin].recordings for twin in ("MuJoCo", "Pteron"))
        for name, recorded in theirs.items():
            cells = [
                f"{float((_rms(getattr(ours[name], k) - given) / _rms(given)).max()):.1e}"
                for k in ("joints", "rates", "accelerations", "forces")
                for given in [getattr(recorded, k)]
            ]
            print(
                f"{case.name:<16}{name:<23}{cells[0]:>4}{cells[1]:>14}{cells[2]:>16}{cells[3]:>12}"
            )


def _row(names: tuple[str, str]) -> str:
    return f"{names[0]:<16}{names[1]:<14}"


if __name__ == "__main__":
    main()
