"""Equations A w = b of the forces in the legs' joints, by Newton and Euler, body by body.

A leg is cut at its platform point c. The unknowns w are the force f and the moment m, about c, that
each leg exerts on the platform. Each joint of the leg transmits these and what the bodies beyond it
need. A passive joint transmits nothing along its own freedom, and the platform is in equilibrium:
these are the equations. Where A has fewer independent rows than unknowns the machine is
overconstrained, and only a norm, or the links' elasticity, decides the rest.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression, Moments, needed_wrench
from pteron.bodies.parameters import LEG_BODIES
from pteron.bodies.vectors import Vector
from pteron.equations.machine import Machine, State
from pteron.legs.kind import LegKind
from pteron.legs.leg import LegMotion


class Wrench(NamedTuple):
    """A force and a moment, linear in a leg's unknowns w = (f, m): rows (3, 6) and the rest."""

    force_rows: Expression
    force: Expression
    moment_rows: Expression
    moment: Expression
    """About the point that it is passed on at."""


class LegForces(NamedTuple):
    """The wrenches that the joints of a leg pass on, from the base to the platform."""

    points: tuple[Expression, ...]
    """The points at which they are passed on, (3, 1)."""
    wrenches: tuple[Wrench, ...]


class Equilibrium(NamedTuple):
    """The equations of w = (f_1, m_1, f_2, ...), (6 n, 1), and what the joints pass on."""

    rows: Expression
    """A: the platform's motions first, (m, 6 n), then what the legs' joints do not pass on."""
    right: Expression
    """b, where nothing but motion and gravity acts on the platform."""
    presumed_rows: Expression
    """Equations of a platform that its legs hold as its motion presumes: the forces on it, the
    moments about P, and those on its bars; none of a platform on a joint with the base."""
    presumed_right: Expression
    legs: tuple[LegForces, ...]
    loads: Expression
    """(m, k): what a wrench on the platform takes of b."""
    driven_rows: Expression
    """(n, 6 n) and (n, 1): the actuator forces are driven_rows w + driven."""
    driven: Expression


def equilibrium(machine: Machine, state: State, parameters: Expression) -> Equilibrium:
    """Return the equations of the internal forces of a state."""
    inertia, own = machine.moments(parameters)
    platform, count = state.platform, len(machine.legs)
    sums, works, legs, driven = [], [], [], []
    released: list[_Row] = []
    bars: dict[Vector, list[_Row]] = {}
    parts = zip(machine.robot.legs, state.legs, platform.points, inertia, strict=True)
    for i, (leg, motion, point, bodies) in enumerate(parts):
        c = point.position
        found = _leg_forces(machine, leg, motion, c, bodies)
        legs.append(found)
        arm = ca.skew(c - platform.body.position)
        sums.append(ca.blockcat([[ca.SX.eye(3), ca.SX(3, 3)], [arm, ca.SX.eye(3)]]))
        moved, barred = platform.matrices[i].T, any(leg.fixed_offset)
        if barred and motion.pushes:  # the bar that it holds does not turn
            moved = ca.horzcat(moved[:, :3], ca.SX(machine.freedom, 3))
        works.append(moved)
        hinges = len(platform.rotation.turns)
        released += [_among(row, i, count) for row in _released(leg, motion, found, hinges)]
        for k in range(len(motion.chain) - hinges, len(motion.chain)) if motion.pushes else ():
            hinge = _among(_along(motion, found, k), i, count)
            if barred:  # at one platform point it is one bar, on one hinge
                bars.setdefault(leg.platform_point, []).append(hinge)
            else:
                released.append(hinge)
        driven.append(_among(_actuated(motion, found), i, count))
    shared = [tuple(sum(parts) for parts in zip(*bar, strict=True)) for bar in bars.values()]
    needs = machine.platform.needs(platform, machine.gravity, own)
    whole = machine.platform.needed_wrench(platform, machine.gravity, own)
    held = [(ca.horzcat(*sums), ca.vertcat(*whole))] if machine.platform.on_legs_alone else []
    held += [(row, -rest) for row, rest in shared]
    wanted = (ca.vertcat(*part) for part in zip(*driven, strict=True))
    return Equilibrium(
        ca.vertcat(ca.horzcat(*works), *(row for row, _ in released)),
        ca.vertcat(needs, *(-rest for _, rest in released)),
        ca.vertcat(ca.SX(0, 6 * count), *(row for row, _ in held)),
        ca.vertcat(ca.SX(0, 1), *(rest for _, rest in held)),
        tuple(legs),
        machine.platform.applied(platform, ca.SX.eye(machine.wrench_size)),
        *wanted,
    )


