"""A control loop in NumPy, sample by sample: to the same bits what `loop.c.j2` makes of it in C.

It serves where there is no C compiler, for the first look at a machine, and for another integrator
than Runge and Kutta's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pteron.equations.sticking import STUCK
from pteron.equations.transmissions import DriveKind
from pteron.kernels.kernel import Array
from pteron.kernels.loop_code import PARTS, ROUNDS
from pteron.kernels.program_cache import Program
from pteron.kernels.vm import OneState, VirtualMachine

Ask = Callable[[int, int, Array], Array]
"""Gives the forces of a machine at a sample from its measured joints and their rates, (2 n,)."""

READINGS = ("joints", "joint_rates", "motors", "motor_rates")
"""Names of the encoders' coordinates and rates among a controller's inputs."""

_TURN = 2.0 * np.pi


class Evaluated:
    """A program on CasADi's virtual machine, called with arrays by name."""

    def __init__(self, name: str, program: Program) -> None:
        self.program = program
        inputs = tuple(replace(port, shared=False) for port in program.inputs)
        self._kernel = VirtualMachine(program.name, program.function, inputs, program.outputs)
        self._keys = [f"{name}_{p.name}" if p.shared else p.name for p in program.inputs]
        self._one = OneState(self._kernel)
        self._rows = [array.reshape(-1) for array in self._one.inputs]

    def __call__(
        self, inputs_by_name: Mapping[str, Array], arrays: Mapping[str, Array]
    ) -> dict[str, Array]:
        """Return the program's outputs (B, size) by name, at inputs (B, size) by name."""
        batch = len(next(iter(inputs_by_name.values())))
        ports = self.program.inputs
        columns = [
            arrays[key][:, 0] if port.shared else inputs_by_name[key]
            for key, port in zip(self._keys, ports, strict=True)
        ]
        if batch == 1:
            for row, numbers in zip(self._rows, columns, strict=True):
                row[:] = numbers[0]
            self._one.evaluate()
            outputs = [array.reshape(1, -1).copy() for array in self._one.outputs]
        else:
            inputs = [
                np.ascontiguousarray(np.broadcast_to(numbers, (batch, port.size)))
                for numbers, port in zip(columns, ports, strict=True)
            ]
            outputs = [np.empty((batch, port.size)) for port in self.program.outputs]
            self._kernel._run(batch, inputs, outputs)
        names = (port.name for port in self.program.outputs)
        return dict(zip(names, outputs, strict=True))


class Plant:
    """The plant of some machines: the sticking joints, and steps under constant forces."""

    def __init__(self, program: Program, kind: DriveKind) -> None:
        self._program = Evaluated("plant", program)
        self._kind, self._dry, self.elastic = kind, kind.dry, kind.elastic
        self.split = kind.parts

    def _evaluate(self, state: dict[str, Array], arrays: Mapping[str, Array]) -> dict[str, Array]:
        """Return accelerations and rates of a state; sticking joints are held by friction."""
        motion = self._program(state, arrays)
        stuck = {name: motion.pop(name) for name in STUCK if name in motion}
        if stuck:
            sticks = (state["side"] == 0.0).any(axis=1)
            for name, stuck_values in stuck.items():
                motion[STUCK[name]][sticks] = stuck_values[sticks]
        return motion

    def begin(
        self, state: dict[str, Array], arrays: Mapping[str, Array], side: Array, step: float
    ) -> dict[str, Array]:
        """Return accelerations and rates of a state, and write the sliding sides into `state`."""
        state["pace"] = np.full((len(side), 1), 1.0 / step)
        if not self._dry:
            return self._evaluate(state, arrays)
        batch, count = side.shape
        state |= {"side": side.copy(), "hold": np.zeros_like(side)}
        state["brake"] = np.full((batch, 1), 1.0 / step)
        motion = self._evaluate(state, arrays)
        best, chances = np.full(batch, count + 1), np.full(batch, 3)
        for _ in range(ROUNDS):
            sides = state["side"]
            ahead = motion["rates"] + step * motion["growth"]
            reverses = sides * ahead < 0.0
            exceeds = np.abs(motion["friction"]) > motion["breakaway"]
            if not (reverses | exceeds).any():
                break
            new_sides = np.where(exceeds, np.where(motion["friction"] > 0.0, -1.0, 1.0), sides)
            new_sides = np.where(reverses, 0.0, new_sides)
            for k in np.flatnonzero((reverses | exceeds).any(axis=1)):
                changed = np.flatnonzero(new_sides[k] != sides[k])
                fewer = len(changed) < best[k]
                at_once = fewer or chances[k] > 0
                chances[k] = 3 if fewer else chances[k] - 1
                best[k] = min(best[k], len(changed))
                chosen = changed if at_once else changed[-1:]
                sides[k, chosen] = new_sides[k, chosen]
            motion = self._evaluate(state, arrays)
        state["hold"] = -(state["brake"] * motion["rates"])
        state["brake"] = np.zeros((batch, 1))
        return motion

    def go(
        self,
        steps: int,
        step: float,
        state: dict[str, Array],
        arrays: Mapping[str, Array],
        alive: Array,
    ) -> None:
        """Advance the states by Runge-Kutta steps of `step` s.

        Machines whose motion is invalid are not advanced.
        """
        y, side, clock = (arrays[name][:, 0] for name in ("state", "side", "clock"))
        m = self.split(y)["pose"].shape[1]
        for _ in range(steps):
            good = alive != 0.0
            old, total, at = y.copy(), np.zeros_like(y), y.copy()
            stages = zip(
                (0.5 * step, 0.5 * step, step, 0.0),
                (step / 6.0, step / 3.0, step / 3.0, step / 6.0),
                strict=True,
            )
            for stage, (ahead, weight) in enumerate(stages):
                state |= self.split(at)
                if stage == 0:
                    motion = self.begin(state, arrays, side, step)
                    side[:] = state.get("side", side)
                else:
                    motion = self._evaluate(state, arrays)
                good &= motion["status"][:, 0] != 0.0
                rates = [(state | motion)[name] for _, name in self._kind.extra_states]
                growth = np.hstack([state["velocity"], motion["acceleration"], *rates])
                total = total + weight * growth
                at = old + ahead * growth
            y[:] = np.where(good[:, None], old + total, old)
            if self._dry and not self._kind.bends:
                rests = good & ~side.any(axis=1)
                y[rests, m : 2 * m] = 0.0
                stays = rests & ~old[:, m : 2 * m].any(axis=1)
                y[stays, :m] = old[stays, :m]
            alive[:] = good
            clock += good[:, None] * step
            if not good.any():
                return


