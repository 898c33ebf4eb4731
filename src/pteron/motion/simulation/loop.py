"""The run of a simulation: the arrays of a machine's control loop, filled, run, and read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np

from pteron.dynamics import drive_accelerations
from pteron.equations.transmissions import DriveKind
from pteron.errors import DataError, shorten
from pteron.kernels import Array, Program, as_array
from pteron.kernels.loops import Loop, loop, machine_numbers
from pteron.manipulator import Manipulator
from pteron.motion.motion import Motion, pose_text
from pteron.motion.simulation.exported import ExportedCustomLaw, ExportedLaw
from pteron.motion.simulation.motor_forces import motor_forces
from pteron.motion.simulation.plant import AdaptivePlant, Method, motor_states
from pteron.motion.simulation.sensors import (
    Sensors,
    encoder_arrays,
    encoder_noise,
    expect_encoders,
)
from pteron.motion.simulation.simulation import Simulation
from pteron.motion.simulation.stops import (
    first_beyond_limits,
    first_singular,
    limit_text,
    singularity_text,
    why_not_further,
)
from pteron.motion.trajectories.limits import limits_of
from pteron.progress import Progress
from pteron.tolerances import ROUNDING

_BLOCK = 1000
"""Samples after which a run returns from compiled code: some 10 ms, at most a second."""

_NO_FORCES, _NOT_INTEGRATED = 1.0, 2.0
"""Fault codes of a run: no force command, or the state could not be integrated further."""


@runtime_checkable
class ControlLaw(Protocol):
    """A controller's law for one machine; `pteron.controllers` has some."""

    def memory(self, pose: Array, velocity: Array) -> Array:
        """Return the controller's initial memory (K,) at a pose and velocity of the platform."""

    def __call__(
        self,
        pose: Array,
        velocity: Array,
        acceleration: Array,
        joints: Array,
        joint_rates: Array,
        memory: Array,
    ) -> tuple[Array, Array]:
        """Return drive forces (n,) and the next memory (K,), from reference and measured joints."""


@runtime_checkable
class ProgramLaw(Protocol):
    """A controller's law that is an expression, and is compiled into the loop's C."""

    @property
    def program(self) -> Program:
        """The program from measurements, reference, memory and parameters to forces."""

    @property
    def numbers(self) -> dict[str, Array]:
        """The law's parameters as arrays by name, for `pteron.kernels.loops.Loop.run`."""

    def memory(self, pose: Array, velocity: Array) -> Array:
        """Return the controller's initial memory (K,) at a pose and velocity of the platform."""


@dataclass(frozen=True)
class Loads:
    """The payload and the wrench on the platform at each sample."""

    masses: Array
    machines: Mapping[float, Manipulator]
    """The machine with each of the masses."""
    wrench: Array


@dataclass(frozen=True)
class Timing:
    """The delays of forces and of readings, and the integration steps between samples."""

    delay: float
    method: Method
    step: float
    tolerance: float
    sensing: float = 0.0

    def parts(self, period: float, samples: int) -> tuple[list[float], list[int]]:
        """Return times, s, and sample counts of delays and steps, for a kernel loop's `run`."""
        (late, late_samples), (reading_age, old_samples) = (
            split_delay(min(delay, period * samples), period)  # later than the end is never
            for delay in (self.delay, self.sensing)
        )
        reading_time = period - reading_age
        reading_time = late if abs(reading_time - late) < ROUNDING * period else reading_time
        bounds = [0.0, min(late, reading_time), max(late, reading_time), period]
        spans, step = np.diff(bounds), min(self.step, period)
        counts = [int(np.ceil(span / step - ROUNDING)) for span in spans]
        lengths = [float(span) / max(n, 1) for span, n in zip(spans, counts, strict=True)]
        force_span = 0 if late == 0.0 else 2 if late > reading_time else 1
        return [*lengths, period], [
            *counts,
            force_span,
            int(reading_time > late),
            late_samples,
            old_samples,
        ]


def split_delay(delay: float, period: float) -> tuple[float, int]:
    """Return a delay as a part below one sample, s, and a number of complete samples."""
    samples = int(delay / period + ROUNDING)
    part = max(delay - samples * period, 0.0)
    return (part if part > ROUNDING * period else 0.0), samples


