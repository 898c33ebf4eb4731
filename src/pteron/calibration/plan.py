"""`plan`: chooses the most informative poses to measure for a calibration.

They lie in a region of poses that is proved to be in reach and away from singularities: a box, or
on a plane that a probe touches a disc, which goes to the rim of what is in reach.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect, expect_one_of
from pteron.calibration.guess import Guess, tolerances_of, variances
from pteron.calibration.measurements import KINDS, TOOL, Measurements, Place, ReferencePlane, Setup
from pteron.calibration.plan_region import proved_box, proved_level, upright_index
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.unknowns import blocks_of
from pteron.calibration.verdict import rows_for_check
from pteron.errors import DataError, ModelError
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import Seed
from pteron.tolerances import EXACT
from pteron.workspace import Box, Cylinder, home_pose

Array = NDArray[np.float64]

Measure = Literal["poses", "positions", "heights", "distances"]
"""The quantity to measure: the pose, or the tool's position, height or distance to an anchor."""

Criterion = Literal["D", "worst"]
"""The aim to minimise: the volume of all values' confidence region, or the tool's worst error."""

_CANDIDATES = 1500
"""Random poses from which those of a plan are chosen."""

_TO_THE_EDGE = 1.0 / 3.0
"""Exponent of random numbers in [0, 1] that crowds candidates towards the box's faces."""

_TO_THE_RIM = 0.5 * _TO_THE_EDGE
"""The same of a disc's radius, whose area grows with its square."""


_RISES = 1e-6
"""Least part of a coordinate along z with which heights vary."""


_NOISE = dict.fromkeys(KINDS, 2e-5)
"""Noise that is expected where nobody says it, m and rad."""


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Result):
    """Poses to measure, in the order to go.

    Attributes
    ----------
    robot : Manipulator
        The machine as drawn.
    measure : str
        What is to be measured.
    poses : array, shape (N, m)
        m and rad.
    readings : array, shape (N, n)
        What the joints read there on the machine as drawn.
    region : Box or Cylinder
        The proved region of poses that holds them, and the straight ways between them.
    plane : ReferencePlane or None
        The plane over which heights are measured.
    before, after : float
        Expected greatest error of the tool's place in that region, as a standard deviation, by
        tolerances alone and after a calibration, m.
    checked : int
        How many poses, or more, leave some to check the calibration by.
    """

    ROWS = "poses:1 readings:1"

    robot: Manipulator
    measure: Measure
    poses: Array
    readings: Array
    region: Box | Cylinder
    plane: ReferencePlane | None
    before: float
    after: float
    checked: int

    def columns(self) -> dict[str, Array]:
        """Return the columns of the table that the machine runs: poses, then readings."""
        names = (*self.robot.coordinates, *self.robot.joint_names)
        columns = np.concatenate([self.poses, self.readings], axis=1)
        return dict(zip(names, columns.T, strict=True))


