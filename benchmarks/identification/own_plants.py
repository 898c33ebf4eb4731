"""Plants with equations of their own, twenty faults each, and what `identify` says of their logs.

Each plant is a set of point masses: uniform rods are three of them, plates four. Positions follow
from the pose by closed forms written here. Forces are those of d'Alembert's principle,
F = J^-T sum m (dp/dx)' (p'' - g), slopes by complex steps: nothing of Pteron's equations is used.

One fault is put into a log, or into the machine's file; the log is identified with another motion
held out, and the model's forces are compared with the plant's on a third motion. Printed are
grades, the first two causes, that error, and the same after following the advice.

    python benchmarks/identification/own_plants.py [--seeds 1] [--first 1] [PLANT ...]
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline  # type: ignore[import-untyped]

import pteron
from pteron.identification import (
    Identification,
    Log,
    LogError,
    Processing,
    States,
    Terms,
    identify,
)
from pteron.kernels import Array
from pteron.legs import Drive

_PERIODS = 2
_COMPLEX = 1e-30
_STEP = 1e-3


Place = Callable[[Any], tuple[Any, Any, Any]]
"""Returns joints, points and directions of poses, real or complex."""


@dataclass(frozen=True)
class Conditions:
    """How a plant moves and is recorded, and how large its faults are.

    Attributes
    ----------
    rate : float
        Samples per second.
    period : float
        Of the motions, s.
    noise : float
        Standard deviation of the forces' noise, over each force's own.
    begin : float
        The log's first time stamp, s.
    motion : float
        Size of the motions, over the plant's usual one.
    fault : float
        Size of the faults, over their usual one.
    """

    rate: float = 500.0
    period: float = 4.0
    noise: float = 0.01
    begin: float = 0.0
    motion: float = 1.0
    fault: float = 1.0


@dataclass(frozen=True)
class Plant:
    """A machine as it was built: its drawn twin, the masses, and positions by its pose.

    Attributes
    ----------
    drawn : Manipulator
        The same machine as Pteron knows it, with the masses of its drawing.
    home, size : array, shape (m,)
        The middle of its motions, and their size.
    place : callable
        Returns joint coordinates (T, n), points (T, k, 3) and rods' directions (T, r, 3) of poses.
    masses : array, shape (k,)
        Of the points, kg.
    gravity : array, shape (3,)
        m/s^2.
    rotor : float
        Inertia of each motor at the joint.
    dry, viscous : float
        Friction of the drives.
    encoder : float
        Resolution of the joints' coordinates.
    conditions : Conditions
        Of its motions and logs.
    """

    name: str
    drawn: pteron.Manipulator
    home: Array
    size: Array
    place: Place
    masses: Array
    gravity: Array
    rotor: float
    dry: float
    viscous: float
    encoder: float
    upright: bool = False
    passive: float = 0.0
    conditions: Conditions = Conditions()


@dataclass
class Moved:
    """A motion of a plant: times, joints, rates, accelerations, and the forces of its drives."""

    time: Array
    joints: Array
    rates: Array
    accelerations: Array
    forces: Array
    load: Array = field(repr=False)


def _slopes(place: Place, x: Array) -> list[Array]:
    """Return slopes of joints (T, n, m), points (T, k, 3, m) and directions (T, r, 3, m)."""
    m = x.shape[1]
    changed = [place(x + 1j * _COMPLEX * np.eye(m)[k]) for k in range(m)]
    return [np.stack([c[k].imag / _COMPLEX for c in changed], axis=-1) for k in range(3)]


def _seconds(place: Place, x: Array, v: Array, a: Array) -> list[Array]:
    """Return rates and accelerations of joints and points along a motion: (q', q'', p'')."""

    def along(s: float) -> list[Array]:
        moved = x + s * v + 0.5 * s * s * a + 1j * _COMPLEX * (v + s * a)
        return [part.imag / _COMPLEX for part in place(moved)]

    h = _STEP
    parts = [along(s) for s in (0.0, -2 * h, -h, h, 2 * h)]
    rate, first, second, third, fourth = parts
    back = [
        (p - 8 * q + 8 * r - s) / (12 * h)
        for p, q, r, s in zip(first, second, third, fourth, strict=True)
    ]
    return [rate[0], back[0], back[1], rate[2]]


def moved(plant: Plant, seed: int, *, payload: float = 0.0) -> Moved:
    """Return a motion of the plant: Fourier series in its own coordinates, from a seed."""
    rng = np.random.default_rng(seed)
    period, rate = plant.conditions.period, plant.conditions.rate
    time = np.arange(round(_PERIODS * period * rate)) / rate
    m = len(plant.home)
    x, v, a = (np.zeros((len(time), m)) for _ in range(3))
    weights = rng.normal(size=(5, 2, m))
    look = np.linspace(0.0, period, 400)
    shape = np.zeros((400, m))
    for h, (c, s) in enumerate(weights, start=1):
        w = 2.0 * np.pi * h / period
        cos, sin = np.cos(w * time)[:, None], np.sin(w * time)[:, None]
        x += (c * cos + s * sin) / h
        v += w * (s * cos - c * sin) / h
        a -= w * w * (c * cos + s * sin) / h
        shape += (c * np.cos(w * look)[:, None] + s * np.sin(w * look)[:, None]) / h
    size = plant.conditions.motion * plant.size / np.abs(shape).max(axis=0)
    return forces_along(plant, time, plant.home + size * x, size * v, size * a, payload=payload)


def forces_along(
    plant: Plant, time: Array, x: Array, v: Array, a: Array, *, payload: float = 0.0
) -> Moved:
    """Return the plant's motion along poses x with rates v and accelerations a, (T, m)."""
    joints, _, _ = plant.place(np.asarray(x + 0j))
    jacobian, of_points, of_rods = _slopes(plant.place, x)
    rates, accelerations, seconds, turning = _seconds(plant.place, x, v, a)
    masses = plant.masses.copy()
    masses[-1] += payload  # the last point is at the platform's middle
    inertia = masses[:, None] * (seconds - plant.gravity)
    generalized = np.einsum("tkcm,tkc->tm", of_points, inertia)
    generalized += plant.passive * np.einsum("trcm,trc->tm", of_rods, turning)
    load = np.linalg.solve(np.swapaxes(jacobian, 1, 2), generalized[..., None])[..., 0]
    friction = plant.dry * np.sign(rates) + plant.viscous * rates
    forces = load + plant.rotor * accelerations + friction
    return Moved(time, joints.real, rates, accelerations, forces, load)


# The four plants -------------------------------------------------------------------------------


def _rod(ends: list[Array]) -> list[Array]:
    """Return the points of a uniform rod: its ends and its middle."""
    first, second = ends
    return [first, 0.5 * (first + second), second]


def _rod_masses(mass: float) -> list[float]:
    return [mass / 6.0, 4.0 * mass / 6.0, mass / 6.0]


def _angle(x: Array, y: Array) -> Array:
    """Return the angle of (x, y), to first order in imaginary parts."""
    size = x.real**2 + y.real**2
    return np.asarray(np.arctan2(y.real, x.real) + 1j * (y.imag * x.real - x.imag * y.real) / size)


def _seen_from(q: Array, x: Array, y: Array) -> Array:
    """Return a direction (x, y) as a crank at angle q sees it, (T, 3)."""
    c, s = np.cos(q), np.sin(q)
    return np.stack([c * x + s * y, c * y - s * x, 0 * x], axis=-1)


def _arccos(share: Array) -> Array:
    """Return the arc cosine, to first order in imaginary parts."""
    return np.asarray(np.arccos(share.real) - 1j * share.imag / np.sqrt(1.0 - share.real**2))


def _root(square: Array) -> Array:
    return np.asarray(np.sqrt(square))


def _with_rotors(name: str, rotor: float, ratio: float, **changes: object) -> pteron.Manipulator:
    robot = pteron.load(name)
    drive = Drive(rotor_inertia=rotor / ratio**2, ratio=ratio)
    legs = tuple(replace(leg, drive=drive) for leg in robot.legs)
    return replace(robot, legs=legs, **changes)  # type: ignore[arg-type]


def _with_legs(robot: pteron.Manipulator, **changes: object) -> pteron.Manipulator:
    """Return a machine with changed legs; a callable changes a leg's own value."""
    legs = tuple(
        replace(leg, **{k: v(getattr(leg, k)) if callable(v) else v for k, v in changes.items()})
        for leg in robot.legs
    )
    return replace(robot, legs=legs)


def linear_delta(*, other: bool = False) -> Plant:
    """Return a linear Delta with vertical guides and belts: carriages above the platform."""
    rotor = 54e-7 / 0.00637**2  # NEMA 17 at a pulley of 40 mm circumference
    robot = _with_rotors("linear-delta", rotor, 1.0 / 0.00637)
    length, limits = 0.2294, (0.13, 0.48)
    slider, rod, effector = 0.14, 0.035, 0.28
    if other:
        length, limits = 0.32, (0.15, 0.7)
        slider, rod, effector = 0.1, 0.05, 0.3
        wider = {"guide_point": lambda p: tuple(1.3 * np.array(p))}
        robot = _with_legs(robot, **wider, lower_length=length, limits=limits, bar_length=None)
    base = np.array([leg.guide_point for leg in robot.legs])
    arm = np.array([leg.platform_point for leg in robot.legs])

    def place(x: Array) -> tuple[Array, Array, Array]:
        c = x[:, None, :] + arm
        flat = c[..., :2] - base[:, :2]
        top = c[..., 2] + _root(length**2 - (flat**2).sum(axis=-1))
        points, rods = [], []
        for i in range(3):
            carriage = np.stack([*(0 * top[:, i] + base[i, k] for k in (0, 1)), top[:, i]], axis=-1)
            points += [carriage, *_rod([carriage, c[:, i]])]
            rods.append((c[:, i] - carriage) / length)
        points.append(x)
        return top, np.stack(points, axis=1), np.stack(rods, axis=1)

    masses = np.array([*([slider, *_rod_masses(rod)] * 3), effector])
    home, size = np.array([0.0, 0.0, 0.1]), np.array([0.06, 0.06, 0.06])
    if other:
        home, size = np.array([0.01, -0.02, 0.2]), np.array([0.08, 0.07, 0.09])
    about = (np.array([0.0, 0.0, -9.81]), rotor, 1.0, 2.0, 2e-6)
    return Plant("linear-delta", robot, home, size, place, masses, *about)


def hexapod(*, other: bool = False) -> Plant:
    """Return a hexapod with screws: rams of a cylinder and a piston each."""
    lead = 0.02
    ratio = 2.0 * np.pi / lead
    rotor = 6e-4 * ratio**2
    robot = _with_rotors("stewart", rotor, ratio)
    platform, cylinder, piston = 1100.0, 100.0, 45.0
    if other:
        platform, cylinder, piston = 1000.0, 80.0, 60.0
        narrower = {"guide_point": lambda p: tuple(0.7 * np.array(p))}
        cones: dict[str, object] = {"base_cone": None, "platform_cone": None}
        robot = _with_legs(robot, **narrower, **cones, limits=(1.8, 3.6))
    base = np.array([leg.guide_point for leg in robot.legs])
    arm = np.array([leg.platform_point for leg in robot.legs])
    span = 3.153801 * 0.75
    plate = np.array([[0.7, 0.0, 0.0], [-0.7, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, -0.7, 0.0]])

    def place(x: Array) -> tuple[Array, Array, Array]:
        (r, p, y), one = x[:, 3:].T, np.ones(len(x))
        cr, sr, cp, sp, cy, sy = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(y), np.sin(y)
        turn = np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp * one, cp * sr, cp * cr],
            ]
        )
        at = np.einsum("abt,kb->tka", turn, np.vstack([arm, plate])) + x[:, None, :3]
        c = at[:, :6]
        length = _root(((c - base) ** 2).sum(axis=-1))
        way = (c - base) / length[..., None]
        points = []
        for i in range(6):
            foot = base[i] + 0 * c[:, i]
            points += _rod([foot, foot + span * way[:, i]])
            points += _rod([c[:, i] - span * way[:, i], c[:, i]])
        points += [at[:, 6 + k] for k in range(4)] + [x[:, :3]]
        return length, np.stack(points, axis=1), way

    rams = [*_rod_masses(cylinder), *_rod_masses(piston)] * 6
    masses = np.array([*rams, *([platform / 4.0] * 4), 0.0])
    home = np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0])
    size = np.array([0.2, 0.2, 0.2, 0.12, 0.12, 0.12])
    about = (np.array([0.0, 0.0, -9.81]), rotor, 150.0, 300.0, 2e-6)
    return Plant("hexapod", robot, home, size, place, masses, *about)


