"""The contents of the report on one machine, computed before its page is written."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

from pteron.equations.machine import closure_of
from pteron.errors import ModelError
from pteron.kernels import Array, geometry_only, numeric
from pteron.kernels.program_cache import cached_result
from pteron.kinematics import singular_orientations
from pteron.kinematics.jacobian_at import JacobianAtPose, jacobian_at
from pteron.kinematics.singularities import best_type_ii
from pteron.manipulator import Manipulator
from pteron.manipulator.template import template_sentence
from pteron.motion import Motion, PickAndPlace, Sizing, least_margin, pick_and_place, size
from pteron.motion.sizing.friction_sentence import friction_sentence
from pteron.playback import Playback
from pteron.reduction import BaseParameters, base_parameters
from pteron.report.costs import Cost, costs
from pteron.report.given_forces import force_doubts
from pteron.report.motion_frames import Frames, frames
from pteron.workspace import (
    BEYOND_LIMITS,
    REACHABLE,
    JointRanges,
    LimitedJoint,
    PoseMargins,
    ReachSlice,
    ReachVolume,
    home_pose,
    joint_ranges,
    limited_joints,
    pose_margins,
    reach_slice,
    reach_volume,
)
from pteron.workspace.examination import examine
from pteron.workspace.reach_slices import Plane, reach_sides, slice_planes
from pteron.workspace.tilts import largest_tilt

_ANGLES = 361
"""Angles of the platform, over a turn, at which the type-II measure is shown."""

_CONSTANT = 1e-6
"""Change of the type-II measure below which it is constant."""

_RIM = 0.08
"""Share of the reach's greatest width that the slices show around it."""

_FINE = 121
"""Points along each side of a measure's slice."""


@dataclass(frozen=True)
class Orientations:
    """The type-II measure (A,) over the platform's angle, relative to its best; NaN out of reach.

    `coordinate` is the place of the angle in a pose, `singular` has the type-II singular
    orientations; angles are in rad. The measure is the same at every position if `everywhere`, else
    it is that of the home position.
    """

    coordinate: int
    angles: Array
    type_ii: Array
    singular: Array
    everywhere: bool

    @property
    def partial(self) -> bool:
        """Whether some angles are out of reach."""
        return bool(np.isnan(self.type_ii).any())


@dataclass(frozen=True)
class Measures:
    """Both singularity measures (B, A) on a slice; NaN out of reach.

    `type_i` is the least of the legs' type-I measures, `type_ii` the type-II measure as a share of
    its best.
    """

    cut: ReachSlice
    type_i: Array
    type_ii: Array


@dataclass(frozen=True)
class Report:
    """The contents of a machine's page; the cycle has T samples.

    `cycle` is the standard one, which keeps the margin `least`, or a given motion, from the file
    `source`; `shown` are the instants of it in the moving picture. `sizing` has the loads of the
    drives in it: forces, in N or N m, include friction and the motors' inertia where the machine's
    file has these (`has_drives`).
    The slices go through the home pose; those over two lengths are all of one width. `volume` is
    None where the pose has fewer than two lengths. `tilt` is the angle, rad, by which the platform
    is proved to tilt to every side at the home position; None where it does not tilt from the
    level. `orientations` is there where the type-II measure depends on one angle, `measures` where
    it depends on the position; neither where J is constant. `passive` has the passive joints with
    limits, at the home pose. `workspace_joints` has the range of each joint over the slices.
    """

    robot: Manipulator
    doubts: tuple[str, ...]
    home: Array
    margins: PoseMargins
    least: float
    cycle: Motion
    source: str
    shown: Frames
    sizing: Sizing
    friction: str
    joints: JointRanges
    workspace_joints: JointRanges
    passive: tuple[LimitedJoint, ...]
    slices: tuple[ReachSlice, ...]
    volume: ReachVolume | None
    tilt: float | None
    jacobian: JacobianAtPose
    orientations: Orientations | None
    measures: Measures | None
    base: BaseParameters
    costs: tuple[Cost, ...]

    @property
    def standard(self) -> PickAndPlace | None:
        """The cycle, if it is the standard pick-and-place cycle."""
        return self.cycle if isinstance(self.cycle, PickAndPlace) else None

    @property
    def has_drives(self) -> bool:
        """Whether the machine's file has drives."""
        return any(leg.drive is not None for leg in self.robot.legs)

    @property
    def shows_joint_limits(self) -> bool:
        """Whether a slice shows poses that only joint limits exclude."""
        return any(bool((cut.status == BEYOND_LIMITS).any()) for cut in self.slices)

    @property
    def missing_legs(self) -> tuple[int, ...]:
        """The legs, from 0, by which a slice shows poses out of reach, or their end of reach."""
        edges = [cut.leg_margins.reshape(-1, self.robot.joint_count) for cut in self.slices]
        return tuple(
            i
            for i in range(self.robot.joint_count)
            if any(bool((cut.status == i + 1).any()) for cut in self.slices)
            or any(edge[:, i].min() < 0.0 < edge[:, i].max() for edge in edges)
        )

    @property
    def forces(self) -> Array:
        """Each drive's force (T, n) at the cycle's samples, N or N m."""
        return self.sizing.forces[::2]

    @property
    def has_drive_limits(self) -> bool:
        """Whether the machine's file has a limit of a drive."""
        drives = self.sizing.drives
        return any(drive.max_force or drive.max_speed or drive.rated_force for drive in drives)

    @property
    def has_rotor_inertia(self) -> bool:
        """Whether the machine's file has a motor's inertia."""
        return any(drive.rotor_inertia > 0.0 for drive in self.sizing.drives)


