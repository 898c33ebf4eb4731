"""The platform in pieces: what moves as one with P, parts that do not turn, gears, sliding halves.

The pieces have together the platform's mass, first moment and moment of inertia, as the equations
take them (`Platform.joined`).
"""

from __future__ import annotations

import numpy as np

from pteron.bodies.vectors import cross
from pteron.export.engines.inertia import cube_moments, plane_moments, shared_masses
from pteron.export.engines.parts import BASE, Closing, TreeBody, TreeJoint
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.platforms import Platform

_COINCIDENT = 1e-9
"""m between hinges that are taken for one."""

Pieces = tuple[list[TreeBody], list[int], list[Closing]]
"""Bodies; which of them each leg carries; where parts of the platform close with it."""


def platform_bodies(robot: Manipulator, pose: Array) -> Pieces:
    """Return the platform's bodies at a pose, which of them carries each leg, and their closings.
    """
    platform = robot.platform
    if platform.slides:
        return _sliding(robot, pose)
    if platform.turns:
        return _turning(robot, pose)
    inertia = platform.joined
    values = inertia.mass, np.array(inertia.first_moment), inertia.inertia
    body = _plane_body(platform, pose, "platform", _moves(platform, pose), *values)
    return [body], [0] * len(robot.legs), []


def _moves(platform: Platform, pose: Array) -> list[TreeJoint]:
    """Return the joints along which P slides."""
    p = platform.at(pose)[0]
    lengths = zip(platform.lengths, platform.directions, pose, strict=False)
    return [TreeJoint(name, True, axis, p, float(at)) for name, axis, at in lengths]


def _turn(platform: Platform, pose: Array) -> TreeJoint:
    """Return the joint about which the platform turns."""
    axis = np.array(platform.axis)
    p = platform.at(pose)[0]
    return TreeJoint("phi", False, axis, p, float(pose[-1]), platform.limits)


def _plane_body(
    platform: Platform,
    pose: Array,
    name: str,
    joints: list[TreeJoint],
    mass: float,
    moment: Array,
    inertia: float,
    *,
    still: bool = False,
) -> TreeBody:
    """Return a body of the platform, its values about P in the platform's frame."""
    p, axes = platform.at(pose)
    axes = np.array(platform.frame).T if still else axes.T
    center = moment / mass
    about = inertia - mass * float(center @ center)
    size = max(float(np.linalg.norm(center)), 0.05)
    moments = plane_moments(mass, about, size)
    at = p + axes[:, :2] @ center
    return TreeBody(name, BASE, tuple(joints), p, axes, mass, at, moments, 0)


def _turning(robot: Manipulator, pose: Array) -> Pieces:
    """Return a platform that turns, its gears, and the parts that hang on its hinges."""
    platform = robot.platform
    p, axes = platform.at(pose)
    hinges, carried = _hinges(robot)
    mass, moment, inertia = _whole(platform)
    own = [bar for bar in platform.bars if not _near(hinges, np.array(bar.hinge))]
    for bar in own:  # nothing hangs on it: a point of the platform
        at = np.array(bar.hinge[:2])
        mass, moment = mass + bar.mass, moment + bar.mass * at
        inertia += bar.mass * float(at @ at)
    masses = [_mass_at(platform, hinge) for hinge in hinges]
    without = [k for k, one in enumerate(masses) if not one]
    places = np.array([*(hinges[k][:2] for k in without), *([np.zeros(2)] * len(platform.geared))])
    shares, mass, moment, inertia = shared_masses(
        mass, moment, inertia, places.reshape(-1, 2)
    )
    for k, share in zip(without, shares, strict=False):
        masses[k] = float(share)
    joints = [*_moves(platform, pose), _turn(platform, pose)]
    bodies = [_plane_body(platform, pose, "platform", joints, mass, moment, inertia)]
    bodies += _gears(platform, pose, shares[len(without) :], against=1.0)
    closings, first = [], len(bodies)
    for j, (hinge, bar) in enumerate(zip(hinges, masses, strict=True), start=1):
        at = p + hinge @ axes
        moves = [
            TreeJoint(f"bar{j}_{name}", True, axis, at, float(axis @ at))
            for name, axis in zip(platform.lengths, platform.directions, strict=True)
        ]
        moments = cube_moments(bar, 0.05)
        frame = np.array(platform.frame).T
        bodies.append(TreeBody(f"bar{j}", BASE, tuple(moves), at, frame, bar, at, moments, 0))
        closings.append(Closing(f"bar{j}", len(bodies) - 1, 0, at))
    return bodies, [0 if k is None else first + k for k in carried], closings


def _whole(platform: Platform) -> tuple[float, Array, float]:
    """Return the platform's own mass, first moment (2,) and moment of inertia."""
    own = platform.inertia
    return own.mass, np.array(own.first_moment), own.inertia


