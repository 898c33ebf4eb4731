"""The commands of `pteron`, and how long one waits for each: CPU and wall seconds, medians.

Each command finds what an earlier run has left in the cache; the demo begins with an empty one, as
on a fresh machine. CPU counts user and system seconds of the process and of all that it starts. The
log that is identified lasts 20 s at 1 kHz, four periods of the motion that `pteron excite` writes:
encoders of 20 bits a turn, friction, bodies off by up to 20 %, 1 % of noise in the forces.
`--before FOLDER` names an earlier checkout, whose commands take turns with these; names of commands
choose some.
"""

from __future__ import annotations

import os
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
    parser.add_argument("names", nargs="*", metavar="COMMAND", help=", ".join(_COMMANDS))
    parser.add_argument("--before", type=Path, help="an earlier checkout")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    states = [state for state in (given.before, _HERE.parent) if state]
    names = given.names or (_QUICK if given.quick else _COMMANDS)
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
            found = np.median(
                [
                    [seconds for state in states for seconds in _seconds(state, name, root)]
                    for _ in range(1 if given.quick else given.rounds)
                ],
                axis=0,
            )
            told = " | ".join(f"{seconds:.2f}" for seconds in found)
            print(f"| {name} | {told} | {_COMMANDS[name][0]:g} |", flush=True)


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
        places = {"PTERON_CACHE": str(cache), "PYTHONPATH": str(state.resolve() / "src")}
        run = [sys.executable, "-m", "pteron", *_COMMANDS[name][1].split()]
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(run, check=True, cwd=fresh, env=os.environ | places, capture_output=True)
        wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, wall


if __name__ == "__main__":
    main()
