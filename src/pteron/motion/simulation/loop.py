"""The run of a simulation: the arrays of a machine's control loop, filled, run, and read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np

from pteron.dynamics import drive_accelerations
from pteron.equations.transmissions import DriveKind
from pteron.errors import DataError, shown
from pteron.kernels import Array, Program, as_array
from pteron.kernels.loops import Loop, loop, machine_numbers
from pteron.manipulator import Manipulator
from pteron.motion.motion import Motion, told_pose
from pteron.motion.simulation.exported import ExportedCustomLaw, ExportedLaw
from pteron.motion.simulation.given import given_forces
from pteron.motion.simulation.plant import Adaptive, Method, motor_states
from pteron.motion.simulation.sensors import (
    Sensors,
    encoder_arrays,
    encoder_noise,
    expect_sensed,
)
from pteron.motion.simulation.simulation import Simulation
from pteron.motion.simulation.stops import (
    first_beyond_limits,
    first_singular,
    told_limit,
    told_singular,
    why_not_further,
)
from pteron.motion.trajectories.limits import limits_of

_WHOLE = 1e-9
"""Part of a sample, from rounding, by which a delay of whole samples may miss them."""

_ASKED, _MOVED = 1.0, 2.0
"""Why a run ended: no forces were asked for, or the machine could not go on."""


@runtime_checkable
class ControlLaw(Protocol):
    """A controller's law for one machine; `pteron.controllers` has some."""

    def memory(self, pose: Array, velocity: Array) -> Array:
        """Return its memory at the start, (K,)."""

    def __call__(
        self,
        pose: Array,
        velocity: Array,
        acceleration: Array,
        joints: Array,
        joint_rates: Array,
        memory: Array,
    ) -> tuple[Array, Array]:
        """Return forces (n,) and the next memory, from the reference and the measured joints."""


@runtime_checkable
class ProgramLaw(Protocol):
    """A controller's law that is an expression, and runs in the loop's C."""

    @property
    def program(self) -> Program:
        """Forces, and the next memory, of readings, reference, memory and its own numbers."""

    @property
    def numbers(self) -> dict[str, Array]:
        """Its numbers, as `pteron.kernels.loops.Loop.run` takes them."""

    def memory(self, pose: Array, velocity: Array) -> Array:
        """Return its memory at the start, (K,)."""


@dataclass(frozen=True)
class Loads:
    """The payload and the wrench on the platform at each sample."""

    masses: Array
    machines: Mapping[float, Manipulator]
    """The machine with each of the masses."""
    wrench: Array


@dataclass(frozen=True)
class Timing:
    """The delays of forces and of readings, and how steps between samples are made."""

    delay: float
    method: Method
    step: float
    tolerance: float
    sensing: float = 0.0

    def parts(self, period: float, samples: int) -> tuple[list[float], list[int]]:
        """Return what `pteron.kernels.loops.Loop.run` takes: times and counts, without the last."""
        (late, late_samples), (old, behind) = (
            divided(min(delay, period * samples), period)  # later than the end is never
            for delay in (self.delay, self.sensing)
        )
        look = period - old
        look = late if abs(look - late) < _WHOLE * period else look
        bounds = [0.0, min(late, look), max(late, look), period]
        spans, step = np.diff(bounds), min(self.step, period)
        counts = [int(np.ceil(span / step - _WHOLE)) for span in spans]
        lengths = [float(span) / max(n, 1) for span, n in zip(spans, counts, strict=True)]
        command_part = 0 if late == 0.0 else 2 if late > look else 1
        return [*lengths, period], [*counts, command_part, int(look > late), late_samples, behind]


def divided(delay: float, period: float) -> tuple[float, int]:
    """Return a delay's part of a sample, and its whole samples."""
    samples = int(delay / period + _WHOLE)
    part = max(delay - samples * period, 0.0)
    return (part if part > _WHOLE * period else 0.0), samples