def _hinges(robot: Manipulator) -> tuple[list[Array], list[int | None]]:
    """Return the hinges of parts that do not turn, in the platform's frame, and each leg's."""
    hinges: list[Array] = []
    carried: list[int | None] = []
    for leg in robot.legs:
        if not any(np.abs(cross(leg.fixed_offset, robot.platform.axis)) > _COINCIDENT):
            carried.append(None)
            continue
        hinge = np.array(leg.platform_point)
        if not _near(hinges, hinge):
            hinges.append(hinge)
        apart = [float(np.abs(one - hinge)[:2].max()) for one in hinges]
        carried.append(int(np.argmin(apart)))
    return hinges, carried


def _near(hinges: list[Array], hinge: Array) -> bool:
    """Return whether a hinge turns about the axis of one of others."""
    return any(np.abs(one - hinge)[:2].max() <= _COINCIDENT for one in hinges)


def _mass_at(platform: Platform, hinge: Array) -> float:
    """Return the mass of the bars at a hinge, 0 where there is none."""
    return sum(bar.mass for bar in platform.bars if _near([hinge], np.array(bar.hinge)))


def _gears(platform: Platform, pose: Array, masses: Array, against: float) -> list[TreeBody]:
    """Return what gears turn; its angle counts against a body at `against` times phi."""
    p, axes = platform.at(pose)
    axis, found = np.array(platform.axis), []
    for j, (part, mass) in enumerate(zip(platform.geared, masses, strict=True), start=1):
        by = part.ratio - against
        joint = TreeJoint(f"gear{j}", False, axis, p, by * float(pose[-1]), None, ("phi", by))
        moments = np.full(3, part.inertia)
        name = f"geared{j}"
        found.append(TreeBody(name, 0, (joint,), p, axes.T, float(mass), p, moments, 0))
    return found


def _sliding(robot: Manipulator, pose: Array) -> Pieces:
    """Return a platform whose halves slide by phi: what moves with P, what turns, what slides.

    The first moment of the whole per radian, h, is that of its mass m sliding by h / m; what of I
    that leaves, h.h / m less, turns by phi.
    """
    platform = robot.platform
    p, _ = platform.at(pose)
    frame = np.array(platform.frame)
    halves: list[Array] = []
    carried: list[int | None] = []
    for leg in robot.legs:
        v = np.array(leg.platform_point)
        if np.abs(v).max() <= _COINCIDENT:
            carried.append(None)
            continue
        if not _near(halves, v):
            halves.append(v)
        carried.append(int(np.argmin([float(np.abs(one - v).max()) for one in halves])))
    mass, moment, inertia = _whole(platform)
    for bar in platform.bars:
        if not _near(halves, np.array(bar.hinge)):
            at = np.array(bar.hinge[:2])
            mass, moment = mass + bar.mass, moment + bar.mass * at
            inertia += bar.mass * float(at @ at)
    masses = [_mass_at(platform, v) for v in halves]
    without = [k for k, one in enumerate(masses) if not one]
    # What moves with P, what turns, the gears, and the halves without a mass take shares.
    still = 2 + len(platform.geared)
    places = np.array([*([np.zeros(2)] * still), *(halves[k][:2] for k in without)])
    shares, mass, moment, inertia = shared_masses(mass, moment, inertia, places)
    for k, share in zip(without, shares[still:], strict=True):
        masses[k] = float(share)
    turning = inertia - float(moment @ moment) / mass
    nobody = np.zeros(2)
    carrier = _plane_body(
        platform, pose, "platform", _moves(platform, pose), float(shares[0]), nobody, 1e-6,
        still=True,
    )  # fmt: skip
    tool = _plane_body(
        platform, pose, "tool", [_turn(platform, pose)], float(shares[1]), nobody, turning
    )
    bodies = [carrier, _under(tool, 0), *_gears(platform, pose, shares[2:still], against=0.0)]
    slides = [(moment / mass, mass, "nacelle")]
    slides += [(v[:2], m, f"half{j}") for j, (v, m) in enumerate(zip(halves, masses, strict=True), 1)]
    first = len(bodies) + 1
    for v, own, name in slides:
        by = float(np.linalg.norm(v))
        along = (v[0] * frame[0] + v[1] * frame[1]) / by if by else frame[0]
        at = p + by * pose[-1] * along
        joint = TreeJoint(f"{name}_slide", True, along, at, by * float(pose[-1]), None, ("phi", by))
        moments = cube_moments(own, 0.05)
        bodies.append(TreeBody(name, 0, (joint,), at, frame.T, own, at, moments, 0))
    return bodies, [0 if k is None else first + k for k in carried], []


def _under(body: TreeBody, parent: int) -> TreeBody:
    from dataclasses import replace

    return replace(body, parent=parent)
