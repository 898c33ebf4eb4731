"""Where a machine can work: its reserves, its home pose, its reach and its joints' ranges."""

from pteron.kinematics.limits import LimitedJoint, limited_joints
from pteron.workspace.conditions import Condition, conditions
from pteron.workspace.home import home_pose
from pteron.workspace.paving import Paving, paving
from pteron.workspace.reach import BEYOND_LIMITS, REACHABLE, ReachSlice, reach_slice
from pteron.workspace.reserve import JointRanges, Reserve, joint_ranges, reserve
from pteron.workspace.volume import ReachVolume, bounding_box, reach_volume

__all__ = [
    "BEYOND_LIMITS",
    "Condition",
    "Paving",
    "REACHABLE",
    "ReachSlice",
    "ReachVolume",
    "Reserve",
    "JointRanges",
    "LimitedJoint",
    "bounding_box",
    "conditions",
    "home_pose",
    "limited_joints",
    "paving",
    "reach_slice",
    "reach_volume",
    "reserve",
    "joint_ranges",
]


def __dir__() -> list[str]:
    return sorted(__all__)
