"""A leg's `reading`: q = zero + scale reading, wherever joint coordinates meet what drives read."""

import ctypes
import json
import subprocess
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.export import export_c, export_klipper, export_linuxcnc, export_mjcf
from pteron.identification.logs import Log, read_log, write_log
from pteron.kinematics import random_poses
from pteron.legs import Reading
from pteron.manipulator.readings import from_readings, to_readings
from pteron.motion import replay

ZERO, SCALE = 0.003, np.array([1.01, 0.98, 1.005, 1.0])


def counted(name):
    """Return a machine whose drives count otherwise, all its legs but the fourth."""
    robot = pteron.load(name)
    scales = np.resize(SCALE, len(robot.legs))
    readings = [None if s == 1.0 else Reading(ZERO, s) for s in scales]
    legs = [replace(leg, reading=r) for leg, r in zip(robot.legs, readings, strict=True)]
    return replace(robot, legs=tuple(legs))


def test_a_file_keeps_readings_and_tells_their_faults(tmp_path):
    robot = counted("stewart")
    path = pteron.save(robot, tmp_path / "robot.toml")
    assert pteron.load(path) == robot
    text = path.read_text().replace("scale = 1.01 }", "scale = 0 }", 1).replace("0.98", "nan", 1)
    path.write_text(text)
    with pytest.raises(pteron.ModelError, match=r"leg 1: reading.scale: 0 given") as error:
        pteron.load(path)
    assert any("leg 2: reading.scale" in fault for fault in error.value.faults)


@pytest.mark.parametrize("name", ["quadrupteron-oblique", "delta", "linear-delta", "sprint-z3"])
def test_a_zero_goes_into_the_geometry(name):
    robot = counted(name)
    zeros = 0.01 * np.arange(1, len(robot.legs) + 1)
    moved = [leg.with_zero(zero) for leg, zero in zip(robot.legs, zeros, strict=True)]
    poses = random_poses(robot, 20, seed=1)
    joints, new = pteron.inverse_kinematics(robot, poses), replace(robot, legs=tuple(moved))
    found = pteron.inverse_kinematics(new, poses)
    np.testing.assert_allclose(found, joints - zeros, rtol=0.0, atol=1e-14)
    # In one posture drives read what they did, and limits are the same postures.
    read, before = to_readings(new, found), to_readings(robot, joints)
    np.testing.assert_allclose(read[:, :3], before[:, :3], rtol=0.0, atol=1e-14)
    for leg, old, zero in zip(moved, robot.legs, zeros, strict=True):
        assert old.limits is None or leg.limits == tuple(limit - zero for limit in old.limits)


def test_a_rams_length_takes_no_zero():
    assert pteron.load("stewart").legs[0].with_zero(0.01) is None


def test_logs_are_read_as_the_drives_count_and_written_so(tmp_path):
    robot, plain = counted("linear-delta"), pteron.load("linear-delta")
    t = np.arange(400) / 1000.0
    joints = 0.05 * np.sin(np.outer(t, [7.0, 9.0, 11.0]) + 1.0) + 0.01
    forces = 20.0 * np.cos(np.outer(t, [5.0, 8.0, 13.0]))
    path = write_log(Log("drives", t, joints, forces), tmp_path / "log.csv")
    log = read_log(path, robot)
    scales = SCALE[:3]
    np.testing.assert_allclose(log.joints, ZERO + scales * joints, rtol=0.0, atol=1e-12)
    power = np.gradient(log.joints, t, axis=0) * log.forces
    np.testing.assert_allclose(power, np.gradient(joints, t, axis=0) * forces, atol=1e-9)
    again = read_log(write_log(log, tmp_path / "again.csv"), plain)
    np.testing.assert_allclose(again.joints, joints, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(again.forces, forces, rtol=0.0, atol=1e-10)


def test_tables_of_joints_are_what_the_machine_runs():
    robot, plain = counted("quadrupteron"), pteron.load("quadrupteron")
    poses = np.linspace(0.0, 1.0, 21)[:, None] * [0.02, -0.01, 0.01, 0.1]
    joints = pteron.inverse_kinematics(plain, poses)
    np.testing.assert_allclose(from_readings(robot, to_readings(robot, joints)), joints, atol=1e-15)
    columns = dict(zip(robot.joint_names, to_readings(robot, joints).T, strict=True))
    table = pl.DataFrame({"t": np.linspace(0.0, 1.0, 21), **columns})
    np.testing.assert_allclose(replay(robot, table, start=poses[0]).pose, poses, atol=1e-9)


def test_commands_speak_as_the_drives_count(tmp_path):
    robot = counted("delta")
    path = pteron.save(robot, tmp_path / "robot.toml")
    pose = random_poses(robot, 1, seed=1)[0].tolist()
    wanted = to_readings(robot, pteron.inverse_kinematics(robot, pose))
    line = ["inverse", str(path), "--json", "--", *map(str, pose)]
    said = json.loads(CliRunner().invoke(app, line).stdout)
    found = [said[name] for name in robot.joint_names]
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-12)
    line = ["direct", str(path), "--json", "--", *map(repr, wanted.tolist())]
    modes = json.loads(CliRunner().invoke(app, line).stdout)
    assert min(np.abs(np.subtract([m["x"], m["y"], m["z"]], pose)).max() for m in modes) < 1e-9


def test_exported_code_counts_as_the_drives_do(tmp_path):
    robot = counted("delta")
    names = ["inverse_kinematics", "direct_kinematics", "jacobian", "inverse_dynamics"]
    _, _, test, *_ = export_c(robot, names, tmp_path)
    source, library = str(tmp_path / "delta.c"), str(tmp_path / "delta.so")
    subprocess.run(["cc", source, str(test), "-lm", "-o", str(tmp_path / "run")], check=True)
    subprocess.run([str(tmp_path / "run")], check=True)
    subprocess.run(["cc", "-shared", "-fPIC", source, "-lm", "-o", library], check=True)
    pose, rate, none = random_poses(robot, 1, seed=1)[0], np.array([0.3, -0.2, 0.1]), np.zeros(3)
    code = ctypes.CDLL(library)

    def call(name, result, *given):
        assert getattr(code, f"delta_{name}")(*(v.ctypes for v in (*given, result))) == 0
        return result

    joints = call("inverse_kinematics", np.zeros(3), pose)
    np.testing.assert_allclose(joints, to_readings(robot, pteron.inverse_kinematics(robot, pose)))
    rows = call("jacobian", np.zeros((3, 3)), pose)
    np.testing.assert_allclose(rows, pteron.jacobian(robot, pose) / SCALE[:3, None])
    # What the drives give in a motion is one power, however they count.
    forces = call("inverse_dynamics", np.zeros(3), pose, rate, none, pteron.parameters(robot))
    power = pteron.inverse_dynamics(robot, pose, rate, none) @ pteron.jacobian(robot, pose) @ rate
    np.testing.assert_allclose(forces @ rows @ rate, power)


def test_other_files_convert_or_refuse(tmp_path):
    robot = counted("linear-delta")
    text = "".join(path.read_text() for path in export_linuxcnc(robot, tmp_path))
    assert "Divide SCALE by 1.01" in text
    assert "joint = 0.003 + 1.01 reading" in export_klipper(robot, tmp_path)[0].read_text()
    with pytest.raises(pteron.ModelError, match="the drives of legs 1, 2, 3 read others"):
        export_mjcf(robot, tmp_path)
