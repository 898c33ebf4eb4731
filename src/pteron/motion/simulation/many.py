"""`simulate_many`: many machines that differ in their numbers, under one controller, at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect_one_of
from pteron.atomic import make_folder
from pteron.controllers import Controller, Custom
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kernels.loop_code import STATE
from pteron.kernels.loops import Device, Loop, loop
from pteron.kernels.samples import Evaluated
from pteron.kinematics import inverse_kinematics
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.simulation.loop import Timing, loop_arrays
from pteron.motion.simulation.machines import Machines
from pteron.motion.simulation.motor_forces import motor_forces
from pteron.motion.simulation.sensors import (
    Sensors,
    encoder_memory,
    encoder_noise,
    expect_encoders,
)
from pteron.motion.simulation.simulate import STEP, check_delay, check_positive, reference_of
from pteron.motion.simulation.stable_steps import allowed_step
from pteron.result import Result
from pteron.shapes import Workers

if TYPE_CHECKING:
    import polars as pl

_ROWS = 200_000
"""Samples that are held in memory at once, and stand in one file, about."""

_WHY = ("", "no forces were asked for", "a leg came to the edge of its reach, or it diverged")
"""Why a machine ended, by its fault."""


@dataclass(frozen=True, eq=False, repr=False)
class Batch(Result):
    """Statistics of many simulated machines, a row each, over the samples before each one's end.

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

    ROWS = "samples rms:1 largest:1 force:1 stopped"

    machines: Machines
    samples: NDArray[np.int64]
    rms: Array
    largest: Array
    force: Array
    stopped: NDArray[np.str_]
    files: tuple[Path, ...]

    def __repr__(self) -> str:
        """Return the counts of machines, and of those that ended early, in one line."""
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
    device: Device = "cpu",
) -> Batch:
    """Return statistics of many simulated machines that follow a motion under a controller.

    Each machine's result equals that of `simulate` to the bit, except for noise, whose seed is the
    sensors' seed with the machine's number; for machines with geometry of their own it is equal up
    to rounding. Joint limits and type-II singularities do not end a simulation. In C, eight
    machines share a vector instruction.

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
    device : {"cpu", "cuda"}
        Where the machines run: in C, or on an NVIDIA GPU, one thread a machine, with the same bits
        but for arctangents.

    Returns
    -------
    Batch

    Raises
    ------
    DataError
        If a number is not sensible, or the folder has samples already.
    ModelError
        If `device` is "cuda" and CuPy or a GPU is missing.
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
    expect_one_of(get_args(Device), device=device)
    _expect_own_controller(controller)
    check_delay(delay)
    check_positive(step=step)
    sensors = sensors or Sensors()
    reference = reference_of(robot, motion, None, duration, controller.period)
    count, n = len(reference.time), robot.joint_count
    about = reference.pose[:: max(1, count // 64)]
    length = allowed_step(robot, about, step, usual=step == STEP, machines=machines)
    sensing = sensors.delay + sensors.samples * controller.period
    timing = Timing(delay, "rk4", length, 1e-10, sensing)
    times, counts = timing.parts(controller.period, count)
    law = controller.law(robot if model is None else as_manipulator(model))
    expect_encoders(robot, law.program)
    simulator = loop(robot, law.program, general=machines.geometry is not None)
    initial_state = reference.pose[0], reference.velocity[0]
    shared_arrays = loop_arrays(simulator, robot, initial_state, reference, law, sensors, counts)
    folder = None if out is None else _make_empty_folder(out)
    sizes = {"states": shared_arrays["state"].shape[2], "joints": n, "rates": n, "forces": n}
    size, files = max(8, _ROWS // count // 8 * 8), list[Path]()
    statistics: list[dict[str, Array]] = []
    for start in range(0, len(machines), size):
        group = machines.rows(slice(start, start + size))
        noise = encoder_noise(sensors, robot, count, range(start, start + len(group)))
        arrays = _group_arrays(simulator, group, shared_arrays | noise, controller.period)
        samples = {name: np.full((len(group), count, k), np.nan) for name, k in sizes.items()}
        run = arrays | samples, count, times, [*counts, 0, 1]
        simulator.run(*run, threads=threads, device=device)
        ended = np.arange(count) >= arrays["done"][:, 0]
        _limit_forces(simulator, robot, samples)
        statistics.append(_group_statistics(samples, arrays, reference.pose, ended))
        if folder is not None:
            table = _table(machines, start, reference.time, samples, ~ended)
            files.append(_write_samples(folder, start, table))
    columns = {name: np.concatenate([row[name] for row in statistics]) for name in statistics[0]}
    return Batch(
        machines,
        columns["done"].astype(np.int64),
        columns["rms"],
        columns["most"],
        columns["force"],
        np.array(_WHY)[columns["fault"].astype(int)],
        tuple(files),
    )


def _expect_own_controller(controller: object) -> None:
    """Raise for a custom controller whose law is not a program."""
    if not isinstance(controller, Controller | Custom):
        raise DataError(
            f"controller: {controller!r} given, one of pteron.controllers expected: `simulate` "
            "takes others"
        )


def _group_arrays(
    simulator: Loop, group: Machines, shared_arrays: dict[str, Array], period: float
) -> dict[str, Array]:
    """Return the loop's arrays for a group of machines, from those of the nominal machine."""
    arrays = shared_arrays | group.numbers
    arrays |= {name: np.repeat(shared_arrays[name], len(group), axis=0) for name in STATE}
    if group.geometry is not None:
        arrays |= _start_arrays(simulator, group, arrays, period)
    return arrays


