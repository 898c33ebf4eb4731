"""The mechanisms, batch shapes and states that all tests share."""

from dataclasses import replace

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


def unit(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def inertia(rng, length):
    """Return the inertia of a real link or platform, its centre of mass off both axes."""
    mass = rng.uniform(0.2, 0.6)
    x, y = rng.uniform(-0.6, 0.6) * length, rng.uniform(-0.1, 0.1) * length
    return pteron.PlanarInertia.of_body(mass, (x, y), mass * (x * x + y * y + (0.3 * length) ** 2))


def random_machine(seed, turns):
    """Return a machine with nothing special about it, built around a pose that it reaches."""
    rng = np.random.default_rng(seed)
    axis = unit(rng)
    x_axis = np.cross(axis, unit(rng))
    x_axis /= np.linalg.norm(x_axis)
    frame = np.column_stack([x_axis, np.cross(axis, x_axis), axis])
    while True:
        directions = [unit(rng) for _ in range(4 if turns else 3)]
        if np.linalg.svd(directions, compute_uv=False)[-1] > 0.4:
            break
    legs = []
    for d in directions:
        s0 = rng.uniform(-0.06, 0.06, 3)
        lu, ll = rng.uniform(0.15, 0.25, 2)
        across = np.cross(d, unit(rng))
        across /= np.linalg.norm(across)
        e = d + 0.5 * rng.normal(size=3)
        e /= np.linalg.norm(e) * np.sign(e @ d)
        reach = rng.uniform(0.75, 0.9) * np.hypot(lu, ll) * across
        legs.append(
            pteron.Leg(
                guide_point=frame @ s0 - reach + rng.uniform(-0.1, 0.1) * e,
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
        )
    platform = pteron.Platform("3T1R" if turns else "3T", inertia(rng, 0.08), axis, x_axis)
    kind = "3T1R" if turns else "3T"
    return pteron.Manipulator(f"random {kind} {seed}", platform, tuple(legs), 9.81 * unit(rng))


CATALOG = {name: pteron.load(name) for name in pteron.catalog()}

MECHANISMS = {
    **CATALOG,
    "quadrupteron +-+-": with_elbows(CATALOG["quadrupteron"], "+-+-"),
    "quadrupteron ----": with_elbows(CATALOG["quadrupteron"], "----"),
    "quadrupteron-oblique +--+": with_elbows(CATALOG["quadrupteron-oblique"], "+--+"),
    "tripteron -+-": with_elbows(CATALOG["tripteron"], "-+-"),
    "tripteron-oblique --+": with_elbows(CATALOG["tripteron-oblique"], "--+"),
    "quadrupteron, gravity along x": replace(CATALOG["quadrupteron"], gravity=(9.81, 0.0, 0.0)),
    "quadrupteron, no gravity": replace(CATALOG["quadrupteron"], gravity=(0.0, 0.0, 0.0)),
    "quadrupteron turned": pteron.turned(
        CATALOG["quadrupteron"], Rotation.random(rng=1).as_matrix()
    ),
    "tripteron on a wall": pteron.turned(
        CATALOG["tripteron"], Rotation.random(rng=2).as_matrix(), gravity=False
    ),
    **{f"random 3T1R {seed}": random_machine(seed, True) for seed in range(3)},
    **{f"random 3T {seed}": random_machine(seed, False) for seed in range(2)},
}


def states(robot, count, seed=0):
    """Return random poses away from singularities, velocities and accelerations."""
    rng = np.random.default_rng(seed)
    pose = pteron.random_poses(robot, count, seed=rng, type_i=0.3, type_ii=0.3)
    return pose, rng.normal(size=pose.shape), 10.0 * rng.normal(size=pose.shape)


def relative_error(found, expected):
    """Return the largest error of any row, relative to the row's largest entry."""
    scale = np.abs(expected).max(axis=-1, keepdims=True)
    return float((np.abs(np.asarray(found) - expected) / scale).max())
