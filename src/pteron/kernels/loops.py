"""`Loop`: a machine's control loop by samples, in C where there is a compiler, else in NumPy."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from threading import Event
from typing import Literal

import numpy as np

from pteron.equations.transmissions import DriveKind
from pteron.errors import ModelError
from pteron.kernels.c import c_compiler
from pteron.kernels.choice import VARIABLE
from pteron.kernels.cuda import run_loop
from pteron.kernels.kernel import Array
from pteron.kernels.loop_code import PARTS, LinkedLaw, LoopCode
from pteron.kernels.program_cache import Program
from pteron.kernels.programs import general_program, geometry_only, motion_program, program
from pteron.kernels.samples import Ask, Evaluated, Plant, run_samples
from pteron.kernels.targets import FIXED
from pteron.manipulator import Manipulator

LANES = 16
"""Machines that share a vector."""

_FEW = 4
"""Machines that go one by one."""

_PIECE = 200_000
"""Steps that one call of C takes, of all its machines: some 0.5 s, after which Ctrl-C is seen."""


Arrays = dict[str, Array]
"""Arrays of a run by name."""

Device = Literal["cpu", "cuda"]
"""Where machines run: the processor, or an NVIDIA GPU."""


def _pieces(
    arrays: Mapping[str, Array], samples: int, counts: Sequence[int], machines: int
) -> Iterator[tuple[Mapping[str, Array], int, Sequence[int]]]:
    """Yield pieces of a run that are short enough to interrupt: arrays, samples, counts."""
    *fixed, first, end = counts
    size = max(1, _PIECE // (max(1, machines) * max(1, sum(counts[:PARTS]))))
    if size >= samples:
        yield arrays, samples, counts
        return
    for start in range(0, samples, size):
        stop = min(start + size, samples)
        piece = {
            name: array[:, start:stop] if array.shape[1] == samples else array
            for name, array in arrays.items()
        }
        yield piece, stop - start, [*fixed, first + start, int(end and stop == samples)]


class Loop:
    """The control loop of machines of one layout; its numbers are given in a call.

    Parameters
    ----------
    robot : Manipulator
        A machine; others may have other inertial parameters and other drives, which have no dry
        friction and no Stribeck friction where its drives have none.
    law : Program, optional
        The controller.
    linked : LinkedLaw, optional
        Its C as it runs on the machine, in place of the program's.
    general : bool
        Whether the machines' geometry is among their numbers.
    """

    def __init__(
        self,
        robot: Manipulator,
        law: Program | None = None,
        linked: LinkedLaw | None = None,
        general: bool = False,
    ) -> None:
        self.kind = DriveKind.from_robot(robot)
        self.plant = _plant(geometry_only(robot), self.kind, general)
        self.sensed = general_program(robot, "sensed") if general else program(robot, "sensed")
        self.law, self.linked = law, linked

    @property
    def is_compiled(self) -> bool:
        """Whether the integration steps run as compiled C."""
        return os.environ.get(VARIABLE) != "vm" and c_compiler() is not None

    def run(
        self,
        arrays: Mapping[str, Array],
        samples: int,
        times: Sequence[float],
        counts: Sequence[int],
        ask: Ask | None = None,
        threads: int = 1,
        go: Callable[..., None] | None = None,
        device: Device = "cpu",
    ) -> None:
        """Simulate a number of samples; arrays (B or 1, T or 1, size) are changed in place.

        Parameters
        ----------
        arrays : dict
            What `LoopCode` names: `STATE`, `GIVEN` and, of `RESULTS`, those that are wanted.
        samples : int
            How many.
        times : sequence
            Length of a step in each of a period's parts, and the period, s.
        counts : sequence
            Steps in each part; how many parts have the command before; the part at whose end the
            sensors look; samples that commands, and that readings, are late; the number of the
            first sample; whether the last one is the end.
        ask : callable, optional
            The controller, where it is no program.
        threads : int
            How many share a batch.
        go : callable, optional
            In place of `Plant.go`.
        device : {"cpu", "cuda"}
            The processor, or an NVIDIA GPU, of which a thread runs a machine.

        Raises
        ------
        ModelError
            If there is no GPU, or CuPy is not installed, or the controller is a C function.
        """
        if device == "cuda":
            self._run_on_device(arrays, samples, times, counts)
            return
        if self.linked is not None and c_compiler() is None:
            raise ModelError("a controller's C needs a C compiler, which is not here; install one")
        batch = len(arrays["state"])
        lanes = 1 if batch < _FEW else LANES
        if go is not None or not (self.linked or self._can_run(lanes)):
            plant = Plant(self.plant, self.kind)
            if go is not None:
                plant.go = go  # type: ignore[method-assign]
            law = None if self.law is None else Evaluated("law", self.law)
            programs = plant, Evaluated("sensed", self.sensed), law
            run_samples(*programs, arrays, samples, times, counts, ask)
            return
        code = self.code(lanes)
        shares = max(1, min(threads, batch // LANES))
        bounds = [batch * k // shares for k in range(shares + 1)]

        ended = Event()

        def part(start: int, stop: int) -> None:
            """Simulate the machines `start` to `stop`, piece by piece, until `ended` is set."""
            cut = {n: a[start:stop] if len(a) == batch else a for n, a in arrays.items()}
            for piece, size, numbers in _pieces(cut, samples, counts, stop - start):
                if ended.is_set():
                    return
                code.run(piece, size, times, numbers, ask)

        if shares == 1:
            part(0, batch)
            return
        with ThreadPoolExecutor(shares) as pool:
            try:
                list(pool.map(part, bounds[:-1], bounds[1:]))
            finally:
                ended.set()

    def _run_on_device(
        self,
        arrays: Mapping[str, Array],
        samples: int,
        times: Sequence[float],
        counts: Sequence[int],
    ) -> None:
        """Run some samples on an NVIDIA GPU; the parameters are those of `run`."""
        if self.linked is not None:
            raise ModelError("a controller's C does not run on a GPU; give one of Pteron's")
        parts = self.plant, self.sensed, self.law, self.kind
        run_loop(_code(*parts, 1, None, True), arrays, samples, times, counts)

    def idle(self, robot: Manipulator, state: Array, late: int = 0, behind: int = 0) -> Arrays:
        """Return the arrays of `run` for states (B, 1, Y) without loads, limits or encoders.

        What a run changes is of the library of `state`, NumPy or one like it. Commands are delayed
        by `late` samples, and readings by `behind` samples.
        """
        batch, n = len(state), robot.joint_count
        encoders = n * (2 if self.kind.bends else 1)
        machine_sizes = {"side": n, "memory": 0, "encoders": 4 * encoders}
        machine_sizes |= dict.fromkeys(("clock", "done", "fault"), 1)
        shared = {"given": n, "wrench": len(robot.column_names["wrench"]), "at_motor": 2 * n}
        shared |= dict.fromkeys(("steps", "noises", "round", "noise"), encoders)
        sizes = {name: (1, size) for name, size in machine_sizes.items()}
        sizes |= {"queue": (late + 2, n), "told": (behind + 1, 2 * encoders)}
        return {
            "state": state,
            "seen": state.copy(),
            **{name: np.zeros_like(state, shape=(batch, *size)) for name, size in sizes.items()},
            **{name: np.zeros((1, 1, size)) for name, size in shared.items()},
            "most": np.full((1, 1, n), np.inf),
            "share": np.ones((1, 1, 1)),
            **machine_numbers(robot, self.plant, "plant"),
        }

    def _can_run(self, lanes: int) -> bool:
        """Return whether the steps can run in C; False if the compiler fails."""
        if not self.is_compiled:
            return False
        try:
            self.code(lanes).load()
        except ModelError:
            return False
        return True

    def code(self, lanes: int) -> LoopCode:
        """Return the loop's C code for `lanes` machines side by side."""
        return _code(self.plant, self.sensed, self.law, self.kind, lanes, self.linked)


@lru_cache(maxsize=64)
def loop(
    robot: Manipulator,
    law: Program | None = None,
    linked: LinkedLaw | None = None,
    general: bool = False,
) -> Loop:
    """Return the simulation loop of a machine under a control law or given forces."""
    return Loop(robot, law, linked, general)


def machine_numbers(robot: Manipulator, part: Program, name: str) -> dict[str, Array]:
    """Return a machine's parameters as arrays by name, for a program of the loop."""
    return {
        f"{name}_{port.name}": _numbers(robot, port.name)
        for port in part.inputs
        if port.name in FIXED
    }


@lru_cache(maxsize=256)
def _numbers(robot: Manipulator, what: str) -> Array:
    """Return a machine's parameters for the input `what`, (1, 1, k), read-only and cached."""
    array = FIXED[what](robot).reshape(1, 1, -1)
    array.setflags(write=False)  # all runs of the machine read it
    return array


_plant = lru_cache(maxsize=64)(motion_program)
_code = lru_cache(maxsize=64)(LoopCode)
