"""Machines whose platforms tilt in drawings, films, pages, cycles and the viewer."""

import json
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from mechanisms import CLIENTS
from PIL import Image
from scipy.spatial import ConvexHull
from tilting import machine
from viewer_pages import opened, slide, wait_for

import pteron
from pteron.motion import Motion, joint_points, pick_and_place, with_payload
from pteron.motion.trajectories.tool import pose_motion, tool_motion, tool_path
from pteron.platforms.nearest_pose import pose_nearest_frame
from pteron.plots import draw, film
from pteron.report import write_motion_page, write_report
from pteron.viewer import view
from pteron.viewer.session import Session
from pteron.viewer.slices import choices
from pteron.workspace.reach_slices import reach_slice

TOOL = (0.05, -0.02, 0.1)


@lru_cache
def tooled(motion, *kinds):
    """Return a random machine with a tool, and a pose about which it moves."""
    robot, home = machine(motion, kinds, 1)
    return replace(robot, platform=replace(robot.platform, tool=TOOL)), home


def turn(robot, home):
    """Return a short motion about a pose, in which every coordinate changes."""
    time = np.linspace(0.0, 0.2, 5)
    way = 0.05 * np.sin(time[:, None] + np.arange(len(home)))
    rate = 0.05 * np.cos(time[:, None] + np.arange(len(home)))
    return Motion(time, home + way, rate, -way)


@pytest.mark.parametrize("kinds", [("3T3R", "UPS"), ("1T2R", "RPS"), ("2R", "RSS")])
def test_drawn_points_are_those_of_a_platform_turned_by_its_pose(kinds):
    robot, home = tooled(*kinds)
    pose = home + 0.05
    points = joint_points(robot, pose)
    place, axes = robot.platform.placement(pose)
    arms = np.array([leg.platform_point for leg in robot.legs])
    np.testing.assert_allclose(points.platform_points, place + arms @ axes, atol=1e-14)
    np.testing.assert_allclose(points.tool, place + TOOL @ axes, atol=1e-15)
    for leg, line, ram, joint in zip(
        robot.legs, points.links, points.rams, points.coordinates, strict=True
    ):
        lengths = np.linalg.norm(np.diff(line, axis=0), axis=-1)
        if ram:  # the cylinder ends where the piston comes out, on a straight line
            np.testing.assert_allclose(lengths, [leg.cylinder, joint - leg.cylinder], atol=1e-14)
            np.testing.assert_allclose(np.cross(*np.diff(line, axis=0)), 0.0, atol=1e-14)
        else:
            np.testing.assert_allclose(lengths, [leg.upper_length, leg.lower_length], atol=1e-14)
    corners = points.parts[0].corners
    apart = np.linalg.norm(corners[:, None] - points.platform_points, axis=-1).min(axis=-1)
    assert len(corners) == len(robot.legs)
    assert apart.max() < 1e-14
    colors = {line.get_color() for line in draw(robot, pose).axes[0].lines}
    assert len(colors & set(pteron.plots.LEG_COLORS)) == len(robot.legs)


@CLIENTS
@pytest.mark.parametrize("kinds", [("3T3R", "UPS"), ("1T2R", "RPS")])
def test_a_film_and_a_page_show_all_coordinates(kinds, tmp_path):
    robot, home = tooled(*kinds)
    motion = turn(robot, home)
    made = film(robot, motion, tmp_path / "turn.gif", fps=10.0, speed=1.0, size=(240, 180))
    with Image.open(made.path) as picture:
        assert picture.n_frames == made.frames > 1
    text = write_motion_page(robot, motion, tmp_path / "turn.html").read_text("utf-8")
    for k, name in enumerate(robot.coordinates):
        assert f'id="pose{k}"' in text
        assert f"<i>{name}</i>" in text


@pytest.mark.parametrize("kinds", [("3T3R", "UPS"), ("1T2R", "RPS"), ("2R", "RSS")])
def test_the_tool_moves_as_its_platform_turns(kinds):
    robot, home = tooled(*kinds)
    platform = robot.platform
    cycle = pick_and_place(robot, home, scale=0.02, duration=1.0, samples=2001)
    state = cycle.pose, cycle.velocity, cycle.acceleration
    place, velocity, acceleration = tool_path(platform, *state)
    points = joint_points(robot, cycle.pose[::500])
    np.testing.assert_allclose(place[::500], points.tool, atol=1e-14)
    step = cycle.time[1]
    for value, rate in ((place, velocity), (velocity, acceleration)):
        slope = (value[2:] - value[:-2]) / (2.0 * step)
        off = np.abs(slope - rate[1:-1]) / np.abs(rate).max()
        assert np.quantile(off, 0.95) < 1e-4
        assert off.max() < 2e-2  # moves begin and end with a jump of the jerk
    back = pose_motion(platform, *tool_motion(platform, *state))
    for part, same in zip(state, back, strict=True):
        np.testing.assert_allclose(part, same, atol=1e-13)
    heavier = with_payload(robot, 2.0)
    gained = [pteron.kinetic_energy(one, *state[:2]) for one in (heavier, robot)]
    np.testing.assert_allclose(gained[0] - gained[1], (velocity**2).sum(axis=-1), atol=1e-12)


