"""The two slowest commands: CPU and wall seconds of whole processes, medians.

`pteron excite delta`, and `pteron identify` of a log of 20 s at 1 kHz, four periods of the motion
that it writes: encoders of 20 bits a turn, friction, bodies off by up to 20 %, 1 % of noise in the
forces. Both find what an earlier run has left in the cache. CPU counts user and system seconds of
the process and of all that it starts.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import polars as pl
from measuring import quick

import pteron

sys.path.append(str(Path(__file__).parent / "identification"))
from plant.built import as_built

_COULOMB, _VISCOUS = np.array([4.0, 4.3, 4.6]), np.array([1.0, 1.1, 1.2])
"""Friction of the drives, N m and N m s."""

_ENCODER = 2.0 * np.pi / 2**20
"""Step of the encoders, rad."""

_STEADY = 5000, 20000
"""The first row behind the lead-in, and how many rows there are."""

_NOISE = 0.01
"""Standard deviation, as a share of each force's root mean square."""


def main() -> None:
    """Print the medians of both commands."""
    rounds = 1 if quick() else 5
    short = ["--seconds", "5", "--starts", "1"] if quick() else []
    with tempfile.TemporaryDirectory() as folder:
        motion, log, out = (str(Path(folder) / name) for name in ("motion.csv", "log.csv", "out"))
        excite = ["excite", "delta", "--periods", "4", "--out", motion, *short]
        identify = ["identify", log, "--robot", "delta", "--out", out]
        _seconds(excite)
        record(Path(motion), Path(log))
        print("| command | CPU (s) | wall (s) |\n| --- | ---: | ---: |")
        for command in (excite, identify):
            _seconds(command)
            cpu, wall = np.median([_seconds(command) for _ in range(rounds)], axis=0)
            print(f"| pteron {command[0]} | {cpu:.1f} | {wall:.1f} |", flush=True)


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


def _seconds(command: list[str]) -> tuple[float, float]:
    """Return CPU and wall seconds of a command of `pteron`."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    run = [sys.executable, "-m", "pteron", *command]
    subprocess.run(run, check=True, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, wall


if __name__ == "__main__":
    main()
