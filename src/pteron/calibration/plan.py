"""`plan`: chooses the most informative poses to measure for a calibration.

They lie in a box of poses that is proved to be in reach and away from singularities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect, expect_one_of
from pteron.calibration.guess import Guess, tolerances_of, variances
from pteron.calibration.measurements import KINDS, TOOL, Measurements, Place, Plane, Setup
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.unknowns import blocks_of
from pteron.calibration.verdict import rows_for_check
from pteron.errors import DataError, ModelError
from pteron.kernels import numeric
from pteron.kinematics import random_poses
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.workspace import Box, home_pose, prove

Array = NDArray[np.float64]

Measure = Literal["poses", "positions", "heights", "distances"]
"""The quantity to measure: the pose, or the tool's position, height or distance to an anchor."""

Criterion = Literal["D", "worst"]
"""The aim to minimise: the volume of all values' confidence region, or the tool's worst error."""

_CANDIDATES = 1500
"""Random poses from which those of a plan are chosen."""

_TO_THE_EDGE = 1.0 / 3.0
"""Exponent of random numbers in [0, 1] that crowds candidates towards the box's faces."""

_SHARE = 0.3
"""Least measures that are proved in the box, over those at its centre: nearer to a singularity the
tolerances of a machine that is not quite as drawn lead far away, or across."""

_MOST = 20_000
"""Undecided boxes at which a proof is given up."""

_HALVINGS = 6
"""Bisections in the search for the size of the box."""

_WIDENINGS = 4
"""Times that each of its sides may then grow by half."""

_RISES = 1e-6
"""Least part of a coordinate along z with which heights vary."""

_ABOVE = 0.005
"""Height above a plane to which a probe is lifted between two places, m."""

_NOISE = dict.fromkeys(KINDS, 2e-5)
"""Noise that is expected where nobody says it, m and rad."""


@dataclass(frozen=True)
class Plan:
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
    region : Box
        The proved box of poses that holds them, and the straight ways between them.
    before, after : float
        Expected greatest error of the tool's place in that box, as a standard deviation, by
        tolerances alone and after a calibration, m.
    checked : int
        How many poses, or more, leave some to check the calibration by.
    """

    robot: Manipulator
    measure: Measure
    poses: Array
    readings: Array
    region: Box
    before: float
    after: float
    checked: int

    def columns(self) -> dict[str, Array]:
        """Return the columns of the table that the machine runs: poses, then readings."""
        names = (*self.robot.coordinates, *self.robot.joint_names)
        values = np.concatenate([self.poses, self.readings], axis=1)
        return dict(zip(names, values.T, strict=True))


def plan(
    robot: RobotLike,
    count: int,
    measure: Measure = "positions",
    *,
    setup: Setup | None = None,
    free: Sequence[str] | None = None,
    prior: Mapping[str, float] | None = None,
    criterion: Criterion = "D",
    seed: int = 0,
) -> Plan:
    """Choose the poses to measure for a calibration.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine as drawn.
    count : int
        How many poses.
    measure : {"poses", "positions", "heights", "distances"}
        What is to be measured at each. Heights are over the setup's plane, by default one at the
        bottom of the proved box; distances to its anchor, by default an unknown one below home.
    setup : Setup, optional
        Noise, marks, planes, anchors and frame, as a log's TOML says them.
    free, prior
        As for `calibrate`.
    criterion : {"D", "worst"}
        What is made least: the volume of the values' joint region, or the greatest error of the
        tool's place.
    seed : int
        Of the candidates.

    Returns
    -------
    Plan

    Raises
    ------
    DataError
        If the count is not above 0, a choice is unknown, or the tool stays where it is.
    ModelError
        If no box of poses around home, or on the plane, is proved to serve.
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
    drawn = Guess.drawn(robot, Measurements.of(robot, np.zeros((1, robot.joint_count))))
    if measure == "heights":
        home, setup = _on_plane(drawn, home, setup)
    region = proved_box(robot, home, measure == "heights")
    rng = np.random.default_rng(seed)
    low, high = region.box
    sides = rng.uniform(-1.0, 1.0, (_CANDIDATES, robot.freedom))
    sides = np.sign(sides) * np.abs(sides) ** _TO_THE_EDGE
    poses = 0.5 * (low + high) + 0.5 * (high - low) * sides
    if measure == "heights":
        poses[:, _upright(robot)] = home[_upright(robot)]
        poses[:, robot.platform.angular] = home[robot.platform.angular]
    if measure == "distances" and not setup.anchors:
        place = robot.platform.at(home[None])[0][0] - [0.0, 0.0, robot.legs[0].size]
        setup = replace(setup, anchors={TOOL: Place(tuple(place.tolist()), known=False)})
    given = _imagined(drawn, poses, measure, setup)
    blocks = blocks_of(robot, given, free, prior)
    start = Guess.drawn(robot, given)
    slopes = MachineSlopes(robot, blocks)
    rows = slopes.rows(start, given, poses, np.arange(len(poses)))
    noise = {**_NOISE, **setup.noise}
    seen = rows.slopes / np.array([noise[kind] for kind in given.kind_of])[:, None]
    used = rows.measured.any(axis=0)
    # Of a machine that turns only, the angles are what goes wrong.
    tool = slopes.pose_slopes(start, given, poses)[bool(robot.platform.lengths)]
    tolerances = tolerances_of(blocks)
    if not np.isfinite(tolerances).all():
        raise DataError("prior: a plan needs finite tolerances; give no inf")
    chosen, covariance = _chosen(seen[:, used], tool, tolerances, count, criterion)
    order = _in_order(poses[chosen], home, robot)
    picked = poses[chosen][order]
    before, after = (
        float(np.sqrt(variances(tool, known).max()))
        for known in (np.diag(tolerances**2), covariance)
    )
    readings = start.readings(slopes.joints(start, picked))
    checked = rows_for_check(given, blocks)
    return Plan(robot, measure, picked, readings, region, before, after, checked)