def ball_table(*, other: bool = False) -> Plant:
    """Return a ball table: three cranks with a link each to a joint under the plate."""
    rotor = 3e-4
    robot = _with_rotors("ball-table", rotor, 10.0)
    azimuths = np.radians([0.0, 120.0, 240.0])
    out = np.stack([np.cos(azimuths), np.sin(azimuths), 0.0 * azimuths], axis=-1)
    across = np.stack([-np.sin(azimuths), np.cos(azimuths), 0.0 * azimuths], axis=-1)
    base, arm, crank, link = 0.06 * out, 0.1 * out, 0.08, 0.11
    if other:
        crank, link = 0.09, 0.14
        robot = _with_legs(robot, upper_length=crank, lower_length=link)
    plate = np.array([[0.1, 0, 0.01], [-0.1, 0, 0.01], [0, 0.1, 0.01], [0, -0.1, 0.01]])
    mass, of_crank, of_link = (0.4, 0.03, 0.025) if other else (0.32, 0.035, 0.018)
    up = np.array([0.0, 0.0, 1.0])

    def place(x: Array) -> tuple[Array, Array, Array]:
        # A turn about a level axis (u, w, 0), which symmetry keeps free of torsion.
        z, u, w = x.T
        turn = _root(u**2 + w**2 + 1e-12)
        s, c = np.sin(turn) / turn, (1.0 - np.cos(turn)) / turn**2
        cross = np.zeros((len(x), 3, 3), dtype=x.dtype)
        cross[:, 0, 2], cross[:, 1, 2], cross[:, 2, 0], cross[:, 2, 1] = w, -u, -w, u
        rotation = np.eye(3) + s[:, None, None] * cross + c[:, None, None] * (cross @ cross)
        at = np.einsum("tab,kb->tka", rotation, np.vstack([arm, plate]))
        # Each joint of the plate is in its leg's plane, which fixes x and y.
        off = -np.einsum("tka,ka->tk", at[:, :3], across)
        level = off @ np.linalg.pinv(across[:, :2]).T
        p = np.concatenate([level, z[:, None]], axis=1)
        at = at + p[:, None]
        points, rods, angles = [], [], []
        for i in range(3):
            rel = at[:, i] - base[i]
            a, b = rel @ out[i], rel[:, 2]
            d2 = a * a + b * b
            along = (d2 + crank**2 - link**2) / (2.0 * _root(d2))
            # The elbow is outwards: the crank is lower than the line to the joint.
            angle = np.arctan2(b.real, a.real) + 1j * (
                (b.imag * a.real - a.imag * b.real) / d2.real
            )
            share = along / crank
            bend = np.arccos(share.real) - 1j * share.imag / np.sqrt(1.0 - share.real**2)
            q = angle - bend if np.iscomplexobj(x) else (angle - bend).real
            elbow = base[i] + crank * (np.cos(q)[:, None] * out[i] + np.sin(q)[:, None] * up)
            foot = base[i] + 0 * elbow
            points += _rod([foot, elbow])
            points += _rod([elbow, at[:, i]])
            way = (at[:, i] - elbow) / link
            rods.append(_seen_from(q, way @ out[i], way[:, 2]))
            angles.append(q)
        points += [at[:, 3 + k] for k in range(4)] + [p]
        return np.stack(angles, axis=1), np.stack(points, axis=1), np.stack(rods, axis=1)

    masses = np.array(
        [*([*_rod_masses(of_crank), *_rod_masses(of_link)] * 3), *([mass / 4.0] * 4), 0.0]
    )
    home, size = np.array([0.12 if other else 0.1, 0.0, 0.0]), np.array([0.025, 0.2, 0.2])
    about = (np.array([0.0, 0.0, -9.81]), rotor, 0.01, 0.005, 2.0 * np.pi / 2**17)
    return Plant("ball-table", robot, home, size, place, masses, *about)