def plan(
    robot: RobotLike,
    count: int,
    measure: Measure = "positions",
    *,
    setup: Setup | None = None,
    free: Sequence[str] | None = None,
    prior: Mapping[str, float] | None = None,
    criterion: Criterion = "D",
    seed: Seed = 0,
) -> Plan:
    """Choose the poses to measure for a calibration.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine as drawn.
    count : int
        How many poses.
    measure : {"poses", "positions", "heights", "distances"}
        What is to be measured at each. Heights are over the setup's plane. By default it is z = 0,
        as a printer's bed, if the tool's home is above it and the machine reaches it; otherwise an
        unknown plane at the lowest poses. Distances are to the setup's anchor, by default an
        unknown point below home.
    setup : Setup, optional
        Noise, marks, planes, anchors and frame, as a log's TOML says them.
    free, prior
        As for `calibrate`.
    criterion : {"D", "worst"}
        What is minimised: the volume of the joint confidence region of all values, or the greatest
        error of the tool's position.
    seed : int
        Of the random candidates among which the poses are chosen.

    Returns
    -------
    Plan

    Raises
    ------
    DataError
        If the count is not above 0, a choice is unknown, or the tool stays where it is.
    ModelError
        If no region of poses around home, or on the plane, is proved to serve.
    """
    robot = as_manipulator(robot)
    expect(count >= 1, "count", count, "1 or more")
    expect_one_of(get_args(Measure), measure=measure)
    expect_one_of(get_args(Criterion), criterion=criterion)
    if measure != "poses" and not (robot.platform.lengths or any(robot.platform.tool)):
        raise DataError(
            f"measure: {measure} of a point that stays where it is show nothing of this machine; "
            "measure poses, or give the platform's tool"
        )
    home = home_pose(robot)
    setup = setup or Setup()
    drawn = Guess.drawn(robot, Measurements.from_readings(robot, np.zeros((1, robot.joint_count))))
    region: Box | Cylinder
    if measure == "heights":
        home, setup, region = _lower_onto_plane(drawn, home, setup)
    else:
        region = proved_box(robot, home)
    poses = _candidates(robot, region, np.random.default_rng(seed))
    if measure == "heights":
        poses[:, upright_index(robot)] = home[upright_index(robot)]
        poses[:, robot.platform.angular] = home[robot.platform.angular]
    if measure == "distances" and not setup.anchors:
        place = robot.platform.placement(home[None])[0][0] - [0.0, 0.0, robot.legs[0].size]
        setup = replace(setup, anchors={TOOL: Place(tuple(place.tolist()), known=False)})
    measurements = _ideal_measurements(drawn, poses, measure, setup)
    blocks = blocks_of(robot, measurements, free, prior)
    start = Guess.drawn(robot, measurements)
    slopes = MachineSlopes(robot, blocks)
    rows = slopes.rows(start, measurements, poses, np.arange(len(poses)))
    noise = {**_NOISE, **measurements.setup.noise}
    seen = rows.slopes / np.array([noise[kind] for kind in measurements.kind_of])[:, None]
    used = rows.measured.any(axis=0)
    # Of a machine that turns only, the angles are what goes wrong.
    tool = slopes.pose_slopes(start, measurements, poses)[bool(robot.platform.lengths)]
    tolerances = tolerances_of(blocks)
    if not np.isfinite(tolerances).all():
        raise DataError("prior: a plan needs finite tolerances; give no inf")
    chosen, covariance = _choose_poses(seen[:, used], tool, tolerances, count, criterion)
    order = _order_by_distance(poses[chosen], home, robot)
    picked = poses[chosen][order]
    drawn_error, fitted_error = (
        float(np.sqrt(variances(tool, known).max()))
        for known in (np.diag(tolerances**2), covariance)
    )
    readings = start.readings(slopes.joints(start, picked))
    checked = rows_for_check(measurements, blocks)
    plane = next(iter(setup.planes.values())) if measure == "heights" else None
    return Plan(robot, measure, picked, readings, region, plane, drawn_error, fitted_error, checked)


def _candidates(robot: Manipulator, region: Box | Cylinder, rng: np.random.Generator) -> Array:
    """Return random poses (N, m) of a region, more of them near its faces than within."""
    low, high = region.box
    sides = rng.uniform(-1.0, 1.0, (_CANDIDATES, robot.freedom))
    if isinstance(region, Cylinder):
        angles = np.pi * sides[:, 0]
        radii = (1.0 - EXACT) * region.radius * np.abs(sides[:, 1]) ** _TO_THE_RIM
        poses = np.tile(0.5 * (low + high), (_CANDIDATES, 1))
        poses[:, :2] = np.array(region.center[:2])
        poses[:, :2] += radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return poses
    sides = np.sign(sides) * np.abs(sides) ** _TO_THE_EDGE
    return np.asarray(0.5 * (low + high) + 0.5 * (high - low) * sides)


