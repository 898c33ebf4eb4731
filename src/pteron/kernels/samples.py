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
from pteron.kernels.kept import Program
from pteron.kernels.kernel import Array
from pteron.kernels.loop_code import PARTS, ROUNDS
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

    def __call__(self, given: Mapping[str, Array], arrays: Mapping[str, Array]) -> dict[str, Array]:
        """Return the outputs (B, size) of inputs (B, size); the machine's numbers are `arrays`."""
        batch = len(next(iter(given.values())))
        ports = self.program.inputs
        values = [
            arrays[key][:, 0] if port.shared else given[key]
            for key, port in zip(self._keys, ports, strict=True)
        ]
        if batch == 1:
            for row, value in zip(self._rows, values, strict=True):
                row[:] = value[0]
            self._one.evaluate()
            outputs = [array.reshape(1, -1).copy() for array in self._one.outputs]
        else:
            inputs = [
                np.ascontiguousarray(np.broadcast_to(value, (batch, port.size)))
                for value, port in zip(values, ports, strict=True)
            ]
            outputs = [np.empty((batch, port.size)) for port in self.program.outputs]
            self._kernel._run(batch, inputs, outputs)
        names = (port.name for port in self.program.outputs)
        return dict(zip(names, outputs, strict=True))


class Plant:
    """The plant of some machines: which joints stick, and steps under forces that stay."""

    def __init__(self, program: Program, kind: DriveKind) -> None:
        self._program = Evaluated("plant", program)
        self._kind, self._dry, self.elastic = kind, kind.dry, kind.elastic
        self.split = kind.parts

    def _moved(self, held: dict[str, Array], arrays: Mapping[str, Array]) -> dict[str, Array]:
        """Return what happens in a state, with the friction that holds joints where some stick."""
        found = self._program(held, arrays)
        stuck = {name: found.pop(name) for name in STUCK if name in found}
        if stuck:
            sticks = (held["side"] == 0.0).any(axis=1)
            for name, values in stuck.items():
                found[STUCK[name]][sticks] = values[sticks]
        return found

    def begin(
        self, held: dict[str, Array], arrays: Mapping[str, Array], side: Array, step: float
    ) -> dict[str, Array]:
        """Return what happens in a state, and put the sides and what sticks into `held`."""
        held["pace"] = np.full((len(side), 1), 1.0 / step)
        if not self._dry:
            return self._moved(held, arrays)
        batch, count = side.shape
        held |= {"side": side.copy(), "hold": np.zeros_like(side)}
        held["brake"] = np.full((batch, 1), 1.0 / step)
        found = self._moved(held, arrays)
        best, chances = np.full(batch, count + 1), np.full(batch, 3)
        for _ in range(ROUNDS):
            now = held["side"]
            ahead = found["rates"] + step * found["growth"]
            against = now * ahead < 0.0
            beyond = np.abs(found["friction"]) > found["breakaway"]
            if not (against | beyond).any():
                break
            better = np.where(beyond, np.where(found["friction"] > 0.0, -1.0, 1.0), now)
            better = np.where(against, 0.0, better)
            for k in np.flatnonzero((against | beyond).any(axis=1)):
                changed = np.flatnonzero(better[k] != now[k])
                fewer = len(changed) < best[k]
                at_once = fewer or chances[k] > 0
                chances[k] = 3 if fewer else chances[k] - 1
                best[k] = min(best[k], len(changed))
                chosen = changed if at_once else changed[-1:]
                now[k, chosen] = better[k, chosen]
            found = self._moved(held, arrays)
        held["hold"] = -(held["brake"] * found["rates"])
        held["brake"] = np.zeros((batch, 1))
        return found

    def go(
        self,
        steps: int,
        step: float,
        held: dict[str, Array],
        arrays: Mapping[str, Array],
        alive: Array,
    ) -> None:
        """Make steps of Runge and Kutta's method; a machine that cannot go on stays."""
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
                held |= self.split(at)
                if stage == 0:
                    found = self.begin(held, arrays, side, step)
                    side[:] = held.get("side", side)
                else:
                    found = self._moved(held, arrays)
                good &= found["status"][:, 0] != 0.0
                rates = [(held | found)[name] for _, name in self._kind.more]
                growth = np.hstack([held["velocity"], found["acceleration"], *rates])
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
    """Run some samples of machines; see `LoopCode.run`."""
    own: dict[str, Any] = {name: value[:, 0] for name, value in arrays.items()}
    y, side, memory, fault, done = (
        own[name] for name in ("state", "side", "memory", "fault", "done")
    )
    seen, batch = own["seen"], len(y)
    late_parts, look, whole, behind, first, end = counts[PARTS:]
    parts = [part for part in range(PARTS) if counts[part]] or [0]
    queue, slots = arrays["queue"], whole + 2
    alive = (fault[:, 0] == 0.0).astype(float)

    def at(name: str, s: int) -> Array:
        values = arrays[name]
        row: Array = values[:, s if values.shape[1] > 1 else 0]
        return np.broadcast_to(row, (batch, values.shape[2]))

    def record(**values: Array) -> None:
        for name, value in values.items():
            if name in arrays:
                arrays[name][:, s] = value

    for s in range(samples):
        number = first + s
        state = plant.split(y)
        found = sensed(state, arrays)
        joints, rates = found["joints"], found["rates"]
        looked, there = (found, state) if look == parts[-1] else (None, plant.split(seen))
        if looked is None:
            looked = sensed(there, arrays)
        heard = _measured(looked, there, plant.elastic, own, at, s, times[PARTS])
        told = arrays["told"]
        told[:, number % (behind + 1) if number else slice(None)] = (
            heard if number else heard[:, None]
        )
        measured = _of_controller(told[:, (number + 1) % (behind + 1)].copy(), own["at_motor"])
        if law is not None:
            wanted = np.split(at("reference", s), 3, axis=1)
            given = dict(zip(("pose", "velocity", "acceleration"), wanted, strict=True))
            given |= dict(zip(READINGS, measured, strict=True)) | {"memory": memory}
            wants = law(given, arrays)
            memory[:] = wants.get("next_memory", memory)
            asked = wants["forces"]
            if "status" in wants:
                asked = np.where(wants["status"] != 0.0, asked, np.nan)
        elif ask is not None:
            asked = np.array([ask(k, number, np.hstack(measured[:2])[k]) for k in range(batch)])
        else:
            asked = at("given", s)
        cut = np.clip(asked, -own["most"], own["most"])
        queue[:, number % slots if number else slice(None)] = cut if number else cut[:, None]
        late, held = queue[:, (number + 1) % slots].copy(), queue[:, (number + 2) % slots].copy()
        now = late if late_parts else held
        loads = {"forces": now, "wrench": at("wrench", s)}
        if "acceleration" in arrays:
            given = {**state, **loads}
            found = plant.begin(given, arrays, side, times[parts[0]])
            growth = np.where(found["status"] != 0.0, found["acceleration"], np.nan)
            if "side" in given and "motor" not in given:
                growth[~(given["side"].any(axis=1) | state["velocity"].any(axis=1))] = 0.0
            record(acceleration=growth)
        record(states=y, joints=joints, rates=rates)
        record(forces=now, asked=asked, memories=memory)
        done += alive[:, None]
        lost = (alive != 0.0) & ~np.isfinite(asked).all(axis=1)
        fault[lost], alive[lost] = 1.0, 0.0
        if not alive.any() or (end and s == samples - 1):
            return
        for part in parts:
            forces = late if part < late_parts else held
            plant.go(counts[part], times[part], {**loads, "forces": forces}, arrays, alive)
            if part == look:
                seen[:] = y
        fault[(alive == 0.0) & (fault[:, 0] == 0.0)] = 2.0


