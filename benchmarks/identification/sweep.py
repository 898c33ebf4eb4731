"""Identification of a machine that is not Pteron's own model, over noise and estimators.

A robot in MuJoCo, its loops closed by constraints, with dry and viscous friction, an encoder's
rounding, noise on the forces and jitter of the sampling, is recorded for 20 s and identified; the
truth is known. Printed, and written to RESULTS.md beside this file: the error of the parameters,
the held-out error over the noise floor on another motion, and how often the stated 95 % intervals
hold the truth, in repetitions with other noise.

It takes about an hour. `--quick` takes three minutes, prints and writes nothing; names of machines
print their rows alone.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
import plant

import pteron
from pteron import atomic
from pteron.identification import (
    Estimate,
    Log,
    Model,
    Observations,
    Preprocessing,
    column_errors,
    halves,
    huber,
    identification_model,
    instrumental,
    maximum_likelihood,
    observations_of,
    ordinary,
    preprocessing_for_log,
    total,
    weighted_least_squares,
)
from pteron.identification.plausibility import usual_sizes
from pteron.identification.prediction import predict
from pteron.identification.recordings import read_recording
from pteron.kernels import Array

matplotlib.use("Agg")

_HERE = Path(__file__).parent
_QUICK = "--quick" in sys.argv


@dataclass(frozen=True)
class Drives:
    """Drives of a machine: friction of its joints, encoders, and speeds.

    Friction is that of the first joint and what each next one has more; at cranks in N m, N m s and
    N m.
    """

    coulomb: tuple[float, float] = (6.0, 1.0)
    viscous: tuple[float, float] = (4.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.3)
    encoder: float = 1e-6
    """m or rad."""
    speed: float = 0.8
    acceleration: float = 8.0
    period: float = 5.0

    def friction(self, n: int) -> plant.Friction:
        """Return the friction of n joints."""
        coulomb, viscous, offset = (
            tuple((first + more * np.arange(n)).tolist())
            for first, more in (self.coulomb, self.viscous, self.offset)
        )
        return plant.Friction(coulomb, viscous, offset)


_TWENTY_BITS = 2.0 * np.pi / 2**20
"""rad: an encoder on the crank's axis, behind the gear."""

# Dry friction is about 15 % of the torques' root mean square.
_DELTA = Drives((4.0, 0.3), (1.0, 0.1), (0.0, 0.1), _TWENTY_BITS, speed=6.0, acceleration=80.0)
_PAR4 = Drives((0.2, 0.02), (0.05, 0.005), (0.0, 0.01), _TWENTY_BITS, 10.0, 120.0, period=4.0)
_STEWART = Drives((500.0, 40.0), (300.0, 30.0), (0.0, 20.0), 1e-6, 1.0, 6.0, period=10.0)
_TABLE = Drives((0.015, 1e-3), (3e-3, 3e-4), (0.0, 1e-3), _TWENTY_BITS, 6.0, 120.0, period=3.0)

MACHINES = {
    "quadrupteron": Drives(),
    "quadrupteron-oblique": Drives(),
    "tripteron": Drives(),
    "delta": _DELTA,
    "par4": _PAR4,
    "stewart": _STEWART,
    "ball-table": _TABLE,
}
if chosen := [name for name in sys.argv[1:] if not name.startswith("-")]:
    MACHINES = {name: MACHINES[name] for name in chosen}
elif _QUICK:
    MACHINES = {name: MACHINES[name] for name in ("quadrupteron",)}

FORCE_NOISE = 0.01
"""Standard deviation, as a share of each force's root mean square."""

NOISE = (
    (1e-7, 0.001),
    (1e-6, FORCE_NOISE),
    (1e-5, 0.01),
    (1e-5, 0.05),
    (5e-5, 0.01),
    (1e-4, 0.01),
    (5e-4, 0.01),
)
JITTER = 1e-5
"""Standard deviation of the sampling times, s; the log has the nominal ones."""

REPETITIONS = 20 if _QUICK else 200
SWEPT = 3 if _QUICK else 10
COMPENSATION = 0.8
"""Share of the friction that the machine's controller knows: the rest shakes it at reversals."""

Estimator = Callable[[Model, Log, Preprocessing, Observations], Estimate]

ESTIMATORS: dict[str, Estimator] = {
    "ordinary": lambda model, log, treatment, equations: ordinary(equations),
    "weighted": lambda model, log, treatment, equations: weighted_least_squares(equations),
    "huber": lambda model, log, treatment, equations: huber(equations),
    "total": lambda model, log, treatment, equations: total(
        equations, column_errors(model, log, treatment)
    ),
    "instrumental": lambda model, log, treatment, equations: instrumental(
        *halves(model, log, treatment), mutual=True
    ),
    "likelihood": lambda model, log, treatment, equations: maximum_likelihood(
        model, log, treatment
    ),
}


