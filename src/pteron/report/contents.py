"""What a report holds: all that Pteron knows of one machine, computed once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pteron.dynamics import inverse_dynamics
from pteron.errors import ModelError
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

__all__ = ["JacobianAtHome", "Orientations", "Report", "contents"]

_SAMPLES = 481
"""Of the cycle: 120 steps of the moving picture, four samples each."""

_LEAST_RESERVE = 0.2
_PLANES: tuple[Literal["xy", "xz", "yz"], ...] = ("xy", "xz", "yz")
_ANGLES = 361

_BARE_RAIL = 0.25
"""Length of a guide without limits, beyond what the cycle uses, as a share of the longest leg."""


@dataclass(frozen=True)
class JacobianAtHome:
    """The Jacobian at the home pose, Eq. (10).

    Attributes
    ----------
    matrix : array, shape (n, m)
        J: without unit, and m/rad in the last column of 3T1R.
    radius : float or None
        Root mean square distance of the platform points from the platform's axis, m; None for 3T.
    condition : float
        Of J with the angle's column divided by `radius`, so that no unit is mixed with another.
    """

    matrix: Array
    radius: float | None
    condition: float


@dataclass(frozen=True)
class Orientations:
    """How well the sliders hold a 3T1R platform over phi.

    Attributes
    ----------
    angles : array, shape (A,)
        phi, rad.
    regularity : array, shape (A,)
        det J over its largest value.
    singular : array, shape (2,)
        The type-II singular orientations, rad.
    """

    angles: Array
    regularity: Array
    singular: Array


@dataclass(frozen=True)
class Report:
    """All that a page says about a machine.

    Attributes
    ----------
    robot : Manipulator
    home : array, shape (m,)
        The home pose.
    reserve : Reserve
        Of the home pose.
    least : float
        The reserve that the cycle keeps.
    cycle : PickAndPlace
        The largest pick-and-place cycle about it, T samples.
    points : JointPoints
        Where the joints are in the cycle.
    home_points : JointPoints
        And in the home pose.
    rails : array, shape (n, 2, 3)
        The ends of the guides, m: the sliders' limits, or a little more than the cycle needs.
    forces : array, shape (T, n)
        The actuator forces of the cycle, N.
    slider_speeds : array, shape (T, n)
        m/s.
    sliders : SliderRanges
        Over the cycle.
    slices : tuple of ReachSlice
        Through the home pose.
    volume : ReachVolume
        At the home pose's orientation.
    jacobian : JacobianAtHome
    orientations : Orientations or None
        None for 3T.
    base : BaseParameters
    costs : tuple of Cost
        Empty where too few poses are in reach to measure them.
    """

    robot: Manipulator
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
    """Return the report on a machine.

    Parameters
    ----------
    robot : Manipulator
        The machine.

    Returns
    -------
    Report

    Raises
    ------
    ModelError
        If the machine reaches no pose.
    SingularPose
        If the machine is singular at every pose.
    """
    home = home_pose(robot)
    at_home = reserve(robot, home)
    # A machine with little reserve anywhere moves where it has half of its best.
    least = min(_LEAST_RESERVE, float(at_home.smallest) / 2.0)
    cycle = pick_and_place(robot, home, samples=_SAMPLES, least=least)
    state = cycle.pose, cycle.velocity, cycle.acceleration
    sliders = slider_ranges(robot, cycle.pose)
    base = base_parameters(robot)
    return Report(
        robot=robot,
        home=home,
        reserve=at_home,
        least=least,
        cycle=cycle,
        points=joint_points(robot, cycle.pose),
        home_points=joint_points(robot, home),
        rails=_rails(robot, sliders),
        forces=inverse_dynamics(robot, *state),
        slider_speeds=joint_rates(robot, cycle.pose, cycle.velocity).sliders,
        sliders=sliders,
        slices=tuple(reach_slice(robot, home, plane) for plane in _PLANES),
        volume=reach_volume(robot, home),
        jacobian=_jacobian(robot, home),
        orientations=_orientations(robot, home),
        base=base,
        costs=_costs(base),
    )


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
    poses[:, 3] = np.linspace(-np.pi, np.pi, _ANGLES)
    return Orientations(
        poses[:, 3], numeric(robot, "regularity")(poses), singular_orientations(robot)
    )


def _costs(base: BaseParameters) -> tuple[Cost, ...]:
    try:
        return costs(base)
    except ModelError:
        return ()
