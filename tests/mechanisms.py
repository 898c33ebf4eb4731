"""The mechanisms, batch shapes and states that all tests share."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

import pteron

BATCH_SHAPES = [(), (1,), (7,), (3, 5), (0,), (300,)]
"""300 is more than one block of the virtual machine."""


def with_elbows(robot, signs):
    """Return the machine in the working mode that a text such as "+-+-" names."""
    legs = tuple(
        replace(leg, elbow=1 if sign == "+" else -1)
        for leg, sign in zip(robot.legs, signs, strict=True)
    )
    return replace(robot, legs=legs)


def unit(rng, across=None):
    """Return a random unit vector, perpendicular to another if that is given."""
    v = rng.normal(size=3)
    if across is not None:
        v = np.cross(across, v)
    return v / np.linalg.norm(v)


def inertia(rng, length):
    """Return the inertia of a real link or platform, its centre of mass off both axes."""
    mass = rng.uniform(0.2, 0.6)
    x, y = rng.uniform(-0.6, 0.6) * length, rng.uniform(-0.1, 0.1) * length
    return pteron.PlanarInertia.of_body(mass, (x, y), mass * (x * x + y * y + (0.3 * length) ** 2))


def slider_leg(rng, d, c, s0):
    """Return a P-R-R-R leg with nothing special about it that reaches c."""
    lu, ll = rng.uniform(0.15, 0.25, 2)
    across = unit(rng, d)
    e = d + 0.5 * rng.normal(size=3)
    e /= np.linalg.norm(e) * np.sign(e @ d)
    reach = rng.uniform(0.75, 0.9) * np.hypot(lu, ll) * across
    return pteron.PRRR(
        guide_point=c - reach + rng.uniform(-0.1, 0.1) * e,
        direction=d,
        platform_point=s0,
        upper_length=lu,
        lower_length=ll,
        slider_mass=rng.uniform(0.3, 0.8),
        upper=inertia(rng, lu),
        lower=inertia(rng, ll),
        slider_direction=e,
        elbow=int(rng.choice([1, -1])),
    )


def crank_leg(rng, d, c, s0):
    """Return an R-S-S leg that reaches c, its rod at 35 to 70 degrees from d and from the crank."""
    a = unit(rng, d)
    lu, ll = rng.uniform(0.1, 0.15), rng.uniform(0.25, 0.35)
    crank = lu * unit(rng, d)
    elbow = int(rng.choice([1, -1]))
    lean, side = rng.uniform(0.6, 1.2, 2) * [1, -elbow]
    across = np.cross(d, crank / lu)
    rod = np.cos(lean) * d + np.sin(lean) * (np.cos(side) * crank / lu + np.sin(side) * across)
    mass, x = rng.uniform(0.2, 0.6), -ll * rng.uniform(0.3, 0.7)
    return pteron.RSS(
        guide_point=c - crank - ll * rod,
        direction=d,
        zero_direction=a,
        platform_point=s0,
        upper_length=lu,
        lower_length=ll,
        upper=inertia(rng, lu),
        lower=pteron.RodInertia.of_body(mass, (x,), mass * (x * x + (0.3 * ll) ** 2)),
        elbow=elbow,
    )


LEGS = {"P": slider_leg, "R": crank_leg}


def random_machine(seed, kinds):
    """Return a machine with nothing special about it, built around a pose that it reaches.

    `kinds` holds a letter for each leg, P (P-R-R-R) or R (R-S-S): four legs turn the platform. Of
    P-R-R-R legs alone it may say whether the platform turns.
    """
    if isinstance(kinds, bool):
        kinds = "PPPP" if kinds else "PPP"
    rng = np.random.default_rng(seed)
    axis = unit(rng)
    x_axis = unit(rng, axis)
    frame = np.column_stack([x_axis, np.cross(axis, x_axis), axis])
    while True:
        directions = [unit(rng) for _ in kinds]
        if np.linalg.svd(directions, compute_uv=False)[-1] > 0.4:
            break
    legs = []
    for kind, d in zip(kinds, directions, strict=True):
        s0 = rng.uniform(-0.06, 0.06, 3)
        legs.append(LEGS[kind](rng, d, frame @ s0, s0))
    motion = "3T1R" if len(kinds) == 4 else "3T"
    platform = pteron.Platform(motion, inertia(rng, 0.08), axis, x_axis)
    return pteron.Manipulator(f"random {kinds} {seed}", platform, tuple(legs), 9.81 * unit(rng))


CATALOG = {name: pteron.load(name) for name in pteron.catalog()}


def _turned(name, seed, **options):
    return pteron.turned(CATALOG[name], Rotation.random(rng=seed).as_matrix(), **options)


NEAREST = ("delta", "quadrupteron", "quadrupteron-oblique", "tripteron", "tripteron-oblique")
"""Machines of the catalog on which every claim is tested; the others have tests of their own."""

MECHANISMS = {
    **{name: CATALOG[name] for name in NEAREST},
    "quadrupteron +-+-": with_elbows(CATALOG["quadrupteron"], "+-+-"),
    "quadrupteron-oblique +--+": with_elbows(CATALOG["quadrupteron-oblique"], "+--+"),
    "quadrupteron, gravity along x": replace(CATALOG["quadrupteron"], gravity=(9.81, 0.0, 0.0)),
    "tripteron, no gravity": replace(CATALOG["tripteron"], gravity=(0.0, 0.0, 0.0)),
    "quadrupteron turned": _turned("quadrupteron", 1),
    "tripteron on a wall": _turned("tripteron", 2, gravity=False),
    "delta on a wall": _turned("delta", 3, gravity=False),
    "random 3T1R 0": random_machine(0, "PPPP"),
    "random 3T1R 1": random_machine(1, "PPPP"),
    "random 3T 0": random_machine(0, "PPP"),
    "random RRR 0": random_machine(0, "RRR"),
    "random RRR 1": random_machine(1, "RRR"),
    "random PRR 0": random_machine(0, "PRR"),
    "random RPP 0": random_machine(0, "RPP"),
}


@lru_cache
def states(robot, count, seed=0):
    """Return random poses away from singularities, velocities and accelerations."""
    rng = np.random.default_rng(seed)
    pose = pteron.random_poses(robot, count, seed=rng, type_i=0.3, type_ii=0.15)
    found = pose, rng.normal(size=pose.shape), 10.0 * rng.normal(size=pose.shape)
    for array in found:
        array.setflags(write=False)
    return found


def relative_error(found, expected):
    """Return the largest error of any row, relative to the row's largest entry."""
    scale = np.abs(expected).max(axis=-1, keepdims=True)
    return float((np.abs(np.asarray(found) - expected) / scale).max())
