"""Kernels on an NVIDIA GPU: registers and spills here, equality and speed where there is a GPU.

    python benchmarks/gpu.py FOLDER [--quick]   # then, there: python FOLDER/run.py
    python benchmarks/gpu.py --registers

The folder has the exported code of five machines, reference values of 10^5 states and of 100
rollouts from the target "c", and a script that needs Python, NumPy and CuPy, and JAX for one of its
columns. `--registers` compiles with NVIDIA's wheel (nvidia-cuda-nvrtc-cu12), without a GPU.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

import pteron
from pteron.controllers import ComputedTorque
from pteron.export import export_cuda
from pteron.kernels import program
from pteron.kernels.loop_code import RESULTS, LoopCode
from pteron.kernels.loops import Loop, loop
from pteron.motion import machines_about, pick_and_place, simulate_many
from pteron.workspace import home_pose

_HERE = Path(__file__).resolve().parent
sys.path.append(str(_HERE.parent / "tests"))

_MACHINES = "quadrupteron", "tripteron", "delta", "par4", "stewart"
_FUNCTIONS = "inverse_kinematics", "inverse_dynamics", "forward_dynamics"
_STATES, _ROLLOUTS, _DURATION = 100_000, 100, 0.1


def print_registers() -> None:
    """Print registers, bytes spilled and seconds to compile, of kernels and loops, as Markdown."""
    import nvrtc  # type: ignore[import-not-found]

    print("| machine | function | registers | spilled (bytes) | code (kB) | compiling (s) |")
    print("| --- | --- | ---: | ---: | ---: | ---: |")
    for name in _MACHINES:
        robot = pteron.load(name)
        sources = {what: pteron.compile(robot, what, "cuda").source for what in _FUNCTIONS}
        code = loop(robot, program(robot, "computed_torque")).code(1)
        sources["loop of computed torque"] = replace(code, device=True).source
        for what, source in sources.items():
            start = perf_counter()
            report = nvrtc.compiled(source)
            seconds = perf_counter() - start
            cells = report.registers, report.spilled, round(report.size / 1e3), f"{seconds:.1f}"
            print(f"| {name} | {what} | " + " | ".join(map(str, cells)) + " |", flush=True)


def _write_states(robot: pteron.Manipulator, folder: Path, states: int) -> None:
    """Write states of a machine and the results of the target "c" there."""
    rng = np.random.default_rng(0)
    pose = pteron.random_poses(robot, states, seed=0)
    velocity, acceleration = rng.normal(size=(2, *pose.shape))
    motion = pose, velocity, acceleration
    forces = pteron.compile(robot, "inverse_dynamics", "c", grade="parametric")(*motion)
    np.savez(
        folder / f"{robot.name}_states.npz",
        pose=pose,
        velocity=velocity,
        acceleration=acceleration,
        joints=pteron.compile(robot, "inverse_kinematics", "c")(pose),
        forces=forces,
        accelerations=pteron.compile(robot, "forward_dynamics", "c", grade="parametric")(
            pose, velocity, forces
        ),
    )


def _write_rollouts(robot: pteron.Manipulator, folder: Path, count: int) -> None:
    """Write a loop's CUDA, its arrays for some machines, and what the target "c" makes of them."""
    taken: dict[str, np.ndarray] = {}
    code: list[LoopCode] = []
    simulator_run = Loop.run

    def run(self, arrays, samples, times, counts, **options):  # type: ignore[no-untyped-def]
        """Keep the arrays before and after a run."""
        code.append(replace(self.code(1), device=True))
        names = [name for name in code[0].names if name in arrays]
        taken.update({f"before_{name}": np.array(arrays[name]) for name in names})
        simulator_run(self, arrays, samples, times, counts, **options)
        taken.update({f"after_{name}": np.array(arrays[name]) for name in ("state", "fault")})
        taken.update({"samples": samples, "times": np.array(times), "counts": np.array(counts)})
        taken.update({f"after_{name}": np.array(arrays[name]) for name in RESULTS if name in names})

    Loop.run = run  # type: ignore[method-assign, assignment]
    try:
        motion = pick_and_place(robot, home_pose(robot))
        machines = machines_about(robot, count, masses=0.1)
        simulate_many(machines, motion, ComputedTorque(), duration=_DURATION)
    finally:
        Loop.run = simulator_run  # type: ignore[method-assign]
    taken["names"] = np.array(code[0].names)
    np.savez(folder / f"{robot.name}_rollouts.npz", **taken)  # type: ignore[arg-type]
    (folder / f"{robot.name}_loop.cu").write_text(code[0].source)


def prepare(folder: Path, states: int, rollouts: int, machines: Sequence[str]) -> None:
    """Write the folder that goes to a machine with a GPU."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in machines:
        robot = pteron.load(name)
        export_cuda(robot, _FUNCTIONS, folder)
        _write_states(robot, folder, states)
        _write_rollouts(robot, folder, rollouts)
        text = pteron.compile(robot, "inverse_dynamics", "jax").source
        (folder / f"{name}_jax.py").write_text(text)
        print(f"{name}: written", flush=True)
    shutil.copy(_HERE / "device" / "compare_targets.py", folder / "run.py")


def main() -> None:
    """Prepare the folder, or print registers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--registers", action="store_true")
    parser.add_argument("--quick", action="store_true", help="few states of one machine")
    options = parser.parse_args()
    if options.registers:
        print_registers()
    else:
        counts = (1000, 7) if options.quick else (_STATES, _ROLLOUTS)
        machines = ("tripteron",) if options.quick else _MACHINES
        prepare(options.folder or Path("gpu"), *counts, machines)


if __name__ == "__main__":
    main()
