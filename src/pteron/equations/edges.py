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
    """A condition of reach, or of a joint's limit."""

    leg: int
    """Its leg, from 1; 0 for the platform's angles."""
    cause: str
    """Its name: "stretched", "folded" or "reach"; "least", "most" or "limits" of a joint."""
    noun: str
    """The joint that it limits; empty for an edge of reach."""
    value: Expression
    """Not negative where the condition holds."""


def edges(machine: Machine, pose: Expression) -> list[Edge]:
    """Return the boundaries of the workspace at a pose: leg reach, joint and passive limits."""
    state = machine.state(pose)
    reach_edges, limits, passive = [], [], []
    equations = machine.legs_at(state.platform)
    legs = zip(machine.robot.legs, equations, state.platform.points, state.legs, strict=True)
    for i, (leg, leg_equations, point, motion) in enumerate(legs, start=1):
        c = point.position
        reach_edges += [
            Edge(i, cause, "", margin) for cause, margin in leg_equations.edges(c).items()
        ]
        if leg.limits is not None:
            limit_edges = leg_equations.limit_margins(c, motion.coordinate, *leg.limits)
            limits += [
                Edge(i, cause, leg.joint.noun, margin) for cause, margin in limit_edges.items()
            ]
    for i, joints in enumerate(passive_joints(machine, pose)):
        for joint in joints:
            if not joint.only_most:
                passive.append(Edge(i, "least", joint.noun, joint.value - joint.least))
            passive.append(Edge(i, "most", joint.noun, joint.most - joint.value))
    return [*reach_edges, *limits, *passive]
