"""`pteron simulate` as a person and a program use it."""

import json
import re
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from commands import read
from mechanisms import CLIENTS
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.motion import pick_and_place


def run(*arguments, code=0):
    found = CliRunner().invoke(app, ["simulate", *map(str, arguments)])
    assert found.exit_code == code, found.output
    return found


@pytest.fixture
def weak(tmp_path):
    """Return the file of a Tripteron whose drives are hardly stronger than they must be."""
    robot = pteron.load("tripteron")
    drive = pteron.legs.Drive(coulomb=1.0, viscous=2.0, max_force=36.0, rest_speed=1e-4)
    legs = tuple(replace(leg, drive=drive) for leg in robot.legs)
    path = tmp_path / "weak.toml"
    pteron.save(replace(robot, legs=legs), path)
    return path


@CLIENTS
def test_a_folder_has_table_numbers_and_pictures(weak, tmp_path):
    out = tmp_path / "run"
    data = json.loads(run(weak, "--duration", 2, "--step", 5e-4, "--out", out, "--json").stdout)
    assert data["stopped"] is None
    assert data["samples"] == 2001
    assert max(row["largest"] for row in data["tracking"]) < 1e-6
    assert all(row["peak_force"] < 36.0 for row in data["drives"])
    names = {path.name for path in out.iterdir()}
    assert names == {"simulation.csv", "simulation.json", "tracking.svg", "forces.svg"}
    table = pl.read_csv(out / "simulation.csv")
    assert len(table) == 2001
    np.testing.assert_allclose(
        np.abs(table["x"] - table["xref"]).max(), data["tracking"][0]["largest"], rtol=1e-9
    )
    # What was written is a cycle to be simulated again.
    again = json.loads(
        run(weak, "--cycle", out / "simulation.csv", "--step", 5e-4, "--json").stdout
    )
    assert again["duration"] == pytest.approx(2.0)


def test_a_step_is_no_longer_than_a_sample():
    assert json.loads(run("tripteron", "--step", 0.01, "--json").stdout)["step"] == 1e-3


def test_the_model_has_the_machines_working_mode():
    given = ["quadrupteron", "--elbows=+-++", "--duration", 0.5, "--step", 5e-4, "--json"]
    own, other = (json.loads(run(*given, *more).stdout) for more in ([], ["--model", given[0]]))
    assert own["tracking"] == other["tracking"]


@CLIENTS
def test_a_pipe_gets_the_table(weak):
    text = run(weak, "--duration", 2, "--rate", 500, "--step", 5e-4, "--controller", "pd").stdout
    assert text.startswith("t,x,y,z,dx,dy,dz,ddx,ddy,ddz,xref,yref,zref,rho1,rho2,rho3,drho1")
    assert len(text.splitlines()) == 1002


def test_a_payload_that_overloads_the_drives_is_refused(weak):
    refused = run(weak, "--duration", 2, "--payload", 3, code=2)
    assert "leg 3: the motion takes up to" in refused.stderr
    assert "its drive gives 36 N (max_force)" in refused.stderr
    assert "--anyway" in refused.stderr
    anyway = run(weak, "--duration", 2, "--payload", 3, "--anyway", "--json", code=1)
    assert "Warning: leg 3" in anyway.stderr
    assert "Stopped at" in anyway.stderr
    data = json.loads(anyway.stdout)
    assert data["drives"][2]["at_its_limit"] > 0.5
    assert data["drives"][2]["peak_force"] == 36.0


