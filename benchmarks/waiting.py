"""The commands of `pteron`, and how long one waits for each: CPU and wall seconds, medians.

Each command finds what an earlier run has left in the cache; the demo begins with an empty one, as
on a fresh machine. CPU counts user and system seconds of the process and of all that it starts. The
log that is identified lasts 20 s at 1 kHz, four periods of the motion that `pteron excite` writes:
encoders of 20 bits a turn, friction, bodies off by up to 20 %, 1 % of noise in the forces.
`--before FOLDER` names an earlier checkout, whose commands take turns with these; names of commands
choose some.

`edits`: the waiting of a person who edits a number of a file and repeats a command, in CPU seconds:
with an empty cache; the same again; with a number in the file that no earlier run has had. A C
compiler that runs in the background counts. `analyses`: analyses of a 6-RSS with an empty cache,
and the wall seconds until the first call of `progress`.
"""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
import time
from argparse import ArgumentParser
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import polars as pl

import pteron

sys.path.append(str(Path(__file__).parent / "identification"))
from plant.built import as_built

_HERE = Path(__file__).parent

_COMMANDS = {
    "start": (0.25, "--version"),
    "catalog": (0.6, "catalog"),
    "new": (0.6, "new"),
    "check": (0.6, "check delta"),
    "inverse": (0.6, "inverse quadrupteron 0.01 0.02 -0.03 0.1"),
    "direct": (0.6, "direct quadrupteron 0.03 0.02 0.01 0.02"),
    "forces": (0.6, "forces quadrupteron --pose 0.01 0.02 -0.03 0.1 --velocity 0 0 0.5 0"),
    "base": (0.6, "base quadrupteron"),
    "table1": (0.6, "table1"),
    "cycle": (0.6, "cycle quadrupteron"),
    "export": (0.6, "export quadrupteron --c controller"),
    "report": (3.0, "report quadrupteron --out report"),
    "film": (4.0, "film delta -o cycle.mp4"),
    "excite": (15.0, "excite delta --periods 4 --out ../motion.csv"),
    "identify": (6.0, "identify ../log.csv --robot delta --out identified"),
    "design": (30.0, f"design {_HERE.parent / 'examples/design_quadrupteron.toml'} --out best"),
    "demo": (40.0, "report quadrupteron --out demo"),
}
"""The wall seconds asked for, and the arguments of `pteron`, in a folder that is new each time."""

_QUICK = "start", "catalog", "check", "base"

_EDITED = {
    "check": ("check robot.toml", 1.1, 2.9),
    "export": ("export robot.toml --c controller", 1.7, 5.0),
    "report": ("report robot.toml --out report", 4.0, 8.0),
    "base": ("base robot.toml", 0.8, 2.0),
}
"""The arguments of `pteron`, and the CPU seconds asked for after an edit, of each machine."""

_MACHINES = "delta", "hexa"

_FAMILIAR = 3
"""Edits before those that count: C code of a topology's programs is compiled when it has been worth
it, not in the first run."""

_ANALYSES = {"nearest_singularities": 60.0, "largest_tilt": 10.0, "largest_ball": 10.0}
"""Functions of `pteron.workspace`, of a machine and its home pose; the CPU seconds asked for."""

_ANALYSIS = """
import sys, time, pteron
from pteron.workspace import {name}, home_pose
robot, calls = pteron.load("{machine}"), []
home, begin = home_pose(robot), time.perf_counter()
{name}(robot, home, progress=lambda share: calls.append(time.perf_counter() - begin))
print(calls[0], len(calls))
"""

_COULOMB, _VISCOUS = np.array([4.0, 4.3, 4.6]), np.array([1.0, 1.1, 1.2])
"""Friction of the drives, N m and N m s."""

_ENCODER = 2.0 * np.pi / 2**20
"""Step of the encoders, rad."""

_STEADY = 5000, 20000
"""The first row behind the lead-in, and how many rows there are."""

_NOISE = 0.01
"""Standard deviation, as a share of each force's root mean square."""


def main() -> None:
    """Print the medians of each command."""
    parser = ArgumentParser(description=(__doc__ or "").splitlines()[0])
    sections = {"edits": print_edits, "analyses": print_analyses}
    names = ", ".join([*_COMMANDS, *sections])
    parser.add_argument("names", nargs="*", metavar="COMMAND", help=names)
    parser.add_argument("--before", type=Path, help="an earlier checkout")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    states = [state for state in (options.before, _HERE.parent) if state]
    selected = options.names or (_QUICK if options.quick else [*_COMMANDS, *sections])
    rounds = 1 if options.quick else options.rounds
    commands = [name for name in selected if name in _COMMANDS]
    if commands:
        print_commands(states, commands, rounds)
    for name in [name for name in sections if name in selected]:
        for state in states:
            sections[name](state, rounds)


