"""Motions of the platform: time laws, the pick-and-place cycle, the joints, drives' limits."""

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
from pteron.motion.pick_and_place import PickAndPlace, pick_and_place
from pteron.motion.scaling import scaled_to_reach

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
    "joint_guides",
    "joint_points",
    "overloads",
    "pick_and_place",
    "scaled_to_reach",
]
