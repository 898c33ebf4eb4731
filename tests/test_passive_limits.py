"""Limits of passive joints: where the joints are, and that whatever asks for reach keeps them."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import CATALOG, CLIENTS, in_turn
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import pteron
from pteron import ModelError
from pteron.cli.main import app
from pteron.kernels import numeric
from pteron.legs import Cone
from pteron.motion import pick_and_place
from pteron.workspace import (
    BEYOND_LIMITS,
    home_pose,
    limited_joints,
    pose_margins,
    reach_slice,
    reach_volume,
)

Z = np.array([0.0, 0.0, 1.0])
TILTED = (0.6, 0.0, 0.8)


def limited(name, **limits):
    """Return a catalog machine with limits on every leg that has the fields, and none of phi."""

    def of(leg):
        return replace(leg, **{key: v for key, v in limits.items() if hasattr(leg, key)})

    robot = CATALOG[name]
    platform = replace(robot.platform, limits=None)
    return replace(robot, legs=tuple(map(of, robot.legs)), platform=platform)


def angle(a, b):
    return np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1.0, 1.0))


def elbows(robot, pose):
    return {
        "elbow": [
            angle(u, v) for u, v in zip(*pteron.kinematics.link_vectors(robot, pose), strict=True)
        ]
    }


def link_angles(robot, pose):
    """The link of a P-R-R leg against its guide, by the right hand about the plane's normal."""
    found = []
    for leg, link in zip(robot.legs, pteron.kinematics.link_vectors(robot, pose)[1], strict=True):
        ahead = leg.elbow * np.array(leg.slider_direction)
        sine = np.cross(ahead, link) @ np.array(leg.direction) / leg.lower_length
        found.append(np.arcsin(sine))
    return {"link": found}


def crank_cones(robot, pose):
    """At the crank's end in the crank's frame, at the platform in the platform's frame at rest."""
    tips, ends = [], []
    for leg, u, rod in zip(robot.legs, *pteron.kinematics.link_vectors(robot, pose), strict=True):
        x, z = u / np.linalg.norm(u), np.array(leg.direction)
        frame = np.column_stack([x, np.cross(z, x), z])
        tips.append(angle(frame @ leg.tip_cone.axis, rod))
        ends.append(angle(np.array(robot.platform.frame).T @ leg.platform_cone.axis, -rod))
    return {"rod at its tip": tips, "rod at the platform": ends}


def slider_cones(robot, pose):
    tips, ends = [], []
    for leg, rod in zip(robot.legs, pteron.kinematics.link_vectors(robot, pose)[1], strict=True):
        tips.append(angle(np.array(leg.tip_cone.axis), rod))
        ends.append(angle(np.array(robot.platform.frame).T @ leg.platform_cone.axis, -rod))
    return {"rod at its tip": tips, "rod at the platform": ends}


def shafts(robot, pose):
    return {"shaft": [np.linalg.norm(pteron.kinematics.link_vectors(robot, pose)[1][3])]}


CONES = {"tip_cone": Cone(TILTED, 3.0), "platform_cone": Cone(TILTED, 3.1)}
MACHINES = {
    "quadrupteron": (limited("quadrupteron", elbow_limits=(0.0, 3.0)), elbows),
    "3-rrr": (limited("3-rrr", elbow_limits=(0.0, 3.0)), elbows),
    "3-prr": (limited("3-prr", elbow_limits=(-1.5, 1.5)), link_angles),
    "delta": (limited("delta", **CONES), crank_cones),
    "linear-delta": (limited("linear-delta", **CONES), slider_cones),
    "par4": (limited("par4", **CONES), crank_cones),
    "delta-4": (limited("delta-4", travel=(0.1, 3.0)), shafts),
}
EVERY = in_turn(MACHINES, tuple(MACHINES), share=3)


def passive(robot, pose):
    found = {}
    for joint in limited_joints(robot, pose):
        if not joint.actuated:
            found.setdefault(joint.noun, []).append(joint.value)
    return found


@EVERY
def test_passive_joints_are_where_the_links_say(name):
    robot, expected = MACHINES[name]
    for pose in pteron.random_poses(robot, 5, type_i=0.2):
        found, right = passive(robot, pose), expected(robot, pose)
        assert found.keys() == right.keys()
        for noun, values in right.items():
            np.testing.assert_allclose(found[noun], values, atol=1e-7)


@EVERY
def test_a_turned_machine_has_its_joints_where_they_were(name):
    robot, _ = MACHINES[name]
    rotation = Rotation.random(rng=5)
    moved = pteron.turned(robot, rotation.as_matrix())
    for pose in pteron.random_poses(robot, 3, type_i=0.2):
        there = pose.copy()
        if not robot.platform.planar:  # in the plane x and y turn with the frame
            there[:3] = rotation.apply(pose[:3])
        for noun, values in passive(robot, pose).items():
            np.testing.assert_allclose(passive(moved, there)[noun], values, atol=1e-9)


@EVERY
def test_they_are_saved_and_loaded(name, tmp_path):
    robot, _ = MACHINES[name]
    assert pteron.load(pteron.save(robot, tmp_path / "robot.toml")) == robot


