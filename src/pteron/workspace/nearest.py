"""How far a pose is from the nearest singular poses, moved or turned alone, in metres or radians.

A singular pose is where a function that is smooth in the pose vanishes: the square of a leg's
type-I measure, the type-II measure, or the constraint measure. Under translation it is sought along
rays in all directions, on which the function changes its sign; the nearest such places are starts
for the nearest point of the surface on which it vanishes (sequential quadratic programming, with
CasADi's gradients). Under rotation it is sought round the axis. Where a function touches zero
without changing its sign, that is not found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.equations.machine import closure_of
from pteron.kernels import Array, numeric, program
from pteron.kinematics import inverse_kinematics, singular_orientations
from pteron.kinematics.architecture import (
    architecture,
    is_singular_everywhere,
    singular_everywhere,
)
from pteron.kinematics.evaluate import checked_one
from pteron.kinematics.sampling import search_ball
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.shapes import PoseLike

_RAYS = 400
_STEPS = 160
"""Places on a ray, closer together near the pose."""

_ANGLES = 1440
_HALVINGS = 60
_STARTS = 6
"""The nearest of the places found on rays, from which a nearer one is sought."""

_CONES = 40
"""Narrower and narrower cones of rays round the best, where no gradient helps: at an edge of the
reach."""

_EDGE = 1e-9
"""Squares of type-I measures below zero that count as in reach: of a pose on the edge."""

_SINGULAR = 1e-10
"""The measure of a pose that counts as singular."""

_TINY = 1e-300

Kind = Literal["I", "II", "constraint"]

_WHAT = {"I": "squared_type_i", "II": "type_ii", "constraint": "constraint"}
"""The function that vanishes, by kind."""


@dataclass(frozen=True)
class NearestSingularity:
    """The nearest singular pose of one kind.

    Attributes
    ----------
    kind : {"I", "II", "constraint"}
        Type I: a leg is stretched or folded. Type II: the actuators do not hold the platform.
        Constraint: the legs do not hold its orientation.
    leg : int
        The leg, from 1, of type I; else 0.
    by : {"translation", "rotation"}
        What leads there: the position alone, or the angle alone.
    distance : float
        m or rad; rad too where the platform slides.
    pose : array, shape (m,)
        The singular pose.
    measure : float
        What vanishes there: the type-I measure's square, the type-II or the constraint measure.
    """

    kind: Kind
    leg: int
    by: Literal["translation", "rotation"]
    distance: float
    pose: Array
    measure: float

    @property
    def unit(self) -> str:
        """The distance's unit."""
        return "m" if self.by == "translation" else "rad"


def nearest_singularities(robot: RobotLike, pose: PoseLike) -> tuple[NearestSingularity, ...]:
    """Return the nearest singular poses of each kind, by translation and by rotation alone.

    Only poses in reach of all legs count, and of the robot's working mode; limits of joints do not.
    But an orientation that is singular (type II) at every position counts as such everywhere.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (m,)
        One pose, m and rad.

    Returns
    -------
    tuple of NearestSingularity
        Those by translation first, the nearest first. A kind of which none is found is left out,
        and constraint singularities where every pose is one, or bars are not told.

    Raises
    ------
    UnreachablePose
        If a leg does not reach the pose.
    SingularPose
        If the machine is singular everywhere.

    Examples
    --------
    >>> import numpy as np
    >>> from pteron.workspace import nearest_singularities
    >>> found = nearest_singularities("quadrupteron", [0.0, 0.0, 0.0, 0.1])
    >>> (turn,) = [one for one in found if one.kind == "II"]
    >>> turn.by, float(np.degrees(turn.pose[3]).round(9))
    ('rotation', 90.0)
    """
    robot = as_manipulator(robot)
    at = checked_one(robot, pose, "pose")
    if is_singular_everywhere(robot):
        raise singular_everywhere(robot)
    inverse_kinematics(robot, at)
    kinds: list[tuple[Kind, int]] = [("I", i) for i in range(1, robot.freedom + 1)]
    kinds += [("II", 0), ("constraint", 0)] if architecture(robot).holds else [("II", 0)]
    found = []
    for by in ("translation", "rotation")[: 1 + ("phi" in robot.coordinates)]:
        search = _turned if by == "rotation" else _moved
        several: list[NearestSingularity] = []
        for kind, leg in kinds:
            vanishing = _Vanishing(robot, leg - 1 if kind == "I" else None, kind)
            place = search(vanishing, at)
            if place is not None:
                lengths = len(robot.platform.lengths)
                way = (place - at)[:lengths] if by == "translation" else (place - at)[lengths:]
                distance = float(np.linalg.norm(way))
                measure = float(vanishing(place[None])[0][0])
                several.append(NearestSingularity(kind, leg, by, distance, place, measure))  # type: ignore[arg-type]
        found += sorted(several, key=lambda one: one.distance)
    return tuple(found)


