"""Links, drives and shapes for URDF and SDF: one link for each joint, frames by roll-pitch-yaw."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pteron.export.engines.formatting import look, row
from pteron.export.engines.inertia import massless_inertia
from pteron.export.engines.parts import BASE, BodyShape, Tree, TreeBody, TreeJoint
from pteron.kernels import Array
from pteron.tolerances import SAME


class Link(NamedTuple):
    """A link, and the joint between it and its parent; all but a body's last link are light."""

    name: str
    parent: str
    body: TreeBody
    joint: TreeJoint
    first: bool
    """Whether its joint is the body's first."""
    last: bool
    """Whether it is the body itself, and not a light link between two joints of it."""
    mass: float
    moments: Array
    products: Array

    @property
    def shapes(self) -> tuple[BodyShape, ...]:
        """Shapes of the body; a light link has none."""
        return self.body.shapes if self.last else ()


def links_of(bodies: Sequence[TreeBody]) -> list[Link]:
    """Return the links of bodies: a link for each joint."""
    links = []
    for body in bodies:
        parent = "base" if body.parent == BASE else bodies[body.parent].name
        for joint in body.joints:
            first, last = joint is body.joints[0], joint is body.joints[-1]
            name = body.name if last else f"{joint.name}_link"
            inertia = body.mass, body.moments, body.products
            if not last:
                inertia = *massless_inertia(body.mass, body.moments), np.zeros(3)
            links.append(Link(name, parent, body, joint, first, last, *inertia))
            parent = name
    return links


class JointDrive(NamedTuple):
    """A drive's numbers at the joint of the tree that it moves, SI units."""

    effort: float | None
    speed: float | None
    damping: float
    friction: float


def joint_drive(opened: Tree, joint: TreeJoint) -> JointDrive | None:
    """Return the numbers of the drive that moves a joint; None for a passive one."""
    for motor in opened.motors:
        if motor.joint == joint.name:
            drive, ratio = motor.drive, abs(motor.ratio)
            effort = ratio * drive.max_force if drive.max_force else None
            speed = drive.max_speed / ratio if drive.max_speed else None
            return JointDrive(effort, speed, ratio**2 * drive.viscous, ratio * drive.coulomb)
    return None


class LinkShape(NamedTuple):
    """A shape: "sphere", "cylinder" along its own z, or "box"; all texts."""

    kind: str
    place: str
    turn: str
    radius: str
    length: str
    side: str


def link_shape(shape: BodyShape, body: TreeBody | None) -> LinkShape:
    """Return a body's shape with its pose and sizes as texts, in the body's or the base frame."""
    ends = shape.ends if body is None else (shape.ends - body.origin) @ body.axes
    axis, middle = ends[1] - ends[0], ends.mean(axis=0)
    length = float(np.linalg.norm(axis))
    kind = {"box": "box"}.get(shape.kind, "cylinder")
    turn = np.eye(3)
    if length < SAME:
        kind = "sphere"
    else:
        z = axis / length
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        x /= np.linalg.norm(x)
        turn = np.column_stack([x, np.cross(z, x), z])
    sizes = look(shape.radius), look(length), look(2.0 * shape.radius)
    return LinkShape(kind, look(middle), look(roll_pitch_yaw(turn)), *sizes)


def roll_pitch_yaw(turn: Array) -> Array:
    """Return the angles (3,) of a rotation about fixed x, then y, then z, rad.

    At a pitch of a quarter turn roll and yaw are not unique; rounding chooses.
    """
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    s, c = np.sin(yaw), np.cos(yaw)
    pitch = np.arctan2(-turn[2, 0], c * turn[0, 0] + s * turn[1, 0])
    roll = np.arctan2(s * turn[0, 2] - c * turn[1, 2], c * turn[1, 1] - s * turn[0, 1])
    return np.array([roll, pitch, yaw])


def frame_texts(motion: Array) -> tuple[str, str]:
    """Return a frame's place and its turn by roll, pitch and yaw, as texts."""
    return row(motion[:3, 3]), row(roll_pitch_yaw(motion[:3, :3]))