def _limit_forces(simulator: Loop, robot: Manipulator, samples: dict[str, Array]) -> None:
    """Replace commanded drive forces in `samples` by the forces that the motors give, in place."""
    rates, parts = samples["rates"], simulator.kind.parts(samples["states"])
    if simulator.kind.bends:
        rates = np.where(simulator.kind.elastic, parts["motor_rate"], rates)
    samples["forces"] = motor_forces(robot, samples["forces"], rates, parts.get("current"))


def _group_statistics(
    samples: dict[str, Array], arrays: dict[str, Array], reference: Array, ended: NDArray[np.bool_]
) -> dict[str, Array]:
    """Return rms and largest errors, peak forces and counts of samples for a group of machines."""
    error = samples["states"][..., : reference.shape[-1]] - reference
    error[ended] = np.nan
    force = np.abs(samples["forces"])
    force[ended] = np.nan
    done = arrays["done"][:, 0, 0]
    # Of a machine that came to nothing all are NaN.
    counted = np.where(done > 0.0, done, np.nan)
    return {
        "done": done,
        "fault": arrays["fault"][:, 0, 0],
        "rms": np.sqrt(np.nansum(error**2, axis=1) / counted[:, None]),
        "most": np.fmax.reduce(np.abs(error), axis=1),
        "force": np.fmax.reduce(force, axis=1),
    }


def _start_arrays(
    simulator: Loop, group: Machines, arrays: dict[str, Array], period: float
) -> dict[str, Array]:
    """Return initial encoder and motor states for machines that start at a common pose."""
    robot, state = group.robot, arrays["state"].copy()
    m, n = robot.freedom, robot.joint_count
    motion = {"pose": state[:, 0, :m], "velocity": state[:, 0, m : 2 * m]}
    encoders = Evaluated("sensed", simulator.sensed)(motion, arrays)
    joints, rates = encoders["joints"], encoders["rates"]
    if simulator.kind.bends:
        # A transmission is bent as that of the machine without tolerances.
        motors = state[:, 0, 2 * m : 2 * m + n]
        motors += joints - inverse_kinematics(robot, motion["pose"])
        soft = np.array(simulator.kind.elastic)
        joints = np.concatenate([joints, np.where(soft, motors, joints)], axis=1)
        rates = np.tile(rates, 2)
    memory = encoder_memory(joints, rates, arrays["steps"][0, 0], period)
    return {"encoders": memory[:, None], "state": state, "seen": state.copy()}


def _make_empty_folder(out: str | Path) -> Path:
    """Return the output folder, created if absent; raise if it has results of another run."""
    folder = make_folder(out)
    there = sorted(folder.glob("machines-*.parquet"))
    if there:
        raise DataError(f"{folder}: has {there[0]} already; give another folder, or remove them")
    return folder


def _write_samples(folder: Path, start: int, table: pl.DataFrame) -> Path:
    """Write a group's samples to a Parquet file, numbered by its first machine; return the path."""
    path = folder / f"machines-{start:08d}.parquet"
    # Noisy floats hardly shrink: lz4 takes half the time of the usual zstd.
    table.write_parquet(path, compression="lz4")
    return path


def _table(
    machines: Machines,
    start: int,
    time: Array,
    samples: dict[str, Array],
    is_valid: NDArray[np.bool_],
) -> pl.DataFrame:
    """Return the valid samples of machines as a table, a row for each machine and time."""
    import polars as pl

    robot = machines.robot
    m = robot.freedom
    names = robot.coordinates
    numbers = np.broadcast_to(start + np.arange(len(is_valid))[:, None], is_valid.shape)
    columns: dict[str, NDArray[np.generic]] = {
        "machine": numbers[is_valid],
        "t": np.broadcast_to(time, is_valid.shape)[is_valid],
    }
    for titles, columns_of_titles in (
        (names, samples["states"][..., :m]),
        ([f"d{name}" for name in names], samples["states"][..., m : 2 * m]),
        (robot.joint_names, samples["joints"]),
        (robot.force_names, samples["forces"]),
    ):
        columns |= {title: columns_of_titles[..., k][is_valid] for k, title in enumerate(titles)}
    return pl.DataFrame(columns)
