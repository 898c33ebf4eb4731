"""A machine in plain numbers, for oracles that share nothing with pteron but its data.

Positions are trigonometry of triangles, in CasADi's functions: of numbers and of symbols alike.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

MOTIONS = {"3T": (3, False), "3T1R": (3, True), "2T": (2, False), "2T1R": (2, True)}
"""How many ways the platform moves without turning, and whether it turns."""

FLAT = {"PRRR", "PRRS", "RRR", "PRR", "RPR", "RPS", "PRS", "RRS"}
"""The kinds whose last link moves in the plane perpendicular to d, as the others' swings."""

TILTS = {"3T3R": 6, "3T2R": 5, "3R": 3, "2R": 2, "1T2R": 3}
"""The motions of platforms that turn about any axis, and how many coordinates they have."""

LENGTH = 0.1
"""Metres that count as much as a radian where singular values are taken."""


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
class Solid:
    """Mass, mass times the centre of mass, and tensor about the reference point."""

    mass: float
    first: np.ndarray
    tensor: np.ndarray

    @property
    def moments(self):
        return self.mass, *self.first, *self.tensor.ravel()


@dataclass(frozen=True)
class Leg:
    """A leg of any kind: what it has not is None.

    A leg with e has a slider, one with a ratio is a shaft, another with an upper body has a crank
    or an upper link, which turns about d. `first` and `second` span the plane perpendicular to d;
    angles count from `first`, as a crank's coordinate does.
    """

    r: np.ndarray
    s0: np.ndarray
    t0: np.ndarray
    d: np.ndarray
    first: np.ndarray
    flat: bool
    e: np.ndarray | None
    ratio: float | None
    lu: float | None
    ll: float | None
    elbow: int
    slider_mass: float | None
    upper: Body | None
    lower: Body
    kappa: int | None = None
    """Of a leg whose lower link turns about the platform's second axis, its second elbow."""
    piston: Body | None = None
    """Of such a leg with a ram; its reference point is the ram's end."""
    arcs: tuple[float, float] | None = None
    """Between the axes of crank and link of a leg whose axes meet in r."""

    @property
    def second(self):
        return np.cross(self.d, self.first)

    @property
    def swings(self):
        """Whether it is a ram on a universal joint, a rod from end to end."""
        no_links = self.e is None and self.lu is None and self.ratio is None
        return no_links and self.kappa is None and self.arcs is None and not self.flat

    @property
    def crank(self):
        """Whether its joint coordinate is a crank's angle."""
        return self.arcs is not None or (self.e is None and self.lu is not None)


@dataclass(frozen=True)
class Machine:
    """Legs, the platform's axes as columns, the directions it moves along, its body and gravity.

    The pose is the position along `moves`, the columns of a matrix, and where the platform `turns`
    its angle about the last axis. If it `slides`, it does not turn, and its points move by the
    angle times what their legs say.
    """

    legs: tuple
    frame: np.ndarray
    moves: np.ndarray
    turns: bool
    slides: bool
    platform: Body
    bars: tuple
    """Mass and hinge, in the platform's frame, of the parts that do not turn."""
    geared: tuple
    """Moment of inertia and ratio of the parts that turn by ratio times the platform's angle."""
    gravity: np.ndarray
    tilts: str | None = None
    """Which motion, if it turns about any axis."""
    axes: tuple = ()
    """Of the turns by its angles in the order in which they follow each other, each with its
    angle's place in the pose; a tripod's yaw counts behind the pose."""
    center: np.ndarray | None = None
    offset: np.ndarray | None = None
    """From the center to P at angles zero, where P turns about the first axis."""

    @property
    def freedom(self):
        if self.tilts:
            return TILTS[self.tilts]
        return self.moves.shape[1] + self.turns


