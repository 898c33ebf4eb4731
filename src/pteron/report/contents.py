"""What a report holds: all that Pteron knows of one machine, computed once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pteron.dynamics import inverse_dynamics
from pteron.kernels import Array, numeric
from pteron.kinematics import jacobian, joint_rates, singular_orientations
from pteron.manipulator import Manipulator
from pteron.motion import JointPoints, PickAndPlace, joint_points, pick_and_place
from pteron.reduction import BaseParameters, base_parameters
from pteron.report.costs import Cost, costs
from pteron.workspace import (
    BEYOND_LIMITS,
    ReachSlice,
    ReachVolume,
    Reserve,
    SliderRanges,
    home_pose,
    reach_slice,
    reach_volume,
    reserve,
    slider_ranges,
)
from pteron.workspace.doubts import doubts

_SAMPLES = 481
"""Samples of the cycle: 120 steps of the moving picture, four each."""

_LEAST_RESERVE = 0.2
_PLANES: tuple[Literal["xy", "xz", "yz"], ...] = ("xy", "xz", "yz")
_ANGLES = 361

_RIM = 0.08
"""Share of the reach's greatest width that the slices show around it."""

_BARE_RAIL = 0.25
"""Length of a guide without limits, beyond what the cycle uses, as a share of the longest leg."""


@dataclass(frozen=True)
class JacobianAtHome:
    """The Jacobian (n, m) at the home pose, Eq. (10), and its condition number.

    The number is that of J with the angle's column divided by `radius`, the root mean square
    distance of the platform points from the platform's axis, so that no unit is mixed with another;
    a platform that does not turn has none.
    """

    matrix: Array
    radius: float | None
    condition: float


@dataclass(frozen=True)
class Orientations:
    """How well the sliders hold the platform over phi: det J over its largest value, shape (A,).

    `singular` has the type-II singular orientations; angles are in rad.
    """

    angles: Array
    regularity: Array
    singular: Array


@dataclass(frozen=True)
class Report:
    """All that a page says about a machine; the cycle has T samples.

    The cycle keeps the reserve `least`; its forces and slider speeds (T, n) are in N and m/s. The
    guides' ends `rails` (n, 2, 3), m, are the sliders' limits, or a little more than the cycle
    needs. The slices go through the home pose and are all of one width.
    """

    robot: Manipulator
    doubts: tuple[str, ...]
    home: Array
    reserve: Reserve
    least: float
    cycle: PickAndPlace
    points: JointPoints
    home_points: JointPoints
    rails: Array
    forces: Array
    slider_speeds: Array
    sliders: SliderRanges
    slices: tuple[ReachSlice, ...]
    volume: ReachVolume
    jacobian: JacobianAtHome
    orientations: Orientations | None
    base: BaseParameters
    costs: tuple[Cost, ...]

    @property
    def limited(self) -> bool:
        """Whether a slice shows poses that only the sliders' limits forbid."""
        return any(bool((cut.status == BEYOND_LIMITS).any()) for cut in self.slices)

    @property
    def peak_forces(self) -> Array:
        """Largest size of each leg's force over the cycle, N."""
        return np.asarray(np.abs(self.forces).max(axis=0))

    @property
    def rms_forces(self) -> Array:
        """Root mean square of each leg's force over the cycle, N."""
        return np.asarray(np.sqrt((self.forces[:-1] ** 2).mean(axis=0)))

    @property
    def peak_speeds(self) -> Array:
        """Largest speed of each slider over the cycle, m/s."""
        return np.asarray(np.abs(self.slider_speeds).max(axis=0))


def contents(robot: Manipulator) -> Report:
    """Return the report on a machine that reaches a pose and is not singular everywhere."""
    home = home_pose(robot)
    at_home = reserve(robot, home)
    # A machine with little reserve anywhere moves where it has half of its best.
    least = min(_LEAST_RESERVE, float(at_home.smallest) / 2.0)
    cycle = pick_and_place(robot, home, samples=_SAMPLES, least=least)
    sliders = slider_ranges(robot, cycle.pose)
    volume = reach_volume(robot, home)
    base = base_parameters(robot)
    return Report(
        robot=robot,
        doubts=doubts(robot),
        home=home,
        reserve=at_home,
        least=least,
        cycle=cycle,
        points=joint_points(robot, cycle.pose),
        home_points=joint_points(robot, home),
        rails=_rails(robot, sliders),
        forces=inverse_dynamics(robot, cycle.pose, cycle.velocity, cycle.acceleration),
        slider_speeds=joint_rates(robot, cycle.pose, cycle.velocity).sliders,
        sliders=sliders,
        slices=_slices(robot, home, volume.box),
        volume=volume,
        jacobian=_jacobian(robot, home),
        orientations=_orientations(robot, home),
        base=base,
        costs=costs(base),
    )


def _slices(robot: Manipulator, home: Array, box: Array) -> tuple[ReachSlice, ...]:
    """Return squares of one width through the home pose, so that the pictures share a scale."""
    middle = box.mean(axis=0)
    half = (0.5 + _RIM) * float((box[1] - box[0]).max())
    found = []
    for plane in _PLANES:
        x, y = (float(middle["xyz".index(letter)]) for letter in plane)
        extent = x - half, x + half, y - half, y + half
        found.append(reach_slice(robot, home, plane, extent=extent))
    return tuple(found)


def _rails(robot: Manipulator, ranges: SliderRanges) -> Array:
    longest = max(leg.upper_length + leg.lower_length for leg in robot.legs)
    ends = []
    for leg, low, high in zip(robot.legs, ranges.least, ranges.greatest, strict=True):
        spare = _BARE_RAIL * longest
        limits = leg.slider_limits or (float(low) - spare, float(high) + spare)
        ends.append([np.array(leg.guide_point) + rho * np.array(leg.e) for rho in limits])
    return np.array(ends)


def _jacobian(robot: Manipulator, home: Array) -> JacobianAtHome:
    matrix = jacobian(robot, home)
    if not robot.platform.turns:
        return JacobianAtHome(matrix, None, float(np.linalg.cond(matrix)))
    points = np.array([leg.platform_point[:2] for leg in robot.legs])
    radius = float(np.sqrt((points**2).sum(axis=-1).mean()))
    return JacobianAtHome(matrix, radius, float(np.linalg.cond(matrix / [1.0, 1.0, 1.0, radius])))


def _orientations(robot: Manipulator, home: Array) -> Orientations | None:
    if not robot.platform.turns:
        return None
    poses = np.tile(home, (_ANGLES, 1))
    poses[:, 3] = angles = np.linspace(-np.pi, np.pi, _ANGLES)
    return Orientations(angles, numeric(robot, "regularity")(poses), singular_orientations(robot))
