"""The conditions of reach and of joints' limits at a pose, each an expression >= 0 where it holds.

They are smooth inside, so that they can be bounded over a box of poses, but most are no distances:
for these see `reach` and `passive_margins` in `equations.kinematics`.
"""

from __future__ import annotations

from typing import NamedTuple

from pteron.bodies.motion import Expression
from pteron.equations.kinematics import passive_joints
from pteron.equations.machine import Machine


class Edge(NamedTuple):
    """A condition of reach, or of a limit."""

    leg: int
    """Its leg, from 1; 0 for the platform's angles."""
    cause: str
    """Its name: "stretched", "folded" or "reach"; "least", "most" or "limits" of a joint."""
    noun: str
    """The joint that it limits; empty for an edge of reach."""
    value: Expression
    """Not negative on its right side."""


def edges(machine: Machine, pose: Expression) -> list[Edge]:
    """Return the edges of every leg's reach, then the limits of its joint, then of passive ones."""
    state = machine.state(pose)
    reached, limits, passive = [], [], []
    trios = zip(machine.robot.legs, machine.legs, state.platform.points, state.legs, strict=True)
    for i, (leg, own, point, motion) in enumerate(trios, start=1):
        c = point.position
        reached += [Edge(i, cause, "", value) for cause, value in own.edges(c).items()]
        if leg.limits is not None:
            found = own.within_limits(c, motion.coordinate, *leg.limits)
            limits += [Edge(i, cause, leg.joint.noun, value) for cause, value in found.items()]
    for i, joints in enumerate(passive_joints(machine, pose)):
        for joint in joints:
            if not joint.only_most:
                passive.append(Edge(i, "least", joint.noun, joint.value - joint.least))
            passive.append(Edge(i, "most", joint.noun, joint.most - joint.value))
    return [*reached, *limits, *passive]
