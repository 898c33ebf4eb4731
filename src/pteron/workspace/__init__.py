"""Where a machine can work: its reserves, its home pose, its reach and its joints' ranges."""

from pteron.kinematics.limits import LimitedJoint, limited_joints
from pteron.workspace.clearance import Clearance, clearance
from pteron.workspace.conditions import Condition, conditions
from pteron.workspace.free_regions import FreeRegion, free_of_singularities
from pteron.workspace.home import home_pose
from pteron.workspace.nearest import NearestSingularity, nearest_singularities
from pteron.workspace.paving import Paving, paving
from pteron.workspace.reach import BEYOND_LIMITS, REACHABLE, ReachSlice, reach_slice
from pteron.workspace.reserve import JointRanges, Reserve, joint_ranges, reserve
from pteron.workspace.volume import ReachVolume, bounding_box, reach_volume

__all__ = [
    "BEYOND_LIMITS",
    "Clearance",
    "Condition",
    "Paving",
    "REACHABLE",
    "ReachSlice",
    "ReachVolume",
    "Reserve",
    "FreeRegion",
    "JointRanges",
    "LimitedJoint",
    "NearestSingularity",
    "bounding_box",
    "clearance",
    "conditions",
    "free_of_singularities",
    "home_pose",
    "limited_joints",
    "nearest_singularities",
    "paving",
    "reach_slice",
    "reach_volume",
    "reserve",
    "joint_ranges",
]


def __dir__() -> list[str]:
    return sorted(__all__)