@dataclass(frozen=True)
class Bench:
    """A machine as drawn and as built, and what it recorded."""

    drives: Drives
    robot: pteron.Manipulator
    model: Model
    truth: Array
    usual: Array
    fitted: plant.Recording
    other: plant.Recording

    @classmethod
    def of(cls, name: str) -> Bench:
        """Simulate a machine of the catalog."""
        robot = pteron.load(name)
        drives = MACHINES[name]
        built = plant.as_built(robot)
        friction = drives.friction(len(robot.legs))
        fitted, other = (
            plant.simulate(
                built,
                plant.fourier_reference(
                    robot,
                    seed,
                    period=drives.period,
                    speed=drives.speed,
                    acceleration=drives.acceleration,
                ),
                friction,
                duration=duration,
                drawn=robot,
                compensation=COMPENSATION,
            )
            for seed, duration in ((0, 20.0), (7, 10.0))
        )
        model = identification_model(robot)
        terms = np.r_[friction.coulomb, friction.viscous, friction.offset]
        usual = np.r_[
            usual_sizes(model.base, pteron.parameters(robot)),
            np.full(len(terms), np.mean(np.r_[friction.coulomb, friction.viscous])),
        ]
        return cls(
            drives, robot, model, np.r_[model.base.values(built), terms], usual, fitted, other
        )

    def log(self, noise: tuple[float, float], seed: int, *, held_out: bool = False) -> Log:
        """Return what the sensors say."""
        seen = plant.measured(
            self.other if held_out else self.fitted,
            encoder=noise[0],
            force=noise[1],
            jitter=JITTER,
            seed=seed,
        )
        name = "another motion" if held_out else "the motion"
        return Log(name, seen.time, seen.joints, seen.forces)


@dataclass(frozen=True)
class Score:
    """Scores (repetitions, p) or (repetitions,) of an estimator."""

    standard: Array
    """Errors in the stated standard deviations."""
    relative: Array
    """Errors relative to what each parameter is usually made of."""
    regions: Array
    """Whether the joint region at 95 % of all values holds the truth."""
    held_out: Array
    """Largest held-out error over the noise floor, of the first repetitions."""
    held_out_all: Array
    """As `held_out`, with the samples next to a joint's reversal, which are left out of it."""
    left_out: Array
    """Share of these samples."""

    @property
    def coverage(self) -> float:
        """Share of the 95 % intervals that hold the truth."""
        return float((np.abs(self.standard) < 1.959964).mean())

    @property
    def error(self) -> float:
        """Root mean square error of the parameters, percent of what they are made of."""
        return 100.0 * float(np.sqrt((self.relative**2).mean()))


def score(
    bench: Bench, noise: tuple[float, float], names: list[str], repetitions: int
) -> dict[str, Score]:
    """Identify with other noise again and again."""
    errors: dict[str, list[tuple[Array, Array, bool]]] = {name: [] for name in names}
    held: dict[str, list[tuple[float, float, float]]] = {name: [] for name in names}
    for seed in range(repetitions):
        log = bench.log(noise, seed)
        treatment = preprocessing_for_log(bench.robot, log)
        equations = observations_of(bench.model, log, treatment)
        for name in names:
            found = ESTIMATORS[name](bench.model, log, treatment, equations)
            off = found.values - bench.truth
            inside = found.p_value(bench.truth) >= 0.05
            errors[name].append((off / found.deviations, off / bench.usual, inside))
            if seed < 5:
                other = bench.log(noise, 1000 + seed, held_out=True)
                judged = predict(
                    bench.model,
                    found.values,
                    read_recording(other),
                    preprocessing_for_log(bench.robot, other),
                )
                true_floor = noise[1] * np.sqrt((bench.other.forces**2).mean(axis=0))
                held[name].append(
                    (
                        float((judged.error / true_floor).max()),
                        float((judged.error_of_all / true_floor).max()),
                        float(judged.left_out.max()),
                    )
                )
    return {
        name: Score(
            *(np.array(part) for part in zip(*errors[name], strict=True)),
            *np.array(held[name]).T,
        )
        for name in names
    }