def test_the_socket_of_a_single_rod_turns_with_the_platform():
    robot = CATALOG["delta-4"]
    still = replace(robot.legs[0], platform_point=(0.1, 0.0, 0.0), fixed_offset=(0.0, 0.0, 0.0))
    cone = Cone((0.6, 0.0, 0.8), 3.0)
    pose = np.array([0.02, 0.03, -0.9, 0.4])
    values = {}
    for rods in (1, 2):
        leg = replace(still, rods=rods, platform_cone=cone)
        machine = replace(robot, legs=(leg, *robot.legs[1:]))
        values[rods] = passive(machine, pose)["rod at the platform"][0]
        rod = pteron.kinematics.link_vectors(machine, pose)[1][0]
        turn = Rotation.from_rotvec(0.4 * Z) if rods == 1 else Rotation.identity()
        assert values[rods] == pytest.approx(angle(turn.apply(cone.axis), -rod), abs=1e-9)
    assert abs(values[1] - values[2]) > 0.01


# What asks for reach keeps the limits.

NARROW = limited("delta", platform_cone=Cone((0.0, 0.0, 1.0), 0.9))


def beyond(robot, poses):
    return (numeric(robot, "passive_room")(poses)[0] < 0.0).any(axis=-1)


def test_random_poses_and_the_cycle_keep_them():
    robot = NARROW
    assert beyond(robot, pteron.random_poses(CATALOG["delta"], 200)).any()
    assert not beyond(robot, pteron.random_poses(robot, 200)).any()
    cycle = pick_and_place(robot, [0.0, 0.0, -1.2])
    assert not beyond(robot, cycle.pose).any()
    low = [0.0, 0.0, -0.9]
    assert pick_and_place(CATALOG["delta"], low).scale == 1.0
    with pytest.raises(ModelError, match="no pick-and-place cycle about pose"):
        pick_and_place(limited("delta", platform_cone=Cone((0.0, 0.0, 1.0), 0.6)), low)


def test_home_its_margin_and_the_reach_keep_them():
    free, robot = CATALOG["delta"], NARROW
    home = home_pose(robot)
    at = pose_margins(robot, home)
    assert 0.0 < at.least < pose_margins(free, home_pose(free)).least
    ends = [joint for joint in limited_joints(robot, home) if not joint.actuated]
    room = [1.0 - abs(joint.value) / 0.9 for joint in ends]
    assert (at.joints <= np.array(room) + 1e-9).all()
    assert pose_margins(robot, home_pose(free)).least < at.least
    volumes = [reach_volume(r, home, count=1 << 12).volume for r in (robot, free)]
    assert volumes[0] < 0.9 * volumes[1]
    cut, whole = (reach_slice(r, home, "xz", points=15, extent=BOX) for r in (robot, free))
    assert (cut.status == BEYOND_LIMITS).sum() > (whole.status == BEYOND_LIMITS).sum()
    assert (cut.margin <= whole.margin + 1e-12).all()


BOX = (-0.8, 0.8, -1.4, -0.7)


def test_the_platform_s_angle_has_limits_too():
    robot = CATALOG["par4"]
    narrow = replace(robot, platform=replace(robot.platform, limits=(-0.7, 0.5)))
    assert np.abs(pteron.random_poses(narrow, 100)[:, 3] + 0.1).max() <= 0.6
    assert -0.7 < home_pose(narrow)[3] < 0.5
    assert pose_margins(narrow, [0.0, 0.0, -0.45, 0.5]).least == pytest.approx(0.0, abs=1e-12)
    (at,) = (joint for joint in limited_joints(narrow, [0.0, 0.0, -0.45, 0.2]) if joint.leg == 0)
    assert (at.noun, at.value, at.least, at.most) == ("phi", 0.2, -0.7, 0.5)


@CLIENTS
def test_check_tells_where_they_are_at_home(tmp_path):
    file = str(pteron.save(limited("3-rrr", elbow_limits=(0.2, 3.0)), tmp_path / "robot.toml"))
    text = CliRunner().invoke(app, ["check", file]).stdout
    assert re.search(r" 1 to 3  elbow +[\d.]+ rad  0.2 to 3 rad", text)
    found = json.loads(CliRunner().invoke(app, ["check", file, "--json"]).stdout)
    joints = [joint for joint in found["limited_joints"] if not joint["actuated"]]
    assert [joint["leg"] for joint in joints] == [1, 2, 3]
    right = elbows(pteron.load(file), np.array(found["home_pose"]))["elbow"]
    np.testing.assert_allclose([joint["value"] for joint in joints], right, atol=1e-7)
    # An angle to a cone's axis is never below zero.
    cone = Cone((0.0, 0.0, 1.0), 1.5)
    pteron.save(limited("delta", platform_cone=cone), file)
    assert CliRunner().invoke(app, ["check", file]).stdout.count("at most 1.5 rad") == 1


def test_inverse_kinematics_does_not_apply_them():
    poses = pteron.random_poses(CATALOG["delta"], 200)
    assert beyond(NARROW, poses).any()
    free = pteron.inverse_kinematics(CATALOG["delta"], poses)
    np.testing.assert_array_equal(pteron.inverse_kinematics(NARROW, poses), free)


def test_a_cone_has_an_axis_and_an_angle():
    with pytest.raises(ModelError, match=r"axis: \[0\.0, 0\.0, 2\.0\] has length 2, not 1"):
        Cone((0.0, 0.0, 2.0), 0.5)
    for wrong in (0.0, -0.2, 30.0, np.nan):
        with pytest.raises(ModelError, match=r"^angle: "):
            Cone((0.0, 0.0, 1.0), wrong)