def run_simulation(
    robot: Manipulator,
    start: tuple[Array, Array],
    reference: Motion,
    source: ControlLaw | ProgramLaw | Array,
    loads: Loads,
    sensors: Sensors,
    timing: Timing,
    *,
    limits: bool,
    progress: Progress | None = None,
) -> Simulation:
    """Simulate the machine under a control law or given forces (T, n); return the `Simulation`.

    `source` is a control law, or the forces at each sample. With `limits` the simulation ends at
    joint limits and type-II singularities.
    """
    time, m, n = reference.time, robot.freedom, robot.joint_count
    count, period = len(time), float(time[1] - time[0])
    times, counts = timing.parts(period, count)
    linked = source.linked if isinstance(source, ExportedLaw | ExportedCustomLaw) else None
    law = source if isinstance(source, ProgramLaw) else None
    if law is not None:
        expect_encoders(robot, law.program)
    simulator = loop(robot, None if law is None else law.program, linked)
    memory = np.empty(0) if isinstance(source, np.ndarray) else source.memory(*start)
    arrays = loop_arrays(simulator, robot, start, reference, law, sensors, counts)
    arrays |= {"wrench": loads.wrench[None], **encoder_noise(sensors, robot, count)}
    if isinstance(source, np.ndarray):
        arrays["given"] = source[None]
    memory_size = arrays["memory"].shape[2]
    sizes = {"states": arrays["state"].shape[2], "acceleration": m, "memories": memory_size}
    sizes |= dict.fromkeys(("joints", "rates", "forces", "asked"), n)
    outputs = {name: np.full((1, count, size), np.nan) for name, size in sizes.items()}
    if timing.method == "dop853":
        if linked is not None:
            raise DataError('method: "dop853" given, but a controller\'s C runs with "rk4" alone')
        del outputs["acceleration"]
    ask, memories = None, [memory]
    if isinstance(source, ControlLaw) and law is None:
        ask = _callback(source, reference, n, memories)
    _run_segments(simulator, arrays, outputs, loads, timing, times, counts, ask, progress)
    end = int(arrays["done"].item())
    columns = _simulation_columns(robot, {name: array[0, :end] for name, array in outputs.items()})
    why = _fault_text(robot, arrays, columns["joints"], has_callback=ask is not None)
    if limits and (stop := _limit_stop(robot, columns["pose"], columns["joints"])) is not None:
        end, why = stop
    clock = float(arrays["clock"].item())
    stopped = None if why is None else f"at {min(clock, time[end - 1]):.4g} s: {why}"
    if timing.method == "dop853":
        state = columns["pose"], columns["velocity"]
        columns["acceleration"] = _accelerations(loads, *state, columns["forces"])
    columns = {name: column[:end] for name, column in columns.items()}
    if ask is not None:
        columns["memory"] = np.array(memories[1 : end + 1])
    return Simulation(
        robot,
        time[:end],
        reference=Motion(*(getattr(reference, field.name)[:end] for field in fields(Motion))),
        payload=loads.masses[:end],
        step=min(timing.step, period) if timing.method == "rk4" else float("nan"),
        stopped=stopped,
        **columns,
    )


def _run_segments(
    simulator: Loop,
    arrays: dict[str, Array],
    outputs: dict[str, Array],
    loads: Loads,
    timing: Timing,
    times: list[float],
    counts: list[int],
    ask: Callable[[int, int, Array], Array] | None,
    progress: Progress | None,
) -> None:
    """Run the loop for each payload in turn, in blocks of samples; it fills `outputs`.

    Compiled code returns after every `_BLOCK` samples, for interrupts and progress.
    """
    count = len(loads.masses)
    changes = np.flatnonzero(np.diff(loads.masses)) + 1
    for start, end in pairwise([0, *changes.tolist(), count]):
        machine = loads.machines[float(loads.masses[start])]
        numbers = arrays | machine_numbers(machine, simulator.plant, "plant") | outputs
        advance_state = (
            AdaptivePlant(machine, timing.tolerance).go if timing.method == "dop853" else None
        )
        for first, stop in pairwise([*range(start, end, _BLOCK), end]):
            inputs = numbers | {
                name: numbers[name][:, first:stop]
                for name in (*outputs, "reference", "given", "noise", "wrench")
                if numbers[name].shape[1] > 1
            }
            call_counts = [*counts, first, int(stop == count)]
            simulator.run(inputs, stop - first, times, call_counts, ask, go=advance_state)
            if arrays["fault"].any():
                return
            if progress is not None:
                progress(stop / count)


