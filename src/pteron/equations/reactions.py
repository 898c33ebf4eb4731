"""Equations A w = b of the forces in the legs' joints, by Newton and Euler, body by body.

A leg is cut at its platform point c. The unknowns w are the force f and the moment m, about c, that
each leg exerts on the platform. Each joint of the leg transmits these and the inertia and gravity
forces of the bodies beyond it. A passive joint transmits nothing along its own freedom, and the
platform is in equilibrium: these are the equations. Where A has fewer independent rows than
unknowns the machine is overconstrained, and only a norm, or the links' elasticity, decides.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression, Moments, needed_wrench
from pteron.bodies.parameters import LINK_BODIES
from pteron.bodies.vectors import Vector
from pteron.equations.machine import Machine, State
from pteron.legs.kind import LegKind
from pteron.legs.leg import LegMotion


class Wrench(NamedTuple):
    """A force and a moment, affine in a leg's unknowns w = (f, m): rows (3, 6) and constants."""

    force_rows: Expression
    force: Expression
    moment_rows: Expression
    moment: Expression
    """About the point at which it is transmitted."""


class LegForces(NamedTuple):
    """The wrenches that the joints of a leg transmit, from the base to the platform."""

    points: tuple[Expression, ...]
    """The points at which they are transmitted, (3, 1)."""
    wrenches: tuple[Wrench, ...]


class Equilibrium(NamedTuple):
    """The equations of w = (f_1, m_1, f_2, ...), (6 n, 1), and the joints' wrenches."""

    rows: Expression
    """A: the platform's equilibrium first, (m, 6 n), then the legs' passive joints."""
    right: Expression
    """b without an external wrench on the platform."""
    presumed_rows: Expression
    """Equations of a platform that its legs hold as its motion presumes: the forces on it, the
    moments about P, and those on its bars; none of a platform on a joint with the base."""
    presumed_right: Expression
    legs: tuple[LegForces, ...]
    loads: Expression
    """(m, k): b changes by -loads times a wrench on the platform."""
    driven_rows: Expression
    """(n, 6 n) and (n, 1): the actuator forces are driven_rows w + driven."""
    driven: Expression


def equilibrium(machine: Machine, state: State, parameters: Expression) -> Equilibrium:
    """Return the linear equilibrium equations of the internal joint forces in a state."""
    inertia, platform_inertia = machine.moments(parameters)
    platform, count = state.platform, len(machine.legs)
    sums, pose_rows, legs, driven = [], [], [], []
    passive_rows: list[_Row] = []
    bars: dict[Vector, list[_Row]] = {}
    parts = zip(machine.robot.legs, state.legs, platform.points, inertia, strict=True)
    for i, (leg, motion, point, bodies) in enumerate(parts):
        c = point.position
        leg_forces = _leg_forces(machine, leg, motion, c, bodies)
        legs.append(leg_forces)
        arm = ca.skew(c - platform.body.position)
        sums.append(ca.blockcat([[ca.SX.eye(3), ca.SX(3, 3)], [arm, ca.SX.eye(3)]]))
        motion_rows, barred = platform.matrices[i].T, any(leg.fixed_offset)
        if barred and motion.pushes:  # the bar that it holds does not turn
            motion_rows = ca.horzcat(motion_rows[:, :3], ca.SX(machine.freedom, 3))
        pose_rows.append(motion_rows)
        hinges = len(platform.rotation.turns)
        passive_rows += [
            _embed_row(row, i, count)
            for row in _passive_joint_rows(leg, motion, leg_forces, hinges)
        ]
        for k in range(len(motion.chain) - hinges, len(motion.chain)) if motion.pushes else ():
            if motion.chain[k].driven:
                continue
            hinge = _embed_row(_freedom_component(motion, leg_forces, k), i, count)
            if barred:  # at one platform point it is one bar, on one hinge
                bars.setdefault(leg.platform_point, []).append(hinge)
            else:
                passive_rows.append(hinge)
        driven.append(_embed_row(_actuator_row(motion, leg_forces), i, count))
    shared = [tuple(sum(parts) for parts in zip(*bar, strict=True)) for bar in bars.values()]
    needs = machine.platform.needs(platform, machine.gravity, platform_inertia)
    platform_wrench = machine.platform.needed_wrench(platform, machine.gravity, platform_inertia)
    presumed = (
        [(ca.horzcat(*sums), ca.vertcat(*platform_wrench))]
        if machine.platform.on_legs_alone
        else []
    )
    presumed += [(row, -constant) for row, constant in shared]
    driven_parts = (ca.vertcat(*part) for part in zip(*driven, strict=True))
    return Equilibrium(
        ca.vertcat(ca.horzcat(*pose_rows), *(row for row, _ in passive_rows)),
        ca.vertcat(needs, *(-constant for _, constant in passive_rows)),
        ca.vertcat(ca.SX(0, 6 * count), *(row for row, _ in presumed)),
        ca.vertcat(ca.SX(0, 1), *(constant for _, constant in presumed)),
        tuple(legs),
        machine.platform.generalized_forces(platform, ca.SX.eye(machine.wrench_size)),
        *driven_parts,
    )