def describe(robot):
    """Return the description of a pteron robot."""
    if isinstance(robot, Machine):
        return robot
    platform = robot.platform
    frame = np.column_stack(platform.frame)
    if platform.motion in TILTS:
        last, turns = TILTS[platform.motion] - 1, list(frame.T)
        axes = [(axis, last - 2 + i) for i, axis in enumerate(turns)]
        if platform.motion == "1T2R":
            axes = [(turns[2], 3), (turns[1], 2), (turns[0], 1)]
        elif platform.second_axis is not None:
            axes = [(platform.axis, last - 1), (platform.second_axis, last)]
        elif platform.angle_order == "rpy":
            axes = axes[::-1]
        body = platform.inertia
        return Machine(
            legs=tuple(_leg(leg, None) for leg in robot.legs),
            frame=frame,
            moves=np.eye(3),
            turns=True,
            slides=False,
            platform=Solid(body.mass, np.array(body.first_moment), body.tensor),
            bars=(),
            geared=(),
            gravity=np.array(robot.gravity),
            tilts=platform.motion,
            axes=tuple(axes),
            center=platform.center,
            offset=platform.axis_offset,
        )
    count, turns = MOTIONS[platform.motion]
    return Machine(
        legs=tuple(_leg(leg, frame[:, 2]) for leg in robot.legs),
        frame=frame,
        moves=np.eye(3) if count == 3 else frame[:, :2],
        turns=turns,
        slides=robot.platform.slides,
        platform=_body(robot.platform.inertia),
        bars=tuple((bar.mass, np.array(bar.hinge)) for bar in robot.platform.bars),
        geared=tuple((part.inertia, part.ratio) for part in robot.platform.geared),
        gravity=np.array(robot.gravity),
    )


def _leg(leg, k):
    ratio = getattr(leg, "ratio", None)
    slider = getattr(leg, "slider_mass", None)
    e = None if slider is None else np.array(leg.slider_direction or leg.direction)
    if ratio is not None or leg.type == "PSS":
        # A shaft is hardly ever across the axis that it turns, nor a rod across its guide.
        first = k if e is None else e
        d = _across(first)
    elif getattr(leg, "second_elbow", None) is not None:
        d = first = np.zeros(3)  # they are the platform's
    elif leg.type in ("UPS", "UPU"):
        first = d = np.eye(3)[0]  # nothing depends on them
    else:
        d = np.array(leg.direction)
        first = np.array(getattr(leg, "zero_direction", _across(d)))
    return Leg(
        r=np.array(leg.guide_point),
        s0=np.array(leg.platform_point),
        t0=np.array(leg.fixed_offset),
        d=d,
        first=first,
        flat=leg.type in FLAT,
        e=e,
        ratio=ratio,
        lu=getattr(leg, "upper_length", None),
        ll=getattr(leg, "lower_length", None),
        elbow=leg.elbow,
        slider_mass=slider,
        upper=_body(leg.upper) if hasattr(leg, "upper") else None,
        lower=_body(leg.lower),
        kappa=getattr(leg, "second_elbow", None),
        piston=_body(leg.piston) if hasattr(leg, "piston") else None,
        arcs=(leg.crank_arc, leg.link_arc) if leg.type == "SRRR" else None,
    )


def _across(v):
    across = np.cross(v, np.eye(3)[np.argmin(np.abs(v))])
    return across / np.linalg.norm(across)


def _body(body):
    if isinstance(body.inertia, tuple):
        return Solid(body.mass, np.array(body.first_moment), body.tensor)
    x, y = (*body.center_of_mass, 0.0)[:2]
    return Body(body.mass, x, y, body.inertia)


class Place(NamedTuple):
    """Where a leg's bodies are; what it has not is None."""

    joint: Any
    """The joint coordinate."""
    point: Any
    """The platform point c, (3, 1)."""
    slide: Any
    """How far its slider is from the guide point."""
    angle: Any
    """Of the upper link or crank, and its direction, (3, 1)."""
    upper: Any
    last: Any
    """The vector of the last link, or of the whole shaft, to the platform point, (3, 1)."""
    bend: Any
    """1 at best, 0 where the leg is singular: the sine between the links, as seen along d, times
    the cosine between d and a guide; or the cosine between a rod and its guide."""
    turn: Any = None
    """The platform's first axis and its second one now, of a leg that has links across them."""


