"""Machines with faults and what is measured of them, simulated in NumPy alone.

Every machine is a body on six rods: of a Delta's parallelograms both rods are there, so that rods
that differ tilt the body. The equations are these: |place of the rod's end on the body - place of
its other end| = its length; Newton's method with differences solves them. Nothing of the library's
mathematics is used, only its file of the machine as drawn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import pteron
from pteron.calibration import Measurements, Setup

BAR = 0.05
"""Distance of parallel rods, m."""

NOISE = 2e-5
"""m and rad."""


def turned(rotation):
    """Return the matrices (N, 3, 3) of rotation vectors (N, 3)."""
    angle = np.linalg.norm(rotation, axis=1)[:, None, None]
    x, y, z = rotation.T
    zero = np.zeros_like(x)
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    safe = np.where(angle > 1e-12, angle, 1.0)
    first = np.where(angle > 1e-12, np.sin(angle) / safe, 1.0)
    second = np.where(angle > 1e-12, (1.0 - np.cos(angle)) / safe**2, 0.5)
    return np.eye(3) + first * skew + second * skew @ skew


@dataclass
class Plant:
    """A body on six rods: numbers as built, m and rad."""

    kind: str
    """"slides", "cranks" or "rams"."""
    base: np.ndarray
    """(n, 3): of guides at 0, crank axes or rams' base joints."""
    drive: np.ndarray
    """(n, 3): of guides; the cranks' axes."""
    pointing: np.ndarray
    """(n, 3): where a crank points at 0."""
    cranks: np.ndarray
    bars: np.ndarray
    """(n, 3): unit vectors along the bars of parallel rods."""
    body: np.ndarray
    """(n, 3): ends of rods, or middles of their bars, on the body."""
    rods: np.ndarray
    """(n, 2): both rods' lengths."""
    tool: np.ndarray

    @property
    def paired(self):
        return self.kind != "rams"

    def ends(self, joints):
        """Return the upper ends (N, r, 3) and lengths (N, r) of all rods at joint coordinates."""
        if self.kind == "rams":
            return np.broadcast_to(self.base, (len(joints), *self.base.shape)), joints
        if self.kind == "slides":
            tips = self.base + joints[..., None] * self.drive
        else:
            across = np.cross(self.drive, self.pointing)
            q = joints[..., None]
            way = np.cos(q) * self.pointing + np.sin(q) * across
            tips = self.base + self.cranks[:, None] * way
        both = np.concatenate([tips + 0.5 * BAR * self.bars, tips - 0.5 * BAR * self.bars], axis=1)
        return both, np.broadcast_to(self.rods.T.ravel(), both.shape[:2])

    def points(self):
        """Return the lower ends (r, 3) of all rods, on the body."""
        if self.kind == "rams":
            return self.body
        half = 0.5 * BAR * self.bars
        return np.concatenate([self.body + half, self.body - half])

    def poses(self, joints, start):
        """Return places (N, 3) and matrices (N, 3, 3) of the body, from starts (N, 6)."""
        ends, lengths = self.ends(joints)
        at, points = np.array(start, dtype=float), self.points()

        def missed(x):
            where = x[:, None, :3] + points @ np.swapaxes(turned(x[:, 3:]), -1, -2)
            return np.linalg.norm(where - ends, axis=-1) - lengths

        for _ in range(30):
            now = missed(at)
            slopes = np.empty((*now.shape, 6))
            for k in range(6):
                step = np.zeros(6)
                step[k] = 1e-7
                slopes[..., k] = (missed(at + step) - missed(at - step)) / 2e-7
            change = np.linalg.solve(slopes, -now[..., None])[..., 0]
            at += np.clip(change, -0.05, 0.05)
            if np.abs(change).max() < 1e-12:
                break
        assert np.abs(missed(at)).max() < 1e-10
        return at[:, :3], turned(at[:, 3:])

    def tools(self, joints, start):
        """Return the tool's places (N, 3)."""
        place, matrix = self.poses(joints, start)
        return place + matrix @ self.tool