class Beams(NamedTuple):
    """The links of the legs as beams, and the couples of rods; NaN where a leg has none."""

    starts: list[Expression]
    """(2, 3) a leg: where its upper and its lower link begin."""
    ways: list[Expression]
    """(2, 3): from there along the link to its end."""
    axes: list[Expression]
    """(2, 3): about which a link bends in its leg's plane."""
    couples: list[Expression]
    """(3, 1): bar x rod, the couple of rods; zero of a single rod, NaN where the link is a beam."""


def beams(machine: Machine, state: State) -> Beams:
    """Return start point, vector and bending axis of every link of the legs; the rods' couples."""
    links = Beams([], [], [], [])
    for leg, motion in zip(machine.robot.legs, state.legs, strict=True):
        rows = []
        for letter, way in zip(LINK_BODIES, motion.links, strict=True):
            if way is None:
                rows.append(ca.SX.nan(3, 3))
                continue
            joint = next(j for j in reversed(motion.chain) if j.body == letter)
            rows.append(ca.horzcat(joint.point, way, joint.axis))
        for k, part in enumerate(links[:3]):
            part.append(ca.horzcat(*(row[:, k] for row in rows)).T)
        couple = leg.rod_couple(motion)
        links.couples.append(ca.SX.nan(3, 1) if couple is None else couple)
    return links


def _leg_forces(
    machine: Machine,
    leg: LegKind,
    motion: LegMotion,
    c: Expression,
    inertia: dict[str, Moments],
) -> LegForces:
    """Return, for each joint of a leg, the wrench it transmits towards the platform."""
    eye, points, wrenches = ca.SX.eye(3), [], []
    force, moment = ca.SX(3, 1), ca.SX(3, 1)  # of the bodies beyond the joint, about c
    for k, joint in reversed(list(enumerate(motion.chain))):
        if joint.body:
            body = motion.bodies[joint.body]
            force_needed, moment_needed = needed_wrench(body, inertia[joint.body], machine.gravity)
            force, moment = (
                force + force_needed,
                moment + moment_needed + ca.cross(body.position - c, force_needed),
            )
        # A slider transmits a moment at its carriage.
        point = motion.chain[k + 1].point if joint.kind == "P" else joint.point
        if joint.seat is not None:
            point = joint.seat
        arm = ca.horzcat(ca.skew(c - point), eye)
        points.append(point)
        forces = ca.horzcat(eye, ca.SX(3, 3))
        wrenches.append(Wrench(forces, force, arm, moment + ca.cross(c - point, force)))
    return LegForces(tuple(reversed(points)), tuple(reversed(wrenches)))


_Row = tuple[Expression, Expression]
"""An affine form: row (1, 6) or (1, 6 n), and constant; row w + constant."""


def _embed_row(row: _Row, i: int, count: int) -> _Row:
    """Return a row (1, 6) of leg i's unknowns as a row (1, 6 n) of all legs' unknowns."""
    blocks = [ca.SX(1, 6)] * count
    return ca.horzcat(*blocks[:i], row[0], *blocks[i + 1 :]), row[1]


def _freedom_component(motion: LegMotion, leg_forces: LegForces, k: int) -> _Row:
    """Return the force or moment that joint k transmits along its own axis, as a linear form."""
    joint, wrench = motion.chain[k], leg_forces.wrenches[k]
    axis = joint.axis.T
    if joint.kind == "P":
        return ca.mtimes(axis, wrench.force_rows), ca.mtimes(axis, wrench.force)
    return ca.mtimes(axis, wrench.moment_rows), ca.mtimes(axis, wrench.moment)


def _actuator_row(motion: LegMotion, leg_forces: LegForces) -> _Row:
    """Return the actuator force as a linear form: along the driven joint's axis, over its gear."""
    row, constant = _freedom_component(
        motion, leg_forces, motion.chain.index(motion.actuated_joint)
    )
    return row / motion.actuated_joint.gear, constant / motion.actuated_joint.gear


def _passive_joint_rows(
    leg: LegKind, motion: LegMotion, leg_forces: LegForces, hinges: int
) -> list[_Row]:
    """Return linear forms that must vanish: forces along the axes of a leg's passive joints.

    The last joints are excluded: hinges on the platform's axes, which legs may share, and joints
    geared to the driven joint.
    """
    couple = leg.rod_couple(motion)
    if couple is None:
        passive = [k for k, joint in enumerate(motion.chain) if not joint.driven]
        return [
            _freedom_component(motion, leg_forces, k)
            for k in passive
            if k < len(motion.chain) - hinges
        ]
    # Rods transmit a force along them and a couple, the same at both of their ends.
    length = ca.norm_2(motion.links[1])
    n, couple = motion.links[1] / length, couple / length
    first, second = [k for k, joint in enumerate(motion.chain) if not joint.driven][:2]
    hinge_axis, tip = motion.chain[second].axis, leg_forces.wrenches[first]
    blocked = ca.horzsplit(ca.SX.eye(3))
    if not couple.is_zero():
        blocked = [n, ca.cross(n, couple)]
    at_c = ca.horzcat(ca.SX(3, 3), ca.SX.eye(3))
    ends = (hinge_axis, ca.cross(n, hinge_axis))
    return [
        *((ca.mtimes(v.T, at_c), ca.SX(0)) for v in blocked),
        *((ca.mtimes(v.T, tip.moment_rows - at_c), ca.mtimes(v.T, tip.moment)) for v in ends),
    ]