def test_a_slice_goes_over_any_two_coordinates():
    robot, home = tooled("1T2R", "RPS")
    cut = reach_slice(robot, home, ("pitch", "z"), points=5)
    assert cut.places == (2, 0)
    np.testing.assert_array_equal(cut.poses[2, 3], [cut.second[2], home[1], cut.first[3]])
    with pytest.raises(pteron.DataError, match="two of z, roll, pitch expected"):
        reach_slice(robot, home, "xy")


@pytest.mark.parametrize("kinds", [("3T3R", "UPS"), ("1T2R", "RPS"), ("2R", "RSS")])
def test_a_frame_that_is_turned_becomes_the_nearest_pose(kinds):
    robot, home = tooled(*kinds)
    platform = robot.platform
    other = home + np.where(platform.angular, 0.3, 0.0)
    np.testing.assert_allclose(
        pose_nearest_frame(platform, home, platform.placement(other)[1]), other, atol=1e-9
    )
    # A frame that a tripod, or a universal joint, has in no pose.
    c, s = np.cos(0.2), np.sin(0.2)
    wanted = platform.placement(other)[1] @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    found = pose_nearest_frame(platform, home, wanted)
    steps = 1e-3 * np.eye(len(home))[platform.angular]
    beside = found + np.vstack([steps, -steps])
    apart = ((platform.placement(beside)[1] - wanted) ** 2).sum(axis=(-1, -2))
    assert (apart > ((platform.placement(found)[1] - wanted) ** 2).sum()).all()
    np.testing.assert_array_equal(found[~platform.angular], home[~platform.angular])


def test_the_viewer_moves_a_platform_by_its_angles():
    robot = pteron.load("ankle")
    session = Session(robot)
    session.type_pose("10 -5")
    np.testing.assert_allclose(session.state.pose, np.radians([10.0, -5.0]))
    session.set_coordinate(1, 0.1)
    np.testing.assert_allclose(session.state.pose, [np.radians(10.0), 0.1])
    low, high = session.pose_range
    np.testing.assert_array_equal(np.transpose([low, high]), robot.platform.limits)
    assert list(choices(robot)) == ["none", "alpha, beta"]
    with pytest.raises(pteron.DataError, match="2 expected: alpha beta, in degrees, with blanks"):
        session.type_pose("1 2 3")


@CLIENTS
def test_a_tripods_page_has_its_angles(browser):
    with view(pteron.load("ball-table"), port=0) as viewer:
        with opened(browser, viewer.url) as page:
            slide(page, "pitch (°)", ["ArrowRight"] * 5)
            wait_for(page, "() => document.querySelectorAll('table.legs tr').length === 4")
            assert viewer.wait(10.0)
        z, roll, pitch = viewer.state.pose
        assert (z, roll) == (pytest.approx(0.12, abs=0.05), 0.0)
        assert pitch > 0.0
        assert viewer.faults == ()


@CLIENTS
@pytest.mark.parametrize("name", ["ball-table", "stewart"])
def test_a_report_has_slices_of_angles_and_the_tilt(name, tmp_path):
    robot = pteron.load(name)
    page = write_report(robot, tmp_path)
    found = json.loads((tmp_path / "report.json").read_text("utf-8"))
    assert found["coordinates"] == list(robot.coordinates)
    assert 0.1 < found["largest_tilt"] < 1.6
    text = page.read_text("utf-8")
    for words in ("<figcaption>roll, pitch</figcaption>", "to every side", "<b>R</b><sub>z</sub>"):
        assert words in text


def test_a_platform_that_is_not_flat_is_drawn_as_its_hull():
    robot = pteron.load("rubin-m2-hexapod")
    (part,) = joint_points(robot, pteron.random_poses(robot, 2)).parts
    a, b, c = np.moveaxis(part.corners[1][part.triangles], 1, 0)
    volume = (np.cross(a, b) * c).sum() / 6.0  # of a closed surface seen from outside
    assert volume == pytest.approx(ConvexHull(part.corners[1]).volume)
    flat = pteron.load("wrist")
    assert joint_points(flat, pteron.random_poses(flat, 2)).parts[0].triangles is None