def drawn(robot):
    """Return the plant of a machine as its file draws it."""
    legs = robot.legs
    kind = {"PSS": "slides", "RSS": "cranks", "UPS": "rams"}[type(legs[0]).__name__]
    every = np.array([leg.guide_point for leg in legs])
    zero = np.zeros_like(every)
    axes = {"slides": "slider_direction", "cranks": "direction"}.get(kind)
    drive = np.array([getattr(leg, axes) for leg in legs]) if axes else zero
    bars = drive
    if kind == "slides":
        bars = np.array([leg.bar_direction for leg in legs])
    cranked = kind == "cranks"
    return Plant(
        kind,
        every,
        drive,
        np.array([leg.zero_direction for leg in legs]) if cranked else zero,
        np.array([leg.upper_length for leg in legs]) if cranked else np.zeros(len(legs)),
        bars,
        np.array([leg.platform_point for leg in legs]),
        np.array([[leg.lower_length] * 2 for leg in legs]) if kind != "rams" else np.empty((0, 2)),
        np.array(robot.platform.tool or (0.0, 0.0, 0.0)),
    )


def built(robot, rng, share=0.3):
    """Return the plant as built, off by a share of ordinary tolerances, and its zeros (n,)."""
    plant = drawn(robot)

    def off(size, shape):
        return share * size * rng.standard_normal(shape)

    shape = plant.base.shape
    drive, pointing = plant.drive, plant.pointing
    if plant.kind != "rams":
        turn = off(0.0035, shape)
        drive = drive + np.cross(turn, drive)
        pointing = pointing + np.cross(turn, pointing)
        drive = drive / np.linalg.norm(drive, axis=1)[:, None]
        size = np.linalg.norm(pointing, axis=1)[:, None]
        pointing = pointing / np.where(size > 0.0, size, 1.0)
    rods = plant.rods + off(1e-3, (len(plant.rods), 1))
    cranks = plant.cranks + (off(1e-3, shape[0]) if plant.kind == "cranks" else 0.0)
    made = replace(
        plant,
        base=plant.base + off(1e-3, shape),
        body=plant.body + off(1e-3, shape),
        drive=drive,
        pointing=pointing,
        rods=rods,
        cranks=cranks,
    )
    zeros = off(8.7e-3 if plant.kind == "cranks" else 2e-3, shape[0])
    return made, zeros


def wide_printer():
    """Return a printer of other dimensions than the catalog's: radius 141 mm, rods of 291 mm."""
    base, legs = pteron.load("linear-delta"), []
    for angle, leg in zip(np.radians([210.0, 330.0, 90.0]), base.legs, strict=True):
        x, y = np.cos(angle), np.sin(angle)
        legs.append(
            replace(
                leg,
                guide_point=(0.141 * x, 0.141 * y, 0.0),
                platform_point=(0.027 * x, 0.027 * y, 0.0),
                bar_direction=(-y, x, 0.0),
                lower_length=0.291,
                limits=(0.05, 0.9),
            )
        )
    return replace(base, name="wide-printer", legs=tuple(legs))


def small_delta():
    """Return a Delta of other dimensions than the catalog's: cranks of 210 mm, rods of 520 mm."""
    base, legs = pteron.load("delta"), []
    for angle, leg in zip(np.radians([30.0, 150.0, 270.0]), base.legs, strict=True):
        x, y = np.cos(angle), np.sin(angle)
        legs.append(
            replace(
                leg,
                guide_point=(0.17 * x, 0.17 * y, 0.0),
                direction=(y, -x, 0.0),
                zero_direction=(x, y, 0.0),
                platform_point=(0.05 * x, 0.05 * y, 0.0),
                upper_length=0.21,
                lower_length=0.52,
                limits=(-1.4, 1.0),
            )
        )
    return replace(base, name="small-delta", legs=tuple(legs))


MACHINES = {"wide-printer": wide_printer, "small-delta": small_delta}
"""Machines beside those of the catalog."""

BOXES = {
    "linear-delta": ((-0.055, -0.055, 0.0), (0.055, 0.055, 0.08)),
    "wide-printer": ((-0.08, -0.08, 0.0), (0.08, 0.08, 0.1)),
    "delta": ((-0.25, -0.25, -0.15), (0.25, 0.25, 0.05)),
    "small-delta": ((-0.12, -0.12, -0.06), (0.12, 0.12, 0.06)),
}
"""Corners of what is measured; of machines that are no printers about home."""

PRINTERS = ("linear-delta", "wide-printer")

CASES = {
    "printer by heights": ("linear-delta", "heights"),
    "printer by positions": ("linear-delta", "positions"),
    "cranks by positions": ("delta", "positions"),
    "cranks by heights": ("delta", "heights"),
    "rams by poses": ("stewart", "poses"),
    "wide printer by distances": ("wide-printer", "distances"),
    "small cranks by positions": ("small-delta", "positions"),
}

