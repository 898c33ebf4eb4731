"""Machines chosen for a job: what they keep, why kinds fall out, files, going on, bad jobs."""

import json

import numpy as np
import pytest
import tomlkit
from mechanisms import CLIENTS
from test_cli import done, refused, run

import pteron
from pteron.design import Job, choose_machine
from pteron.dynamics import drive_forces
from pteron.errors import DataError
from pteron.kinematics import inverse_kinematics
from pteron.motion import along, line_path, with_payload
from pteron.workspace import Box, pose_margins, prove

JOB = {
    "workspace": {"size": [0.2, 0.2, 0.05]},
    "payload": {"mass": 0.3},
    "cycles": [{"points": [[-0.08, 0.0, 0.0], [0.08, 0.0, 0.0]], "duration": 0.3}],
    "accuracy": {"most": 5e-4},
    "kinds": ["linear-delta"],
    "search": {"evaluations": 40},
}
"""A job that a linear Delta does easily."""


def of(**keys):
    return Job.model_validate(JOB | keys)


@pytest.fixture(scope="module")
def chosen(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chosen")
    return choose_machine(of(), folder=folder), folder


def test_a_chosen_machine_keeps_what_was_asked(chosen, tmp_path):
    one = chosen[0].best
    assert one.serves
    assert "proved" in one.proved
    file = tmp_path / "machine.toml"
    file.write_text(one.robot)
    robot = pteron.load(file)
    rng = np.random.default_rng(0)
    middle, half = np.array(one.middle), np.array([0.1, 0.1, 0.025])
    poses = middle + rng.uniform(-1.0, 1.0, (2000, 3)) * half
    assert pose_margins(robot, poses).type_i.min() >= 0.1
    low, high = np.array([leg.limits for leg in robot.legs]).T
    joints = inverse_kinematics(robot, poses)
    assert (joints >= low).all()
    assert (joints <= high).all()
    assert prove(robot, Box(tuple(middle - half), tuple(middle + half)), type_i=0.1).holds
    carrying = with_payload(robot, 0.3)
    for shift, turn in zip(rng.uniform(-1.0, 1.0, (5, 3)), rng.uniform(0.0, np.pi, 5), strict=True):
        way = 0.08 * np.array([np.cos(turn), np.sin(turn), 0.0])
        at = middle + shift * (half - np.abs(way))
        motion = along(carrying, line_path(carrying, [at - way, at + way]), duration=0.3)
        forces = drive_forces(carrying, motion.pose, motion.velocity, motion.acceleration)
        drive = robot.legs[0].drive
        assert np.abs(forces).max() < drive.max_force
        assert np.sqrt((forces**2).mean(axis=0)).max() < drive.rated_force
    assert one.figures["error"] <= 5e-4
    assert min(one.figures[f"{k}_margin"] for k in ("rated", "peak", "speed")) >= 1.0
    assert one.figures["shortest_time"] < 0.3


def test_a_finished_kind_is_not_searched_again(chosen, tmp_path):
    first, folder = chosen
    again = choose_machine(of(), folder=folder)
    assert again.resumed == ("linear-delta",)
    assert again.data() == first.data()
    other = choose_machine(of(search={"evaluations": 6, "seed": 3}), folder=folder)
    assert other.resumed == ()


def test_why_a_kind_falls_out_is_told():
    (one,) = choose_machine(of(cell={"height": 0.05}, search={"evaluations": 12})).candidates
    assert not one.serves
    assert any("height" in text and "at most 0.05 m asked" in text for text in one.why)


def test_kinds_are_those_that_can_do_the_motion():
    turning = of(workspace={**JOB["workspace"], "turn": [-1, 1]}, kinds=["five-bar", "delta"])
    with pytest.raises(DataError, match="five-bar moves along x y only") as caught:
        choose_machine(turning)
    assert "delta does not turn" in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"workspace": {"size": [300.0, 300.0, 150.0]}}, "are these mm"),
        ({"workspace": {"size": [0.1, 0.1, 0.1], "radius": 0.2}}, "a box has size"),
        ({"objectives": ["beauty"]}, "is none of price"),
        ({"cycles": []}, "nothing says what the motors must do"),
        ({"objectives": ["cycle_time"]}, "every cycle has its duration"),
        ({"cycles": [{"points": [[0, 0], [1, 0]], "duration": 1.0}]}, "points of 3 numbers"),
        ({"payload": {"mass": -1.0}}, "mass"),
        ({"nonsense": 1}, "nonsense"),
        ({"links": {"upper": ["wood"]}}, "is no stock"),
        ({"cell": {"low": [0, 0, 0], "high": [1, 1, 1]}}, "need [workspace] center"),
    ],
)
def test_a_bad_job_is_refused_in_a_line(keys, told, tmp_path):
    file = tmp_path / "job.toml"
    file.write_text(tomlkit.dumps(JOB | keys))
    assert told in refused(f"choose {file}")


def test_a_cycle_that_does_not_fit_and_motors_without_inertia_are_refused(tmp_path):
    with pytest.raises(DataError, match="600 x 0 x 0 mm does not fit"):
        choose_machine(of(cycles=[{"points": [[-0.3, 0, 0], [0.3, 0, 0]], "duration": 1.0}]))
    motors = tmp_path / "motors.csv"
    motors.write_text("name,rated_torque,peak_torque,max_speed\na,1,3,300\n")
    with pytest.raises(DataError, match="rotor_inertia"):
        choose_machine(of(motors={"list": str(motors)}))
    motors.write_text("name,rotor_inertia,rated_torque,peak_torque,max_speed\na,1e-4,1,3,300\n")
    with pytest.raises(DataError, match="price: asked for"):
        choose_machine(of(motors={"list": str(motors)}))


@CLIENTS
def test_the_command_writes_a_page_and_files_that_other_commands_take(tmp_path):
    file, out = tmp_path / "job.toml", tmp_path / "out"
    file.write_text(tomlkit.dumps(JOB | {"kinds": ["linear-delta", "delta"]}))
    text = done(f"choose {file} --out {out}")
    assert "linear-delta" in text
    assert "linear-delta" in (out / "choose.html").read_text()
    data = json.loads((out / "choose.json").read_text())
    for one in data["kinds"]:
        if one["serves"]:
            assert run(f"check {out / one['kind']}.toml").exit_code == 0
    again = run(f"choose {file} --out {out} --json")
    assert "finished before" in again.stderr
    assert json.loads(again.stdout)["kinds"] == data["kinds"]