def five_bar(*, other: bool = False) -> Plant:
    """Return a five-bar that stands upright: gravity is in its plane."""
    rotor = 1e-5
    gravity = (0.0, -9.81, 0.0)
    robot = _with_rotors("five-bar", rotor, 5.0, gravity=gravity)
    base = np.array([[-0.059, 0.0], [0.059, 0.0]])
    upper, lower, bend = 0.09, 0.09, (1.0, -1.0)
    crank, link, pen = 0.07, 0.04, 0.035
    if other:
        base, upper, lower = 0.7 * base, 0.1, 0.13
        crank, link, pen = 0.05, 0.05, 0.025
        nearer = {"guide_point": lambda p: tuple(0.7 * np.array(p))}
        robot = _with_legs(robot, **nearer, upper_length=upper, lower_length=lower)

    def place(x: Array) -> tuple[Array, Array, Array]:
        points, rods, angles = [], [], []
        for i in range(2):
            rel = x - base[i]
            d = _root((rel**2).sum(axis=-1))
            share = (d * d + upper**2 - lower**2) / (2.0 * upper * d)
            q = _angle(rel[:, 0], rel[:, 1]) + bend[i] * _arccos(share)
            elbow = base[i] + upper * np.stack([np.cos(q), np.sin(q)], axis=-1)
            points += _rod([base[i] + 0 * elbow, elbow])
            points += _rod([elbow, x])
            rods.append(_seen_from(q, *((x - elbow) / lower).T))
            angles.append(q)
        points.append(x)
        flat = np.stack(points, axis=1)
        level = np.concatenate([flat, 0 * flat[..., :1]], axis=-1)
        return np.stack(angles, axis=1), level, np.stack(rods, axis=1)

    masses = np.array([*([*_rod_masses(crank), *_rod_masses(link)] * 2), pen])
    home, size = np.array([0.0, 0.16 if other else 0.125]), np.array([0.03, 0.02])
    about = (np.array(gravity), rotor, 0.004, 0.001, 2.0 * np.pi / 2**17)
    return Plant("five-bar", robot, home, size, place, masses, *about, upright=True)