FAULTS = (
    "none",
    "reversed",
    "one reversed",
    "swapped",
    "half the lead",
    "other pulleys",
    "all pulleys",
    "millimetres",
    "inches or degrees",
    "shifted rows",
    "row 195 mm off",
    "beyond the reach",
    "slipped zero",
    "unequal rods",
    "zero off",
)

WORDS = {
    "reversed": ("of all joints are reversed",),
    "one reversed": ("of joint 2 (",),
    "swapped": ("legs 1 and 2 (", "nor the order of the legs"),
    "half the lead": ("are half as large",),
    "other pulleys": ("joint 2 (rho2) are 1.25 times", "joint 2 (theta2) are 1.25 times"),
    "all pulleys": ("all joints are 1.25 times",),
    "millimetres": ("in millimetres",),
    "inches or degrees": ("in inches", "in degrees"),
    "shifted rows": ("stands a row before its readings",),
    "row 195 mm off": ("row 18 ",),
    "beyond the reach": ("row 18 ",),
    "slipped zero": ("The zero of joint 2 (rho2) slipped", "The zero of joint 2 (theta2) slipped"),
    "unequal rods": ("parallel rods of leg 2", "nor rods of one pair that differ"),
    "zero off": ("zero of joint 2 (",),
}
"""Words of which one names the cause, in the first sentence or the first finding."""


@dataclass
class Trial:
    """Measurements with a fault, and the errors of the tool at poses that are held back."""

    given: Measurements
    robot: pteron.Manipulator
    plant: Plant
    zeros: np.ndarray
    desired: np.ndarray
    """(K, m): poses at which the calibrated machine is tried."""

    def errors(self, calibrated):
        """Return the errors (3,), root mean square, of a calibrated machine's tool, by coordinate.

        It is driven to the desired poses by its own inverse kinematics; the plant goes elsewhere.
        """
        joints = pteron.inverse_kinematics(calibrated, self.desired, on_failure="nan")
        for i, leg in enumerate(calibrated.legs):
            if leg.reading is not None:
                joints[:, i] = (joints[:, i] - leg.reading.zero) / leg.reading.scale
        good = np.isfinite(joints).all(axis=1)
        place, axes = calibrated.platform.placement(self.desired[good])
        tool = np.array(calibrated.platform.tool or (0.0, 0.0, 0.0))
        asked = place + np.einsum("i,nij->nj", tool, axes)
        gone = self.plant.tools(joints[good] + self.zeros, starts(self.robot, self.desired[good]))
        return np.sqrt(np.mean((gone - asked) ** 2, axis=0))


def starts(robot, poses):
    """Return six coordinates (N, 6) of the body near poses."""
    place, axes = robot.platform.placement(poses)
    matrices = np.swapaxes(axes, -1, -2)
    # Rotation vectors, by the antisymmetric part: turns are well below a right angle.
    parts = 0.5 * (matrices - np.swapaxes(matrices, -1, -2))
    vector = np.stack([parts[:, 2, 1], parts[:, 0, 2], parts[:, 1, 0]], axis=-1)
    sine = np.linalg.norm(vector, axis=1)[:, None]
    angle = np.arcsin(np.clip(sine, 0.0, 1.0))
    return np.hstack(
        [place, vector * np.where(sine > 1e-12, angle / np.where(sine > 0, sine, 1), 1)]
    )


def workspace(robot, rng, count, level=None):
    """Return poses about the middle of the work space: of a printer those over its bed."""
    home = np.array(pteron.workspace.home_pose(robot))
    if robot.name in BOXES:
        low, high = map(np.array, BOXES[robot.name])
        if robot.name not in PRINTERS:
            low, high = home + low, home + high
    else:
        size = 0.1 * max(leg.limits[1] for leg in robot.legs)
        half = np.repeat([size, 0.15], 3)
        low, high = home - half, home + half
    poses = rng.uniform(low, high, (count, len(home)))
    if level is not None:
        poses[:, 2] = level
    return poses


