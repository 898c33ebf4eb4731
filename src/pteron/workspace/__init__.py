"""The workspace of a machine: margins, home pose, reach, joints' ranges, and proofs of them."""

from typing import TYPE_CHECKING

from pteron.arguments import check_arguments
from pteron.kinematics.limits import LimitedJoint, limited_joints
from pteron.renamed import former_names
from pteron.workspace.clearance import Clearance, clearance, interference
from pteron.workspace.components import Component, Components, components
from pteron.workspace.conditions import Condition, conditions
from pteron.workspace.cube_bound import cube_bound
from pteron.workspace.free_regions import FreeRegion, free_of_singularities
from pteron.workspace.home import home_pose
from pteron.workspace.inscribed import Inscribed, largest_cube, largest_cylinder
from pteron.workspace.margins import JointRanges, PoseMargins, joint_ranges, pose_margins
from pteron.workspace.modes import Contact, mode_contacts, mode_pavings
from pteron.workspace.nearest_singularities import NearestSingularity, nearest_singularities
from pteron.workspace.orientations import VolumesOverAngles, over_angles
from pteron.workspace.paving import Paving, paving
from pteron.workspace.proofs import Proof, prove
from pteron.workspace.quadrature import Quadrature, quadrature_volume
from pteron.workspace.reach import BEYOND_LIMITS, REACHABLE, ReachSlice, reach_slice
from pteron.workspace.regions import Box, Cylinder, Region
from pteron.workspace.tilts import LargestTilt, TiltedBall, largest_ball, largest_tilt
from pteron.workspace.volume import ReachVolume, bounding_box, reach_volume

__all__ = [
    "BEYOND_LIMITS",
    "Box",
    "Clearance",
    "Component",
    "Components",
    "Condition",
    "Contact",
    "Cylinder",
    "FreeRegion",
    "Inscribed",
    "JointRanges",
    "LargestTilt",
    "LimitedJoint",
    "NearestSingularity",
    "Paving",
    "Proof",
    "Quadrature",
    "REACHABLE",
    "ReachSlice",
    "ReachVolume",
    "Region",
    "TiltedBall",
    "PoseMargins",
    "VolumesOverAngles",
    "bounding_box",
    "clearance",
    "conditions",
    "free_of_singularities",
    "components",
    "cube_bound",
    "home_pose",
    "interference",
    "joint_ranges",
    "largest_ball",
    "largest_cube",
    "largest_cylinder",
    "largest_tilt",
    "limited_joints",
    "nearest_singularities",
    "mode_contacts",
    "mode_pavings",
    "over_angles",
    "paving",
    "prove",
    "quadrature_volume",
    "reach_slice",
    "reach_volume",
    "pose_margins",
]
check_arguments(__name__)
if not TYPE_CHECKING:
    __getattr__ = former_names(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
