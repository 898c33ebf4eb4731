"""Ten million rows are identified in bounded memory: time and peak memory, for CSV and Parquet.

Writes 1.4 GB to a temporary folder and takes some 15 minutes; `--quick` has three million rows.
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

import pteron
from pteron.identification import identify, open_log
from pteron.kernels import Array

_ROWS = 3_000_000 if "--quick" in sys.argv else 10_000_000
_RATE = 1000.0
_PIECE = 500_000
_FRICTION = (6.0, 4.0)


def main() -> None:
    """Write a log, identify it in a process of its own, and print what that took."""
    if len(sys.argv) > 2 and sys.argv[1] == "--identify":
        _identify(Path(sys.argv[2]))
        return
    with tempfile.TemporaryDirectory() as folder:
        for ending in (".csv", ".parquet"):
            path = Path(folder) / f"log{ending}"
            _write(path)
            size = path.stat().st_size / 1e9
            print(f"{ending}: {_ROWS} rows, {size:.2f} GB", flush=True)
            subprocess.run([sys.executable, __file__, "--identify", str(path)], check=True)
            path.unlink()


def _identify(path: Path) -> None:
    robot = pteron.load("quadrupteron")
    begun = time.perf_counter()
    found = identify(robot, open_log(path, robot))
    seconds = time.perf_counter() - begun
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    truth = np.r_[
        found.model.base.values(robot), np.repeat(_FRICTION, len(robot.legs)), np.zeros(4)
    ]
    errors = np.abs(found.estimate.values - truth) / found.estimate.deviations
    print(
        f"  identified in {seconds:.0f} s, peak memory {peak:.2f} GB; {found.estimate.rows} "
        f"equations, largest error {errors.max():.2f} standard deviations, {found.verdict.grade}"
    )


def _motion(robot: pteron.Manipulator, time: Array) -> tuple[Array, Array, Array]:
    """Return a motion whose frequencies have no common period."""
    rng = np.random.default_rng(1)
    pose, velocity, acceleration = np.zeros((3, len(time), robot.freedom))
    for frequency in (0.31, 0.73, 1.17, 1.61):
        size = rng.normal(size=robot.freedom) * np.array([0.02, 0.02, 0.02, 0.12]) / frequency
        phase = rng.uniform(0.0, 2.0 * np.pi, robot.freedom)
        speed = 2.0 * np.pi * frequency
        angle = speed * time[:, None] + phase
        pose += size * np.sin(angle)
        velocity += speed * size * np.cos(angle)
        acceleration -= speed**2 * size * np.sin(angle)
    return pose, velocity, acceleration


def _write(path: Path) -> None:
    robot = pteron.load("quadrupteron")
    forces_of = pteron.compile(robot, "inverse_dynamics", "c")
    rng = np.random.default_rng(0)
    parts = []
    for start in range(0, _ROWS, _PIECE):
        time = np.arange(start, min(start + _PIECE, _ROWS)) / _RATE
        motion = _motion(robot, time)
        rates = pteron.kinematics.joint_rates(robot, motion[0], motion[1]).actuated
        forces = forces_of(*motion) + _FRICTION[0] * np.sign(rates) + _FRICTION[1] * rates
        sliders = np.round(pteron.inverse_kinematics(robot, motion[0]) / 1e-6) * 1e-6
        forces = forces + 0.2 * rng.normal(size=forces.shape)
        columns = {"t": time}
        columns |= {f"rho{i + 1}": value for i, value in enumerate(sliders.T)}
        columns |= {f"force{i + 1}": value for i, value in enumerate(forces.T)}
        part = path.with_name(f"part{start}.parquet")
        pl.DataFrame(columns).write_parquet(part)
        parts.append(part)
    whole = pl.scan_parquet(parts)
    if path.suffix == ".csv":
        whole.sink_csv(path)
    else:
        whole.sink_parquet(path)
    for part in parts:
        part.unlink()


if __name__ == "__main__":
    main()