def realistic(benches: dict[str, Bench]) -> Iterator[str]:
    """Yield the lines of the table at realistic noise."""
    yield (
        f"Encoders 1 um, on cranks 20 bits a turn (6 urad); force noise 1 %, jitter 10 us, 20 s at "
        f"1 kHz; {REPETITIONS} repetitions, estimator weighted."
    )
    yield ""
    yield (
        "| machine | parameters | 95 % intervals that hold the truth | least and most of a "
        "parameter | 95 % regions of all that hold it | "
        "largest error, first repetition (std) | beyond 3 std | error (%) | "
        "held-out error / noise | left out, next to reversals | with these |"
    )
    yield "| --- " + "| ---: " * 10 + "|"
    for name, bench in benches.items():
        noise = bench.drives.encoder, FORCE_NOISE
        found = score(bench, noise, ["weighted"], REPETITIONS)["weighted"]
        each = (np.abs(found.standard) < 1.959964).mean(axis=0)
        yield (
            f"| {name} | {len(bench.truth)} | {100 * found.coverage:.1f} % | "
            f"{100 * each.min():.0f} to {100 * each.max():.0f} % | "
            f"{100 * found.regions.mean():.0f} % | "
            f"{np.abs(found.standard[0]).max():.2f} | "
            f"{100 * (np.abs(found.standard) > 3.0).mean():.2f} % | {found.error:.2f} | "
            f"{found.held_out.max():.3f} | {100 * found.left_out.max():.0f} % | "
            f"{found.held_out_all.max():.2f} |"
        )


def swept(benches: dict[str, Bench]) -> tuple[list[str], dict[str, list[Score]]]:
    """Return the lines of the table over noise, and the scores, for the first machine."""
    name, bench = next(iter(benches.items()))
    lines = [
        f"{name}, {SWEPT} repetitions. Each cell: error of the parameters (% of what they are made "
        "of) / intervals that hold the truth / regions that do / held-out error over the noise.",
        "",
        "| encoder (um) | force noise | " + " | ".join(ESTIMATORS) + " |",
        "| ---: | ---: | " + " | ".join("---:" for _ in ESTIMATORS) + " |",
    ]
    scores: dict[str, list[Score]] = {estimator: [] for estimator in ESTIMATORS}
    for noise in NOISE:
        found = score(bench, noise, list(ESTIMATORS), SWEPT)
        cells = []
        for estimator, one in found.items():
            scores[estimator].append(one)
            cells.append(
                f"{one.error:.3g} / {100 * one.coverage:.0f} % / {100 * one.regions.mean():.0f} % "
                f"/ {one.held_out.max():.2f}"
            )
        lines.append(f"| {1e6 * noise[0]:g} | {100 * noise[1]:g} % | " + " | ".join(cells) + " |")
        print(lines[-1], file=sys.stderr, flush=True)
    return lines, scores


def picture(scores: dict[str, list[Score]], path: Path) -> None:
    """Draw error and coverage over noise."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    labels = [f"{1e6 * e:g} um\n{100 * f:g} %" for e, f in NOISE]
    at = np.arange(len(NOISE))
    for estimator, found in scores.items():
        left.semilogy(at, [one.error for one in found], "o-", label=estimator)
        right.plot(at, [100 * one.coverage for one in found], "o-", label=estimator)
    left.set_ylabel("parameter error (% of their usual size)")
    right.axhspan(90.0, 98.0, color="0.9")
    right.set_ylabel("95 % intervals that hold the truth (%)")
    for axes in (left, right):
        axes.set_xticks(at, labels, fontsize=8)
        axes.set_xlabel("encoder, force noise")
        axes.grid(alpha=0.3)
    left.legend(fontsize=8)
    figure.savefig(path)


def main() -> None:
    """Run the benchmark."""
    begun = time.perf_counter()
    benches = {name: Bench.of(name) for name in MACHINES}
    print("simulated", round(time.perf_counter() - begun), "s", file=sys.stderr, flush=True)
    lines = ["# Identification of a simulated machine\n"]
    lines += [
        "Written by `python benchmarks/identification/sweep.py`. The machine is simulated in "
        "MuJoCo with its loops closed by constraints (`plant`, checked by `check.py`), with dry "
        "and viscous friction; its inertia differs by up to 20 % from the model that the "
        f"controller has, which knows {100 * COMPENSATION:.0f} % of the friction.\n",
        "## Realistic noise\n",
    ]
    for line in realistic(benches):
        lines.append(line)
        print(line, flush=True)
    if chosen:
        return
    table, scores = swept(benches)
    lines += ["\n## Over noise and estimators\n", *table, "\n![Error and coverage](sweep.svg)\n"]
    print("\n".join(table))
    print(f"{time.perf_counter() - begun:.0f} s", file=sys.stderr)
    if not _QUICK:
        picture(scores, _HERE / "sweep.svg")
        print(atomic.write_text(_HERE / "RESULTS.md", "\n".join(lines) + "\n"))


if __name__ == "__main__":
    main()