PLANTS: dict[str, Callable[[], Plant]] = {
    "linear-delta": lru_cache(linear_delta),
    "hexapod": lru_cache(hexapod),
    "ball-table": lru_cache(ball_table),
    "five-bar": lru_cache(five_bar),
}
"""Each also with other dimensions and masses: `other=True`."""


def log_of(plant: Plant, motion: Moved, seed: int, source: str = "log.csv") -> Log:
    """Return the log of a motion without a fault: encoders round, forces have noise."""
    rng = np.random.default_rng((seed, 7))
    size = plant.conditions.noise * motion.forces.std(axis=0)
    forces = motion.forces + size * rng.normal(size=motion.forces.shape)
    joints = np.round(motion.joints / plant.encoder) * plant.encoder
    symbols = tuple(leg.joint for leg in plant.drawn.legs)
    return Log(source, motion.time, joints, forces, symbols=symbols)


# Twenty faults --------------------------------------------------------------------------------


@dataclass
class Case:
    """A plant's log before it is written, and the machine's file; a fault changes some of it.

    `actuator` is the one that a fault of one is of; `home` are the joints at the homing position.
    """

    plant: Plant
    drawn: pteron.Manipulator
    motion: Moved
    rng: np.random.Generator
    actuator: int
    time: Array
    joints: Array
    forces: Array
    seed: int = 0

    @property
    def size(self) -> float:
        """The size of its fault, over the usual one."""
        return self.plant.conditions.fault

    @property
    def home(self) -> Array:
        """The joints (n,) where the machine is homed."""
        return np.asarray(self.plant.place(np.asarray(self.plant.home[None] + 0j))[0].real[0])

    def seen_at(self, instants: Array) -> None:
        """Take positions at other instants than the stamps say."""
        spline = make_interp_spline(self.time, self.joints, k=5)
        self.joints = spline(np.clip(instants, self.time[0], self.time[-1]))


