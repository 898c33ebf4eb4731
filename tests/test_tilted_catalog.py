"""The machines of the catalog whose platforms tilt: clean files, homes that are level."""

import json

import numpy as np
import pytest
import tilting
from commands import run
from mechanisms import CLIENTS, TILTED, gated

import pteron
from pteron.export.engines import tree
from pteron.maps import pose_grid
from pteron.motion import pick_and_place, replay
from pteron.playback import playback
from pteron.workspace import bounding_box, home_pose, largest_cube, pose_margins

HOMES = {
    "ankle": [0.0, 0.0],
    "wrist": [0.0, 0.0, 0.0],
    "reachy-mini": [0.0, 0.0, 0.177, 0.0, 0.0, 0.0],
    "rubin-camera-hexapod": [0.0] * 6,
    "rubin-m2-hexapod": [0.0] * 6,
    "stewart": [0.0, 0.0, 2.0, 0.0, 0.0, 0.0],
}
"""Where drawings have them at home."""


@pytest.mark.parametrize("name", gated(TILTED, ("ankle",)))
def test_it_is_clean_and_level_at_home(name):
    robot = TILTED[name]
    done = run(f"check {name} --json")
    assert (done.exit_code, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert found["doubts"] == []
    home = home_pose(robot)
    assert found["home_pose"] == home.tolist()
    assert not home[robot.platform.angular].any()
    np.testing.assert_allclose(home, HOMES.get(name, home), atol=1e-12)
    assert pose_margins(robot, home).least > 0.4
    turned = pteron.rotation_of(robot, home, form="tilt-torsion")
    np.testing.assert_allclose(turned, 0.0, atol=1e-12)
    np.testing.assert_array_equal(tree(robot).home, home)  # where its files start


@pytest.mark.parametrize("name", gated(TILTED, ["ankle", "wrist"]))
def test_a_machine_turned_as_a_whole_keeps_its_margins(name):
    robot, turn = TILTED[name], tilting.rotation(np.random.default_rng(1))
    other, pose = pteron.turned(robot, turn), home_pose(robot) + 0.01
    moved, place = pose.copy(), robot.platform.placement(pose)[0]
    moved[~robot.platform.angular] = other.platform.directions @ turn @ place
    found, expected = pose_margins(other, moved), pose_margins(robot, pose)
    np.testing.assert_allclose(found.joints, expected.joints, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", gated(["ankle", "wrist", "ball-table"], ["ankle"]))
def test_commands_serve_platforms_that_have_no_place_to_move_to(name, tmp_path):
    done = run(f"workspace {name} --certify --tolerance 0.3")
    assert done.exit_code == 0, done.stderr
    lengths = TILTED[name].platform.lengths
    assert ("Proved length" if lengths else "deg in all directions.") in done.stdout
    done = run(f"cycle {name} --out {tmp_path / 'cycle.csv'}")
    assert "mm from P as it turns, is limited to 10 m/s^2" in done.stderr
    cycle, farthest = replay(name, tmp_path / "cycle.csv"), 0.0
    for leg in TILTED[name].legs:
        farthest = max(farthest, np.linalg.norm(leg.platform_point))
    turning = np.linalg.norm(cycle.acceleration[:, TILTED[name].platform.angular], axis=-1)
    assert 9.0 < farthest * turning.max() < 10.01


def test_the_cycle_of_a_tripod_on_a_wall_goes_along_its_axis():
    cycle = pick_and_place("sprint-z3", home_pose("sprint-z3"), scale=0.5, samples=51)
    np.testing.assert_allclose(np.ptp(cycle.pose[:, 0]), 0.0125, rtol=1e-2)


@CLIENTS
def test_a_cube_is_found_where_it_is_far_smaller_than_the_machine():
    found = largest_cube("rubin-m2-hexapod", np.zeros(6))
    assert found.edge > 0.02
    assert found.proof.holds


def test_tables_of_poses_may_be_in_mm_and_degrees(tmp_path):
    robot, table = TILTED["ball-table"], tmp_path / "poses.csv"
    table.write_text("t,z (mm),roll [deg],pitch [deg]\n0,120,5,-3\n.1,121,5,-3\n", encoding="utf-8")
    first, _ = json.loads(run(f"inverse ball-table --table {table} --json").stdout)
    pose = [0.12, *np.radians([5.0, -3.0])]
    joints = [first[name] for name in robot.joint_names]
    np.testing.assert_allclose(joints, pteron.inverse_kinematics(robot, pose), rtol=1e-12)
    shown = playback(robot, table)
    np.testing.assert_allclose(shown.motion.pose[0], pose, rtol=1e-12)


@CLIENTS
def test_a_map_of_lengths_and_an_angle_has_the_reach_of_every_angle():
    robot = TILTED["ball-table"]
    over = pose_grid(robot, held={"pitch": 0.1}, ranges={"roll": (-0.3, 0.3)})
    (z,) = [axis for axis in over.axes if axis.name == "z"]
    for roll in (-0.3, 0.0, 0.3):
        low, high = bounding_box(robot, [0.12, roll, 0.1])[:, 0]
        assert z.least <= low < high <= z.greatest


def test_a_design_of_a_platform_that_only_turns_needs_a_range_of_turns(tmp_path):
    file = tmp_path / "design.toml"
    file.write_text(
        'robot = "wrist"\n[[variables]]\nmoves = "legs.platform_point.z"\nrange = [-0.05, 0.05]\n'
        '[[objectives]]\nmaximise = "type_ii"\n',
        encoding="utf-8",
    )
    done = run(f"design {file} --out {tmp_path / 'out'}")
    assert done.exit_code == 2
    assert "workspace: missing; wrist only turns, and needs one with tilt or angles" in done.stderr