def _measured(
    looked: Mapping[str, Array],
    state: Mapping[str, Array],
    elastic: Sequence[bool],
    own: Mapping[str, Any],
    at: Callable[[str, int], Array],
    s: int,
    period: float,
) -> Array:
    """Return coordinates and rates (B, 2 E) as the encoders tell them, and count on in `encoders`.

    Where a transmission bends, motors have encoders too, after those of all joints.
    """
    read = [looked["joints"], looked["rates"]]
    if "motor" in state:
        read = [
            np.hstack([one, np.where(elastic, state[name], one)])
            for name, one in zip(("motor", "motor_rate"), read, strict=True)
        ]
    joints, rates = read
    steps, noises = own["steps"], own["noises"]
    if not (steps.any() or noises.any()):
        return np.hstack(read)
    last, turns, reading, filtered = np.split(own["encoders"], 4, axis=1)
    turns -= own["round"] * np.rint((joints - last) / _TURN)
    last[:] = joints
    gone = _TURN * turns
    told = joints + gone + noises * at("noise", s)
    widths = np.where(steps > 0.0, steps, 1.0)
    told = np.where(steps > 0.0, steps * np.rint(told / widths), told)
    filtered += own["share"] * ((told - reading) / period - filtered)
    reading[:] = told
    return np.hstack([told - gone, np.where(steps + noises > 0.0, filtered, rates)])


def _of_controller(heard: Array, at_motor: Array) -> tuple[Array, ...]:
    """Return `READINGS` of what the encoders tell."""
    n = at_motor.shape[1] // 2
    parts = np.split(heard, heard.shape[1] // n, axis=1)
    if len(parts) == len(READINGS[:2]):
        return (*parts, *parts)
    joints, motors, rates, motor_rates = parts
    mixed = np.where(at_motor > 0.0, np.hstack([motors, motor_rates]), np.hstack([joints, rates]))
    return mixed[:, :n], mixed[:, n:], motors, motor_rates