def trial(case, fault, seed=0, count=60):
    """Return a trial of a case with a fault; None where the machine cannot have it."""
    name, measure = CASES[case]
    robot = MACHINES[name]() if name in MACHINES else pteron.load(name)
    rng = np.random.default_rng(seed)
    plant, zeros = built(robot, rng)
    if fault == "shifted rows" and measure == "distances":
        return None
    if fault == "unequal rods":
        if not plant.paired:
            return None
        rods = plant.rods.copy()
        rods[1] += [1e-3, -1e-3]
        plant = replace(plant, rods=rods)
    heights = measure == "heights"
    level = 0.0 if name in PRINTERS else float(pteron.workspace.home_pose(robot)[2])
    poses = workspace(robot, rng, count, level if heights else None)
    desired = workspace(robot, rng, 80, level if heights else None)
    readings = pteron.inverse_kinematics(robot, poses)  # as the controller of the drawn machine
    place, matrices = plant.poses(readings + zeros, starts(robot, poses))
    tool = place + matrices @ plant.tool
    tool = tool + NOISE * rng.standard_normal(tool.shape)
    measured = {}
    if heights:
        measured["heights"] = tool[:, 2] - level
    elif measure == "distances":
        measured["distances"] = np.linalg.norm(tool - tool[origins_of(count)], axis=1)
    else:
        measured["positions"] = tool
    if measure == "poses":
        measured["poses"] = angles_of(robot, poses, matrices, rng)
    readings, measured, zeros = spoil(fault, robot, readings, measured, zeros, count)
    distances = measured.pop("distances", None)
    plane = {"": pteron.calibration.ReferencePlane(offset=level)} if heights else {}
    given = Measurements.from_readings(robot, readings, setup=Setup(planes=plane), **measured)
    if distances is not None:
        given = replace(given, distances=distances, origins=origins_of(count))
    return Trial(given, robot, plant, zeros, desired)


def origins_of(count):
    """Return the rows (N,) from which distances are measured, none its own: each is used once."""
    return np.roll(np.arange(count), 23)


def angles_of(robot, poses, matrices, rng):
    """Return poses (N, 6) with the angles of matrices, by Newton's steps on the platform's own."""
    found = poses.copy()
    for _ in range(20):
        axes = np.swapaxes(robot.platform.placement(found)[1], -1, -2)
        off = matrices @ np.swapaxes(axes, -1, -2)
        vector = 0.5 * np.stack(
            [off[:, 2, 1] - off[:, 1, 2], off[:, 0, 2] - off[:, 2, 0], off[:, 1, 0] - off[:, 0, 1]],
            axis=-1,
        )
        slopes = np.empty((len(found), 3, 3))
        for k in range(3):
            step = np.zeros(6)
            step[3 + k] = 1e-6
            ahead = np.swapaxes(robot.platform.placement(found + step)[1], -1, -2)
            rate = (ahead - axes) / 1e-6 @ np.swapaxes(axes, -1, -2)
            slopes[:, :, k] = np.stack([rate[:, 2, 1], rate[:, 0, 2], rate[:, 1, 0]], axis=-1)
        found[:, 3:] += np.linalg.solve(slopes, vector[..., None])[..., 0]
    found[:, 3:] += NOISE * rng.standard_normal((len(found), 3))
    return found


def spoil(fault, robot, readings, measured, zeros, count):
    """Return readings, what is measured and the true zeros of a log with a fault."""
    readings, measured = readings.copy(), {k: v.copy() for k, v in measured.items()}
    linear = robot.legs[0].joint.unit == "m"
    key = next(iter(measured))
    if fault == "reversed":
        readings *= -1.0
    elif fault == "one reversed":
        readings[:, 1] *= -1.0
    elif fault == "swapped":
        readings[:, [0, 1]] = readings[:, [1, 0]]
    elif fault == "half the lead":
        readings[:, 1] *= 0.5
    elif fault == "other pulleys":
        readings[:, 1] *= 1.25
    elif fault == "all pulleys":
        readings *= 1.25
    elif fault == "millimetres":
        for name in ("positions", "heights", "distances"):
            if name in measured:
                measured[name] *= 1e3
        if linear:
            readings *= 1e3
    elif fault == "inches or degrees":
        readings = readings / 25.4e-3 if linear else np.degrees(readings)
    elif fault == "shifted rows":
        measured = {name: np.roll(values, -1, axis=0) for name, values in measured.items()}
    elif fault == "row 195 mm off":
        measured[key][17] -= 0.195
    elif fault == "beyond the reach":
        readings[17, 0] += 3.0 * robot.legs[0].size if linear else 3.0
    elif fault == "slipped zero":
        readings[35:, 1] += 1.5e-3 if linear else 6e-3
    elif fault == "zero off":
        shift = 0.03 if linear else 0.1
        readings[:, 1] -= shift
        zeros = zeros.copy()
        zeros[1] += shift
    return readings, measured, zeros