def proved_box(robot: Manipulator, center: Array, flat: bool = False) -> Box:
    """Return a box of poses around one that is proved to serve, with margins to singularities.

    Its sides are as those of the least box that holds random poses; `flat` keeps it within 5 mm
    above the centre, level: the ways of a probe.

    Raises
    ------
    ModelError
        If there is none.
    """
    type_i, type_ii = numeric(robot, "reach")(center)[1], numeric(robot, "type_ii")(center)[0]
    floors = _SHARE * float(type_i.min()), _SHARE * abs(float(type_ii))
    drawn = random_poses(robot, 400)
    sides = np.maximum(np.abs(drawn - center).max(axis=0), 1e-9)
    thin = np.zeros(robot.freedom)
    if flat:
        sides[_upright(robot)] = 0.0
        sides[robot.platform.angular] = 0.0
        thin[_upright(robot)] = _ABOVE
    least, most = 0.0, 1.0
    found: Box | None = None
    for _ in range(_HALVINGS):
        share = 0.5 * (least + most)
        box = Box(tuple(center - share * sides), tuple(center + share * sides + thin))
        if prove(robot, box, type_i=floors[0], type_ii=floors[1], most=_MOST).holds:
            least, found = share, box
        else:
            most = share
    if found is None:
        raise ModelError(
            f"no box of poses around {np.round(center, 4).tolist()} is proved to be in reach, "
            "within limits and away from singularities; move the plane, or the machine's limits",
            subject=robot.name,
        )
    return _widened(robot, found, sides, floors)


def _widened(robot: Manipulator, box: Box, sides: Array, floors: tuple[float, float]) -> Box:
    """Return a proved box whose sides grew one after the other, as far as they may."""
    for k in np.flatnonzero(sides):
        for _ in range(_WIDENINGS):
            low, high = box.box
            more = 0.5 * (high[k] - low[k])
            if high[k] - low[k] >= 2.0 * sides[k]:
                break
            low[k], high[k] = low[k] - 0.5 * more, high[k] + 0.5 * more
            wider = Box(tuple(low), tuple(high))
            type_i, type_ii = floors
            if not prove(robot, wider, type_i=type_i, type_ii=type_ii, most=_MOST // 4).holds:
                break
            box = wider
    return box


def _upright(robot: Manipulator) -> int:
    """Return which coordinate moves along z most."""
    lengths = np.flatnonzero(~robot.platform.angular)
    return int(lengths[np.abs(robot.platform.directions[:, 2]).argmax()])


def _on_plane(drawn: Guess, home: Array, setup: Setup) -> tuple[Array, Setup]:
    """Return home with the tool on the setup's plane; without one, a plane below home."""
    robot = drawn.robot
    if not np.abs(robot.platform.directions[:, 2]).max(initial=0.0) > _RISES:
        raise DataError(f"measure: the heights of a {robot.platform.motion} platform do not vary")
    at = _upright(robot)
    point = drawn.points([TOOL], home[None])[0]
    moved = home.copy()
    if setup.planes:
        plane = next(iter(setup.planes.values()))
        normal = np.array(plane.normal)
        moved[at] += (plane.offset - normal @ point) / normal[2]
        return moved, setup
    below = proved_box(robot, home).box[0, at] - home[at]
    moved[at] += below
    plane = Plane(offset=float(point[2] + below), known=False)
    return moved, replace(setup, planes={TOOL: plane})


def _imagined(drawn: Guess, poses: Array, measure: Measure, setup: Setup) -> Measurements:
    """Return the measurements that a faultless machine would give at poses."""
    robot, n = drawn.robot, len(poses)
    readings = drawn.readings(MachineSlopes(robot, ()).joints(drawn, poses))
    given = Measurements.of(robot, readings, setup=setup)
    if measure == "positions":
        return replace(given, positions=np.zeros((n, 3)))
    if measure == "poses":
        known = [0.0 if axis in robot.coordinates else np.nan for axis in "xyz"]
        angles = poses[:, robot.platform.angular]
        return replace(given, positions=np.tile(known, (n, 1)), angles=angles)
    if measure == "heights":
        return replace(given, heights=np.zeros(n), planes=(next(iter(setup.planes), TOOL),) * n)
    return replace(given, distances=np.ones(n), anchors=(next(iter(setup.anchors), TOOL),) * n)


def _chosen(
    seen: Array, tool: Array, tolerances: Array, count: int, criterion: Criterion
) -> tuple[list[int], Array]:
    """Return the poses that say most, one after the other, and the covariance after them.

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


def _in_order(poses: Array, home: Array, robot: Manipulator) -> list[int]:
    left, at, order = list(range(len(poses))), home, []
    size = np.where(robot.platform.angular, 1.0 / max(leg.size for leg in robot.legs), 1.0)
    while left:
        next_ = min(left, key=lambda i: float(np.linalg.norm((poses[i] - at) / size)))
        order.append(next_)
        left.remove(next_)
        at = poses[next_]
    return order
