"""Motions of the platform, the forces that they need, and simulation of the machine."""

from pteron.arguments import check_arguments
from pteron.motion.cueing import Cue, Washout, cue
from pteron.motion.joint_points import Guide, JointPoints, Part, joint_guides, joint_points
from pteron.motion.motion import Motion
from pteron.motion.overloads import overloads
from pteron.motion.payload import with_payload
from pteron.motion.simulation import Sensors, Simulation, advance, longest_step, simulate
from pteron.motion.sizing.drive_loads import Sizing, best_ratio, best_ratios
from pteron.motion.sizing.gearing import Span
from pteron.motion.sizing.motor_choice import Fit, choose
from pteron.motion.sizing.motors import Motor, read_motors
from pteron.motion.sizing.size import size
from pteron.motion.trajectories.checks import check_motion, check_path
from pteron.motion.trajectories.demand import Peak, peaks
from pteron.motion.trajectories.fourier import FourierSeries, fourier_motion
from pteron.motion.trajectories.jerk_limited import jerk_limited
from pteron.motion.trajectories.limits import MotionLimits, limits_of
from pteron.motion.trajectories.path import LinePath, Path, line_path, there_and_back
from pteron.motion.trajectories.pick_and_place import PickAndPlace, cycle_path, pick_and_place
from pteron.motion.trajectories.point_to_point import point_to_point
from pteron.motion.trajectories.replay import replay
from pteron.motion.trajectories.scaling import least_reserve, scaled_to_reach
from pteron.motion.trajectories.time_law import along, shortest
from pteron.motion.trajectories.time_optimal import TimeOptimal, time_optimal

__all__ = [
    "Cue",
    "Fit",
    "FourierSeries",
    "Guide",
    "JointPoints",
    "LinePath",
    "Motion",
    "MotionLimits",
    "Motor",
    "Part",
    "Path",
    "Peak",
    "PickAndPlace",
    "Sensors",
    "Simulation",
    "Sizing",
    "Span",
    "TimeOptimal",
    "Washout",
    "advance",
    "along",
    "best_ratio",
    "best_ratios",
    "check_motion",
    "check_path",
    "choose",
    "cue",
    "cycle_path",
    "fourier_motion",
    "jerk_limited",
    "joint_guides",
    "joint_points",
    "least_reserve",
    "limits_of",
    "line_path",
    "longest_step",
    "overloads",
    "peaks",
    "pick_and_place",
    "point_to_point",
    "read_motors",
    "replay",
    "scaled_to_reach",
    "shortest",
    "simulate",
    "size",
    "there_and_back",
    "time_optimal",
    "with_payload",
]
check_arguments(__name__, classes=("FourierSeries", "Motor", "MotionLimits", "Washout"))


def __dir__() -> list[str]:
    return sorted(__all__)
