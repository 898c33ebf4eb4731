"""`tree`: a machine as an opened mechanism, the legs and the platform as chains from the base.

Each leg is cut at its platform point, where its last body ends. The joints beyond are left out: the
platform has a chain of its own, which slides along the pose's lengths and turns by its angles. Of
an articulated platform each part that does not turn is a body of its own, closed with the platform
at its hinge. Gears, and halves of a platform that slide, are coupled to the angle phi.

Any kind of leg is served: all is read from `LegMotion.chain` and `LegMotion.bodies` (`legs.leg`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pteron.bodies.inertia import SpatialInertia
from pteron.errors import SingularPose
from pteron.export.engines.chains import LegStance, leg_stances, shaft_ratio
from pteron.export.engines.home_pose import chosen_home
from pteron.export.engines.inertia import (
    central_inertia,
    cube_moments,
    plane_moments,
    rod_moments,
    spatial_moments,
)
from pteron.export.engines.parts import BASE, Closing, Tree, TreeBody, TreeJoint, TreeMotor
from pteron.export.engines.platform import platform_bodies
from pteron.kernels import Array
from pteron.legs import Drive
from pteron.legs.kind import LegKind
from pteron.manipulator import RobotLike, as_manipulator
from pteron.manipulator.readings import refuse_readings
from pteron.shapes import PoseLike
from pteron.tolerances import ROUNDING

_ALONG_HINGE = 0.04
"""Distance of the second point of a hinge at the platform from the first, as a share of the
machine's size: both points close the loop and hold the hinge's axis."""


def tree(robot: RobotLike, home: PoseLike | None = None) -> Tree:
    """Return a machine as chains of bodies, and the points where their loops close.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    home : array, shape (m,), optional
        The pose in which it stands, m and rad; where it is left out that with all joints in the
        middle of their ranges, or the best of random ones.

    Returns
    -------
    Tree

    Raises
    ------
    DataError, UnreachablePose
        If `home` is no pose, or out of reach.
    SingularPose
        If a joint of a leg has no axis in that pose.
    ModelError
        If a kind of leg does not say which joint carries which body.

    Examples
    --------
    >>> import pteron
    >>> from pteron.export import tree
    >>> opened = tree(pteron.load("delta"))
    >>> [body.name for body in opened.bodies][:3]
    ['platform', 'leg1_crank', 'leg1_rod']
    >>> [joint.name for joint in opened.joints][:6]
    ['x', 'y', 'z', 'theta1', 'leg1_joint1', 'leg1_joint2']
    """
    robot = as_manipulator(robot)
    refuse_readings(robot, "a model for another engine")
    pose = chosen_home(robot, home)
    stances = leg_stances(robot, pose)
    _expect_axes(stances, pose)
    size = _size(stances, robot.platform.placement(pose)[0])
    bodies, carriers, closings = platform_bodies(robot, pose)
    names = robot.joint_names
    motors, axis_closings = [], []
    for i, (leg, stance) in enumerate(zip(robot.legs, stances, strict=True)):
        chain = _leg(leg, i + 1, stance, names[i], len(bodies), size)
        bodies += chain
        closings.append(Closing(f"leg{i + 1}", len(bodies) - 1, carriers[i], stance.end))
        if stance.hinge is not None:
            on_axis = stance.end + _ALONG_HINGE * size * stance.hinge
            axis_closings.append(Closing(f"leg{i + 1}_axis", len(bodies) - 1, carriers[i], on_axis))
        drive, ratio = leg.drive or Drive(), 1.0
        joint = names[i]
        if stance.driven is None:
            joint, ratio = bodies[0].joints[-1].name, shaft_ratio(robot, i)
            bodies[0] = _with_shaft(bodies[0], leg.limits, ratio)
        motors.append(TreeMotor(names[i], joint, ratio, drive))
    # The legs' closings first: what the platform's parts and the legs' hinges add comes after.
    count = len(robot.legs)
    closings = closings[-count:] + closings[:-count] + axis_closings
    return Tree(robot, pose, tuple(bodies), tuple(closings), tuple(motors), (), size)


def _expect_axes(stances: Sequence[LegStance], pose: Array) -> None:
    """Raise SingularPose if the axis of a leg's joint is undefined at a home pose (m,)."""
    for i, stance in enumerate(stances, start=1):
        places = (*stance.axes, *stance.points, *stance.references.values(), stance.end)
        if not np.isfinite(np.concatenate(places)).all():
            raise SingularPose(
                f"home: {pose.round(6).tolist()}: a joint of leg {i} has no axis there, as of a "
                "universal joint whose axes coincide; give another home",
                kind="I",
                measure=0.0,
                index=(),
                leg=i,
            )