def run_samples(
    plant: Plant,
    sensed: Evaluated,
    law: Evaluated | None,
    arrays: Mapping[str, Array],
    samples: int,
    times: Sequence[float],
    counts: Sequence[int],
    ask: Ask | None,
) -> None:
    """Simulate a number of samples of machines, in place in `arrays`; see `LoopCode.run`."""
    numbers: dict[str, Any] = {name: array[:, 0] for name, array in arrays.items()}
    y, side, memory, fault, done, seen = (
        numbers[name] for name in ("state", "side", "memory", "fault", "done", "seen")
    )
    late_parts, look, late_samples, behind, first, end = counts[PARTS:]
    parts = [part for part in range(PARTS) if counts[part]] or [0]
    queue, slots = arrays["queue"], late_samples + 2
    alive = (fault[:, 0] == 0.0).astype(float)
    for s in range(samples):
        number = first + s
        state = plant.split(y)
        joint_motion = sensed(state, arrays)
        joints, rates = joint_motion["joints"], joint_motion["rates"]
        seen_state = state if look == parts[-1] else plant.split(seen)
        seen_motion = joint_motion if look == parts[-1] else sensed(seen_state, arrays)
        period = times[PARTS]
        reported = _encoder_readings(seen_motion, seen_state, plant.elastic, arrays, s, period)
        delayed = _delay(arrays["told"], reported, number, behind)
        measured = _controller_readings(delayed, numbers["at_motor"])
        commands = _commands(law, ask, arrays, s, number, measured)
        limited = np.clip(commands, -numbers["most"], numbers["most"])
        queue[:, number % slots if number else slice(None)] = (
            limited if number else limited[:, None]
        )
        late, current = (queue[:, (number + k) % slots].copy() for k in (1, 2))
        applied = late if late_parts else current
        loads = {"forces": applied, "wrench": _row(arrays, "wrench", s)}
        if "acceleration" in arrays:
            arrays["acceleration"][:, s] = _acceleration(
                plant, {**state, **loads}, arrays, side, times[parts[0]]
            )
        recorded = {"states": y, "joints": joints, "rates": rates, "forces": applied}
        recorded |= {"asked": commands, "memories": memory}
        for name in recorded.keys() & arrays.keys():
            arrays[name][:, s] = recorded[name]
        done += alive[:, None]
        lost = (alive != 0.0) & ~np.isfinite(commands).all(axis=1)
        fault[lost], alive[lost] = 1.0, 0.0
        if not alive.any() or (end and s == samples - 1):
            return
        for part in parts:
            forces = late if part < late_parts else current
            plant.go(counts[part], times[part], {**loads, "forces": forces}, arrays, alive)
            if part == look:
                seen[:] = y
        fault[(alive == 0.0) & (fault[:, 0] == 0.0)] = 2.0


