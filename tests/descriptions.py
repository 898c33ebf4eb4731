"""A machine in plain numbers, for oracles that share nothing with pteron but its files.

Positions are trigonometry of triangles; `crank_angle` finds the same by a search for roots.
"""

import tomllib
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from scipy.optimize import brentq


@dataclass(frozen=True)
class Body:
    """Mass, centre of mass, and moment of inertia about the reference point."""

    mass: float
    x: float
    y: float
    inertia: float

    @property
    def moments(self):
        return self.mass, self.mass * self.x, self.mass * self.y, self.inertia

    @property
    def about_center(self):
        return self.inertia - self.mass * (self.x**2 + self.y**2)


@dataclass(frozen=True)
class Leg:
    """A P-R-R-R leg, or with `crank` an R-S-S leg.

    `first` and `second` span the plane perpendicular to d; a crank's angle counts from `first`.
    """

    crank: bool
    r: np.ndarray
    d: np.ndarray
    e: np.ndarray
    first: np.ndarray
    s0: np.ndarray
    lu: float
    ll: float
    elbow: int
    slider_mass: float
    upper: Body
    lower: Body

    @property
    def second(self):
        return np.cross(self.d, self.first)


@dataclass(frozen=True)
class Machine:
    """Legs, the platform's axes as columns, whether it turns about the last, body and gravity."""

    legs: tuple
    frame: np.ndarray
    turns: bool
    platform: Body
    gravity: np.ndarray

    @property
    def freedom(self):
        return 4 if self.turns else 3

    def with_elbows(self, signs):
        legs = zip(self.legs, signs, strict=True)
        return replace(self, legs=tuple(replace(leg, elbow=sign) for leg, sign in legs))


def describe(robot):
    """Return the description of a pteron robot, or of what looks like one."""
    if isinstance(robot, Machine):
        return robot
    return Machine(
        legs=tuple(_leg(leg) for leg in robot.legs),
        frame=np.column_stack(robot.platform.frame),
        turns=robot.platform.turns,
        platform=_body(robot.platform.inertia),
        gravity=np.array(robot.gravity),
    )


def _leg(leg):
    crank = getattr(leg, "type", "PRRR") == "RSS"
    d = np.array(leg.direction)
    if crank:
        first = np.array(leg.zero_direction)
    else:
        first = np.cross(d, np.eye(3)[np.argmin(np.abs(d))])
        first /= np.linalg.norm(first)
    return Leg(
        crank=crank,
        r=np.array(leg.guide_point),
        d=d,
        e=d if crank else np.array(leg.slider_direction or leg.direction),
        first=first,
        s0=np.array(leg.platform_point),
        lu=leg.upper_length,
        ll=leg.lower_length,
        elbow=leg.elbow,
        slider_mass=0.0 if crank else leg.slider_mass,
        upper=_body(leg.upper),
        lower=_body(leg.lower),
    )


def _body(body):
    x, y = (*np.ravel(body.center_of_mass), 0.0)[:2]
    return Body(body.mass, float(x), float(y), body.inertia)


def read(path):
    """Return the description of a file, read without pteron."""
    return describe(lookalike(tomllib.loads(Path(path).read_text(encoding="utf-8"))))


def lookalike(document):
    """Return what has a robot's attributes, from a file's content; 3T machines, frame of the base.

    Unit vectors are taken as they are.
    """
    platform = document["platform"]
    legs = []
    for table in document["legs"]:
        bodies = {key: SimpleNamespace(**table[key]) for key in ("upper", "lower")}
        slider = {
            "slider_direction": table.get("slider_direction"),
            "slider_mass": table.get("slider", {}).get("mass"),
        }
        legs.append(SimpleNamespace(**{**table, **bodies, **slider}))
    return SimpleNamespace(
        name=document["name"],
        legs=tuple(legs),
        platform=SimpleNamespace(frame=np.eye(3), turns=False, inertia=SimpleNamespace(**platform)),
        gravity=document["gravity"],
    )