@dataclass(frozen=True)
class _Vanishing:
    """A function that vanishes at the singular poses of a kind."""

    robot: Manipulator
    leg: int | None
    """Of type I, from 0."""
    kind: Kind

    def __call__(self, poses: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return its values at poses (..., m), and which of them are in reach of other legs."""
        squares = numeric(self.robot, "squared_type_i")(poses)[0]
        values = (
            squares if self.leg is not None else numeric(self.robot, _WHAT[self.kind])(poses)[0]
        )
        return self.among(squares, values)

    def among(self, squares: Array, values: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the same of the squares of all type-I measures and of a measure's values."""
        if self.leg is None:
            return values, np.asarray((squares >= 0.0).all(axis=-1) & np.isfinite(values))
        others = np.delete(squares, self.leg, axis=-1)
        return squares[..., self.leg], np.asarray((others >= -_EDGE).all(axis=-1))

    def slope(self, pose: Array) -> tuple[Array, Array, Array]:
        """Return its gradient, the squares of all type-I measures, and their gradients (n, m)."""
        row = self.robot.freedom + (self.kind == "constraint")
        values, slopes = (np.asarray(part) for part in _smooth(self.robot)(pose))
        n = self.robot.freedom
        return slopes[row if self.leg is None else self.leg], values[:n, 0], slopes[:n]


@lru_cache(maxsize=32)
def _smooth(robot: Manipulator) -> ca.Function:
    """Return the functions that vanish, and their gradients."""
    pose = ca.SX.sym("pose", robot.freedom)
    parts = [
        program(robot, what).function(pose) for what in ("squared_type_i", "type_ii", "constraint")
    ]
    values = ca.vertcat(*(ca.vec(part) for part in parts))
    return ca.Function("smooth", [pose], ca.cse([values, ca.jacobian(values, pose)]))


def _changes(
    vanishing: _Vanishing,
    start: Array,
    way: Array,
    places: Array,
    known: tuple[Array, NDArray[np.bool_]] | None = None,
) -> Array:
    """Return the least share (R,) of ways (R, m) from a start at which the sign changes, or inf.

    It is looked for between each two of `places` (S,), where the function may be known.
    """
    values, reached = known or vanishing(start + places[:, None, None] * way)
    negative = values < 0.0
    changed = (negative[1:] != negative[:-1]) & reached[1:] & reached[:-1]
    rays = np.flatnonzero(changed.any(axis=0))
    first = changed[:, rays].argmax(axis=0)
    low, high, side = places[first], places[first + 1], negative[first, rays]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        value, _ = vanishing(start + middle[:, None] * way[rays])
        before = (value < 0.0) == side
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    found = np.full(len(way), np.inf)
    value, reached_too = vanishing(start + low[:, None] * way[rays])
    # Else a gap in the reach lies between two places.
    true = reached_too & (np.abs(value) <= 1e3 * _SINGULAR)
    found[rays[true]] = low[true]
    return found


def _turned(vanishing: _Vanishing, start: Array) -> Array | None:
    """Return the nearest pose at which the function vanishes, turned only."""
    if np.abs(vanishing(start[None])[0][0]) <= _SINGULAR:
        return start
    if vanishing.kind == "II" and closure_of(vanishing.robot).orientation is not None:
        ways = singular_orientations(vanishing.robot) - start[-1]
        ways -= 2.0 * np.pi * np.round(ways / (2.0 * np.pi))
        return np.append(start[:-1], start[-1] + ways[np.abs(ways).argmin()])
    way = np.zeros((2, len(start)))
    way[:, -1] = np.pi, -np.pi
    shares = _changes(vanishing, start, way, np.linspace(0.0, 1.0, _ANGLES // 2 + 1))
    best = int(shares.argmin())
    return start + shares[best] * way[best] if np.isfinite(shares[best]) else None


def _moved(vanishing: _Vanishing, start: Array) -> Array | None:
    """Return the nearest pose at which the function vanishes, moved only."""
    if np.abs(vanishing(start[None])[0][0]) <= _SINGULAR:
        return start
    robot, lengths = vanishing.robot, len(vanishing.robot.platform.lengths)
    rays, places = _rays(robot, tuple(start.tolist()))
    squares, values = (
        _on_rays(robot, tuple(start.tolist()), _WHAT[kind]) for kind in ("I", vanishing.kind)
    )
    shares = _changes(vanishing, start, rays, places, vanishing.among(squares, values))
    order = np.argsort(shares, kind="stable")[:_STARTS]
    hits = [start + shares[i] * rays[i] for i in order if np.isfinite(shares[i])]
    if not hits:
        return None
    nearer = [found for hit in hits if (found := _projected(vanishing, start, hit)) is not None]

    def distance(pose: Array) -> float:
        return float(np.linalg.norm(pose - start))

    best: Array = min([hits[0], *nearer], key=distance)
    return _narrowed(vanishing, start, best, lengths) if best is hits[0] else best


def _rays(robot: Manipulator, start: tuple[float, ...]) -> tuple[Array, Array]:
    """Return rays (R, m) from a start to beyond all that is in reach, and shares (S,) of them."""
    lengths = len(robot.platform.lengths)
    center, radius = search_ball(robot)
    far = float(np.linalg.norm(np.array(start[:lengths]) - center)) + radius
    rays = np.zeros((_RAYS, len(start)))
    rays[:, :lengths] = far * _directions(lengths)
    return rays, np.linspace(0.0, 1.0, _STEPS + 1) ** 1.5


@lru_cache(maxsize=4)
def _on_rays(robot: Manipulator, start: tuple[float, ...], what: str) -> Array:
    """Return a function at all places on all rays."""
    rays, places = _rays(robot, start)
    return np.asarray(numeric(robot, what)(np.array(start) + places[:, None, None] * rays)[0])


def _directions(lengths: int) -> Array:
    """Return unit vectors spread evenly over a sphere (Fibonacci's lattice) or a circle."""
    k = np.arange(_RAYS) + 0.5
    if lengths == 2:
        angles = 2.0 * np.pi * k / _RAYS
        return np.column_stack([np.cos(angles), np.sin(angles)])
    height, angles = 1.0 - 2.0 * k / _RAYS, np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - height * height)
    return np.column_stack([across * np.cos(angles), across * np.sin(angles), height])


def _projected(vanishing: _Vanishing, start: Array, hit: Array) -> Array | None:
    """Return the point of the surface nearest to the start, sought from a hit; None if lost."""
    # Kinematics load without SciPy.
    from scipy.optimize import minimize  # type: ignore[import-untyped]

    lengths, scale = len(vanishing.robot.platform.lengths), float(np.linalg.norm(hit - start))
    if scale == 0.0:
        return hit

    def pose_of(x: Array) -> Array:
        pose = start.copy()
        pose[:lengths] += scale * x
        return pose

    def value(x: Array) -> float:
        return float(vanishing(pose_of(x)[None])[0][0])

    def slope(x: Array) -> Array:
        return np.asarray(scale * vanishing.slope(pose_of(x))[0][:lengths])

    others = [i for i in range(vanishing.robot.freedom) if i != vanishing.leg]
    conditions: list[dict[str, str | Callable[[Array], object]]] = [
        {"type": "eq", "fun": value, "jac": slope},
        {
            "type": "ineq",
            "fun": lambda x: vanishing.slope(pose_of(x))[1][others],
            "jac": lambda x: scale * vanishing.slope(pose_of(x))[2][others, :lengths],
        },
    ]
    with np.errstate(all="ignore"):
        run = minimize(
            lambda x: (0.5 * x @ x, x),
            (hit - start)[:lengths] / scale,
            jac=True,
            method="SLSQP",
            constraints=conditions,
            options={"ftol": 1e-15, "maxiter": 60},
        )
        pose = pose_of(run.x)
        for _ in range(3):  # on the surface to rounding
            g = vanishing.slope(pose)[0][:lengths]
            pose[:lengths] -= vanishing(pose[None])[0][0] * g / max(float(g @ g), _TINY)
        measure, reached = vanishing(pose[None])
    good = np.isfinite(pose).all() and reached[0] and abs(measure[0]) <= _SINGULAR
    return pose if good else None


def _narrowed(vanishing: _Vanishing, start: Array, hit: Array, lengths: int) -> Array:
    """Return a nearer place than a hit, on rays in narrower and narrower cones round it."""
    rng, places = np.random.default_rng(0), np.linspace(0.9, 1.001, 12)
    spread = 2.0 / np.sqrt(_RAYS)
    for _ in range(_CONES):
        size = float(np.linalg.norm(hit - start))
        rays = np.zeros((32, len(start)))
        rays[:, :lengths] = (hit - start)[:lengths]
        rays[1:, :lengths] += spread * size * rng.normal(size=(31, lengths))
        rays *= size / np.linalg.norm(rays, axis=-1, keepdims=True)
        shares = _changes(vanishing, start, rays, places)
        best = int(shares.argmin())
        if shares[best] < 1.0:
            hit = start + shares[best] * rays[best]
        else:
            spread *= 0.6
    return hit