def _lower_onto_plane(
    drawn: Guess, home: Array, setup: Setup
) -> tuple[Array, Setup, Box | Cylinder]:
    """Return home with the tool on the setup's plane, the setup and the proved region there.

    Without a plane it is z = 0, the bed, where that serves, else an unknown one below home.
    """
    robot = drawn.robot
    if not np.abs(robot.platform.directions[:, 2]).max(initial=0.0) > _RISES:
        raise DataError(f"measure: the heights of a {robot.platform.motion} platform do not vary")
    at = upright_index(robot)
    point = drawn.points([TOOL], home[None])[0]
    if setup.planes:
        moved = _lower_home(home, at, point, next(iter(setup.planes.values())))
        return moved, setup, proved_level(robot, moved)
    if point[2] > 0.0:
        bed = ReferencePlane()
        moved = _lower_home(home, at, point, bed)
        try:
            return moved, replace(setup, planes={TOOL: bed}), proved_level(robot, moved)
        except ModelError:
            pass  # There is no bed at z = 0.
    moved = home.copy()
    below = proved_box(robot, home).box[0, at] - home[at]
    moved[at] += below
    plane = ReferencePlane(offset=float(point[2] + below), known=False)
    return moved, replace(setup, planes={TOOL: plane}), proved_level(robot, moved)


def _lower_home(home: Array, at: int, point: Array, plane: ReferencePlane) -> Array:
    """Return home moved along a coordinate so that the tool, at a point (3,), is on a plane."""
    normal = np.array(plane.normal)
    moved = home.copy()
    moved[at] += (plane.offset - normal @ point) / normal[2]
    return moved


def _ideal_measurements(drawn: Guess, poses: Array, measure: Measure, setup: Setup) -> Measurements:
    """Return the measurements that a faultless machine would give at poses."""
    robot, n = drawn.robot, len(poses)
    readings = drawn.readings(MachineSlopes(robot, ()).joints(drawn, poses))
    measurements = Measurements.from_readings(robot, readings, setup=setup)
    if measure == "positions":
        return replace(measurements, positions=np.zeros((n, 3)))
    if measure == "poses":
        known = [0.0 if axis in robot.coordinates else np.nan for axis in "xyz"]
        angles = poses[:, robot.platform.angular]
        return replace(measurements, positions=np.tile(known, (n, 1)), angles=angles)
    if measure == "heights":
        return replace(
            measurements, heights=np.zeros(n), planes=(next(iter(setup.planes), TOOL),) * n
        )
    return replace(
        measurements, distances=np.ones(n), anchors=(next(iter(setup.anchors), TOOL),) * n
    )


def _choose_poses(
    seen: Array, tool: Array, tolerances: Array, count: int, criterion: Criterion
) -> tuple[list[int], Array]:
    """Return the most informative poses (indices), greedily, and the covariance after them.

    Each lowers the determinant of the covariance most, by det(1 + J C J'); or is where the tool's
    place is least known.
    """
    covariance = np.diag(tolerances**2)
    width = seen.shape[1]
    chosen: list[int] = []
    for _ in range(count):
        spread = np.einsum("nkp,pq->nkq", seen, covariance)
        grown = np.einsum("nkp,njp->nkj", spread, seen) + np.eye(width)
        gain = np.linalg.slogdet(grown)[1] if criterion == "D" else variances(tool, covariance)
        gain[chosen] = -np.inf
        best = int(gain.argmax())
        chosen.append(best)
        push = np.linalg.solve(grown[best], spread[best])
        covariance = covariance - spread[best].T @ push
    return chosen, covariance


def _order_by_distance(poses: Array, home: Array, robot: Manipulator) -> list[int]:
    """Return the order of poses by nearest neighbours, from the home pose on."""
    remaining, at, order = list(range(len(poses))), home, []
    size = np.where(robot.platform.angular, 1.0 / max(leg.size for leg in robot.legs), 1.0)
    while remaining:
        next_ = min(remaining, key=lambda i: float(np.linalg.norm((poses[i] - at) / size)))
        order.append(next_)
        remaining.remove(next_)
        at = poses[next_]
    return order