def platform_points(machine, pose):
    """Return the platform points (n, 3)."""
    phi = pose[3] if machine.turns else 0.0
    turn = np.array([[np.cos(phi), -np.sin(phi), 0], [np.sin(phi), np.cos(phi), 0], [0, 0, 1]])
    return np.array([pose[:3] + machine.frame @ turn @ leg.s0 for leg in machine.legs])


def leg_angles(leg, c):
    """Return the joint coordinate, the angle of the upper link, and the last link (3,).

    The angle counts from `first`, so that a crank's is its joint coordinate.
    """
    w = c - leg.r
    slide = 0.0 if leg.crank else (w @ leg.d) / (leg.e @ leg.d)
    w = w - slide * leg.e
    x, y, out = w @ leg.first, w @ leg.second, w @ leg.d
    n = np.hypot(x, y)
    opening = np.arccos((n**2 + leg.lu**2 + out**2 - leg.ll**2) / (2 * n * leg.lu))
    angle = np.arctan2(y, x) + leg.elbow * opening
    last = w - leg.lu * (np.cos(angle) * leg.first + np.sin(angle) * leg.second)
    return (angle if leg.crank else slide), angle, last


def crank_angle(leg, c):
    """Return the angle at which the crank's end is as far from c as the rod is long, by search.

    Of the two it is the one whose crank lies on the elbow's side of the plane through d and c.
    """
    w = c - leg.r

    def crank(q):
        return leg.lu * (
            np.multiply.outer(np.cos(q), leg.first) + np.multiply.outer(np.sin(q), leg.second)
        )

    def excess(q):
        return np.linalg.norm(w - crank(q), axis=-1) - leg.ll

    grid = np.linspace(-np.pi, np.pi, 721)
    negative = excess(grid) < 0
    brackets = np.flatnonzero(negative[:-1] != negative[1:])
    roots = [brentq(excess, grid[i], grid[i + 1], xtol=1e-15, rtol=1e-14) for i in brackets]
    (found,) = [q for q in roots if leg.elbow * (leg.d @ np.cross(w, crank(q))) > 0]
    return found


def inverse_kinematics(machine, pose):
    """Return the joint coordinates (n,); cranks within (-pi, pi]."""
    points = zip(machine.legs, platform_points(machine, pose), strict=True)
    joints = [leg_angles(leg, c)[0] for leg, c in points]
    cranks = [leg.crank for leg in machine.legs]
    return np.where(cranks, -((np.pi - np.array(joints)) % (2 * np.pi)) + np.pi, joints)


def distances_from_singular(machine, pose):
    """Return the least sine between a leg's two links, and the least singular value of A (3T).

    The sine is that of the crank and the rod's part in its plane, per rod length; A's rows are
    unit vectors along the rods, and d for a slider. NaN where a leg does not reach.
    """
    sines, rows = [], []
    for leg, c in zip(machine.legs, platform_points(machine, pose), strict=True):
        with np.errstate(invalid="ignore"):
            _, angle, last = leg_angles(leg, c)
        upper = np.cos(angle) * leg.first + np.sin(angle) * leg.second
        sines.append(abs(leg.d @ np.cross(upper, last)) / leg.ll)
        rows.append(last / leg.ll if leg.crank else leg.d)
    if not np.isfinite(rows).all():
        return np.nan, np.nan
    return min(sines), np.linalg.svd(rows, compute_uv=False)[-1]


def states(machine, center, spread, count, seed):
    """Return poses of a box that are far from singular, velocities and accelerations (3T)."""
    rng = np.random.default_rng(seed)
    drawn = center + spread * rng.uniform(-1, 1, (20 * count, 3))
    far = (pose for pose in drawn if min(distances_from_singular(machine, pose)) > 0.2)
    poses = np.array(list(islice(far, count)))
    assert len(poses) == count, "the box holds too few poses far from singular"
    return poses, rng.normal(size=poses.shape), 10.0 * rng.normal(size=poses.shape)
