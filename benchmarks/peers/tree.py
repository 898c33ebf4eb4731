"""The mechanism with its loops cut at the platform points: a tree that any engine can carry.

Each leg is a chain of its own, and so is the platform, whose joints are the pose itself. A slider
does not turn and R1 runs through it, so that its mass may sit in the upper link: one body less. The
joint between a crank or a slider and its rod is two hinges.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

import pteron
from peers.closure import Array, frame_of

__all__ = ["Body", "tree"]


@dataclass(frozen=True)
class Body:
    """A body, with its joints to the body before: it slides along some axes, then turns.

    Parameters
    ----------
    parent : int
        Index of the body before, or -1 for the base.
    rotation, offset : array, shape (3, 3) and (3,)
        Where its frame is in the frame before when all joints are zero.
    slides : tuple of array, shape (3,)
        The axes it slides along, in its own frame.
    hinges : str
        The axes of its frame that it turns about, one after the other; "free" is a free body.
    mass : float
        kg.
    center, inertia : array, shape (3,)
        Centre of mass, and the moments of inertia about it along the frame's axes.
    """

    parent: int
    rotation: Array
    offset: Array
    slides: tuple[Array, ...]
    hinges: Literal["", "z", "zy", "free"]
    mass: float
    center: Array
    inertia: Array


def tree(robot: pteron.Manipulator, carried: bool = True) -> list[Body]:
    """Return two bodies for each leg, then the platform.

    A platform that does not turn is but a mass at its points: without `carried` it is at the end of
    the first leg, a body less.
    """
    legs: tuple[Any, ...] = robot.legs
    bodies: list[Body] = []
    for leg in legs:
        bodies += _LEGS[leg.type](leg, len(bodies))
    platform = robot.platform
    if platform.tilts:
        return [*bodies, Body(-1, np.eye(3), np.zeros(3), (), "free", *_spatial(platform.inertia))]
    if not carried:
        end = np.array([legs[0].lower_length, 0.0, 0.0])
        bodies[1] = _with_mass(bodies[1], platform.total_inertia.mass, end)
        return bodies
    frame = np.column_stack(platform.frame)
    slides = tuple(platform.directions @ frame)
    inertia = _planar(platform.total_inertia)
    return [*bodies, Body(-1, frame, np.zeros(3), slides, "z" if platform.turns else "", *inertia)]


def _with_mass(body: Body, mass: float, place: Array) -> Body:
    """Return a body with a mass at a place in its frame."""
    total = body.mass + mass
    center = (body.mass * body.center + mass * place) / total
    apart = place - body.center
    moved = body.mass * mass / total * (apart @ apart - apart**2)
    return replace(body, mass=total, center=center, inertia=body.inertia + moved)


def _prrr(leg: Any, count: int) -> list[Body]:
    frame = frame_of(leg)
    e = frame.T @ np.array(leg.e) if leg.e != leg.direction else np.array([0.0, 0.0, 1.0])
    mass = leg.upper.mass + leg.slider_mass
    upper = pteron.bodies.PlanarInertia(mass, leg.upper.first_moment, leg.upper.inertia)
    elbow = np.array([leg.upper_length, 0.0, 0.0])
    lower = _planar(leg.lower, reach=leg.lower_length)
    return [
        Body(-1, frame, np.array(leg.guide_point), (e,), "z", *_planar(upper)),
        Body(count, np.eye(3), elbow, (), "z", *lower),
    ]


def _pss(leg: Any, count: int) -> list[Body]:
    mass = leg.slider_mass
    x, nowhere, base = np.array([1.0, 0.0, 0.0]), np.zeros(3), np.array(leg.guide_point)
    # A body that does not turn: its moments of inertia do not matter, but MuJoCo wants some.
    slider = Body(-1, frame_of(leg), base, (x,), "", mass, nowhere, np.full(3, mass))
    return [slider, _rod(leg, count, nowhere)]


def _rss(leg: Any, count: int) -> list[Body]:
    elbow = np.array([leg.upper_length, 0.0, 0.0])
    return [_crank(leg), _rod(leg, count, elbow)]


def _rrr(leg: Any, count: int) -> list[Body]:
    elbow = np.array([leg.upper_length, 0.0, 0.0])
    lower = _planar(leg.lower, reach=leg.lower_length)
    return [_crank(leg), Body(count, np.eye(3), elbow, (), "z", *lower)]


def _ups(leg: Any, count: int) -> list[Body]:
    cylinder, piston = (
        (rod.mass, np.array([rod.center_of_mass[0], 0.0, 0.0]), _of_rod(rod))
        for rod in (leg.upper, leg.lower)
    )
    along, nowhere = (np.array([1.0, 0.0, 0.0]),), np.zeros(3)
    return [
        Body(-1, frame_of(leg), np.array(leg.guide_point), (), "zy", *cylinder),
        Body(count, np.eye(3), nowhere, along, "", *piston),
    ]


_LEGS = {"PRRR": _prrr, "PSS": _pss, "RSS": _rss, "RRR": _rrr, "UPS": _ups}


def _crank(leg: Any) -> Body:
    return Body(-1, frame_of(leg), np.array(leg.guide_point), (), "z", *_planar(leg.upper))


def _rod(leg: Any, count: int, tip: Array) -> Body:
    rod = leg.lower
    center = np.array([leg.lower_length + rod.center_of_mass[0], 0.0, 0.0])
    return Body(count, np.eye(3), tip, (), "zy", rod.mass, center, _of_rod(rod))


def _of_rod(rod: Any) -> Array:
    """Return the moments of a rod along x about its centre."""
    about_center = rod.inertia - rod.mass * rod.center_of_mass[0] ** 2
    # A rod's spin has no inertia; MuJoCo wants some, and this much is lost in rounding.
    return np.array([2e-15, about_center, about_center])


def _spatial(body: Any) -> tuple[float, Array, Array]:
    """Return mass, centre and moments of a body whose axes are its principal ones."""
    center, (xx, xy, xz, yy, yz, zz) = np.array(body.center_of_mass), body.inertia
    about_point = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inertia = about_point - body.mass * (center @ center * np.eye(3) - np.outer(center, center))
    if np.abs(inertia - np.diag(np.diag(inertia))).max() > 1e-12 * inertia.max():
        raise ValueError("the peers have platforms whose axes are principal ones")
    return body.mass, center, np.diag(inertia).copy()


def _planar(body: Any, reach: float = 0.0) -> tuple[float, Array, Array]:
    """Return mass, centre and moments of a body whose reference point is at `reach` along x."""
    gx, gy = body.center_of_mass
    about_center = body.inertia - body.mass * (gx**2 + gy**2)
    # The other two moments do not matter to a body that moves in its plane; these are a real one's.
    inertia = about_center * np.array([0.6, 0.7, 1.0])
    return body.mass, np.array([reach + gx, gy, 0.0]), inertia
