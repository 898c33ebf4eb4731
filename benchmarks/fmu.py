"""Exported FMUs, run by FMPy, against SciPy on the library's equations.

Each machine starts at rest with the forces that hold it, plus a push, and moves for 30 ms. FMPy, an
FMI master that is not ours, runs the FMU in both kinds.
"""

from __future__ import annotations

import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from measuring import Array, quick
from scipy.integrate import solve_ivp  # type: ignore[import-untyped]

import pteron
from pteron.export import export_fmu

MACHINES = ("quadrupteron", "delta", "par4", "five-bar")
KINDS = ("CoSimulation", "ModelExchange")
DURATION = 0.03
PUSH = 0.02
"""Share of the largest holding force, which is added with changing signs."""

GOAL = 1e-6
"""m and rad."""


def main() -> None:
    """Print how far each machine went, and how far apart the two are."""
    if find_spec("fmpy") is None:
        print("FMU: left out, the package fmpy is not installed")
        return
    worst = 0.0
    for name in MACHINES[:1] if quick() else MACHINES:
        with tempfile.TemporaryDirectory() as folder:
            path = export_fmu(pteron.load(name), folder)[0]
            for kind in KINDS:
                moved, apart = compared(name, path, kind)
                worst = max(worst, apart)
                print(f"{name:<13}{kind:<14} moved {moved:.1e}, apart {apart:.1e}")
    if not worst < GOAL:
        sys.exit(f"apart by {worst:.1e}, and less than {GOAL:.0e} is wanted")


def compared(name: str, path: Path, kind: str) -> tuple[float, float]:
    """Return how far a machine moved, and the largest difference of its pose, m and rad."""
    import fmpy  # type: ignore[import-untyped]

    robot = pteron.load(name)
    starts: dict[str, Any] = {
        variable.name: variable.start
        for variable in fmpy.read_model_description(path).modelVariables
    }
    poses = [f"pose.{coordinate}" for coordinate in robot.coordinates]
    drives = [f"{leg.joint.force}{i}" for i, leg in enumerate(robot.legs, start=1)]
    start, held = (np.array([float(starts[key]) for key in keys]) for keys in (poses, drives))
    signs = np.array([1.0, -0.5, 0.7, 0.3])[: len(held)]
    forces = held + PUSH * np.abs(held).max() * signs + 0.1
    expected = simulated(robot, start, forces)
    found = fmpy.simulate_fmu(
        path,
        fmi_type=kind,
        stop_time=DURATION,
        output_interval=DURATION / 8,
        relative_tolerance=1e-10,
        start_values=dict(zip(drives, forces, strict=True)),
    )[-1]
    last = np.array([found[key] for key in poses])
    return float(np.abs(last - start).max()), float(np.abs(last - expected).max())


def simulated(robot: pteron.Manipulator, start: Array, forces: Array) -> Array:
    """Return the pose (m,) to which forces (n,) take a machine from rest."""
    m = robot.freedom

    def rates(_: float, state: Array) -> Array:
        forward = pteron.drive_accelerations(robot, state[:m], state[m:], forces)
        return np.concatenate([state[m:], forward])

    whole = np.concatenate([start, np.zeros(m)])
    run = solve_ivp(rates, (0.0, DURATION), whole, method="DOP853", rtol=1e-11, atol=1e-13)
    return np.asarray(run.y[:m, -1])


if __name__ == "__main__":
    main()
