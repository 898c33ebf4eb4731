"""`simulate_many`: many machines that differ in their numbers, under one controller, at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pteron.atomic import make_folder
from pteron.controllers import Controller, Custom
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kernels.loop_code import STATE
from pteron.kernels.loops import Loop, loop
from pteron.kernels.samples import Evaluated
from pteron.kinematics import inverse_kinematics
from pteron.manipulator import RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.simulation.given import given_forces
from pteron.motion.simulation.loop import Timing, loop_arrays
from pteron.motion.simulation.machines import Machines
from pteron.motion.simulation.sensors import (
    Sensors,
    encoder_memory,
    encoder_noise,
    expect_sensed,
)
from pteron.motion.simulation.simulate import STEP, check_delay, check_positive, reference_of
from pteron.motion.simulation.stable_steps import allowed_step
from pteron.shapes import Workers

if TYPE_CHECKING:
    import polars as pl

_ROWS = 200_000
"""Samples that are held in memory at once, and stand in one file, about."""

_WHY = ("", "no forces were asked for", "a leg came to the edge of its reach, or it diverged")
"""Why a machine ended, by its fault."""


@dataclass(frozen=True)
class Batch:
    """Figures of many simulated machines, a row each, over the samples that each has.

    Attributes
    ----------
    machines : Machines
        What was simulated.
    samples : array, shape (B,)
        How many each came to.
    rms, largest : array, shape (B, m)
        Pose less reference, m and rad.
    force : array, shape (B, n)
        Largest force of each drive, N or N m.
    stopped : array of str, shape (B,)
        Why a machine ended before its time; empty where it did not.
    files : tuple of Path
        The samples, if they were asked for.
    """

    machines: Machines
    samples: NDArray[np.int64]
    rms: Array
    largest: Array
    force: Array
    stopped: NDArray[np.str_]
    files: tuple[Path, ...]

    def __repr__(self) -> str:
        """Return the batch in a line."""
        ended = int((self.stopped != "").sum())
        return f"<Batch of {len(self.samples)} {self.machines.robot.name!r}: {ended} ended early>"


def simulate_many(
    machines: Machines,
    motion: Motion,
    controller: Controller | Custom,
    *,
    model: RobotLike | None = None,
    sensors: Sensors | None = None,
    delay: float = 0.0,
    step: float = STEP,
    duration: float | None = None,
    out: str | Path | None = None,
    threads: Workers = 1,
) -> Batch:
    """Simulate many machines that follow a motion under one controller.

    Each is what `simulate` makes of it, to the same bits but for the noise, whose seed is that of
    the sensors with the machine's number; where machines have a geometry of their own, to rounding.
    Joints' limits and singularities of type II do not end it. In C eight machines share a vector.

    Parameters
    ----------
    machines : Machines
        See `machines_about`.
    motion : Motion
        What they are to follow; they start on it.
    controller : Controller
        Of `pteron.controllers`.
    model : Manipulator, name or path, optional
        What the controller takes them for; by default `machines.robot` without payload.
    sensors : Sensors, optional
        The encoders; by default coordinates and rates are exact.
    delay : float
        From a sample to what the drives give for it, s.
    step : float
        Length of the integration's steps, s.
    duration : float, optional
        s; by default the motion's.
    out : path, optional
        A folder for the samples: files of Parquet, each written when its machines are done, so that
        memory does not grow with their number.
    threads : int
        How many share the work.

    Returns
    -------
    Batch

    Raises
    ------
    DataError
        If a number is not sensible, or the folder has samples already.
    OutputError
        If it cannot be written.

    Examples
    --------
    >>> import pteron
    >>> from pteron.controllers import ComputedTorque
    >>> from pteron.motion import machines_about, pick_and_place, simulate_many
    >>> robot = pteron.load("tripteron")
    >>> motion = pick_and_place(robot, [0.0, 0.0, 0.0])
    >>> many = machines_about(robot, 2, masses=0.1)
    >>> simulate_many(many, motion, ComputedTorque(), duration=0.01)
    <Batch of 2 'tripteron': 0 ended early>
    """
    robot = machines.robot
    if not isinstance(controller, Controller | Custom):
        raise DataError(
            f"controller: {controller!r} given, one of pteron.controllers expected: `simulate` "
            "takes others"
        )
    check_delay(delay)
    check_positive(step=step)
    sensors = sensors or Sensors()
    sensing = sensors.delay + sensors.samples * controller.period
    reference = reference_of(robot, motion, None, duration, controller.period)
    count = len(reference.time)
    about = reference.pose[:: max(1, count // 64)]
    length = allowed_step(robot, about, step, usual=step == STEP, machines=machines)
    timing = Timing(delay, "rk4", length, 1e-10, sensing)
    law = controller.law(robot if model is None else as_manipulator(model))
    expect_sensed(robot, law.program)
    control_loop = loop(robot, law.program, general=machines.geometry is not None)
    _, counts = timing.parts(controller.period, count)
    start = reference.pose[0], reference.velocity[0]
    arrays = loop_arrays(control_loop, robot, start, reference, law, sensors, counts)
    course = _Course(control_loop, reference, sensors, timing, controller.period, arrays)
    folder = None if out is None else _empty(out)
    size, files = max(8, _ROWS // count // 8 * 8), list[Path]()
    figures: list[dict[str, Array]] = []
    for first in range(0, len(machines), size):
        part = machines.rows(slice(first, first + size))
        part_figures, samples, reached = course.simulated(part, first, threads)
        figures.append(part_figures)
        if folder is not None:
            files.append(folder / f"machines-{first:08d}.parquet")
            table = _table(machines, first, reference.time, samples, reached)
            # Noisy floats hardly shrink: lz4 takes half the time of the usual zstd.
            table.write_parquet(files[-1], compression="lz4")
    every = {name: np.concatenate([part[name] for part in figures]) for name in figures[0]}
    return Batch(
        machines,
        every["done"].astype(np.int64),
        every["rms"],
        every["most"],
        every["force"],
        np.array(_WHY)[every["fault"].astype(int)],
        tuple(files),
    )


@dataclass(frozen=True)
class _Course:
    """What all machines of a batch follow, and the loop that simulates them.

    `arrays` are those of a single machine.
    """

    loop: Loop
    reference: Motion
    sensors: Sensors
    timing: Timing
    period: float
    arrays: dict[str, Array]

    def simulated(
        self, part: Machines, first: int, threads: Workers
    ) -> tuple[dict[str, Array], dict[str, Array], NDArray[np.bool_]]:
        """Return figures of some machines, their samples (B, T, ...), and which are reached (B, T).

        `first` is the number of the first of them in the batch.
        """
        robot, count = part.robot, len(self.reference.time)
        m, n = robot.freedom, robot.joint_count
        arrays = self.arrays | part.numbers
        arrays |= encoder_noise(self.sensors, robot, count, range(first, first + len(part)))
        arrays |= {name: np.repeat(self.arrays[name], len(part), axis=0) for name in STATE}
        if part.geometry is not None:
            arrays |= _begun(self.loop, part, arrays, self.period)
        sizes = {"states": arrays["state"].shape[2], "joints": n, "rates": n, "forces": n}
        samples = {name: np.full((len(part), count, k), np.nan) for name, k in sizes.items()}
        times, counts = self.timing.parts(self.period, count)
        self.loop.run(arrays | samples, count, times, [*counts, 0, 1], threads=threads)
        done = arrays["done"][:, 0]
        reached = np.arange(count) < done
        error = samples["states"][..., :m] - self.reference.pose
        error[~reached] = np.nan
        # Of a machine that came to nothing all are NaN.
        came = np.where(done[:, 0] > 0.0, done[:, 0], np.nan)
        rates, parts = samples["rates"], self.loop.kind.parts(samples["states"])
        if self.loop.kind.bends:
            rates = np.where(self.loop.kind.elastic, parts["motor_rate"], rates)
        samples["forces"] = given_forces(robot, samples["forces"], rates, parts.get("current"))
        force = np.abs(samples["forces"])
        force[~reached] = np.nan
        figures = {
            "done": done[:, 0],
            "fault": arrays["fault"][:, 0, 0],
            "rms": np.sqrt(np.nansum(error**2, axis=1) / came[:, None]),
            "most": np.fmax.reduce(np.abs(error), axis=1),
            "force": np.fmax.reduce(force, axis=1),
        }
        return figures, samples, reached


def _begun(
    control_loop: Loop, part: Machines, arrays: dict[str, Array], period: float
) -> dict[str, Array]:
    """Return encoders and motors of machines whose joints, in one pose, are their own."""
    robot, state = part.robot, arrays["state"].copy()
    m, n = robot.freedom, robot.joint_count
    motion = {"pose": state[:, 0, :m], "velocity": state[:, 0, m : 2 * m]}
    sensed = Evaluated("sensed", control_loop.sensed)(motion, arrays)
    joints, rates = sensed["joints"], sensed["rates"]
    if control_loop.kind.bends:
        # A transmission is bent as that of the machine without tolerances.
        motors = state[:, 0, 2 * m : 2 * m + n]
        motors += joints - inverse_kinematics(robot, motion["pose"])
        soft = np.array(control_loop.kind.elastic)
        joints = np.concatenate([joints, np.where(soft, motors, joints)], axis=1)
        rates = np.tile(rates, 2)
    memory = encoder_memory(joints, rates, arrays["steps"][0, 0], period)
    return {"encoders": memory[:, None], "state": state, "seen": state.copy()}


def _empty(out: str | Path) -> Path:
    folder = make_folder(out)
    there = sorted(folder.glob("machines-*.parquet"))
    if there:
        raise DataError(f"{folder}: has {there[0]} already; give another folder, or remove them")
    return folder


def _table(
    machines: Machines,
    start: int,
    time: Array,
    samples: dict[str, Array],
    reached: NDArray[np.bool_],
) -> pl.DataFrame:
    """Return the samples of some machines that each came to."""
    import polars as pl

    robot = machines.robot
    m = robot.freedom
    names = robot.coordinates
    numbers = np.broadcast_to(start + np.arange(len(reached))[:, None], reached.shape)
    columns: dict[str, NDArray[np.generic]] = {
        "machine": numbers[reached],
        "t": np.broadcast_to(time, reached.shape)[reached],
    }
    for titles, values in (
        (names, samples["states"][..., :m]),
        ([f"d{name}" for name in names], samples["states"][..., m : 2 * m]),
        (robot.joint_names, samples["joints"]),
        (robot.force_names, samples["forces"]),
    ):
        columns |= {title: values[..., k][reached] for k, title in enumerate(titles)}
    return pl.DataFrame(columns)
