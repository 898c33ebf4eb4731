"""Calibration on twins whose truth is known: recovery, intervals, heights alone, and a trap.

    python benchmarks/calibration.py [REPETITIONS | --quick] [heights]

Each machine is drawn off its drawing by ordinary tolerances (points and lengths 1 mm, directions
0.2 degrees, zeros 2 mm or 0.5 degrees), measured at 60 poses with noise of 20 um and 20 urad, and
calibrated; then compared with the truth at 200 poses held back. Readings of machines with more legs
than coordinates have noise of 10 um and 10 urad.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2  # type: ignore[import-untyped]

import pteron
from pteron.calibration import Measurements, ReferencePlane, Setup, calibrate, plan
from pteron.calibration.fit import Fitter
from pteron.calibration.guess import Guess
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.unknowns import blocks_of

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from calibrated import printer

MACHINES = (
    *("quadrupteron", "quadrupteron-oblique", "tripteron", "delta", "linear-delta", "orthoglide"),
    *("par4", "five-bar", "3-rrr", "stewart", "hexa", "ball-table", "3-rrr-point"),
    "delta-redundant",
)
FREE = ["lengths", "points", "directions", "zeros"]
NOISE, READINGS_NOISE = 20e-6, 10e-6
POSES, HELD = 60, 200


class Twin:
    """A machine off its drawing, its blocks, and poses that both reach."""

    def __init__(self, name: str, seed: int, count: int) -> None:
        self.robot = robot = pteron.load(name)
        self.rng = np.random.default_rng(seed)
        empty = Measurements.from_readings(robot, np.zeros((1, len(robot.legs))))
        self.blocks = blocks_of(robot, empty, FREE)
        tolerances = np.array([u.tolerance for block in self.blocks for u in block.unknowns])
        self.steps = tolerances * self.rng.standard_normal(len(tolerances))
        self.drawn = Guess.drawn(robot, empty)
        self.truth = self.drawn.apply_step(self.blocks, self.steps)
        slopes = MachineSlopes(robot, self.blocks)
        poses = pteron.random_poses(robot, 3 * count, seed=seed)
        joints = pteron.inverse_kinematics(self.truth.robot, poses, on_failure="nan")
        readings = joints - self.truth.zeros
        there = slopes.poses(self.drawn, self.drawn.joints(readings), poses)
        good = np.isfinite(joints).all(axis=1) & (np.abs(there - poses).max(axis=1) < 0.5)
        self.poses, self.readings = poses[good][:count], readings[good][:count]

    def measured(self, part: slice) -> Measurements:
        """Return the measurements of some rows: whole poses with noise."""
        robot, poses = self.robot, self.poses[part]
        place, axes = self.truth.robot.platform.placement(poses)
        tool = place + np.einsum("nij,i->nj", axes, self.truth.marks[""])
        seen = [name in robot.coordinates for name in "xyz"]
        lengths = int((~robot.platform.angular).sum())
        if lengths not in (0, 3):
            tool = tool @ np.array(robot.platform.frame).T
        tool = np.where(seen, tool, np.nan) + NOISE * self.rng.standard_normal(tool.shape)
        readings, noise = self.readings[part], {"position": NOISE, "angle": NOISE}
        if robot.redundancy:  # without noise they would contradict each other exactly
            noise["readings"] = READINGS_NOISE
            readings = readings + READINGS_NOISE * self.rng.standard_normal(readings.shape)
        given = Measurements.from_readings(robot, readings, poses=poses, positions=tool)
        noisy = given.angles + NOISE * self.rng.standard_normal(given.angles.shape)
        return replace(given, angles=noisy, setup=Setup(noise=noise))


def recovery(name: str, repetitions: int) -> tuple[Any, ...]:
    """Return ratio of the greatest errors, cover, joint cover and CPU time of one machine."""
    ratios, inside, joint, region, spent = [], [], [], [], 0.0
    for seed in range(repetitions):
        twin = Twin(name, seed, POSES + HELD)
        given = twin.measured(slice(0, POSES))
        begin = time.process_time()
        fitter = Fitter(given, twin.blocks, twin.drawn, twin.poses[:POSES])
        fit = fitter.run()
        spent += time.process_time() - begin
        held, readings = twin.poses[POSES:], twin.readings[POSES:]
        slopes = fitter.slopes
        before = slopes.poses(twin.drawn, twin.drawn.joints(readings), held) - held
        after = slopes.poses(fit.guess, fit.guess.joints(readings), held) - held
        ratios.append(np.nanmax(np.abs(before)) / np.nanmax(np.abs(after)))
        off = fit.total - twin.steps
        inside.append(np.abs(off) < 1.959964 * np.sqrt(np.diag(fit.covariance)))
        misfit = fitter.cost(twin.truth, twin.steps, fit) - fitter.cost(fit.guess, fit.total, fit)
        joint.append(misfit < chi2.ppf(0.95, len(off)))
        region.append(off @ np.linalg.solve(fit.covariance, off) < chi2.ppf(0.95, len(off)))
    return min(ratios), np.mean(inside), np.mean(joint), np.mean(region), spent / repetitions


def heights(name: str, repetitions: int) -> tuple[Any, ...]:
    """Return what 30 heights over a bed, at planned places, make of a Delta."""
    robot = pteron.load(name)
    places = plan(robot, 30, "heights", seed=1)
    low, high = places.region.box
    level = places.poses[0, 2]
    bed = np.random.default_rng(7).uniform(low, high, (300, 3))
    bed[:, 2] = level
    poses = np.concatenate([places.poses, bed])
    held, far, farther, values, sideways = [], 0, 0, 0, []
    for seed in range(repetitions):
        twin = Twin(name, seed, 1)
        slopes = MachineSlopes(robot, twin.blocks)
        readings = slopes.joints(twin.truth, poses) - twin.truth.zeros
        tool = twin.truth.marks[""][2]
        seen = NOISE * twin.rng.standard_normal(len(poses))
        setup = Setup(noise={"height": NOISE}, planes={"": ReferencePlane(offset=level + tool)})
        given = Measurements.from_readings(robot, readings[:30], heights=seen[:30], setup=setup)
        fitter = Fitter(given, twin.blocks, Guess.drawn(robot, given), poses[:30])
        fit = fitter.run()
        found = slopes.poses(fit.guess, fit.guess.joints(readings[30:]), poses[30:])
        held.append(np.sqrt(np.mean((found[:, 2] - level - seen[30:]) ** 2)) / NOISE)
        unknowns = [u for block in twin.blocks for u in block.unknowns]
        lengths = [u.unit == "m" for u in unknowns]
        off = np.abs(fit.total - twin.steps) / np.sqrt(np.diag(fit.covariance))
        far, farther = far + (off[lengths] > 3).sum(), farther + (off[lengths] > 5).sum()
        values += sum(lengths)
        others = Measurements.from_readings(robot, readings[30:])
        moved = slopes.pose_slopes(fit.guess, others, found)[0][:, :2]
        spread = np.sqrt(np.einsum("nip,pq,niq->ni", moved, fit.covariance, moved, optimize=True))
        sideways.append(np.abs(found - poses[30:])[:, :2] < 1.959964 * spread)
    return np.sqrt(np.mean(np.square(held))), max(held), far / values, farther, np.mean(sideways)


def trap(seed: int) -> list[tuple[float, float]]:
    """Return rods' greatest error and the heights' rms, mm: by nine free factors, and by all.

    A bed that is uneven by 0.1 mm is probed at 16 places. The nine have no tolerance, all have.
    """
    rng = np.random.default_rng(seed)
    rings = ((0.0425, 6), (0.085, 9))
    angles = [(r, 2.0 * np.pi * k / count) for r, count in rings for k in range(count)]
    places = [(0.0, 0.0), *((r * np.cos(t), r * np.sin(t)) for r, t in angles)]
    poses = np.column_stack([places, 1e-4 * rng.standard_normal(len(places))])
    joints = pteron.inverse_kinematics(printer(0.1442, 0.2881), poses)
    robot = printer(0.1447, 0.2878)
    given = Measurements.from_readings(
        robot, joints + np.array([3e-4, -2e-4, 1e-4]), heights=np.zeros(len(poses))
    )
    nine = ["zeros", "lengths", "radius", "legs[1].angle", "legs[2].angle"]
    loose = dict.fromkeys(("zeros", "lengths", "radius", "angles"), 10.0)
    found = []
    for free, prior in ((nine, loose), (None, None)):
        result = calibrate(robot, given, free=free, prior=prior)
        rods = np.array([leg.metres["lower_length"][0] for leg in result.fit.guess.robot.legs])
        heights = result.fit.residuals[:, 3]
        found.append((1e3 * np.abs(rods - 0.2881).max(), 1e3 * np.sqrt(np.mean(heights**2))))
    return found


if __name__ == "__main__":
    quick = "--quick" in sys.argv
    repetitions = 2 if quick else int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for seed in range(1 if quick else 6):
        (nine, fell), (own, left) = trap(seed)
        print(
            f"trap {seed}: nine free, rods off by {nine:.1f} mm, heights {fell:.3f} mm rms; with"
            f" tolerances {own:.2f} mm, {left:.3f} mm rms",
            flush=True,
        )
    for name in ("delta", "linear-delta"):
        held, worst, far, farther, sideways = heights(name, repetitions)
        print(
            f"{name} by 30 heights: held out {held:.3f} (most {worst:.3f}) times the noise; "
            f"lengths over 3 deviations off {100 * far:.2f} %, over 5: {farther}; "
            f"x and y within 95 %: {100 * sideways:.1f} %",
            flush=True,
        )
    print(f"{'machine':22}{'error falls':>13}{'cover':>8}{'joint':>8}{'linear':>8}{'CPU s':>8}")
    covers = []
    for name in MACHINES[: 2 if quick else None] if "heights" not in sys.argv else ():
        ratio, cover, joint, region, spent = recovery(name, repetitions)
        covers.append(cover)
        shares = "".join(f"{100 * share:7.1f}%" for share in (cover, joint, region))
        print(
            f"{name:22}{ratio:12.0f}x{shares}{spent:8.2f}",
            flush=True,
        )
    if covers:
        print(f"pooled cover {100 * np.mean(covers):.2f} %")