@CLIENTS
def test_a_motor_that_gives_too_little_at_speed_is_told_by_every_command(tmp_path):
    """Its greatest force and speed are enough, each by itself."""
    robot, file, table = pteron.load("five-bar"), tmp_path / "motor.toml", tmp_path / "fast.csv"
    motion = pick_and_place(robot)
    rates = np.abs(pteron.kinematics.joint_rates(robot, motion.pose, motion.velocity).actuated)
    forces = np.abs(pteron.inverse_dynamics(robot, motion.pose, motion.velocity,
                                            motion.acceleration))  # fmt: skip
    most = 0.6 * (forces[:, 0] / forces[:, 0].max() + rates[:, 0] / rates[:, 0].max()).max()
    curve = ((0.0, most * forces[:, 0].max()), (most * rates[:, 0].max(), 0.0))
    drive = pteron.legs.Drive(curve=curve)
    pteron.save(replace(robot, legs=(replace(robot.legs[0], drive=drive), robot.legs[1])), file)
    told = "leg 1: the motion takes .* at a speed at which its drive gives .* N m .curve."

    def said(*line, code):
        found = CliRunner().invoke(app, [*map(str, line)])
        assert found.exit_code == code, found.output
        return found, " ".join(found.stderr.split())

    said("cycle", "five-bar", "--duration", motion.duration, "--out", table, code=0)
    assert re.search(told, said("simulate", file, "--cycle", table, code=2)[1])
    sized = said("size", file, "--within", "here", "--cycle", table, code=1)
    assert re.search(told, " ".join(sized[0].output.split()))
    found, noted = said("cycle", file, "--table", table, code=0)
    assert re.search(r"leg 1 takes .* N m, its limit at that speed is", noted)
    assert "torque at speed" in found.stdout
    slower = json.loads(said("cycle", file, "--json", code=0)[0].stdout)["duration"]
    assert slower > motion.duration
    kept = said("simulate", file, "--duration", slower, "--json", code=0)[0]
    assert json.loads(kept.stdout)["stopped"] is None
    quick = "--harmonics", 2, "--period", 1, "--starts", 1, "--draws", 4, "--workers", 1
    fast = "--speed", 2.0 * rates.max(), "--acceleration", 1000.0
    assert re.search(told, said("excite", file, *quick, *fast, code=0)[1])


def test_units_of_a_cycle_and_a_payload_are_doubted(tmp_path):
    time = np.linspace(0.0, 1.0, 11)
    poses = {"x": 0.0, "y": 0.0, "z": -0.02, "phi": 12.0 * np.sin(time)}
    path = tmp_path / "degrees.csv"
    pl.DataFrame(
        {"t": time, **{key: value + 0.0 * time for key, value in poses.items()}}
    ).write_csv(path)
    refused = run("quadrupteron", "--cycle", path, code=2)
    assert f"; {path}: phi up to 10.0977: are these degrees? rad are expected" in refused.stderr
    heavy = run("tripteron", "--payload", 500, "--delay", "-1", code=2)
    assert "Note: a payload of 500 kg" in heavy.stderr


@CLIENTS
def test_a_table_on_a_narrow_screen_keeps_its_numbers():
    lines = read("simulate delta --duration 1").splitlines()
    assert max(map(len, lines)) <= 60
    cells = lines[-2].split()
    assert cells[0] == "3"
    assert [cell for cell in cells if not cell[0].isdigit()] == [
        "N",
        "m",
        "N",
        "m",
        "rad/s",
        "W",
        "unlimited",
    ]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["--cycles", "0"], "--cycles: 0 given, 1 or more"),
        (["--rate", "-1"], "--rate: -1 given"),
        (["--bandwidth", "-5"], "bandwidth: -5"),
        (["--payload", "-1"], "payload: -1"),
        (["--cycle", "no.csv"], "no.csv"),
        (["--delay", "-1"], "delay: -1"),
        (["--step", "0"], "step: 0"),
        (["--encoder", "-1e-6"], "encoder: -1e-06"),
        (["--controller", "best"], "best"),
        (["--model", "delta"], "--model delta: its joints are theta1 theta2 theta3, and of"),
        (["--model", "quadrupteron"], "--model quadrupteron: its pose is x y z phi, and of"),
    ],
)
def test_mistakes_are_told_in_a_line(given, told, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = run("tripteron", *given, code=2)
    assert told in found.stderr
    assert len(found.stderr.strip().splitlines()) == 1
