"""Washout: a simulator shows a vehicle by its platform, which never leaves a proved box."""

import json

import numpy as np
import polars as pl
import pytest
import tilting
from mechanisms import CLIENTS
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.errors import DataError, ModelError
from pteron.motion import Washout, cue

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