def run(
    robot: Manipulator,
    start: tuple[Array, Array],
    reference: Motion,
    source: ControlLaw | ProgramLaw | Array,
    loads: Loads,
    sensors: Sensors,
    timing: Timing,
    *,
    limits: bool,
) -> Simulation:
    """Simulate; `limits` says whether joints' limits and singularities of type II end it.

    The source of forces is a controller's law, or forces at each sample.
    """
    memories = [np.empty(0) if isinstance(source, np.ndarray) else source.memory(*start)]
    ask = None
    if isinstance(source, ControlLaw) and not isinstance(source, ProgramLaw):
        ask = _callback(source, reference, robot.joint_count, memories)
    arrays, samples = _run_loop(robot, start, reference, source, loads, sensors, timing, ask)
    done = int(arrays["done"].item())
    columns = _columns(robot, {name: array[0, :done] for name, array in samples.items()})
    end, why = done, _fault_words(robot, arrays, columns["joints"], python=ask is not None)
    if limits:
        beyond, reason = _first_failure(robot, columns["pose"], columns["joints"])
        end, why = (end, why) if beyond is None else (beyond + 1, reason)
    if timing.method == "dop853":
        columns["acceleration"] = _accelerations(
            loads, columns["pose"], columns["velocity"], columns["forces"]
        )
    columns = {name: column[:end] for name, column in columns.items()}
    if ask is not None:
        columns["memory"] = np.array(memories[1 : end + 1])
    time, clock = reference.time, float(arrays["clock"].item())
    return Simulation(
        robot,
        time[:end],
        reference=Motion(*(getattr(reference, field.name)[:end] for field in fields(Motion))),
        payload=loads.masses[:end],
        step=min(timing.step, float(time[1] - time[0])) if timing.method == "rk4" else np.nan,
        stopped=None if why is None else f"at {min(clock, time[end - 1]):.4g} s: {why}",
        **columns,
    )


