"""The mechanism with its loops cut at the platform points: a tree that any engine can carry.

Each leg is a chain of its own, and so is the platform, whose joints are the pose itself. A slider
does not turn and R1 runs through it, so that its mass may sit in the upper link: one body less.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import pteron
from peers.closure import Array, plane

__all__ = ["Body", "tree"]


@dataclass(frozen=True)
class Body:
    """A body, with its joints to the body before: it slides along some axes, then turns about z.

    Parameters
    ----------
    parent : int
        Index of the body before, or -1 for the base.
    rotation, offset : array, shape (3, 3) and (3,)
        Where its frame is in the frame before when all joints are zero.
    slides : tuple of array, shape (3,)
        The axes it slides along, in its own frame.
    mass : float
        kg.
    center, inertia : array, shape (3,)
        Centre of mass, and the moments of inertia about it along the frame's axes.
    """

    parent: int
    rotation: Array
    offset: Array
    slides: tuple[Array, ...]
    mass: float
    center: Array
    inertia: Array


def tree(robot: pteron.Manipulator) -> list[Body]:
    """Return upper and lower link of each leg, then the platform."""
    bodies = []
    for leg in robot.legs:
        frame = plane(leg)
        e = frame.T @ np.array(leg.e) if leg.e != leg.direction else np.array([0.0, 0.0, 1.0])
        mass = leg.upper.mass + leg.slider_mass
        upper = pteron.PlanarInertia(mass, leg.upper.first_moment, leg.upper.inertia)
        bodies.append(_body(upper, -1, frame, np.array(leg.guide_point), (e,)))
        elbow = np.array([leg.upper_length, 0.0, 0.0])
        bodies.append(
            _body(leg.lower, len(bodies) - 1, np.eye(3), elbow, (), reach=leg.lower_length)
        )
    frame = np.column_stack(robot.platform.frame)
    bodies.append(_body(robot.platform.inertia, -1, frame, np.zeros(3), tuple(frame)))
    return bodies


def _body(
    planar: pteron.PlanarInertia,
    parent: int,
    rotation: Array,
    offset: Array,
    slides: tuple[Array, ...],
    reach: float = 0.0,
) -> Body:
    """Return a body whose reference point is at `reach` along x."""
    gx, gy = planar.center_of_mass
    about_center = planar.inertia - planar.mass * (gx**2 + gy**2)
    # The other two moments do not matter to a body that moves in its plane; these are a real one's.
    inertia = about_center * np.array([0.6, 0.7, 1.0])
    center = np.array([reach + gx, gy, 0.0])
    return Body(parent, rotation, offset, slides, planar.mass, center, inertia)
