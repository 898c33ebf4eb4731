"""The parts of a `Tree`, a machine with its loops cut open: bodies, joints, drives, loop closings.

Engines' files are written from it. Everything is in the base frame with the machine at its home
pose, where all loops are closed; `bodies_at_zero` takes the joints back to zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from pteron.kernels import Array
from pteron.legs import Drive
from pteron.manipulator import Manipulator
from pteron.renamed import former_attribute

BASE = -1
"""The parent of a body that hangs on the base."""


@dataclass(frozen=True)
class TreeJoint:
    """A joint between a body and its parent.

    Attributes
    ----------
    name : str
        For actuated joints as in the robot's logs, for the platform's as in its pose.
    is_prismatic : bool
        Whether it slides along its axis, and does not turn about it.
    axis, point : array, shape (3,)
        Unit vector, and a point on it, m, at the home pose.
    home : float
        Its coordinate there, m or rad. Passive joints of legs are zero there.
    limits : (float, float), optional
        m or rad.
    follows : (str, float), optional
        The joint that it is coupled to, and its coordinate per unit of that one's.
    """

    name: str
    is_prismatic: bool
    axis: Array
    point: Array
    home: float = 0.0
    limits: tuple[float, float] | None = None
    follows: tuple[str, float] | None = None

    slides = former_attribute("slides", "is_prismatic")


@dataclass(frozen=True)
class BodyShape:
    """The shape of a body: a round bar between two points, or a box along them.

    Attributes
    ----------
    kind : {"capsule", "cylinder", "box"}
        What it is.
    ends : array, shape (2, 3)
        Where it begins and ends in the base frame at the home pose, m.
    radius : float
        m; of a box, half its side.
    """

    kind: Literal["capsule", "cylinder", "box"]
    ends: Array
    radius: float


@dataclass(frozen=True)
class TreeBody:
    """A body, with the joints between it and the body before.

    Attributes
    ----------
    name : str
        Such as "leg1_crank".
    parent : int
        The body before, or `BASE`.
    joints : tuple of TreeJoint
        From the body before; several are at one place, with nothing between them.
    origin : array, shape (3,)
        The origin of its frame, on its last joint, m.
    axes : array, shape (3, 3)
        The axes of its frame, as columns.
    mass : float
        kg.
    center : array, shape (3,)
        Its centre of mass, m.
    moments : array, shape (3,)
        Its moments of inertia about the centre of mass, kg m^2.
    color : int
        The leg it belongs to, from 1; 0 for the platform's.
    products : array, shape (3,)
        Ixy, Ixz and Iyz about the centre of mass, kg m^2.
    shapes : tuple of BodyShape
        Its shapes in pictures.
    """

    name: str
    parent: int
    joints: tuple[TreeJoint, ...]
    origin: Array
    axes: Array
    mass: float
    center: Array
    moments: Array
    color: int
    products: Array = field(default_factory=lambda: np.zeros(3))
    shapes: tuple[BodyShape, ...] = ()

    @property
    def tensor(self) -> Array:
        """Its inertia tensor (3, 3) about the centre of mass, kg m^2."""
        tensor = np.diag(self.moments)
        tensor[[0, 0, 1], [1, 2, 2]] = tensor[[1, 2, 2], [0, 0, 1]] = self.products
        return tensor


@dataclass(frozen=True)
class Closing:
    """A point where a loop was cut, common to two bodies.

    Attributes
    ----------
    name : str
        Of the leg, or of the part of the platform, that ends there.
    one, other : int
        The bodies: the leg's last, and that of the platform.
    point : array, shape (3,)
        In the base frame at the home pose, m.
    """

    name: str
    one: int
    other: int
    point: Array


@dataclass(frozen=True)
class TreeMotor:
    """The drive of a joint of the tree.

    Attributes
    ----------
    name : str
        The actuated joint's, as in logs.
    joint : str
        The joint of the tree that it moves.
    ratio : float
        The actuated joint's coordinate per unit of that one's: 1, but for a shaft, which turns the
        platform.
    drive : Drive
        Its friction, its motor, its limits.
    """

    name: str
    joint: str
    ratio: float
    drive: Drive


@dataclass(frozen=True)
class Tree:
    """A mechanism whose loops are cut: the platform and the legs as chains from the base.

    Attributes
    ----------
    robot : Manipulator
        The machine.
    home : array, shape (m,)
        The pose in which everything here is.
    bodies : tuple of TreeBody
        Each after its parent: the platform's first, then those of leg 1, leg 2, ...
    closings : tuple of Closing
        Of the legs, then of the platform's parts.
    motors : tuple of TreeMotor
        One for each leg.
    base : tuple of (int, BodyShape)
        What stands on the base, guides and axles, by the leg it belongs to.
    size : float
        How large the machine is, m.
    """

    robot: Manipulator
    home: Array
    bodies: tuple[TreeBody, ...]
    closings: tuple[Closing, ...]
    motors: tuple[TreeMotor, ...]
    base: tuple[tuple[int, BodyShape], ...]
    size: float

    @property
    def joints(self) -> tuple[TreeJoint, ...]:
        """All joints, in the order of the coordinates."""
        return tuple(joint for body in self.bodies for joint in body.joints)

    @property
    def platform(self) -> int:
        """The index of the platform's body."""
        return next(i for i, body in enumerate(self.bodies) if body.name == "platform")

    @property
    def free(self) -> tuple[TreeJoint, ...]:
        """Joints that are coupled to no other."""
        return tuple(joint for joint in self.joints if joint.follows is None)


