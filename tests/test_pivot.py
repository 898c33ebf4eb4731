"""Poses about another point of the platform: `with_pivot`, `motion_at_point`, `--pivot`."""

import json
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import done, refused, run

import pteron
from pteron.errors import ModelError
from pteron.kinematics import random_poses
from pteron.manipulator import Tool, with_pivot
from pteron.motion import with_tool

FREE = (
    "stewart",
    "reachy-mini",
    "pentapteron",
    "quadrupteron-oblique",
    "h4",
    "3-rrr",
    "delta",
    "five-bar",
)
"""Machines of each motion whose P may be any point; h4 has bars, and a gear."""

FIXED = ("wrist", "ankle-offset", "agile-eye", "sprint-z3")


def _point(robot, seed):
    point = np.random.default_rng(seed).uniform(-0.1, 0.1, 3)
    return point * [1, 1, 0] if robot.platform.planar else point


@pytest.mark.parametrize("name", FREE)
def test_joints_and_forces_are_those_of_the_same_state_at_p(name):
    robot = pteron.load(name)
    point, rng = _point(robot, 1), np.random.default_rng(2)
    pivoted = with_pivot(robot, point)
    poses = random_poses(robot, 5, seed=3)
    rates, growth = 0.1 * rng.normal(size=(2, *poses.shape))
    at_pivot = pteron.compile(robot, "motion_at_point")(poses, rates, growth, point)
    assert pteron.inverse_kinematics(pivoted, at_pivot[0]) == pytest.approx(
        pteron.inverse_kinematics(robot, poses), abs=1e-13
    )
    # Virtual work does not know which point of the platform is P.
    forces = pteron.inverse_dynamics(robot, poses, rates, growth)
    assert pteron.inverse_dynamics(pivoted, *at_pivot) == pytest.approx(
        forces, abs=1e-11 * np.abs(forces).max()
    )
    back = pteron.compile(robot, "motion_at_point")(*at_pivot, -point)
    assert np.stack(back) == pytest.approx(np.stack([poses, rates, growth]), abs=1e-13)


def test_motion_at_point_is_the_derivative_of_its_pose():
    kernel = pteron.compile("stewart", "motion_at_point")
    pose, rate, growth = random_poses("stewart", 3, seed=5)
    step = 1e-4
    times = step * np.arange(-1, 2)[:, None]
    along = pose + times * rate + times**2 / 2 * growth
    poses = kernel(along, 0 * along, 0 * along, [0.3, -0.2, 0.9])[0]
    _, velocity, acceleration = kernel(pose, rate, growth, [0.3, -0.2, 0.9])
    assert velocity == pytest.approx((poses[2] - poses[0]) / (2 * step), abs=1e-7)
    assert acceleration == pytest.approx((poses[2] - 2 * poses[1] + poses[0]) / step**2, abs=1e-6)


def test_tools_and_home_are_converted():
    tool = Tool("probe", (0.1, 0.0, 0.2), 0.3)
    home = (0.0, 0.1, 2.1, 0.1, 0.0, 0.3)
    robot = pteron.load("stewart")
    robot = replace(robot, tools=(tool,), home=home)
    point = (0.2, -0.1, 0.5)
    there = with_tool(with_pivot(robot, point), "probe")
    here = with_pivot(with_tool(robot, "probe"), point)
    assert there.platform.tool == pytest.approx(here.platform.tool, abs=1e-15)
    assert there.platform.inertia.values == pytest.approx(here.platform.inertia.values, rel=1e-12)
    assert pteron.inverse_kinematics(there, there.home) == pytest.approx(
        pteron.inverse_kinematics(robot, home), abs=1e-13
    )


@pytest.mark.parametrize("name", FIXED)
def test_platforms_with_a_fixed_point_refuse_a_pivot(name):
    with pytest.raises(ModelError, match="its point P cannot be chosen"):
        with_pivot(name, (0.0, 0.0, 0.1))


def test_pivot_of_a_planar_machine_lies_in_its_plane():
    with pytest.raises(ModelError, match=r"0\.1 m out of the plane"):
        with_pivot("3-rrr", (0.0, 0.0, 0.1))