def _volume(robot: Manipulator, home: Array) -> ReachVolume:
    """Return the volume of reach at the orientation of a pose, cached between runs."""
    key = "reach_volume", geometry_only(robot), tuple(home.tolist()), version("scipy")
    return cached_result(
        key, ("dynamics", "kinematics", "workspace"), lambda: reach_volume(robot, home)
    )


def contents(robot: Manipulator, motion: Playback | None = None) -> Report:
    """Return the report on a machine that reaches a pose and is not singular everywhere.

    It shows a motion, or the standard cycle where none is given.
    """
    home = home_pose(robot)
    at_home = pose_margins(robot, home)
    cycle = pick_and_place(robot, home) if motion is None else motion.motion
    sizing = size(robot, cycle)
    volume = _volume(robot, home) if len(robot.platform.lengths) > 1 else None
    base = base_parameters(robot)
    slices = _slices(robot, home, volume)
    reached = [cut.poses[cut.status == REACHABLE] for cut in slices]
    return Report(
        robot=robot,
        doubts=(
            *examine(robot, home).warnings,
            *([kept] if (kept := template_sentence(robot)) else []),
            *(() if motion is None else force_doubts(robot, motion)),
        ),
        home=home,
        margins=at_home,
        least=least_margin(robot, home),
        cycle=cycle,
        source="" if motion is None else motion.source,
        shown=frames(robot, cycle, sizing.forces[::2], home),
        sizing=sizing,
        friction=friction_sentence(robot),
        joints=joint_ranges(robot, cycle.pose),
        workspace_joints=joint_ranges(robot, np.vstack([home[None], *reached])),
        passive=tuple(joint for joint in limited_joints(robot, home) if not joint.actuated),
        slices=slices,
        volume=volume,
        tilt=_tilt(robot, home),
        jacobian=jacobian_at(robot, home),
        orientations=_orientations(robot, home),
        measures=_measures(robot, home, volume),
        base=base,
        costs=costs(base),
    )


def _slices(robot: Manipulator, home: Array, volume: ReachVolume | None) -> tuple[ReachSlice, ...]:
    """Return the slices through home; those over two lengths have a common width."""
    slices = []
    for plane in slice_planes(robot):
        extent = None
        if volume is not None and set(plane) <= set(robot.platform.lengths):
            half = (0.5 + _RIM) * float((volume.box[1] - volume.box[0]).max())
            extent = _extent(volume.box, plane, [half] * 3)
        slices.append(reach_slice(robot, home, plane, extent=extent))
    return tuple(slices)


def _tilt(robot: Manipulator, home: Array) -> float | None:
    """Return the largest tilt, rad, at a pose, cached between runs; None if there is none."""

    def tilt() -> float | None:
        """Return the largest tilt, rad; None if the platform does not tilt, or not from level."""
        with suppress(ModelError):  # it does not tilt, or not from the level
            return largest_tilt(robot, home).tilt
        return None

    key = "largest tilt", geometry_only(robot), tuple(home.tolist())
    return cached_result(key, ("dynamics", "kinematics", "workspace"), tilt)


def _extent(box: Array, plane: Plane, half: Sequence[float]) -> tuple[float, float, float, float]:
    """Return the sides of a rectangle about the middle of a box."""
    i, j = ("xyz".index(letter) for letter in plane)
    x, y = (float(box[:, k].mean()) for k in (i, j))
    return x - half[i], x + half[i], y - half[j], y + half[j]


def _measures(robot: Manipulator, home: Array, volume: ReachVolume | None) -> Measures | None:
    """Return the measures on a plane through home, a vertical one if possible.

    None where the type-II measure is constant or depends on the orientation alone.
    """
    closure = closure_of(robot)
    if closure.orientation is not None or closure.vanishes() is False:
        return None
    if volume is None:
        cut = reach_slice(robot, home, slice_planes(robot)[0], points=_FINE)
    else:
        # The plane of two axes of the base frame that is nearest to vertical, x before y.
        vertical = np.abs(robot.gravity if any(robot.gravity) else robot.platform.axis)
        upright = "xz" in slice_planes(robot) and vertical[1] <= vertical[2]
        plane, box = "xz" if upright else "xy", volume.box
        half = (0.5 + _RIM) * (box[1] - box[0])
        extent = _extent(box, plane, half.tolist())
        wide_cut = reach_slice(robot, home, plane, extent=extent, points=_FINE)
        # The box holds the whole reach: this plane may reach a small part of it.
        cut = reach_slice(robot, home, plane, extent=reach_sides(wide_cut), points=_FINE)
    type_i = numeric(robot, "reach")(cut.poses)[1].min(axis=-1)
    type_ii = _type_ii(robot, cut.poses)
    return Measures(cut, type_i, np.where(np.isnan(type_i), np.nan, type_ii))


def _orientations(robot: Manipulator, home: Array) -> Orientations | None:
    """Return the type-II measure over the platform's only angle at home; None if constant."""
    if robot.platform.axis_angle is None:
        return None
    (turn,) = np.flatnonzero(robot.platform.angular).tolist()
    poses = np.tile(home, (_ANGLES, 1))
    poses[:, turn] = angles = np.linspace(-np.pi, np.pi, _ANGLES)
    measure = _type_ii(robot, poses)
    if np.nanmax(measure) - np.nanmin(measure) <= _CONSTANT:
        return None
    singular = singular_orientations(robot, home[~robot.platform.angular])
    everywhere = closure_of(robot).orientation is not None
    return Orientations(turn, angles, measure, singular, everywhere)


def _type_ii(robot: Manipulator, poses: Array) -> Array:
    """Return the type-II measure's size as a share of its best, NaN where undefined."""
    share = np.abs(numeric(robot, "type_ii")(poses)[0]) / best_type_ii(robot)
    return np.asarray(np.minimum(share, 1.0))
