"""Machines with R-S-S legs, as the content of their files, and states of them."""

import tomllib
from pathlib import Path

import descriptions
import numpy as np

CATALOG = Path(__file__).parents[1] / "src" / "pteron" / "manipulator" / "catalog"


def catalog_document(name):
    """Return the content of a file of the catalog."""
    return tomllib.loads((CATALOG / f"{name}.toml").read_text(encoding="utf-8"))


def mixed():
    """Return the Delta with its first leg replaced by one with a slider along x."""
    document = catalog_document("delta")
    slider = {
        "guide_point": [0.1, 0.55, -0.5],
        "direction": [1.0, 0.0, 0.0],
        "slider_direction": [0.8, 0.0, 0.6],
        "platform_point": [0.125, 0.0, 0.01],
        "upper_length": 0.5,
        "lower_length": 0.45,
        "elbow": -1,
        "slider": {"mass": 1.3},
        "upper": {"mass": 1.1, "center_of_mass": [0.2, 0.01], "inertia": 0.08},
        "lower": {"mass": 0.9, "center_of_mass": [-0.21, -0.02], "inertia": 0.07},
    }
    return {**document, "name": "mixed", "legs": [slider, *document["legs"][1:]]}


def random_delta(seed):
    """Return three cranks in any places, built around a pose that they reach: zero."""
    rng = np.random.default_rng(seed)
    while True:
        legs = [_random_leg(rng) for _ in range(3)]
        document = {
            "name": f"random delta {seed}",
            "gravity": (9.81 * _unit(rng)).tolist(),
            "platform": {"motion": "3T", "axis": [0.0, 0.0, 1.0], **_body(rng, 0.1, 2)},
            "legs": legs,
        }
        machine = descriptions.describe(descriptions.lookalike(document))
        bent, held = descriptions.distances_from_singular(machine, np.zeros(3))
        if bent > 0.5 and held > 0.4:
            return document


def _random_leg(rng):
    d = _unit(rng)
    a = np.cross(d, _unit(rng))
    a /= np.linalg.norm(a)
    s0 = rng.uniform(-0.1, 0.1, 3)
    lu, ll = rng.uniform(0.2, 0.4), rng.uniform(0.5, 0.8)
    angle = rng.uniform(-np.pi, np.pi)
    upper = lu * (np.cos(angle) * a + np.sin(angle) * np.cross(d, a))
    rod = _unit(rng) + 0.5 * a
    rod *= ll / np.linalg.norm(rod)
    return {
        "type": "RSS",
        "guide_point": (s0 - rod - upper).tolist(),
        "direction": d.tolist(),
        "zero_direction": a.tolist(),
        "platform_point": s0.tolist(),
        "upper_length": lu,
        "lower_length": ll,
        "elbow": int(np.sign(d @ np.cross(rod, upper))),
        "upper": _body(rng, lu, 2),
        "lower": _body(rng, ll, 1),
        "rods": 2,
    }


def _body(rng, length, size):
    mass = rng.uniform(0.5, 2.0)
    center = np.array([-0.5, 0.1][:size]) * length * rng.uniform(0.5, 1.5, size)
    inertia = float(mass * (center @ center + (0.3 * length) ** 2))
    return {"mass": mass, "center_of_mass": center.tolist(), "inertia": inertia}


def _unit(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


DELTA_BOX = np.array([0.0, 0.0, -0.85]), np.array([0.5, 0.5, 0.25])
SMALL_BOX = np.zeros(3), np.full(3, 0.1)

MACHINES = {
    "delta": (catalog_document("delta"), DELTA_BOX),
    "mixed": (mixed(), DELTA_BOX),
    **{f"random delta {seed}": (random_delta(seed), SMALL_BOX) for seed in range(3)},
}
"""The content of a machine's file, and the box (centre, half its edges) its states are drawn in."""


def states(name, machine, count, seed):
    """Return states (pose, velocity, acceleration) of one of the machines, or of a mode of it."""
    return descriptions.states(machine, *MACHINES[name][1], count, seed)