def _run_loop(
    robot: Manipulator,
    start: tuple[Array, Array],
    reference: Motion,
    source: ControlLaw | ProgramLaw | Array,
    loads: Loads,
    sensors: Sensors,
    timing: Timing,
    ask: Callable[[int, int, Array], Array] | None,
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return the loop's arrays when it has run, and its samples (1, T, ...) by name."""
    count, period = len(reference.time), float(reference.time[1] - reference.time[0])
    times, counts = timing.parts(period, count)
    linked = source.linked if isinstance(source, ExportedLaw | ExportedCustomLaw) else None
    law = source if isinstance(source, ProgramLaw) else None
    if law is not None:
        expect_sensed(robot, law.program)
    if timing.method == "dop853" and linked is not None:
        raise DataError('method: "dop853" given, but a controller\'s C runs with "rk4" alone')
    control_loop = loop(robot, None if law is None else law.program, linked)
    arrays = loop_arrays(control_loop, robot, start, reference, law, sensors, counts)
    arrays |= {"wrench": loads.wrench[None], **encoder_noise(sensors, robot, count)}
    if isinstance(source, np.ndarray):
        arrays["given"] = source[None]
    sizes = {"states": arrays["state"].shape[2], "memories": arrays["memory"].shape[2]}
    if timing.method == "rk4":
        sizes["acceleration"] = robot.freedom
    sizes |= dict.fromkeys(("joints", "rates", "forces", "asked"), robot.joint_count)
    samples = {name: np.full((1, count, size), np.nan) for name, size in sizes.items()}
    # A stretch of samples for each mass that is carried.
    changes = np.flatnonzero(np.diff(loads.masses)) + 1
    for first, stop in pairwise([0, *changes.tolist(), count]):
        loaded = loads.machines[float(loads.masses[first])]
        stretch = arrays | machine_numbers(loaded, control_loop.plant, "plant") | samples
        stretch |= {
            name: stretch[name][:, first:stop]
            for name in (*samples, "reference", "given", "noise", "wrench")
            if stretch[name].shape[1] > 1
        }
        go = Adaptive(loaded, timing.tolerance).go if timing.method == "dop853" else None
        indices = [*counts, first, int(stop == count)]
        control_loop.run(stretch, stop - first, times, indices, ask, go=go)
        if arrays["fault"].any():
            break
    return arrays, samples


def _columns(robot: Manipulator, samples: dict[str, Array]) -> dict[str, Array]:
    """Return samples (T, ...) as a simulation names them, motors' coordinates and forces too."""
    kind, columns = DriveKind.from_robot(robot), dict(samples)
    parts = kind.parts(columns.pop("states"))
    columns |= {"pose": parts["pose"], "velocity": parts["velocity"]}
    columns |= {"memory": columns.pop("memories"), "joint_rates": columns.pop("rates")}
    for name, motor in (("joints", "motor"), ("joint_rates", "motor_rate")):
        joints = columns[name]
        columns[f"{motor}s"] = (
            np.where(kind.elastic, parts[motor], joints) if kind.bends else joints
        )
    columns["forces"] = given_forces(
        robot, columns["forces"], columns["motor_rates"], parts.get("current")
    )
    return columns


def _fault_words(
    robot: Manipulator, arrays: dict[str, Array], joints: Array, *, python: bool
) -> str | None:
    """Return why the loop ended before its time; None if it did not."""
    fault = arrays["fault"].item()
    if fault == _ASKED and python:
        return "no forces are asked for: the controller returns some that are not finite numbers"
    if fault == _ASKED:
        return (
            f"no forces are asked for at the joints {told_pose(joints[-1])}: they have no pose "
            "near the last one, or the wanted pose is out of the controller's reach"
        )
    if fault == _MOVED:
        m = robot.freedom
        return why_not_further(robot, *np.split(arrays["state"].ravel(), [m, 2 * m])[:2])
    return None


def _first_failure(
    robot: Manipulator, poses: Array, joints: Array
) -> tuple[int | None, str | None]:
    """Return the first sample beyond joints' limits or a singularity, and the reason."""
    failures = {
        first_beyond_limits(robot, poses, joints): told_limit,
        first_singular(robot, poses): told_singular,
    }
    first = min((k for k in failures if k is not None), default=None)
    return first, None if first is None else failures[first](robot, poses[first])


def loop_arrays(
    control_loop: Loop,
    robot: Manipulator,
    start: tuple[Array, Array],
    reference: Motion,
    law: ProgramLaw | None,
    sensors: Sensors,
    counts: Sequence[int],
) -> dict[str, Array]:
    """Return what a loop's `run` takes of a machine under a law, or without.

    `counts` are those of `Timing.parts`.
    """
    period = float(reference.time[1] - reference.time[0])
    parts = reference.pose, reference.velocity, reference.acceleration
    state = dict(zip(("pose", "velocity"), start, strict=True))
    state |= motor_states(robot, *start, reference.acceleration[0])
    begun = np.concatenate(list(state.values())).reshape(1, 1, -1)
    arrays = control_loop.idle(robot, begun, *counts[-2:])
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
    """Return what asks a controller in Python; `memories` grows by its memory."""

    def ask(_: int, sample: int, measured: Array) -> Array:
        parts = reference.pose, reference.velocity, reference.acceleration
        pose, velocity, acceleration = (part[sample] for part in parts)
        readings = measured[:joints], measured[joints:]
        answer: Any = law(pose, velocity, acceleration, *readings, memories[-1])
        try:
            returned, memory = answer
        except (TypeError, ValueError):
            raise DataError(
                f"controller: {shown(answer)} returned, forces (n,) and the next memory expected"
            ) from None
        forces = as_array(returned, "controller: forces", (joints,))
        if forces.ndim > 1:
            raise DataError(f"controller: forces: shape {forces.shape} given, ({joints},) expected")
        memories.append(memory)
        return forces

    return ask


def _accelerations(loads: Loads, pose: Array, velocity: Array, forces: Array) -> Array:
    """Return the accelerations of states whose friction is smooth."""
    accelerations, masses = np.empty_like(pose), loads.masses[: len(pose)]
    for mass, loaded in loads.machines.items():
        at: Any = masses == mass
        states = pose[at], velocity[at], forces[at], loads.wrench[: len(pose)][at]
        accelerations[at] = drive_accelerations(loaded, *states, on_failure="nan")
    return accelerations