def print_commands(states: list[Path], names: list[str], rounds: int) -> None:
    """Print the median CPU and wall seconds of commands, of each state of the sources in turn."""
    print("| command | CPU (s) | wall (s) |" + " CPU now | wall now |" * (len(states) - 1), end="")
    print(" wall asked |\n|" + " --- |" + " ---: |" * (2 * len(states) + 1))
    with TemporaryDirectory() as folder:
        root = Path(folder)
        if "identify" in names:
            _seconds(_HERE.parent, "excite", root)
            record(root / "motion.csv", root / "log.csv")
        for name in names:
            for state in states if name != "demo" else ():
                _seconds(state, name, root)
            medians = np.median(
                [
                    [seconds for state in states for seconds in _seconds(state, name, root)]
                    for _ in range(rounds)
                ],
                axis=0,
            )
            cells = " | ".join(f"{seconds:.2f}" for seconds in medians)
            print(f"| {name} | {cells} | {_COMMANDS[name][0]:g} |", flush=True)


def print_edits(state: Path, rounds: int) -> None:
    """Print the CPU seconds of commands after an edit, by median, and those asked for."""
    print("| command | machine | empty cache | asked | again | after an edit | asked | factor |")
    print("| --- | --- |" + " ---: |" * 6)
    for k, machine in enumerate(_MACHINES):
        for name, (command, *limits) in _EDITED.items():
            with TemporaryDirectory() as folder:
                cold, again, edited = _edit_seconds(state, command, machine, Path(folder), rounds)
            cells = cold, 2.0 * limits[k], again, edited, limits[k], edited / again
            row = " | ".join(f"{cell:.2f}" for cell in cells)
            print(f"| {name} | {machine} | {row} |", flush=True)


def _edit_seconds(
    state: Path, command: str, machine: str, folder: Path, rounds: int
) -> tuple[float, float, float]:
    """Return a command's CPU seconds with an empty cache, and medians again and after an edit."""
    robot = folder / "robot.toml"
    pteron.save(pteron.load(machine), robot)

    def run() -> float:
        return _run(["-m", "pteron", *command.split()], state, folder / "cache", folder)[0]

    def edit() -> None:
        text = re.sub(
            r"(?<=lower_length = )[\d.]+",
            lambda number: f"{1.001 * float(number[0]):.6f}",
            robot.read_text(),
            count=1,
        )
        robot.write_text(text)

    cold = run()
    for _ in range(_FAMILIAR):
        edit()
        run()
    edited, again = [], []
    for _ in range(rounds):
        edit()
        edited.append(run())
        again.append(run())
    return cold, float(np.median(again)), float(np.median(edited))


def print_analyses(state: Path, _: int) -> None:
    """Print the CPU seconds of analyses with an empty cache, and when they report progress."""
    print("| analysis of a hexa | CPU (s) | asked | first progress (s) | reports |")
    print("| --- |" + " ---: |" * 4)
    for name, limit in _ANALYSES.items():
        with TemporaryDirectory() as folder:
            code = _ANALYSIS.format(name=name, machine=_MACHINES[1])
            cpu, _wall, output = _run(["-c", code], state, Path(folder) / "cache", Path(folder))
        first, count = output.split()
        print(f"| {name} | {cpu:.1f} | {limit:g} | {float(first):.2f} | {count} |", flush=True)


def record(motion: Path, log: Path) -> None:
    """Write the log of a Delta that was not built as drawn, along a motion of `pteron excite`."""
    drawn, rng = pteron.load("delta"), np.random.default_rng(1)
    table = pl.read_csv(motion).slice(*_STEADY)

    def of(names: str) -> np.ndarray:
        return table.select(names.split()).to_numpy()

    state = of("x y z"), of("dx dy dz"), of("ddx ddy ddz")
    rates = of("dtheta1 dtheta2 dtheta3")
    forces = pteron.inverse_dynamics(as_built(drawn), *state)
    forces = forces + _COULOMB * np.sign(rates) + _VISCOUS * rates
    forces += _NOISE * np.sqrt((forces**2).mean(axis=0)) * rng.normal(size=forces.shape)
    joints = _ENCODER * np.round(of("theta1 theta2 theta3") / _ENCODER)
    columns = [table["t"].to_numpy(), *joints.T, *forces.T]
    names = ["t", "theta1", "theta2", "theta3", "torque1", "torque2", "torque3"]
    pl.DataFrame(dict(zip(names, columns, strict=True))).write_csv(log)


def _seconds(state: Path, name: str, root: Path) -> tuple[float, float]:
    """Return CPU and wall seconds of a command of a state of the sources."""
    with TemporaryDirectory(dir=root) as fresh:
        cache = Path(fresh) if name == "demo" else root / state.resolve().name
        arguments = ["-m", "pteron", *_COMMANDS[name][1].split()]
        return _run(arguments, state, cache, Path(fresh))[:2]


def _run(arguments: list[str], state: Path, cache: Path, folder: Path) -> tuple[float, float, str]:
    """Return CPU and wall seconds and the output of Python with a state of the sources."""
    places = {"PTERON_CACHE": str(cache), "PYTHONPATH": str(state.resolve() / "src")}
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    process = subprocess.run(
        [sys.executable, *arguments],
        check=True,
        cwd=folder,
        env=os.environ | places,
        capture_output=True,
        text=True,
    )
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, wall, process.stdout


if __name__ == "__main__":
    main()