def _row(arrays: Mapping[str, Array], name: str, s: int) -> Array:
    """Return the rows (B, size) of the array `name`, (B or 1, T or 1, size), at sample s."""
    array = arrays[name]
    row: Array = array[:, s if array.shape[1] > 1 else 0]
    return np.broadcast_to(row, (len(arrays["state"]), array.shape[2]))


def _delay(line: Array, reported: Array, number: int, behind: int) -> Array:
    """Put readings (B, E) into a delay line; return those of `behind` samples before."""
    line[:, number % (behind + 1) if number else slice(None)] = (
        reported if number else reported[:, None]
    )
    return line[:, (number + 1) % (behind + 1)].copy()


def _commands(
    law: Evaluated | None,
    ask: Ask | None,
    arrays: Mapping[str, Array],
    s: int,
    number: int,
    measured: Sequence[Array],
) -> Array:
    """Return the controller's forces (B, n), NaN where invalid, and update its memory."""
    if law is not None:
        desired = np.split(_row(arrays, "reference", s), 3, axis=1)
        inputs = dict(zip(("pose", "velocity", "acceleration"), desired, strict=True))
        memory = arrays["memory"][:, 0]
        inputs |= dict(zip(READINGS, measured, strict=True)) | {"memory": memory}
        outputs = law(inputs, arrays)
        memory[:] = outputs.get("next_memory", memory)
        if "status" in outputs:
            return np.where(outputs["status"] != 0.0, outputs["forces"], np.nan)
        return outputs["forces"]
    if ask is not None:
        readings = np.hstack(measured[:2])
        return np.array([ask(k, number, readings[k]) for k in range(len(readings))])
    return _row(arrays, "given", s)


def _acceleration(
    plant: Plant, state: dict[str, Array], arrays: Mapping[str, Array], side: Array, step: float
) -> Array:
    """Return platform accelerations (B, m) of a state, NaN where invalid, 0 at rest."""
    motion = plant.begin(state, arrays, side, step)
    acceleration = np.where(motion["status"] != 0.0, motion["acceleration"], np.nan)
    if "side" in state and "motor" not in state:
        acceleration[~(state["side"].any(axis=1) | state["velocity"].any(axis=1))] = 0.0
    return acceleration


def _encoder_readings(
    motion: Mapping[str, Array],
    state: Mapping[str, Array],
    elastic: Sequence[bool],
    arrays: Mapping[str, Array],
    s: int,
    period: float,
) -> Array:
    """Return encoder positions and rates (B, 2 E), and update the encoders' memory.

    With elastic transmissions, motors have encoders too, after those of all joints.
    """
    exact = [motion["joints"], motion["rates"]]
    if "motor" in state:
        exact = [
            np.hstack([joint_part, np.where(elastic, state[name], joint_part)])
            for name, joint_part in zip(("motor", "motor_rate"), exact, strict=True)
        ]
    joints, rates = exact
    steps, noises = arrays["steps"][:, 0], arrays["noises"][:, 0]
    if not (steps.any() or noises.any()):
        return np.hstack(exact)
    last, turns, reading, filtered = np.split(arrays["encoders"][:, 0], 4, axis=1)
    turns -= arrays["round"][:, 0] * np.rint((joints - last) / _TURN)
    last[:] = joints
    offset = _TURN * turns
    reported = joints + offset + noises * _row(arrays, "noise", s)
    widths = np.where(steps > 0.0, steps, 1.0)
    reported = np.where(steps > 0.0, steps * np.rint(reported / widths), reported)
    filtered += arrays["share"][:, 0] * ((reported - reading) / period - filtered)
    reading[:] = reported
    return np.hstack([reported - offset, np.where(steps + noises > 0.0, filtered, rates)])


def _controller_readings(reported: Array, at_motor: Array) -> tuple[Array, ...]:
    """Return positions and rates of joints and motors, (B, n) each, from encoder readings."""
    n = at_motor.shape[1] // 2
    parts = np.split(reported, reported.shape[1] // n, axis=1)
    if len(parts) == len(READINGS[:2]):
        return (*parts, *parts)
    joints, motors, rates, motor_rates = parts
    mixed = np.where(at_motor > 0.0, np.hstack([motors, motor_rates]), np.hstack([joints, rates]))
    return mixed[:, :n], mixed[:, n:], motors, motor_rates