def _with_shaft(platform: TreeBody, limits: tuple[float, float] | None, ratio: float) -> TreeBody:
    """Return the platform with the limits that its shaft leaves its last joint, which is phi."""
    *others, phi = platform.joints
    if limits is None:
        return platform
    low, high = sorted(limit / ratio for limit in limits)
    least, most = phi.limits or (low, high)
    phi = replace(phi, limits=(max(low, least), min(high, most)))
    return replace(platform, joints=(*others, phi))


def _size(stances: list[LegStance], p: Array) -> float:
    """Return the longest side of the box that holds the machine, m."""
    points = [p, *(stance.end for stance in stances)]
    points += [point for stance in stances for point in stance.points]
    return float(np.ptp(points, axis=0).max()) or 1.0


def _leg(
    leg: LegKind, number: int, stance: LegStance, actuated: str, count: int, size: float
) -> list[TreeBody]:
    """Return a leg's bodies; `count` bodies precede them in the tree."""
    bodies: list[TreeBody] = []
    waiting: list[TreeJoint] = []
    joints = stance.numbers, stance.prismatic, stance.carries, stance.axes, stance.points
    for k, is_prismatic, letter, axis, point in zip(*joints, strict=True):
        if k == stance.driven:
            home, name, limits = float(stance.coordinate), actuated, leg.limits
            if is_prismatic:  # its point is where its coordinate is zero
                point = point + home * axis
        else:
            home, name, limits = 0.0, f"leg{number}_joint{k}", None
        waiting.append(TreeJoint(name, is_prismatic, axis, point, home, limits))
        if not letter:
            continue
        parent = count + len(bodies) - 1 if bodies else BASE
        title = f"leg{number}_{leg.names[letter].replace(' ', '_')}"
        body = _body(leg, stance, letter, waiting[-1], size)
        bodies.append(replace(body, name=title, parent=parent, joints=tuple(waiting), color=number))
        waiting = []
    return bodies


def _body(leg: LegKind, stance: LegStance, letter: str, joint: TreeJoint, size: float) -> TreeBody:
    """Return the body that a joint carries; the caller sets its name, parent and joints."""
    inertia, reference = leg.bodies[letter], stance.references[letter]
    if isinstance(inertia, SpatialInertia):
        axes = _frame_along(stance.along[letter], stance.across[letter])
        moments, products = spatial_moments(inertia, size)
        center = reference + axes @ inertia.center_of_mass
        return TreeBody("", BASE, (), joint.point, axes, inertia.mass, center, moments, 0, products)
    mass, (x, y), moment = central_inertia(inertia)
    if letter not in stance.along:
        axes = _frame_along(joint.axis)
        moments, center = cube_moments(mass, 0.05 * size), reference
    else:
        direction = stance.along[letter]
        if letter in stance.across:
            axes = _frame_along(direction, stance.across[letter])
            moments = plane_moments(mass, moment, size)
        else:
            # A rod's y is the axis of the joint that carries it, where that is across the rod.
            axes = _frame_along(direction, np.cross(direction, joint.axis))
            moments = rod_moments(mass, moment, size)
        center = reference + axes @ [x, y, 0.0]
    return TreeBody("", BASE, (), joint.point, axes, mass, center, moments, 0)


def _frame_along(x: Array, z: Array | None = None) -> Array:
    """Return axes as columns (3, 3): x along a vector, and z near another one."""
    x = x / np.linalg.norm(x)
    normal = None if z is None else z - (z @ x) * x
    if normal is None or np.linalg.norm(normal) < ROUNDING:
        normal = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
    normal = normal / np.linalg.norm(normal)
    return np.column_stack([x, np.cross(normal, x), normal])
