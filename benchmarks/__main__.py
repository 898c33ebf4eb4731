"""Run every benchmark and write RESULTS.md beside this file, with what it ran on.

`make bench` does it; `python benchmarks` with `--quick` prints a short run and writes nothing.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from measuring import quick

from pteron import atomic
from pteron.kernels.c import compiler

_HERE = Path(__file__).parent
_SCRIPTS = {
    "Fewest operations": "operations.py",
    "Fastest": "speed.py",
    "Public functions": "public_calls.py",
    "Second start": "startup.py",
    "Commands that one waits for": "waiting.py",
    "Memory traffic": "memory_traffic.py",
    "The paper's 41 %": "paper_claim.py",
    "The paper's inverse position": "inverse_position.py",
    "Reachy Mini's own kinematics": "reachy_mini.py",
    "Excitation": "excitation.py",
    "The same free motion in MuJoCo": "mujoco_convergence.py",
    "Limits of excitation": "excitation_limits.py",
    "Time-optimal cycles": "time_optimal.py",
    "Time-optimal motions on corners": "corners.py",
    "Control": "control.py",
    "Simulation": "simulation.py",
    "Energy": "energy.py",
    "Exported FMUs": "fmu.py",
    "Certified workspaces": "certified.py",
    "Nearest singular poses": "nearest_singularities.py",
    "All poses of hexapods": "direct_position.py",
    "Singular machines and poses": "singular.py",
    "Platforms that tilt": "platforms_that_tilt.py",
    "The Gymnasium environment": "environment.py",
    "The viewer": "viewer.py",
    "Maps of eight million poses": "maps.py",
    "A machine for a job": "choosing.py",
    "Twenty thousand damaged files": "mutants.py",
    "Calibrations with faults": "calibration_faults.py",
    "From a log to a running machine": "identification/chain.py",
    "An owner's way": "identification/owner.py",
    "Plants of their own equations, twenty faults each": "identification/own_plants.py",
}
_PACKAGES = ("pteron", "numpy", "casadi", "numba", "jax", "pin", "mujoco")


def main() -> None:
    """Run the scripts one by one, then write the file whole."""
    parts = ["# Results of the benchmarks\n", machine()]
    for claim, script in _SCRIPTS.items():
        print(f"{script} ...", file=sys.stderr, flush=True)
        run = subprocess.run(
            [sys.executable, str(_HERE / script), *sys.argv[1:]],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        if run.returncode != 0:
            sys.exit(f"{script} has failed:\n{run.stdout}")
        command = " ".join(["python", f"benchmarks/{script}", *sys.argv[1:]])
        parts.append(f"## {claim}\n\n```console\n$ {command}\n{run.stdout.strip()}\n```\n")
    text = "\n".join(parts)
    if quick():
        print(text)
    else:
        path = atomic.write_text(_HERE / "RESULTS.md", text)
        print(path)


def machine() -> str:
    """Return what the benchmarks run on, as a list in Markdown."""
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg()) if os.name == "posix" else "-"
    lines = {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "processor": f"{processor()}, {os.cpu_count()} cores",
        "load before (1, 5, 15 minutes)": load,
        "system": f"{platform.system()} {platform.machine()}",
        "C compiler": first_line(compiler()),
        "Python": platform.python_version(),
    }
    lines |= {package: installed(package) for package in _PACKAGES}
    rows = "".join(f"- {name}: {value}\n" for name, value in lines.items())
    return (
        "Written by `make bench`. Times are of one run on this machine; the contestants of a table "
        "took\nturns, so that what slowed one slowed all, and ratios carry further than times.\n\n"
        + rows
    )


def processor() -> str:
    """Return the processor's model."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    found: dict[str, str] = {}
    for line in lines:
        name, _, value = line.partition(":")
        found.setdefault(name.strip(), value.strip())
    name = found.get("model name") or platform.processor() or platform.machine()
    if {"cpu family", "model"} <= found.keys():
        name += f" (family {found['cpu family']}, model {found['model']})"
    return name


def first_line(command: Sequence[str] | None) -> str:
    """Return what a compiler calls itself."""
    if command is None:
        return "none"
    run = subprocess.run([*command, "--version"], capture_output=True, text=True, check=False)
    return (run.stdout.splitlines() or ["unknown"])[0]


def installed(package: str) -> str:
    """Return a package's version."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


if __name__ == "__main__":
    main()
