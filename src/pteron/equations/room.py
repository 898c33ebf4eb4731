"""What a pose must keep to serve: every edge of reach and every limit, each one expression.

A pose serves where none of them is negative. They are smooth inside, so that they can be bounded
over a box of poses; they are no distances, but for some. `reach` and `passive_room` have those.
"""

from __future__ import annotations

from typing import NamedTuple

from pteron.bodies.motion import Expression
from pteron.equations.kinematics import passive_joints
from pteron.equations.machine import Machine


class Room(NamedTuple):
    """What is not negative on the right side of an edge or a limit."""

    leg: int
    """From 1; 0 for the platform's angle."""
    cause: str
    """What ends there: "stretched", "folded" or "reach"; "least", "most" or "limits" of a joint."""
    noun: str
    """The joint that it limits; empty for an edge of reach."""
    value: Expression


def rooms(machine: Machine, pose: Expression) -> list[Room]:
    """Return the edges of every leg's reach, then the limits of its joint, then of passive ones."""
    state = machine.state(pose)
    edges, limits, passive = [], [], []
    trios = zip(machine.robot.legs, machine.legs, state.platform.points, state.legs, strict=True)
    for i, (leg, own, point, motion) in enumerate(trios, start=1):
        c = point.position
        edges += [Room(i, cause, "", value) for cause, value in own.edges(c).items()]
        if leg.limits is not None:
            found = own.within_limits(c, motion.coordinate, *leg.limits)
            limits += [Room(i, cause, leg.joint.noun, value) for cause, value in found.items()]
    for i, joints in enumerate(passive_joints(machine, pose)):
        for joint in joints:
            if not joint.only_most:
                passive.append(Room(i, "least", joint.noun, joint.value - joint.least))
            passive.append(Room(i, "most", joint.noun, joint.most - joint.value))
    return [*edges, *limits, *passive]