def jitter(case: Case) -> None:
    """Sample positions 0.2 ms off their stamps, at random."""
    case.seen_at(case.time + 2e-4 * case.size * case.rng.normal(size=case.time.shape))


def lost(case: Case) -> None:
    """Lose 3 % of the samples."""
    kept = case.rng.random(len(case.time)) >= 0.03 * case.size
    case.time, case.joints, case.forces = case.time[kept], case.joints[kept], case.forces[kept]


def slow_clock(case: Case) -> None:
    """Let the log's clock run 3 % slow."""
    case.time = (1.0 - 0.03 * case.size) * case.time


def late(case: Case) -> None:
    """Make forces 4 ms late."""
    spline = make_interp_spline(case.time, case.forces, k=1)
    case.forces = spline(np.clip(case.time - 4e-3 * case.size, case.time[0], None))


def saturated(case: Case) -> None:
    """Cut the range of forces to 60 %."""
    low, high = case.forces.min(axis=0), case.forces.max(axis=0)
    cut = 0.2 * case.size * (high - low)
    case.forces = np.clip(case.forces, low + cut, high - cut)


def _sized(factor: float, case: Case) -> float:
    """Return a factor by the size of the case's fault; one of two has no other size."""
    return factor if factor in (0.5, 2.0) else 1.0 + case.size * (factor - 1.0)


def times(factor: float) -> Callable[[Case], None]:
    """Return what multiplies all forces."""

    def change(case: Case) -> None:
        case.forces = _sized(factor, case) * case.forces

    return change


def geared(factor: float) -> Callable[[Case], None]:
    """Return what gives the drives another ratio, or lead, than the file has."""

    def change(case: Case) -> None:
        moved = _sized(factor, case)
        case.joints = case.home + moved * (case.joints - case.home)
        case.forces = case.forces / moved

    return change


def zero_off(case: Case) -> None:
    """Shift the zero of one joint, by a twentieth of its range or so."""
    case.joints = case.joints.copy()
    case.joints[:, case.actuator] += 0.06 * case.size * np.ptp(case.joints[:, case.actuator])


def flipped(case: Case) -> None:
    """Give one force the other sign."""
    case.forces = case.forces.copy()
    case.forces[:, case.actuator] *= -1.0


def swapped(case: Case) -> None:
    """Swap two forces."""
    n = case.forces.shape[1]
    case.forces = case.forces[:, [1, 0, *range(2, n)]]


def quarter_turn(case: Case) -> None:
    """Give the file gravity along another axis: -z for a machine that stands upright."""
    gravity = (0.0, 0.0, -9.81) if case.plant.upright else (0.0, -9.81, 0.0)
    case.drawn = replace(case.drawn, gravity=gravity)


def _with_leg(case: Case, **changes: object) -> None:
    legs = list(case.drawn.legs)
    legs[case.actuator] = replace(legs[case.actuator], **changes)
    case.drawn = replace(case.drawn, legs=tuple(legs))


def wrong_elbow(case: Case) -> None:
    """Give the file the other elbow of one leg; rams, which have none, two legs exchanged."""
    leg = case.drawn.legs[case.actuator]
    if len(leg.branches) > 1:
        _with_leg(case, elbow=-leg.elbow)
        return
    legs = list(case.drawn.legs)
    legs[0], legs[1] = legs[1], legs[0]
    case.drawn = replace(case.drawn, legs=tuple(legs))