def _simulation_columns(robot: Manipulator, columns: dict[str, Array]) -> dict[str, Array]:
    """Return the arrays of a `Simulation` by field name from a loop's raw outputs (T, ...)."""
    kind = DriveKind.from_robot(robot)
    parts = kind.parts(columns.pop("states"))
    columns |= {"pose": parts["pose"], "velocity": parts["velocity"]}
    columns |= {"memory": columns.pop("memories"), "joint_rates": columns.pop("rates")}
    for name, motor in (("joints", "motor"), ("joint_rates", "motor_rate")):
        readings = columns[name]
        columns[f"{motor}s"] = (
            np.where(kind.elastic, parts[motor], readings) if kind.bends else readings
        )
    columns["forces"] = motor_forces(
        robot, columns["forces"], columns["motor_rates"], parts.get("current")
    )
    return columns


def _fault_text(
    robot: Manipulator, arrays: dict[str, Array], joints: Array, *, has_callback: bool
) -> str | None:
    """Return the reason why a simulation ended early, as text; None if it did not."""
    fault, m = arrays["fault"].item(), robot.freedom
    if fault == _NO_FORCES and has_callback:
        return "no forces are asked for: the controller returns some that are not finite numbers"
    if fault == _NO_FORCES:
        return (
            f"no forces are asked for at the joints {pose_text(joints[-1])}: they have no pose "
            "near the last one, or the wanted pose is out of the controller's reach"
            + (", or no forces within limits move it so" if robot.greatest_forces else "")
        )
    if fault == _NOT_INTEGRATED:
        return why_not_further(robot, *np.split(arrays["state"].ravel(), [m, 2 * m])[:2])
    return None


def _limit_stop(robot: Manipulator, pose: Array, joints: Array) -> tuple[int, str] | None:
    """Return the sample count up to the first joint limit or singularity, and its text."""
    ends = {
        first_beyond_limits(robot, pose, joints): limit_text,
        first_singular(robot, pose): singularity_text,
    }
    end_sample = min((k for k in ends if k is not None), default=None)
    if end_sample is None:
        return None
    return end_sample + 1, ends[end_sample](robot, pose[end_sample])


def loop_arrays(
    simulator: Loop,
    robot: Manipulator,
    start: tuple[Array, Array],
    reference: Motion,
    law: ProgramLaw | None,
    sensors: Sensors,
    counts: Sequence[int],
) -> dict[str, Array]:
    """Return the input arrays, by name, of a simulation loop with or without a control law.

    `counts` are the sample counts that `Timing.parts` returns.
    """
    period = float(reference.time[1] - reference.time[0])
    parts = reference.pose, reference.velocity, reference.acceleration
    state = dict(zip(("pose", "velocity"), start, strict=True))
    state |= motor_states(robot, *start, reference.acceleration[0])
    initial_state = np.concatenate(list(state.values())).reshape(1, 1, -1)
    arrays = simulator.idle(robot, initial_state, *counts[-2:])
    arrays |= {
        "most": limits_of(robot).force.reshape(1, 1, -1),
        "reference": np.hstack(parts)[None],
        **encoder_arrays(sensors, robot, period, state),
    }
    if law is not None:
        arrays |= {**law.numbers, "memory": np.array(law.memory(*start)).reshape(1, 1, -1)}
    return arrays


def _callback(
    law: ControlLaw, reference: Motion, joints: int, memories: list[Array]
) -> Callable[[int, int, Array], Array]:
    """Return the callback that evaluates a Python controller at a sample, to (n,) forces."""

    def ask(_: int, sample: int, measured: Array) -> Array:
        """Return the controller's forces (n,) at a sample, from measured joints and rates."""
        parts = reference.pose, reference.velocity, reference.acceleration
        pose, velocity, acceleration = (part[sample] for part in parts)
        readings = measured[:joints], measured[joints:]
        answer: Any = law(pose, velocity, acceleration, *readings, memories[-1])
        try:
            returned, memory = answer
        except (TypeError, ValueError):
            raise DataError(
                f"controller: {shorten(answer)} returned, forces (n,) and the next memory expected"
            ) from None
        forces = as_array(returned, "controller: forces", (joints,))
        if forces.ndim > 1:
            raise DataError(f"controller: forces: shape {forces.shape} given, ({joints},) expected")
        memories.append(memory)
        return forces

    return ask


def _accelerations(loads: Loads, pose: Array, velocity: Array, forces: Array) -> Array:
    """Return platform accelerations (T, m) at states, friction smooth; NaN where undefined."""
    accelerations, masses = np.empty_like(pose), loads.masses[: len(pose)]
    for mass, machine in loads.machines.items():
        chosen: Any = masses == mass
        states = pose[chosen], velocity[chosen], forces[chosen], loads.wrench[: len(pose)][chosen]
        accelerations[chosen] = drive_accelerations(machine, *states, on_failure="nan")
    return accelerations
