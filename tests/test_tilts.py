"""Tilts and balls of places that are proved to lie in the workspace of a platform that tilts."""

from functools import lru_cache
from itertools import combinations

import numpy as np
import pytest
import tilting
from mechanisms import CLIENTS, NIGHTLY

import pteron
from pteron.errors import DataError, ModelError
from pteron.workspace import (
    clearance,
    conditions,
    interference,
    largest_ball,
    largest_cube,
    largest_tilt,
)
from pteron.workspace.conditions import keeps

drawn = lru_cache(tilting.machine)

CASES = [
    ("3R", ("UPS",)),
    *(
        pytest.param(motion, (kind,), marks=NIGHTLY)
        for motion, kind in (("3T3R", "UPS"), ("1T2R", "RPS"))
    ),
]


def leaning(robot, home, tilt, count=20_000, radius=0.0):
    """Return poses of exactly a tilt, their platform's z drawn by its azimuth, on a ball's rim."""
    rng = np.random.default_rng(1)
    azimuth = rng.uniform(-np.pi, np.pi, count)
    z = np.stack([np.cos(azimuth) * np.sin(tilt), np.sin(azimuth) * np.sin(tilt)], -1)
    poses = np.tile(home, (count, 1))
    angles = np.flatnonzero(robot.platform.angular)[:2]
    # R ez = (sin(pitch) cos(roll), -sin(roll), cos(roll) cos(pitch)), but for the yaw.
    poses[:, angles[0]] = -np.arcsin(z[:, 1])
    poses[:, angles[1]] = np.arctan2(z[:, 0], np.cos(tilt))
    lengths = np.flatnonzero(~robot.platform.angular)
    way = rng.normal(size=(count, len(lengths)))
    poses[:, lengths] += radius * way / np.maximum(np.linalg.norm(way, axis=1)[:, None], 1e-9)
    axis = robot.platform.placement(poses)[1][:, 2] @ np.array(robot.platform.frame[2])
    np.testing.assert_allclose(np.arccos(axis), tilt, atol=1e-7)
    return poses


@pytest.mark.parametrize(("motion", "kinds"), CASES)
def test_every_pose_of_the_largest_tilt_serves_and_not_all_beyond(motion, kinds):
    robot, home = drawn(motion, kinds, 4)
    asked = conditions(robot)
    found = largest_tilt(robot, home, tolerance=0.02)
    assert found.proof.holds
    assert keeps(robot, asked, leaning(robot, home, found.tilt)).all()
    beyond = min(1.04 * found.tilt, 1.55)
    assert beyond == 1.55 or not keeps(robot, asked, leaning(robot, home, beyond)).all()


@CLIENTS
@pytest.mark.parametrize(
    ("motion", "kinds"), [("1T2R", ("RPS",)), pytest.param("3T3R", ("UPS",), marks=NIGHTLY)]
)
def test_every_place_of_the_largest_ball_serves_at_a_tilt(motion, kinds):
    robot, home = drawn(motion, kinds, 4)
    asked = conditions(robot)
    found = largest_ball(robot, home, tilt=0.1, tolerance=0.03)
    assert found.proof.holds
    assert keeps(robot, asked, leaning(robot, home, 0.1, radius=found.radius)).all()
    far = leaning(robot, home, 0.1, count=50_000, radius=1.07 * found.radius)
    assert not keeps(robot, asked, far).all()


def test_what_has_no_tilt_or_no_place_is_told():
    wrist, home = drawn("3R", ("UPS",), 4)
    with pytest.raises(ModelError, match="3R platform has no places to move to"):
        largest_ball(wrist, home)
    with pytest.raises(ModelError, match="only turns; ask for its `largest_tilt`"):
        largest_cube(wrist, home)
    with pytest.raises(ModelError, match="3T platform has no tilt to every side"):
        largest_tilt("delta", pteron.workspace.home_pose("delta"))
    ankle, home = drawn("2R", ("RSS",), 4)
    with pytest.raises(ModelError, match="its axes are not level"):
        largest_tilt(ankle, home)
    tripod, home = drawn("1T2R", ("RPS",), 4)
    with pytest.raises(DataError, match="tilt: 2 rad given"):
        largest_ball(tripod, home, tilt=2.0)
    with pytest.raises(ModelError, match="not even the middle"):
        largest_tilt(tripod, home + 10.0)


def rams_apart(robot, poses, count=60):
    """Return the least distance of the rams' centre lines (B,), from points along them."""
    p, axes = robot.platform.placement(poses)
    share = np.linspace(0.0, 1.0, count)[:, None]
    lines = []
    for leg in robot.legs:
        end = p + np.array(leg.platform_point) @ axes
        lines.append(leg.guide_point + share * (end[:, None] - leg.guide_point))
    return np.min(
        [
            np.linalg.norm(a[:, :, None] - b[:, None], axis=-1).min(axis=(1, 2))
            for a, b in combinations(lines, 2)
        ],
        axis=0,
    )


@CLIENTS
def test_a_tilt_keeps_the_legs_apart():
    robot = pteron.load("wrist")
    home, thick = np.zeros(3), 0.06
    asked = (*conditions(robot), *interference(robot, thick / 2))
    found = largest_tilt(robot, home, tolerance=0.02, given=asked)
    assert found.tilt < 0.95 * largest_tilt(robot, home, tolerance=0.02).tilt
    poses = leaning(robot, home, found.tilt, 1000)
    fine = 5e-4  # by which points along two lines are farther apart than the lines, at most
    assert thick < rams_apart(robot, poses).min() < thick + 0.002
    exact = clearance(robot, poses, 0.0).least
    np.testing.assert_array_less(exact, rams_apart(robot, poses) + 1e-12)
    np.testing.assert_allclose(exact, rams_apart(robot, poses), atol=fine)
    assert rams_apart(robot, leaning(robot, home, 1.04 * found.tilt, 1000)).min() < thick
