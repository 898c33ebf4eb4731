"""The command line from a robot's file to its code: a Delta with a fourth axis.

The machine is simulated in MuJoCo (`plant`), up to 20 % off what was drawn, with dry friction that
sticks and falls with speed. Its controller's log is of another dialect than Pteron's: forces in per
cent of the motors' rated torque, 2 ms late, angles in degrees, times in ms, decimal commas, German
names. The commands are those that a user types; a refusal is answered by pasting the lines that it
tells, and the verdict's advice is followed once. Then the exported C runs the machine beside slow
feedback, against the machine's own true model.

`--quick` has a shorter search, and one draw of the sensors' noise instead of four.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import plant
import polars as pl
from chain import BANDWIDTH, Controller, Cycles
from plant.model import Array
from scipy.interpolate import make_interp_spline  # type: ignore[import-untyped]

import pteron

FRICTION = plant.Friction(
    (6.0, 7.0, 5.0, 0.8),
    (3.0, 2.5, 3.5, 0.15),
    (0.5, -0.8, 0.3, 0.05),
    stribeck=(4.0, 5.0, 3.5, 0.6),
    speeds=(0.25, 0.3, 0.2, 0.5),
)
RATIO = np.array([55.0, 55.0, 55.0, 28.11])
RATED = np.array([1.27, 1.27, 1.27, 0.32])
LATE = 2
"""Samples, of 1 ms, by which forces are late for positions."""

_ENCODER = 2.0 * np.pi / 2**22
_NOISE = 0.01
_JITTER = 1e-6
_DRIVES = {"max_force": (210.0, 210.0, 210.0, 27.0), "max_speed": (6.0, 6.0, 6.0, 12.0)}


class Played:
    """A motion file as a reference of the joints; the machine rests before it and behind it."""

    def __init__(self, path: Path, robot: pteron.Manipulator) -> None:
        table = pl.read_csv(path)
        time = table["t"].to_numpy()
        self.duration = float(time[-1])
        self._curve = make_interp_spline(time, table[list(robot.joint_names)].to_numpy(), k=5)

    def __call__(self, time: Array) -> tuple[Array, Array, Array]:
        """Return joint coordinates, rates and accelerations, (T, n) each."""
        moves = ((time >= 0.0) & (time <= self.duration))[:, None]
        inside = np.clip(time, 0.0, self.duration)
        q, dq, ddq = (self._curve(inside, k) for k in range(3))
        return q, dq * moves, ddq * moves


def german(recording: plant.Recording, path: Path, seed: int) -> None:
    """Write what the controller logs of a recording."""
    seen = plant.measured(recording, encoder=_ENCODER, force=_NOISE, jitter=_JITTER, seed=seed)
    n = seen.joints.shape[1]
    words = [f"{word} Achse {i}" for word in ("Istlage", "Istmoment") for i in range(1, n + 1)]
    time, degrees = 1e3 * seen.time[LATE:], np.degrees(seen.joints[LATE:])
    percent = 100.0 * seen.forces[:-LATE] / (RATIO * RATED)
    rows = [";".join(["Zeit", *words])]
    for t, q, f in zip(time, degrees, percent, strict=True):
        cells = [f"{t:.3f}", *(f"{v:.6f}" for v in q), *(f"{v:.1f}" for v in f)]
        rows.append(";".join(cells).replace(".", ","))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def typed(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Return what `pteron` with these words does in a folder."""
    command = [sys.executable, "-m", "pteron", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def succeeded(folder: Path, *words: str) -> str:
    """Return what a command prints that must not be refused."""
    done = typed(folder, *words)
    if done.returncode != 0:
        sys.exit(f"pteron {' '.join(words)}\n{done.stderr}")
    return done.stdout


def identified(folder: Path, *options: str) -> tuple[dict[str, Any], int]:
    """Return the numbers of an identification, and how many refusals were answered before."""
    words = "identify log.csv slow.csv --robot robot.toml --held-out cycle.csv --out result --json"
    refusals = 0
    while True:
        told = folder / "log.toml"
        beside = ["--description", "log.toml"] if told.is_file() else []
        done = typed(folder, *words.split(), *beside, *options)
        if done.returncode == 0:
            return json.loads(done.stdout), refusals
        refusals += 1
        _, start, lines = done.stderr.partition("\n[")
        if not start or refusals > 4:
            sys.exit(done.stderr)
        with told.open("a", encoding="utf-8") as file:
            file.write(start + lines)


def truth(robot: pteron.Manipulator, built: pteron.Manipulator) -> dict[str, float]:
    """Return the true values by name."""
    base = pteron.base_parameters(robot)
    found = dict(zip(base.names, base.values(built).tolist(), strict=True))
    kinds = {
        "Fc": FRICTION.coulomb,
        "Fv": FRICTION.viscous,
        "offset": FRICTION.offset,
        "Fs": FRICTION.stribeck,
    }
    return found | {
        f"{kind}{i}": value for kind, values in kinds.items() for i, value in enumerate(values, 1)
    }


def true_model(built: pteron.Manipulator) -> Callable[[Array, Array, Array], Array]:
    """Return what the machine itself needs, as a feed-forward of the joints."""
    rows = zip(*(getattr(FRICTION, name) for name in _FRICTION), strict=True)
    drives = [
        pteron.legs.Drive(
            coulomb=c, viscous=v, offset=o, stribeck=pteron.legs.Stribeck(force, speed)
        )
        for c, v, o, force, speed in rows
    ]
    legs = [replace(leg, drive=drive) for leg, drive in zip(built.legs, drives, strict=True)]
    whole = replace(built, legs=tuple(legs))

    def needed(joints: Array, rates: Array, accelerations: Array) -> Array:
        state = plant.platform_state(whole, joints, rates, accelerations)
        motion = state.pose, state.velocity, state.acceleration
        return np.asarray(pteron.drive_forces(whole, *motion, smooth=True))

    return needed


_FRICTION = ("coulomb", "viscous", "offset", "stribeck", "speeds")


def main() -> None:
    """Go the way, and print what it took and gave."""
    quick = "--quick" in sys.argv[1:]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        # The machine, with its motors, and motions
        succeeded(folder, "new", "delta-4", "--out", "robot.toml")
        robot = pteron.load(folder / "robot.toml")
        rows = zip(robot.legs, RATIO, RATED, *_DRIVES.values(), strict=True)
        legs = [
            replace(
                leg,
                drive=pteron.legs.Drive(ratio=r, rated_torque=t, max_force=force, max_speed=speed),
            )
            for leg, r, t, force, speed in rows
        ]
        robot = replace(robot, legs=tuple(legs))
        pteron.save(robot, folder / "robot.toml")
        succeeded(folder, "check", "robot.toml")
        seconds = "5" if quick else "20"
        motion = "excite robot.toml --stribeck --out motion.csv --acceleration 40 --periods 4"
        succeeded(folder, *motion.split(), "--seconds", seconds)

        # Record
        built = plant.as_built(robot)
        files = {"log": "motion", "slow": "motion-slow", "cycle": "motion-held-out"}
        recordings = {}
        for log, played in files.items():
            reference = Played(folder / f"{played}.csv", robot)
            recordings[log] = plant.simulate(
                built,
                reference,
                FRICTION,
                duration=reference.duration + 1.0,
                settle=0.5,
                drawn=robot,
                compensation=0.0,
            )

        # Identify, and follow the advice once; again with other draws of the noise
        true = truth(robot, built)
        print("draw  refusals  verdict            then               of 35 hold  speeds    delay")
        for draw in range(1 if quick else 4):
            for k, (log, recording) in enumerate(recordings.items()):
                german(recording, folder / f"{log}.csv", seed=3 * draw + k)
            (folder / "log.toml").unlink(missing_ok=True)
            first, refusals = identified(folder)
            advice = " ".join(first["verdict"]["reasons"] + first["verdict"]["next_steps"])
            options = sorted(set(re.findall(r"--(?:delay|stribeck) auto", advice)))
            second, _ = identified(folder, *" ".join(options).split())
            found = second["estimate"]
            low, high = found["intervals_95"]
            held = sum(
                a <= true[name] <= b for name, a, b in zip(found["names"], low, high, strict=True)
            )
            unknown = second["unknowns"]
            off = np.array(unknown["stribeck_speeds"]) / np.array(FRICTION.speeds) - 1.0
            print(
                f"{draw:<6}{refusals:<10}{first['verdict']['grade']:<19}"
                f"{second['verdict']['grade']:<19}{held:<12}{100.0 * np.abs(off).max():.1f} % off"
                f"{1e3 * unknown['delay']:9.3f} ms"
            )
        print(f"Advice of the first run: {', '.join(options)}\n")

        # Export, and run the machine with it
        controller = Controller(robot, folder / "result" / "identification.json", folder)
        placing = Cycles(robot)
        errors = {}
        for name, feed_forward in {
            "nothing": lambda q, dq, ddq: np.zeros_like(q),
            "exported C": controller,
            "true model": true_model(built),
        }.items():
            followed = plant.simulate(
                built,
                placing,
                FRICTION,
                duration=2.0 * (placing.duration + 0.2),
                drawn=robot,
                bandwidth=BANDWIDTH,
                feed_forward=feed_forward,
            )
            behind = followed.joints - placing(followed.time)[0]
            errors[name] = np.sqrt((behind**2).mean(axis=0))
        print("Tracking of a pick-and-place cycle with feedback of 10 Hz, rms error (urad)")
        print(f"{'feed-forward':<14}" + "".join(f"{f'joint {i}':>10}" for i in range(1, 5)))
        for name, size in errors.items():
            print(f"{name:<14}" + "".join(f"{1e6 * one:>10.1f}" for one in size))
        ratio = errors["exported C"] / errors["true model"]
        print(f"Exported C over the true model: {ratio.max():.2f} at most")


if __name__ == "__main__":
    main()