class Beams(NamedTuple):
    """The links of the legs as beams, and what rods carry: NaN where a leg has none."""

    starts: list[Expression]
    """(2, 3) a leg: where its upper and its lower link begin."""
    ways: list[Expression]
    """(2, 3): from there along the link to its end."""
    axes: list[Expression]
    """(2, 3): about which a link bends in its leg's plane."""
    couples: list[Expression]
    """(3, 1): bar x rod, the couple of rods; zero of a single rod, NaN where the link is a beam."""


def beams(machine: Machine, state: State) -> Beams:
    """Return the links of a state's legs."""
    found = Beams([], [], [], [])
    for leg, motion in zip(machine.robot.legs, state.legs, strict=True):
        rows = []
        for letter, way in zip(LEG_BODIES[1:], motion.links, strict=True):
            if way is None:
                rows.append(ca.SX.nan(3, 3))
                continue
            joint = next(j for j in reversed(motion.chain) if j.body == letter)
            rows.append(ca.horzcat(joint.point, way, joint.axis))
        for k, part in enumerate(found[:3]):
            part.append(ca.horzcat(*(row[:, k] for row in rows)).T)
        couple = leg.rod_couple(motion)
        found.couples.append(ca.SX.nan(3, 1) if couple is None else couple)
    return found


def _leg_forces(
    machine: Machine,
    leg: LegKind,
    motion: LegMotion,
    c: Expression,
    inertia: dict[str, Moments],
) -> LegForces:
    """Return what the joints of a leg pass on, towards the platform."""
    eye, points, wrenches = ca.SX.eye(3), [], []
    force, moment = ca.SX(3, 1), ca.SX(3, 1)  # what the bodies beyond need, about c
    for k, joint in reversed(list(enumerate(motion.chain))):
        if joint.body:
            body = motion.bodies[joint.body]
            needed, about = needed_wrench(body, inertia[joint.body], machine.gravity)
            force, moment = force + needed, moment + about + ca.cross(body.position - c, needed)
        # A slider passes on a moment where it is.
        point = motion.chain[k + 1].point if joint.kind == "P" else joint.point
        if joint.seat is not None:
            point = joint.seat
        arm = ca.horzcat(ca.skew(c - point), eye)
        points.append(point)
        forces = ca.horzcat(eye, ca.SX(3, 3))
        wrenches.append(Wrench(forces, force, arm, moment + ca.cross(c - point, force)))
    return LegForces(tuple(reversed(points)), tuple(reversed(wrenches)))


_Row = tuple[Expression, Expression]
"""(1, 6), or (1, 6 n), and the rest of it: row w + rest."""


def _among(row: _Row, i: int, count: int) -> _Row:
    """Return a row of a leg's unknowns as one of all."""
    none = [ca.SX(1, 6)] * count
    return ca.horzcat(*none[:i], row[0], *none[i + 1 :]), row[1]


def _along(motion: LegMotion, found: LegForces, k: int) -> _Row:
    """Return what a joint passes on along its own freedom."""
    joint, at = motion.chain[k], found.wrenches[k]
    axis = joint.axis.T
    if joint.kind == "P":
        return ca.mtimes(axis, at.force_rows), ca.mtimes(axis, at.force)
    return ca.mtimes(axis, at.moment_rows), ca.mtimes(axis, at.moment)


def _actuated(motion: LegMotion, found: LegForces) -> _Row:
    """Return the actuator force: what the driven joint passes on, over the ratio of its gear."""
    row, rest = _along(motion, found, motion.chain.index(motion.driven))
    return row / motion.driven.gear, rest / motion.driven.gear


def _released(leg: LegKind, motion: LegMotion, found: LegForces, hinges: int) -> list[_Row]:
    """Return what the passive joints of a leg pass on along their freedoms: nothing.

    The last ones are left out: hinges on the platform's axes, which legs may share, or what is
    geared to the driven joint.
    """
    couple = leg.rod_couple(motion)
    if couple is None:
        passive = [k for k, joint in enumerate(motion.chain) if not joint.driven]
        return [_along(motion, found, k) for k in passive if k < len(motion.chain) - hinges]
    # Rods: what is no force along them is their couple, the same at both of their ends.
    length = ca.norm_2(motion.links[1])
    n, couple = motion.links[1] / length, couple / length
    first, second = [k for k, joint in enumerate(motion.chain) if not joint.driven][:2]
    across, tip = motion.chain[second].axis, found.wrenches[first]
    blocked = ca.horzsplit(ca.SX.eye(3))
    if not couple.is_zero():
        blocked = [n, ca.cross(n, couple)]
    at_c = ca.horzcat(ca.SX(3, 3), ca.SX.eye(3))
    ends = (across, ca.cross(n, across))
    return [
        *((ca.mtimes(v.T, at_c), ca.SX(0)) for v in blocked),
        *((ca.mtimes(v.T, tip.moment_rows - at_c), ca.mtimes(v.T, tip.moment)) for v in ends),
    ]
