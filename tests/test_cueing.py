"""Washout: a simulator shows a vehicle by its platform, which never leaves a proved box."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import tilting
from mechanisms import CLIENTS
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.errors import DataError, ModelError
from pteron.kinematics import joint_rates
from pteron.legs.drive import Drive
from pteron.manipulator import with_pivot
from pteron.motion import Washout, cue, with_payload
from pteron.workspace import conditions, home_pose
from pteron.workspace.conditions import keeps

ROBOT, HOME = tilting.machine("3T3R", ("UPS",), 3)
TIME = np.arange(0.0, 12.0, 0.01)
NONE = dict.fromkeys(("ax", "ay", "az", "wx", "wy", "wz"), 0.0 * TIME)


def shown(washout=None, **columns):
    return cue(ROBOT, {"t": TIME, **NONE, **columns}, washout=washout, pose=HOME)


def test_what_lasts_is_tilted_into_and_what_is_quick_comes_back():
    ramp = np.clip(TIME / 2.0, 0.0, 1.0)
    found = shown(Washout(scale=0.05), ax=2.0 * ramp)
    away = found.pose - HOME
    names = list(ROBOT.coordinates)
    x, pitch = away[:, names.index("x")], away[:, names.index("pitch")]
    assert x.max() == x[np.abs(x).argmax()] > 0.0
    assert abs(x[-1]) < 0.2 * x.max()
    # A held acceleration is felt as gravity: R^T g has as much ahead, which is -sin(pitch) g.
    assert -np.sin(pitch[-1]) * 9.81 == pytest.approx(0.05 * 2.0, rel=0.02)
    assert np.abs(np.delete(away, [names.index("x"), names.index("pitch")], axis=1)).max() < 1e-12


def test_it_moves_as_its_derivatives_say():
    wave = np.sin(0.7 * TIME) ** 3
    found = shown(ax=wave, ay=0.5 * wave, az=wave, wx=0.1 * wave, wy=0.2 * wave, wz=-0.1 * wave)
    inner = slice(2, -2)
    for one, rate in ((found.pose, found.velocity), (found.velocity, found.acceleration)):
        slope = np.gradient(one, TIME, axis=0)[inner]
        np.testing.assert_allclose(slope, rate[inner], atol=0.02 * np.abs(rate).max())


@CLIENTS
def test_no_pose_leaves_the_box_whatever_the_vehicle_does():
    rng = np.random.default_rng(0)
    wild = {name: 50.0 * rng.normal(size=len(TIME)) for name in NONE}
    found = shown(**wild)
    assert found.proof.holds
    assert found.region.holds(found.pose).all()
    assert found.pressed > 0.3
    joints = pteron.inverse_kinematics(ROBOT, found.pose)
    low, high = np.array([leg.limits for leg in ROBOT.legs]).T
    assert ((low <= joints) & (joints <= high)).all()


@pytest.mark.parametrize(
    "time",
    [
        np.round(np.arange(0.0, 6.0, 1 / 60), 3),
        np.arange(0.0, 60.0, 0.5),
        np.arange(0.0, 60.0, 1.0),
        np.cumsum(np.random.default_rng(5).uniform(0.001, 0.2, 200)),
    ],
    ids=["60 Hz in ms", "0.5 s", "1 s", "uneven"],
)
def test_the_curve_between_samples_stays_in_the_box(time):
    rng = np.random.default_rng(0)
    vehicle = {name: 10.0 * rng.normal(size=len(time)) for name in NONE}
    found = cue(ROBOT, {"t": time, **vehicle}, pose=HOME)
    assert found.duration == pytest.approx(time[-1] - time[0])
    assert np.ptp(np.diff(found.time)) < 1e-9
    assert found.time[1] <= 0.01 + 1e-9
    fine = found.at(np.linspace(0.0, found.duration, 20 * len(found.time)))[0]
    assert found.region.holds(fine).all()


def test_the_box_is_centred_where_the_largest_one_fits():
    robot = pteron.load("stewart")
    legs = tuple(replace(leg, limits=(3.0, 3.6)) for leg in robot.legs)
    robot = replace(robot, legs=legs, home=(0.0, 0.0, 1.8, 0.0, 0.0, 0.0))
    wave = 4.0 * np.sin(TIME)
    vehicle = {"t": TIME, **NONE, "ax": wave, "ay": wave, "az": wave, "wx": 0.1 * wave}
    found, at_home = cue(robot, vehicle), cue(robot, vehicle, pose=robot.home)
    assert found.proof.holds
    half, at_rest = (0.5 * np.ptp(each.region.box, axis=0) for each in (found, at_home))
    np.testing.assert_allclose(half / at_rest, (half / at_rest)[0])
    assert (half > 1.5 * at_rest).all()
    np.testing.assert_array_equal(at_home.center, robot.home)
    # No middle of a grid about it has a box that is a sixth larger: a ninth is the proof's share.
    corners = 1.17 * half * np.sign(np.random.default_rng(0).uniform(-1, 1, (256, 6)))
    for step in np.stack(np.meshgrid(*[[-0.2, -0.1, 0.0, 0.1, 0.2]] * 3), -1).reshape(-1, 3):
        middle = found.center + np.append(step, np.zeros(3))
        assert not keeps(robot, conditions(robot), middle + corners).all()


def test_lost_rows_are_bridged_and_told_and_a_gap_is_refused():
    rng, time = np.random.default_rng(2), np.arange(0.0, 6.0, 1 / 60)
    whole = {**NONE, "ax": np.sin(TIME)}
    uneven = np.delete(time, rng.choice(len(time) - 2, 20, replace=False) + 1)
    uneven = uneven + 0.002 * rng.uniform(-1, 1, len(uneven))
    assert shown(ax=np.sin(TIME)).resampling == ""
    found = cue(ROBOT, {"t": uneven, **{k: np.interp(uneven, TIME, v) for k, v in whole.items()}})
    assert "(20 missing), interpolated linearly to steps of" in found.resampling
    full = cue(ROBOT, {"t": TIME, **whole}, pose=found.center)
    inner = (full.time > 0.5) & (full.time < found.duration - 0.5)
    at = full.time[inner]
    assert np.abs(full.at(at)[0] - found.at(at)[0]).max() < 0.02 * np.ptp(full.pose, axis=0).max()
    gap = np.delete(time, np.arange(100, 200))
    with pytest.raises(DataError, match=r"row 101: t: a gap of 1\.68 s before this row"):
        cue(ROBOT, {"t": gap, **{k: np.interp(gap, TIME, v) for k, v in NONE.items()}})
    with pytest.raises(DataError, match="row 4: t: two or more times expected that ascend"):
        cue(ROBOT, {"t": np.sort(time)[[0, 1, 2, 2, 3]], **{k: v[:5] for k, v in NONE.items()}})


@CLIENTS
def test_what_cannot_be_shown_is_told():
    with pytest.raises(ModelError, match="3T platform shows no vehicle's motion"):
        cue("delta", {"t": TIME, **NONE})
    with pytest.raises(DataError, match="wz"):
        cue(ROBOT, {"t": TIME, **{k: v for k, v in NONE.items() if k != "wz"}}, pose=HOME)
    with pytest.raises(DataError, match="times expected that ascend"):
        cue(ROBOT, {"t": -TIME, **NONE}, pose=HOME)
    with pytest.raises(DataError, match="tilting: -1"):
        Washout(tilting=-1.0)
    with pytest.raises(ModelError, match="no box of poses"):
        cue(ROBOT, {"t": TIME, **NONE}, pose=HOME + 50.0)


@CLIENTS
def test_the_command_writes_what_the_function_returns(tmp_path):
    robot, out = pteron.save(ROBOT, tmp_path / "robot.toml"), tmp_path / "cue.csv"
    vehicle = {"t": TIME, **NONE, "ax": np.sin(TIME)}
    pl.DataFrame(vehicle).write_csv(tmp_path / "vehicle.csv")
    given = ["cue", str(tmp_path / "vehicle.csv"), "--robot", str(robot), "--out", str(out)]
    done = CliRunner().invoke(app, [*given, "--scale", "0.1", "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.output)
    found = cue(ROBOT, vehicle, washout=Washout(scale=0.1))
    assert told["proved"]
    assert told["box"]["x"] == pytest.approx([corner[0] for corner in found.region.box])
    written = pl.read_csv(out)
    np.testing.assert_allclose(written.select(ROBOT.coordinates).to_numpy(), found.pose, atol=1e-12)
    assert set(ROBOT.joint_names) < set(written.columns)
    refused = CliRunner().invoke(app, given[:-2])
    assert refused.exit_code == 2
    assert "nothing to write" in refused.output


def test_the_command_takes_a_payload_a_pivot_and_a_middle(tmp_path):
    drive = Drive(ratio=-400.0, rotor_inertia=1e-4, rated_torque=2.0, max_force=100.0)
    robot = pteron.load("stewart")
    robot = replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))
    file, table = pteron.save(robot, tmp_path / "robot.toml"), tmp_path / "vehicle.csv"
    pl.DataFrame({"t": TIME, **NONE, "ax": np.sin(TIME)}).write_csv(table)
    line = ["cue", str(table), "--robot", str(file), "--out", str(tmp_path / "cue.csv")]
    line += ["--around", "home", "--payload", "90@0,0,0.4", "--pivot", "0", "0", "0.8", "--json"]
    done = CliRunner().invoke(app, line)
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    loaded = with_pivot(with_payload(robot, 90.0, [0.0, 0.0, 0.4]), [0.0, 0.0, 0.8])
    home = np.add(home_pose(robot), [0.0, 0.0, 0.8, 0.0, 0.0, 0.0])
    found = cue(loaded, table, pose=home)
    np.testing.assert_allclose(told["center"], home, atol=1e-9)
    forces = pteron.drive_forces(loaded, found.pose, found.velocity, found.acceleration)
    speeds = joint_rates(loaded, found.pose, found.velocity).actuated
    for motor, force, speed in zip(told["motors"], forces.T, speeds.T, strict=True):
        assert motor["rms_torque"] == pytest.approx(np.sqrt(np.mean(force**2)) / 400.0, rel=1e-3)
        assert motor["peak_torque"] == pytest.approx(np.abs(force).max() / 400.0, rel=1e-3)
        assert motor["speed"] == pytest.approx(400.0 * np.abs(speed).max(), rel=1e-2)
    (first, *_) = (peak for peak in told["peaks"] if peak["quantity"] == "force")
    assert first["share"] == pytest.approx(first["size"] / 100.0)
    assert "its limit is 100 N; a smaller --scale asks less" in done.stderr
