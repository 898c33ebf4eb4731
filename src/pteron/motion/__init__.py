"""Motions of the platform and of the machine: trajectories, simulation, the drives' limits."""

from pteron.motion.drive_sizing import size
from pteron.motion.gearing import Span, best_ratio, best_ratios
from pteron.motion.joint_points import Guide, JointPoints, Part, joint_guides, joint_points
from pteron.motion.motion import Motion
from pteron.motion.motor_choice import Fit, choose
from pteron.motion.motors import Motor, read_motors
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
from pteron.motion.sizing import Sizing

__all__ = [
    "Fit",
    "Guide",
    "JointPoints",
    "Motion",
    "Motor",
    "Part",
    "PickAndPlace",
    "Sensors",
    "Simulation",
    "Sizing",
    "Span",
    "advance",
    "best_ratio",
    "best_ratios",
    "choose",
    "joint_guides",
    "joint_points",
    "longest_step",
    "overloads",
    "pick_and_place",
    "read_motors",
    "scaled_to_reach",
    "simulate",
    "size",
    "with_payload",
]