def test_commands_take_a_pivot():
    plain = json.loads(done("inverse stewart 0.1 0 2 0 0 0.2 --json"))
    about = json.loads(done("inverse stewart 0.1 0 2.8 0 0 0.2 --pivot 0 0 0.8 --json"))
    assert [about[f"rho{i}"] for i in range(1, 7)] == pytest.approx(
        [plain[f"rho{i}"] for i in range(1, 7)], abs=1e-12
    )
    refused("cycle stewart --pivot 0 1", "--pivot: 2 values given, 3 expected: x y z")
    refused("workspace wrist --from 0,0,0 --pivot 0,0,1", "its point P cannot be chosen")


def test_a_table_about_another_point_is_doubted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = "cycle delta --around 0 0 -0.9 --scale 0.5 --out about.csv"
    assert run(f"{line} --pivot 0.01 0 0").exit_code == 0
    text = run("size delta --cycle about.csv").stderr
    assert "about another point (--pivot)? The poses count" in text
    assert "--pivot" not in run("size delta --cycle about.csv --pivot 0.01,0,0").stderr


def test_the_home_pose_is_a_word_wherever_a_pose_is_typed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    home = ",".join(map(str, pteron.workspace.home_pose("delta").tolist()))
    for line in (
        "workspace delta --from {} --json",
        "inverse delta {} --json",
        "forces delta --pose {} --json",
        "cycle delta --from 0.1,0,-0.9 --to {} --duration 1 --json",
    ):
        assert done(line.format("home")) == done(line.format(home)), line
    assert "'house' is not a number" in refused("workspace delta --from house")


def test_a_pivot_in_millimetres_leaves_no_box_and_no_warning_of_arithmetic(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("drive.csv").write_text(
        "t,ax,ay,az,wx,wy,wz\n0,0,0,0,0,0,0\n0.1,1,0,0,0,0,0.1\n0.2,0,1,0,0,0,0\n1,0,0,0,0,0,0\n"
    )
    options = "--limits=-60:60deg --crank 15mm --rod 140mm --base-sides 60mm:130mm"
    done(f"new hexa {options} --platform-radius 5cm --platform-pair 20mm --out robot.toml")
    result = run("cue drive.csv --robot robot.toml --pivot 0,0,500 --out cue.csv")
    assert result.exit_code == 2
    assert "that serves is a point: there is no room for the motion" in result.stderr
    assert "pivot: 500 m from P" in result.stderr


def test_a_warning_of_arithmetic_is_a_sentence(monkeypatch):
    def home_pose(robot):
        warnings.warn("overflow encountered in multiply", RuntimeWarning, stacklevel=1)
        return np.array([0.0, 0.0, -1.0])

    monkeypatch.setattr(pteron.workspace, "home_pose", home_pose)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        monkeypatch.setattr(sys, "warnoptions", [])
        result = run("inverse delta home")
        monkeypatch.setattr(sys, "warnoptions", ["default"])
        raw = run("inverse delta home")
    assert result.stderr == (
        "Note: a number was not finite on the way (overflow encountered in multiply); results may "
        "be wrong: are all values in m, rad, kg and s?\n"
    )
    assert "RuntimeWarning: overflow" in raw.stderr


def test_commands_that_read_a_table_of_a_pivot_have_the_option(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pivot = "--pivot 0.1,0,0.2"
    assert run(f"cycle quadrupteron {pivot} --out table.csv").exit_code == 0
    assert run("cycle quadrupteron --out own.csv").exit_code == 0
    note = "its joints are not those of its poses: was it made with --pivot"
    for line in (
        "simulate quadrupteron --cycle {} --out run.csv",
        "play quadrupteron {} --out page.html",
    ):
        right = run(f"{line.format('table.csv')} {pivot}")
        assert right.exit_code == 0, right.output
        assert note not in right.stderr
        assert note in run(line.format("table.csv")).stderr
        assert note not in run(line.format("own.csv")).stderr
    for command in ("film", "tune", "report", "size"):
        assert "--pivot" in done(f"{command} --help")