def guide_off(case: Case) -> None:
    """Draw one guide point off, by 25 mm on a hexapod of 3 m, and as a share of smaller ones."""
    leg = case.drawn.legs[case.actuator]
    size = {"hexapod": 0.025, "linear-delta": 0.008, "ball-table": 0.006, "five-bar": 0.004}
    way = case.rng.normal(size=3) * (1.0, 1.0, 0.0)
    point = np.array(leg.guide_point) + case.size * size[case.plant.name] * way / np.linalg.norm(
        way
    )
    _with_leg(case, guide_point=tuple(point))


def length_off(case: Case) -> None:
    """Draw a link 3 % too long; of a ram, its platform point 3 % too far out."""
    leg = case.drawn.legs[case.actuator]
    if hasattr(leg, "lower_length"):
        _with_leg(case, lower_length=(1.0 + 0.03 * case.size) * leg.lower_length)
    else:
        _with_leg(
            case, platform_point=tuple((1.0 + 0.03 * case.size) * np.array(leg.platform_point))
        )


def passive(case: Case) -> None:
    """Let the joints between crank, rod and platform have viscous friction."""
    bare = forces_like(case)
    with_one = forces_like(case, passive=1.0)
    share = (
        0.1 * case.size * case.motion.load.std(axis=0).mean() / (with_one - bare).std(axis=0).mean()
    )
    case.forces = case.forces + share * (with_one - bare)


def load_friction(case: Case) -> None:
    """Let friction grow with the load: 8 % of it."""
    case.forces = case.forces + 0.08 * case.size * np.abs(case.motion.load) * np.sign(
        case.motion.rates
    )


def flexible(case: Case) -> None:
    """Measure motors ahead of their joints, by a transmission that gives."""
    inertia = case.motion.load.std(axis=0) / case.motion.accelerations.std(axis=0)
    case.joints = case.joints + case.size * case.motion.load / (inertia * (2.0 * np.pi * 15.0) ** 2)


def payload(case: Case) -> None:
    """Carry a payload that nobody declares in the second half: 30 % of the platform's mass."""
    mass = 0.3 * case.size * case.drawn.platform.inertia.mass
    carrying = forces_like(case, payload=mass) - forces_like(case)
    case.forces = case.forces + carrying * (case.time > case.time.mean())[:, None]


def quantised(case: Case) -> None:
    """Round forces to steps of 5 % of their deviation."""
    step = 0.05 * case.size * case.forces.std(axis=0)
    case.forces = np.round(case.forces / step) * step


def forces_like(case: Case, *, passive: float = 0.0, payload: float = 0.0) -> Array:
    """Return the plant's forces along the case's motion, with passive friction or a payload."""
    plant = replace(case.plant, passive=passive)
    return moved(plant, case.seed, payload=payload).forces


MACHINE = ("passive", "load friction", "flexible")
"""Faults that the machine itself has: the true forces have them too."""

FAULTS: dict[str, tuple[Callable[[Case], None], str]] = {
    "jitter": (jitter, "jitter|time stamps"),
    "lost samples": (lost, "lost|missing"),
    "clock": (slow_clock, "clock"),
    "delay": (late, "late for"),
    "saturation": (saturated, "limit|saturat"),
    "forces x 0.5": (times(0.5), "ratio|factor|gain"),
    "forces x 1.1": (times(1.1), "factor|gain"),
    "gear ratio 5 %": (geared(1.05), "ratio|factor|gain"),
    "half the lead": (geared(0.5), "ratio|lead"),
    "zero off": (zero_off, "zero"),
    "sign": (flipped, "sign"),
    "swapped columns": (swapped, "swapped|exchanged|order"),
    "gravity turned": (quarter_turn, "[Gg]ravity"),
    "wrong elbow": (wrong_elbow, "working mode|elbow|exchanged|swapped"),
    "guide point": (guide_off, "geometry|[Pp]oints|[Ll]engths"),
    "length": (length_off, "geometry|[Pp]oints|[Ll]engths"),
    "passive friction": (passive, "[Pp]assive"),
    "load friction": (load_friction, "with the load|load-dependent"),
    "flexible": (flexible, "elastic"),
    "payload": (payload, "undeclared payload"),
    "quantised": (quantised, "quanti|steps"),
}
"""Each with the words that name its cause."""

_OPTIONS: dict[str, dict[str, Any]] = {
    "--joints each": {"terms": Terms(passive="each")},
    "--stribeck auto": {"terms": Terms(stribeck="auto")},
    "--delay auto": {"processing": Processing(delay="auto")},
    "--shared": {"shared": True},
    "--estimator huber": {"estimator": "huber"},
}
"""Advice that a command's option follows."""