def about(axis, angle):
    """Return the matrix of a turn about a unit vector, (3, 3)."""
    a = ca.DM(axis)
    return ca.cos(angle) * (ca.SX.eye(3) - a @ a.T) + ca.sin(angle) * ca.skew(a) + a @ a.T


def tilted(machine, pose):
    """Return the position of P, (3, 1), and the platform's axes as columns, (3, 3)."""
    if machine.tilts == "1T2R":
        p, yaw = _held(machine, pose)
        pose = ca.vertcat(pose, yaw)
    else:
        p = pose[:3] if machine.tilts in ("3T3R", "3T2R") else ca.DM(machine.center)
    if machine.offset is not None:
        axis, place = machine.axes[0]
        p += about(axis, pose[place]) @ ca.DM(machine.offset)
    turn = ca.SX.eye(3)
    for axis, place in machine.axes:
        turn = turn @ about(axis, pose[place])
    return p, turn @ ca.DM(machine.frame)


def _held(machine, pose):
    """Return the position of P and the yaw at which the planes of a tripod's legs hold its points.

    The yaw is the one of two that is nearest to 0.
    """
    x, y, k = machine.frame.T
    level = about(y, pose[2]) @ about(x, pose[1]) @ ca.DM(machine.frame)
    normals = [leg.d for leg in machine.legs]
    arms = [level @ ca.DM(leg.s0) for leg in machine.legs]
    total = ca.SX(3, 1)
    for i, (n, leg, u) in enumerate(zip(normals, machine.legs, arms, strict=True)):
        weight = np.cross(normals[i - 2], normals[i - 1]) @ k
        total += weight * ca.vertcat(ca.dot(n, u), ca.dot(np.cross(k, n), u), n @ leg.r)
    a, b, c = ca.vertsplit(total)
    middle = ca.atan2(-b, a)
    yaw = middle - ca.sign(middle) * ca.acos(c / ca.sqrt(a * a + b * b))
    turn = about(k, yaw)
    wanted = [
        n @ leg.r - ca.dot(n, turn @ u)
        for n, leg, u in list(zip(normals, machine.legs, arms, strict=True))[:2]
    ]
    matrix = ca.DM([[n @ x, n @ y] for n in normals[:2]])
    across = ca.solve(matrix, ca.vertcat(*wanted))
    return pose[0] * ca.DM(k) + ca.DM(np.column_stack([x, y])) @ across, yaw


def carried(machine, pose):
    """Return the matrix (3, 3) from the platform's frame to the base's: columns phi times as long
    as the platform's axes where the platform slides."""
    if machine.tilts:
        return tilted(machine, pose)[1]
    phi = pose[-1] if machine.turns else 0.0
    return phi * ca.DM(machine.frame) if machine.slides else turned(machine, phi)


