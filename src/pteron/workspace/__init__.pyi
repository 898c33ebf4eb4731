from pteron.kinematics.limits import (
    LimitedJoint as LimitedJoint,
    limited_joints as limited_joints,
)
from pteron.workspace.clearance import (
    Clearance as Clearance,
    clearance as clearance,
    interference as interference,
)
from pteron.workspace.components import (
    Component as Component,
    Components as Components,
    components as components,
)
from pteron.workspace.conditions import Condition as Condition, conditions as conditions
from pteron.workspace.cube_bound import cube_bound as cube_bound
from pteron.workspace.free_regions import (
    FreeRegion as FreeRegion,
    free_of_singularities as free_of_singularities,
)
from pteron.workspace.home import (
    HomePoses as HomePoses,
    home_pose as home_pose,
    home_poses as home_poses,
)
from pteron.workspace.inscribed import (
    Inscribed as Inscribed,
    largest_cube as largest_cube,
    largest_cylinder as largest_cylinder,
)
from pteron.workspace.margins import (
    JointRanges as JointRanges,
    PoseMargins as PoseMargins,
    joint_ranges as joint_ranges,
    pose_margins as pose_margins,
)
from pteron.workspace.modes import (
    Contact as Contact,
    mode_contacts as mode_contacts,
    mode_pavings as mode_pavings,
)
from pteron.workspace.nearest_singularities import (
    NearestSingularity as NearestSingularity,
    nearest_singularities as nearest_singularities,
)
from pteron.workspace.orientations import (
    VolumesOverAngles as VolumesOverAngles,
    volumes_over_angles as volumes_over_angles,
)
from pteron.workspace.paving import Paving as Paving, paving as paving
from pteron.workspace.pose_proofs import ProvedPoses as ProvedPoses, proved_poses as proved_poses
from pteron.workspace.proofs import Proof as Proof, prove as prove
from pteron.workspace.quadrature import (
    Quadrature as Quadrature,
    quadrature_volume as quadrature_volume,
)
from pteron.workspace.reach_slices import (
    BEYOND_LIMITS as BEYOND_LIMITS,
    REACHABLE as REACHABLE,
    ReachSlice as ReachSlice,
    reach_slice as reach_slice,
)
from pteron.workspace.redundancy import Redundancy as Redundancy, redundancy as redundancy
from pteron.workspace.regions import Box as Box, Cylinder as Cylinder, Region as Region
from pteron.workspace.screw_lengths import screw_lengths as screw_lengths
from pteron.workspace.tilts import (
    LargestTilt as LargestTilt,
    TiltedBall as TiltedBall,
    largest_ball as largest_ball,
    largest_tilt as largest_tilt,
)
from pteron.workspace.travels import (
    Travel as Travel,
    largest_box as largest_box,
    travel as travel,
)
from pteron.workspace.volume import (
    ReachVolume as ReachVolume,
    bounding_box as bounding_box,
    reach_volume as reach_volume,
)