def case_of(plant: Plant, fault: str, seed: int) -> Case:
    """Return the case of one motion of a plant, with a fault, or "none"."""
    motion = moved(plant, seed)
    rng = np.random.default_rng((seed, list(FAULTS).index(fault) if fault in FAULTS else 99))
    n = motion.joints.shape[1]
    actuator = seed % n
    about = motion.time, motion.joints, motion.forces
    return Case(plant, plant.drawn, motion, rng, actuator, *about, seed=seed)


def recorded(case: Case, fault: str, source: str) -> Log:
    """Return the log of a case: a fault, noise, and an encoder's rounding."""
    if fault in FAULTS:
        FAULTS[fault][0](case)
    size = case.motion.forces.std(axis=0)
    noise = case.plant.conditions.noise * size
    case.forces = case.forces + noise * case.rng.normal(size=case.forces.shape)
    if fault == "quantised":
        quantised(case)
    joints = np.round(case.joints / case.plant.encoder) * case.plant.encoder
    symbols = tuple(leg.joint for leg in case.drawn.legs)
    time = case.plant.conditions.begin + case.time
    return Log(source, time, joints, case.forces, symbols=symbols)


HIDDEN = "These logs cannot show"
"""How the first sentence begins on what a log cannot show."""


@dataclass(frozen=True)
class Answer:
    """What `identify` said: grade, first sentence, causes in order, and true error (%)."""

    grade: str
    first: str
    causes: tuple[str, ...]
    off: float
    expected: float = np.nan
    steps: tuple[str, ...] = ()

    def names(self, pattern: str, most: int = 2) -> bool:
        """Say whether words name one of the first causes, or what the log cannot show at all."""
        hidden = [self.first] * self.first.startswith(HIDDEN)
        return any(re.search(pattern, cause) for cause in (*self.causes[:most], *hidden))


def answered(plant: Plant, fault: str, seed: int, **options: Any) -> Answer:
    """Identify a log of a plant with a fault, and compare forces on a third motion."""
    cases = [case_of(plant, fault, seed + k) for k in (0, 1000)]
    cases[1].actuator = cases[0].actuator
    cases[1].rng = np.random.default_rng((seed, 3))
    log, other = (recorded(c, fault, s) for c, s in zip(cases, ("log", "other"), strict=True))
    cases[1].drawn = cases[0].drawn
    try:
        result = identify(cases[0].drawn, log, held_out=other, **options)
    except (LogError, pteron.ModelError) as error:
        said = str(error)
        return Answer("refused", said, (said,), np.nan)
    verdict = result.verdict
    off = error_of(result, plant, fault, seed)
    shown = result.fault_isolation.expected_error
    expected = float(np.max(shown)) if len(shown) else np.nan
    return Answer(
        verdict.grade, verdict.reasons[0], result.causes, off, expected, verdict.next_steps
    )


def error_of(result: Identification, plant: Plant, fault: str, seed: int) -> float:
    """Return the greatest error of the model's forces on a third motion, % of their deviation."""
    if result.machine is None:
        return float("nan")
    case = case_of(plant, fault, seed + 2000)
    if fault in MACHINE:
        FAULTS[fault][0](case)
    motion = case.motion
    about = motion.joints, motion.rates, motion.accelerations
    try:
        start = result.preprocessing[0].start
        s = States.from_joints(result.machine, about, motion.time, start)
    except pteron.PteronError:
        return float("inf")
    forces = pteron.drive_forces(result.machine, s.pose, s.velocity, s.acceleration)
    moving = np.abs(motion.rates) > 0.05 * motion.rates.std(axis=0)
    error = np.sqrt((moving * (forces - case.forces) ** 2).sum(axis=0) / moving.sum(axis=0))
    return float(100.0 * (error / case.forces.std(axis=0)).max())


def followed(plant: Plant, fault: str, seed: int, answer: Answer) -> list[tuple[str, Answer]]:
    """Return the answers after each piece of advice that an option follows."""
    texts = " ".join((*answer.causes, *answer.steps))
    return [
        (name, answered(plant, fault, seed, **options))
        for name, options in _OPTIONS.items()
        if name in texts
    ]


@dataclass(frozen=True)
class Faultless:
    """Of logs without a fault: intervals, those within two standard errors, and accused logs."""

    intervals: int
    within: int
    logs: int
    accused: tuple[str, ...]


