"""The C of a control loop, compiled: sensors, controller, delay, drives and plant in one function.

It is a library without Python in it, so that threads may run it beside each other.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pteron.equations.sticking import STUCK
from pteron.equations.transmissions import DriveKind
from pteron.kernels.blocks import Block
from pteron.kernels.c import FLAGS, LINKED, SUFFIX, c_compiler, compiler_version
from pteron.kernels.cache import digest, entry
from pteron.kernels.code import arithmetic, render_template
from pteron.kernels.compilers import compile_library
from pteron.kernels.kernel import Array
from pteron.kernels.program_cache import Program, name_of

ROUNDS = 200
"""Maximum number of active-set changes in a step; of 729 sets for six joints a few are visited."""

PARTS = 3
"""Parts of a period: the sensors' look and a late command divide it."""

STATE = ("state", "side", "memory", "encoders", "seen", "told", "queue", "clock", "done", "fault")
"""State that a run changes, for each machine."""

GIVEN = (
    *("reference", "given", "noise", "wrench", "most", "steps", "noises", "round", "share"),
    "at_motor",
)
"""Arguments beside the numbers of plant and controller."""

RESULTS = (*("states", "acceleration", "joints", "rates", "forces", "asked", "memories"),)
"""Quantities recorded at each sample, where there is an array for them."""

LOOP_INPUTS = {
    "pose": "wanted",
    "velocity": "wanted + M",
    "acceleration": "wanted + 2 * M",
    "joints": "measured",
    "joint_rates": "measured + N",
    "motors": "measured + 2 * N",
    "motor_rates": "measured + 3 * N",
    "memory": "memory",
}
"""The inputs that a controller may have, as expressions of the loop's C."""

_RIGID = {"motors": LOOP_INPUTS["joints"], "motor_rates": LOOP_INPUTS["joint_rates"]}
"""Motor inputs where no transmission is elastic."""

_ASK = ctypes.CFUNCTYPE(
    None,
    ctypes.c_long,
    ctypes.c_long,
    ctypes.POINTER(ctypes.c_double),
    ctypes.POINTER(ctypes.c_double),
)

_LIBRARY = "pteron_loop" + SUFFIX


class _Port(ctypes.Structure):
    # A `long` of Windows has 32 bits, too few for where an array of 16 GB ends.
    _fields_ = (
        ("numbers", ctypes.c_void_p),
        ("machine", ctypes.c_longlong),
        ("sample", ctypes.c_longlong),
    )


@dataclass(frozen=True)
class LinkedLaw:
    """A controller's C, as `pteron.export_c` writes it, that is compiled into the loop.

    Attributes
    ----------
    source : str
        Its header and source.
    function : str
        The function's name.
    tables : tuple of (str, str)
        For each input that is the machine's own, the array in the source that is passed.
    zeros, scales : tuple of float
        Of the drives' readings, which its joints and rates are: coordinate = zero + scale reading.
        Its forces are along them.
    """

    source: str
    function: str
    tables: tuple[tuple[str, str], ...]
    zeros: tuple[float, ...]
    scales: tuple[float, ...]

    def arguments(self, block: Block) -> list[str]:
        """Return the C arguments of the law's call: its inputs, then forces and next memory."""
        tables = dict(self.tables)
        taken = [
            tables[port.name] if port.shared else f"given + {block.first_rows[port.name]}"
            for port in block.program.inputs
        ]
        return taken + [name for name in ("forces", "next_memory") if name in block.output_rows]

    def readings(self, block: Block) -> list[tuple[int, float, float]]:
        """Return (input row, zero, scale) of joints and rates whose readings differ."""
        zero_rates = (0.0,) * len(self.zeros)
        zeros = dict.fromkeys(("joints", "motors"), self.zeros)
        zeros |= dict.fromkeys(("joint_rates", "motor_rates"), zero_rates)
        return [
            (block.first_rows[name] + i, zero, scale)
            for name, joint_zeros in zeros.items()
            if name in block.first_rows
            for i, (zero, scale) in enumerate(zip(joint_zeros, self.scales, strict=True))
            if (zero, scale) != (0.0, 1.0)
        ]