def turned(machine, angle):
    """Return the platform's axes as columns, (3, 3), turned by an angle."""
    c, s = ca.cos(angle), ca.sin(angle)
    turn = ca.blockcat([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return ca.mtimes(ca.DM(machine.frame), turn)


def position(machine, pose):
    """Return the position of P, (3, 1)."""
    if machine.tilts:
        return tilted(machine, pose)[0]
    return ca.mtimes(ca.DM(machine.moves), pose[: machine.moves.shape[1]])


def places(machine, pose):
    """Return where every leg is at a pose, (m, 1)."""
    p, turn = position(machine, pose), carried(machine, pose)
    phi = pose[-1] if machine.turns else None
    points = (p + ca.mtimes(turn, ca.DM(leg.s0)) + ca.DM(leg.t0) for leg in machine.legs)
    return [
        _place(leg, c, phi) if leg.kappa is None else _universal_place(machine, leg, c, pose)
        for leg, c in zip(machine.legs, points, strict=True)
    ]


def _spherical_place(leg, c):
    """Return where a spherical R-R-R leg is: its crank by the law of cosines on a sphere."""
    u, v = ca.DM(leg.d), (c - ca.DM(leg.r)) / ca.norm_2(c - ca.DM(leg.r))
    first, second = leg.arcs
    apart = ca.acos(ca.dot(u, v))
    corner = (np.cos(second) - np.cos(first) * ca.cos(apart)) / (np.sin(first) * ca.sin(apart))
    x, y = ca.dot(v, ca.DM(leg.first)), ca.dot(v, ca.DM(leg.second))
    angle = ca.atan2(y, x) + leg.elbow * ca.acos(corner)
    upper = ca.cos(angle) * leg.first + ca.sin(angle) * leg.second
    w = np.cos(first) * u + np.sin(first) * upper
    bend = ca.fabs(ca.dot(u, ca.cross(w, v))) / (np.sin(first) * np.sin(second))
    across = (v - np.cos(second) * w) / np.sin(second)
    return Place(angle, ca.DM(leg.r), None, angle, upper, w, bend, (u, across))


def _universal_place(machine, leg, c, pose):
    """Return where a P-R-U-R leg is: its angles by arc functions, its links by turns of axes."""
    (a, i), (b0, _) = machine.axes
    turn = about(a, pose[i])
    b, n = turn @ ca.DM(b0), turn @ ca.DM(np.cross(a, b0))
    a, w = ca.DM(a), c - ca.DM(leg.r)
    if leg.e is None:
        lean = ca.asin(ca.dot(a, w) / leg.ll)
        last = leg.ll * (ca.sin(lean) * a + leg.kappa * ca.cos(lean) * n)
        ram = ca.norm_2(w - last)
        upper = (w - last) / ram
        force = ca.cross(ca.cross(a, upper), ca.cross(b, last))
        bend = ca.fabs(ca.dot(force, upper)) / ca.norm_2(force)
        return Place(ram, c, None, lean, upper, last, bend, (a, b))
    e = ca.DM(leg.e)
    if abs(float(ca.dot(a, e))) < 0.5:
        lean = ca.asin(ca.dot(a, w) / leg.ll)
        last = leg.ll * (ca.sin(lean) * a + leg.kappa * ca.cos(lean) * n)
        v, side = w - last, ca.cross(a, e)
        angle = ca.asin(ca.dot(v, side) / leg.lu)
        upper = leg.elbow * ca.cos(angle) * e + ca.sin(angle) * side
        slide = ca.dot(w - last - leg.lu * upper, e)
    else:
        angle = ca.asin(ca.dot(b, w) / leg.lu)
        upper = ca.sin(angle) * b + leg.elbow * ca.cos(angle) * n
        lean = ca.asin(ca.dot(n, w - leg.lu * upper) / leg.ll)
        last = leg.ll * (ca.sin(lean) * n + leg.kappa * ca.cos(lean) * a)
        slide = ca.dot(w - last, e)
    force = ca.cross(ca.cross(a, upper), ca.cross(b, last))
    bend = ca.fabs(ca.dot(force, e)) / ca.norm_2(force)
    return Place(slide, c, slide, angle, upper, last, bend, (a, b))


def _place(leg, c, phi):
    if leg.arcs is not None:
        return _spherical_place(leg, c)
    d, first, second, w = ca.DM(leg.d), ca.DM(leg.first), ca.DM(leg.second), c - ca.DM(leg.r)
    slide = angle = upper = None
    if leg.ratio is not None:
        return Place(leg.ratio * phi, c, slide, angle, upper, w, 1)
    if leg.upper is None:
        e = ca.DM(leg.e)
        if leg.flat:
            w -= ca.dot(w, d) * d
        lean = ca.asin(ca.norm_2(w - ca.dot(w, e) * e) / leg.ll)
        slide, bend = ca.dot(w, e) - leg.elbow * leg.ll * ca.cos(lean), ca.cos(lean)
        return Place(slide, c, slide, angle, upper, w - slide * e, bend)
    cosine = 1
    if leg.e is not None:
        e = ca.DM(leg.e)
        cosine = ca.dot(e, d)
        slide = ca.dot(w, d) / cosine
        w -= slide * e
    elif leg.flat:
        w -= ca.dot(w, d) * d
    elif leg.lu is None:
        n = ca.norm_2(w)
        return Place(n, c, slide, angle, w / n, w, 1)
    x, y, out = ca.dot(w, first), ca.dot(w, second), ca.dot(w, d)
    n = ca.sqrt(x**2 + y**2)
    if leg.lu is None:
        angle = ca.atan2(y, x)
        upper = ca.cos(angle) * first + ca.sin(angle) * second
        return Place(n, c, slide, angle, upper, n * upper, 1)
    opening = ca.acos((n**2 + leg.lu**2 + out**2 - leg.ll**2) / (2 * n * leg.lu))
    angle = ca.atan2(y, x) + leg.elbow * opening
    upper = ca.cos(angle) * first + ca.sin(angle) * second
    last = w - leg.lu * upper
    bend = ca.fabs(cosine * ca.dot(d, ca.cross(upper, last))) / leg.ll
    return Place(angle if slide is None else slide, c, slide, angle, upper, last, bend)


def _positions(machine):
    """Return the function from the pose to joint coordinates, their derivatives and the bends."""
    x = ca.SX.sym("x", machine.freedom)
    found = places(machine, x)
    joints = ca.vertcat(*(at.joint for at in found))
    bends = ca.vertcat(*(at.bend for at in found))
    return ca.Function("positions", [x], [joints, ca.jacobian(joints, x), bends])


def inverse_kinematics(machine, poses):
    """Return the joint coordinates (B, n) at poses (B, m); cranks within (-pi, pi]."""
    joints = np.array(_positions(machine)(poses.T)[0]).T
    cranks = [leg.crank for leg in machine.legs]
    return np.where(cranks, -((np.pi - joints) % (2 * np.pi)) + np.pi, joints)


def jacobians(machine, poses):
    """Return J (B, m, m) of poses (B, m), and the least bend of the legs (B,)."""
    _, jacobian, bends = (np.array(v) for v in _positions(machine)(poses.T))
    return jacobian.reshape(len(jacobian), *poses.shape).swapaxes(0, 1), bends.min(axis=0)


def force_sizes(machine, poses):
    """Return |dq/dc| (B, n), c moving anywhere in space; of a shaft its ratio."""
    x, phi, c = (ca.SX.sym(name, n) for name, n in (("x", machine.freedom), ("phi", 1), ("c", 3)))
    sizes = []
    for leg, at in zip(machine.legs, places(machine, x), strict=True):
        slope = ca.norm_2(ca.jacobian(_place(leg, c, phi).joint, c))
        sizes.append(ca.substitute(slope, c, at.point) if leg.ratio is None else abs(leg.ratio))
    return np.array(ca.Function("sizes", [x], [ca.vertcat(*sizes)])(poses.T)).T


def distances_from_singular(machine, poses):
    """Return the least bend of the legs, and the least singular value of J with rows of length 1.

    Poses are (B, m), results (B,); NaN where a leg does not reach.
    """
    rows, bends = jacobians(machine, poses)
    rows[..., machine.moves.shape[1] :] /= LENGTH
    reached = np.isfinite(rows).all(axis=(1, 2))
    held = np.full(len(rows), np.nan)
    rows = rows[reached]
    rows /= np.linalg.norm(rows, axis=-1, keepdims=True)
    held[reached] = np.linalg.svd(rows, compute_uv=False)[:, -1]
    return bends, held


def states(machine, count, seed, least=0.1):
    """Return poses around zero that are far from singular, velocities and accelerations.

    `least` is the least singular value of J with rows of length 1.
    """
    rng = np.random.default_rng(seed)
    spread = np.array([0.07] * machine.moves.shape[1] + [np.pi] * machine.turns)
    found = np.empty((0, machine.freedom))
    for _ in range(100):
        drawn = spread * rng.uniform(-1, 1, (4096, machine.freedom))
        bend, held = distances_from_singular(machine, drawn)
        found = np.concatenate([found, drawn[(bend > 0.3) & (held > least)]])[:count]
        if len(found) == count:
            return found, rng.normal(size=found.shape), 10.0 * rng.normal(size=found.shape)
    raise AssertionError("there are too few poses far from singular")
