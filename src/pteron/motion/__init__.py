"""Motions of the platform and of the machine: trajectories, simulation, the drives' limits."""

from pteron.controllers import (
    Adaptive,
    ComputedTorque,
    Controller,
    FeedForwardPD,
    PDGravity,
)
from pteron.motion.joint_points import Guide, JointPoints, Part, joint_guides, joint_points
from pteron.motion.motion import Motion
from pteron.motion.overloads import overloads
from pteron.motion.payload import with_payload
from pteron.motion.pick_and_place import PickAndPlace, pick_and_place
from pteron.motion.scaling import scaled_to_reach
from pteron.motion.simulation import (
    Sensors,
    Simulation,
    advance,
    longest_step,
    simulate,
)

__all__ = [
    "Adaptive",
    "ComputedTorque",
    "Controller",
    "FeedForwardPD",
    "PDGravity",
    "Guide",
    "JointPoints",
    "Motion",
    "Part",
    "PickAndPlace",
    "Sensors",
    "Simulation",
    "advance",
    "joint_guides",
    "joint_points",
    "longest_step",
    "overloads",
    "pick_and_place",
    "scaled_to_reach",
    "simulate",
    "with_payload",
]
