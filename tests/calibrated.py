"""Machines that differ from their drawing, printers, and what is measured of them."""

import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

import pteron
from pteron.calibration import Measurements, Setup
from pteron.calibration.guess import Guess
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.unknowns import blocks_of

PRINTERS = json.loads((Path(__file__).parent / "data" / "printers.json").read_text())
"""Steps at which real printers' probes touched, and what Klipper made of them."""

GEOMETRY = ("lengths", "points", "directions", "zeros")
NOISE = 20e-6


def printer(radius, arm, angles=(210.0, 330.0, 90.0)):
    """Return a linear Delta with upright towers at a radius, m, and angles, degrees."""
    base, legs = pteron.load("linear-delta"), []
    for angle, leg in zip(np.radians(angles), base.legs, strict=True):
        x, y = np.cos(angle), np.sin(angle)
        changes = {
            "guide_point": (radius * x, radius * y, 0.0),
            "slider_direction": (0.0, 0.0, 1.0),
            "bar_direction": (-y, x, 0.0),
            "platform_point": (0.0, 0.0, 0.0),
        }
        legs.append(replace(leg, lower_length=arm, elbow=-1, limits=None, **changes))
    platform = replace(base.platform, tool=(0.0, 0.0, 0.0))
    return replace(base, name="printer", legs=tuple(legs), platform=platform)


def tool_places(robot, poses, tool):
    """Return the tool (N, 3) as logs count it; NaN where the pose has no such coordinate."""
    place, axes = robot.platform.placement(poses)
    point = place + np.einsum("nij,i->nj", axes, tool)
    if int((~robot.platform.angular).sum()) not in (0, 3):
        point = point @ np.array(robot.platform.frame).T
        point[:, [name not in robot.coordinates for name in "xyz"]] = np.nan
    return point


@lru_cache(maxsize=32)
def off_drawing(robot, seed=0, count=60):
    """Return a machine off its drawing by tolerances: truth, steps, poses and readings."""
    rng = np.random.default_rng(seed)
    empty = Measurements.from_readings(robot, np.zeros((1, len(robot.legs))))
    blocks = blocks_of(robot, empty, GEOMETRY)
    tolerances = np.array([u.tolerance for block in blocks for u in block.unknowns])
    steps = tolerances * rng.standard_normal(len(tolerances))
    drawn = Guess.drawn(robot, empty)
    truth = drawn.apply_step(blocks, steps)
    poses = pteron.random_poses(robot, 3 * count, seed=seed)
    joints = pteron.inverse_kinematics(truth.robot, poses, on_failure="nan")
    slopes = MachineSlopes(robot, blocks)
    there = slopes.poses(drawn, drawn.joints(joints - truth.zeros), poses)
    good = np.isfinite(joints).all(axis=1) & (np.abs(there - poses).max(axis=1) < 0.5)
    return truth, steps, poses[good][:count], (joints - truth.zeros)[good][:count]


def measured(robot, seed=0, count=60, told=True):
    """Return measurements of whole poses of that machine, with noise."""
    truth, _, poses, readings = off_drawing(robot, seed, count)
    rng = np.random.default_rng(seed + 1000)
    places = tool_places(truth.robot, poses, truth.marks[""])
    angles = poses + NOISE * rng.standard_normal(poses.shape)
    noise = {"position": NOISE, "angle": NOISE} if told else {}
    places = places + NOISE * rng.standard_normal(places.shape)
    return Measurements.from_readings(
        robot, readings, poses=angles, positions=places, setup=Setup(noise=noise)
    )