@dataclass(frozen=True)
class LoopCode:
    """The C of a loop for some machines side by side.

    Attributes
    ----------
    plant, sensed : Program
        The accelerations in a state under forces; the joints and their rates in it.
    law : Program or None
        The controller; None where forces are given.
    kind : DriveKind
        What the drives have.
    lanes : int
        How many machines go side by side.
    linked : LinkedLaw, optional
        C in place of the controller's own.
    device : bool
        Whether it is CUDA, of which a thread runs one machine after another, a grid apart.
    """

    plant: Program
    sensed: Program
    law: Program | None
    kind: DriveKind
    lanes: int
    linked: LinkedLaw | None = None
    device: bool = False

    @cached_property
    def _blocks(self) -> list[Block]:
        """The blocks of C code: the plant, and sensors and law where the loop has them."""
        parts = {"sensed": self.sensed, "law": self.law}
        blocks = [
            Block(name, part, needed=self._needed(part))
            for name, part in parts.items()
            if part is not None
        ]
        # Machines side by side rarely slide all at once, and one part fills the pipeline better.
        later = STUCK if self.kind.dry else None
        split = later is not None and self.lanes == 1
        plant = Block("plant", self.plant, later, split, self._needed(self.plant))
        return [plant, *blocks]

    def _needed(self, part: Program) -> list[str] | None:
        """Return the outputs of a program that the loop reads on a GPU; None on the processor.

        The joints' growth, friction and breakaway are read where friction is dry.
        """
        if not self.device:
            return None
        names = [port.name for port in part.outputs]
        if part is self.plant and not self.kind.dry:
            growths = [growth for _, growth in self.kind.extra_states]
            names = [name for name in names if name in ("acceleration", "status", *growths)]
        return names

    @cached_property
    def source(self) -> str:
        """The C source of the simulation loop."""
        plant, _, *laws = self._blocks
        law = laws[0] if laws else None
        sizes = {port.name: port.size for port in plant.state_inputs}
        freedom = sizes["pose"]
        rates = [("in", plant.first_rows["velocity"] + j) for j in range(freedom)]
        rates += [("out", plant.output_rows["acceleration"] + j) for j in range(freedom)]
        extra_states = []
        for name, growth in self.kind.extra_states:
            extra_states.append((name, len(rates), sizes[name]))
            is_input = growth in plant.first_rows
            start = plant.first_rows[growth] if is_input else plant.output_rows[growth]
            rates += [("in" if is_input else "out", start + j) for j in range(sizes[name])]
        memory = 0
        if law is not None:
            memory = {port.name: port.size for port in law.state_inputs}.get("memory", 0)
        return render_template(
            "pteron.kernels",
            "loop.c.j2",
            name=self.plant.name,
            real="double",
            **arithmetic(),
            blocks=self._blocks,
            plant=plant,
            law=law,
            linked=self.linked,
            lanes=self.lanes,
            device=self.device,
            function="static __device__ __noinline__" if self.device else "static",
            freedom=freedom,
            joints=sizes["forces"],
            wrench=sizes["wrench"],
            memory=memory,
            rates=rates,
            more=extra_states,
            dry=self.kind.dry,
            bends=self.kind.bends,
            elastic=[int(soft) for soft in self.kind.elastic],
            encoders=sizes["forces"] * (2 if self.kind.bends else 1),
            parts=PARTS,
            told=LOOP_INPUTS if self.kind.bends else LOOP_INPUTS | _RIGID,
            rounds=ROUNDS,
            ports=self.names,
        )

    @cached_property
    def names(self) -> list[str]:
        """The names of the arrays that the loop's C function takes, in order."""
        numbers = (
            f"{block.name}_{port.name}" for block in self._blocks for port in block.machine_inputs
        )
        return [*STATE, *GIVEN, *RESULTS, *numbers]

    @cached_property
    def _library(self) -> ctypes.CDLL:
        """The compiled library of the loop, from the cache or compiled on demand."""
        command = c_compiler()
        assert command is not None  # whoever runs it has asked
        # By what the source is made of: to make it takes longer than all else of a first call.
        texts = tuple(part and part.text for part in (self.plant, self.sensed, self.law))
        made_of = name_of(*texts, self.kind, self.lanes, self.linked)
        assert made_of is not None  # texts and numbers
        name = f"loop-{digest(made_of, *command, compiler_version(command), *FLAGS)}"
        return ctypes.CDLL(str(entry(name, _LIBRARY, self._build)))

    def load(self) -> None:
        """Load the loop's library; compile it first if it is not in the cache.

        Raises
        ------
        ModelError
            If it could not be compiled.
        """
        _ = self._library

    def _build(self, folder: Path) -> None:
        """Compile the loop's C source into a library in `folder`; ModelError on failure."""
        advice = "set CC to another compiler, or PTERON_KERNELS=vm"
        flags, sources = [*FLAGS, *LINKED], {"loop.c": self.source}
        what = "the simulation's loop"
        compile_library(c_compiler() or (), flags, sources, folder / _LIBRARY, what, advice)

    def run(
        self,
        arrays: Mapping[str, Array],
        samples: int,
        times: Sequence[float],
        counts: Sequence[int],
        ask: Callable[[int, int, Array], Array] | None = None,
    ) -> None:
        """Run the loop for a number of samples.

        Arrays (B or 1, T or 1, size) are changed in place.
        """
        table = (_Port * len(self.names))()
        for port, name in zip(table, self.names, strict=True):
            optional = name in (*RESULTS, "reference", "given")
            array = arrays.get(name) if optional else arrays[name]
            if array is not None:
                machine, sample = (
                    array.strides[axis] // 8 if array.shape[axis] > 1 else 0 for axis in (0, 1)
                )
                port.numbers, port.machine, port.sample = array.ctypes.data, machine, sample
        failures: list[BaseException] = []
        joints = arrays["most"].shape[2]

        def answer_request(machine: int, sample: int, measured: Any, forces: Any) -> None:
            """Fill in the controller's forces (n,) for measurements (2 n,); NaN after a failure."""
            commanded = np.ctypeslib.as_array(forces, (joints,))
            commanded[:] = np.nan
            if not failures:
                readings = np.ctypeslib.as_array(measured, (2 * joints,)).copy()
                try:
                    commanded[:] = ask(machine, sample, readings)  # type: ignore[misc]
                except BaseException as error:
                    failures.append(error)

        self._library.run(
            ctypes.c_long(len(arrays["state"])),
            ctypes.c_long(samples),
            (ctypes.c_double * len(times))(*times),
            (ctypes.c_long * len(counts))(*counts),
            table,
            _ASK(answer_request) if ask is not None else _ASK(),
        )
        if failures:
            raise failures[0]
