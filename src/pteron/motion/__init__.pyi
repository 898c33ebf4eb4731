from pteron.motion.cue_limits import CueLimits as CueLimits, cue_limits as cue_limits
from pteron.motion.cueing import Cue as Cue, cue as cue
from pteron.motion.joint_points import (
    Guide as Guide,
    JointPoints as JointPoints,
    Part as Part,
    joint_guides as joint_guides,
    joint_points as joint_points,
)
from pteron.motion.live_cue import LiveCue as LiveCue
from pteron.motion.motion import Motion as Motion
from pteron.motion.overloads import overloads as overloads
from pteron.motion.payload import with_payload as with_payload, with_tool as with_tool
from pteron.motion.simulation import (
    Batch as Batch,
    Exported as Exported,
    Machines as Machines,
    Sensors as Sensors,
    Simulation as Simulation,
    advance as advance,
    longest_step as longest_step,
    machines_about as machines_about,
    modes as modes,
    simulate as simulate,
    simulate_many as simulate_many,
)
from pteron.motion.sizing.common_choice import (
    alike_legs as alike_legs,
    choose_common as choose_common,
)
from pteron.motion.sizing.drive_loads import (
    Sizing as Sizing,
    best_ratio as best_ratio,
    best_ratios as best_ratios,
)
from pteron.motion.sizing.drive_margins import DriveMargin as DriveMargin
from pteron.motion.sizing.gearing import Span as Span
from pteron.motion.sizing.motor_choice import (
    CommonFit as CommonFit,
    MotorFit as MotorFit,
    choose as choose,
)
from pteron.motion.sizing.motors import Motor as Motor, read_motors as read_motors
from pteron.motion.sizing.places import (
    CyclePlace as CyclePlace,
    motion_at_place as motion_at_place,
)
from pteron.motion.sizing.size import size as size
from pteron.motion.trajectories.checks import (
    check_motion as check_motion,
    check_path as check_path,
)
from pteron.motion.trajectories.demand import Peak as Peak, peaks as peaks
from pteron.motion.trajectories.fourier import (
    FourierSeries as FourierSeries,
    fourier_motion as fourier_motion,
)
from pteron.motion.trajectories.jerk_limited import jerk_limited as jerk_limited
from pteron.motion.trajectories.limits import (
    MotionLimits as MotionLimits,
    limits_of as limits_of,
)
from pteron.motion.trajectories.path import (
    LinePath as LinePath,
    Path as Path,
    line_path as line_path,
    return_path as return_path,
)
from pteron.motion.trajectories.pick_and_place import (
    PickAndPlace as PickAndPlace,
    cycle_path as cycle_path,
    pick_and_place as pick_and_place,
)
from pteron.motion.trajectories.point_to_point import point_to_point as point_to_point
from pteron.motion.trajectories.replay import replay as replay
from pteron.motion.trajectories.scaling import (
    least_margin as least_margin,
    scaled_to_reach as scaled_to_reach,
)
from pteron.motion.trajectories.time_law import (
    polynomial_motion as polynomial_motion,
    shortest as shortest,
)
from pteron.motion.trajectories.time_optimal import (
    TimeOptimal as TimeOptimal,
    time_optimal as time_optimal,
)
from pteron.motion.tuning import (
    GainTrial as GainTrial,
    LinearPlant as LinearPlant,
    LoopMargins as LoopMargins,
    Required as Required,
    SampledLoop as SampledLoop,
    Tuning as Tuning,
    linearise as linearise,
    trial as trial,
    trials as trials,
    tune as tune,
)
from pteron.motion.washout import Washout as Washout