def place(tree: Tree, coordinates: Mapping[str, float]) -> list[Array]:
    """Return each body's displacement from the home pose, (4, 4), for joint coordinates by name."""
    displacements: list[Array] = []
    for body in tree.bodies:
        moved = np.eye(4) if body.parent == BASE else displacements[body.parent]
        for joint in body.joints:
            moved = moved @ displacement(joint, coordinates[joint.name] - joint.home)
        displacements.append(moved)
    return displacements


def bodies_at_zero(tree: Tree) -> tuple[TreeBody, ...]:
    """Return the bodies at zero joint coordinates: each chain for itself, loops open."""
    bodies: list[TreeBody] = []
    moved: list[Array] = []
    for body in tree.bodies:
        motion = np.eye(4) if body.parent == BASE else moved[body.parent]
        joints = []
        for joint in body.joints:
            axis, point = motion[:3, :3] @ joint.axis, moved_point(motion, joint.point)
            joints.append(replace(joint, axis=axis, point=point, home=0.0))
            motion = motion @ displacement(joint, -joint.home)
        moved.append(motion)
        shapes = [
            replace(shape, ends=np.array([moved_point(motion, end) for end in shape.ends]))
            for shape in body.shapes
        ]
        bodies.append(
            replace(
                body,
                joints=tuple(joints),
                origin=moved_point(motion, body.origin),
                axes=motion[:3, :3] @ body.axes,
                center=moved_point(motion, body.center),
                shapes=tuple(shapes),
            )
        )
    return tuple(bodies)


def displacement(joint: TreeJoint, by: float) -> Array:
    """Return the displacement (4, 4) of a body by its joint's motion, m or rad."""
    moved = np.eye(4)
    if joint.is_prismatic:
        moved[:3, 3] = by * joint.axis
    else:
        cross = np.cross(np.eye(3), joint.axis)
        moved[:3, :3] += np.sin(by) * cross + (1.0 - np.cos(by)) * cross @ cross
        moved[:3, 3] = joint.point - moved[:3, :3] @ joint.point
    return moved


def moved_point(motion: Array, point: Array) -> Array:
    """Return a point (3,) displaced by a rigid motion (4, 4)."""
    return np.asarray(motion[:3, :3] @ point + motion[:3, 3])