def faultless(plant: Plant, count: int, first: int = 3000) -> Faultless:
    """Return what `identify` says of so many logs without a fault.

    The true values are those of a log without noise, which is exact.
    """
    symbols = tuple(leg.joint for leg in plant.drawn.legs)
    exact = [
        Log(f"exact {k}", m.time, m.joints, m.forces, symbols=symbols)
        for k, m in ((k, moved(plant, k)) for k in (8001, 8002))
    ]
    truth = identify(plant.drawn, exact[0], held_out=exact[1]).estimate.values
    within, intervals, accused = 0, 0, []
    for seed in range(first, first + count):
        pair = [case_of(plant, "none", seed + k) for k in (0, 1000)]
        for k, case in enumerate(pair):
            case.rng = np.random.default_rng((seed, k, 5))
        log, other = (recorded(c, "none", s) for c, s in zip(pair, ("log", "other"), strict=True))
        result = identify(plant.drawn, log, held_out=other)
        off = np.abs(result.estimate.values - truth) / result.estimate.deviations
        within += int((off <= 2.0).sum())
        intervals += len(off)
        if result.causes or result.verdict.grade != "trustworthy":
            reasons = result.causes or result.verdict.reasons
            accused.append(f"{seed}: {result.verdict.grade}: {reasons[0][:120]}")
    return Faultless(intervals, within, count, tuple(accused))


_LOGS = {"linear-delta": 64, "five-bar": 60, "ball-table": 31, "hexapod": 23}
"""Logs without a fault, so many that they have a thousand intervals or more."""


def print_faultless(name: str, count: int) -> None:
    """Print a line on a plant's logs without a fault."""
    seen = faultless(PLANTS[name](), count)
    share = 100.0 * seen.within / seen.intervals
    print(
        f"{name}: {seen.within} of {seen.intervals} intervals ({share:.1f} %) hold the true value "
        f"at 2 standard errors; {len(seen.accused)} of {seen.logs} logs without a fault accused"
    )
    for line in seen.accused:
        print(f"    {line}")


@dataclass(frozen=True)
class Row:
    """One plant with a fault: what was said, and the errors after each piece of advice."""

    plant: str
    fault: str
    seed: int
    answer: Answer
    later: tuple[tuple[str, Answer], ...] = ()

    @property
    def right(self) -> bool:
        """Whether the cause is among the first two, or named as invisible; none, without one."""
        if self.fault == "none":
            return not self.answer.causes
        return self.answer.names(FAULTS[self.fault][1])

    @property
    def misleads(self) -> bool:
        """Whether it is trusted with an error above 3 % that the first sentence does not name."""
        trusted = self.answer.grade == "trustworthy" and self.answer.off > WORST
        return trusted and not self.answer.names(FAULTS.get(self.fault, (None, "$^"))[1], 0)

    @property
    def worse(self) -> tuple[str, ...]:
        """The advice that made the error larger, by more than a tenth and noise."""
        most = 1.1 * self.answer.off + 0.3
        return tuple(name for name, later in self.later if later.off > most)

    def __str__(self) -> str:
        """Return the row of a table."""
        a = self.answer
        row = f"{self.plant:12} {self.fault:16} {self.seed:2} {a.grade:17} {a.off:7.2f} "
        row += f"{a.expected:7.2f} {'right' if self.right else 'WRONG'} "
        after = "; ".join(f"{name}: {later.off:.2f}" for name, later in self.later)
        said = " || ".join(cause[:100] for cause in a.causes[:2])
        return f"{row} {said}{' >> ' * bool(after)}{after}"


WORST = 3.0
"""Error up to which a model may be trusted, percent."""


def row_of(name: str, fault: str, seed: int, *, follow: bool = True) -> Row:
    """Return the row of a plant, a fault and a seed."""
    plant = PLANTS[name]()
    answer = answered(plant, fault, seed)
    later = followed(plant, fault, seed, answer) if follow else []
    return Row(name, fault, seed, answer, tuple(later))


def print_summary(rows: list[Row]) -> None:
    """Print how many causes are right, and all that misleads."""
    for name in dict.fromkeys(row.plant for row in rows):
        some = [row for row in rows if row.plant == name and row.fault != "none"]
        right = sum(row.right for row in some)
        print(f"{name}: {right} of {len(some)} causes among the first two, or named as invisible")
    for row in rows:
        if row.misleads:
            print(f"trusted, and {row.answer.off:.1f} % off: {row.plant}, {row.fault}, {row.seed}")
        for name in row.worse:
            print(f"advice makes it worse: {row.plant}, {row.fault}, {row.seed}: {name}")


def main() -> None:
    """Print a row for each plant, fault and seed, and what is said of logs without a fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--faults", nargs="*", default=["none", *FAULTS])
    parser.add_argument("--faultless", action="store_true")
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    names = given.plants or list(PLANTS)
    if given.quick:
        names, given.faults = ["linear-delta"], ["none", "delay", "sign"]
    if not given.faultless:
        print("plant        fault         seed grade               off %  told % first causes")
        rows = []
        for name in names:
            for fault in given.faults:
                for seed in range(given.first, given.first + given.seeds):
                    rows.append(row_of(name, fault, seed))
                    print(rows[-1], flush=True)
        print_summary(rows)
    if not given.quick:
        for name in names:
            print_faultless(name, _LOGS[name])


if __name__ == "__main__":
    main()
