"""Batches of machines that differ in masses, friction and payload: each as `simulate` has it."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from mechanisms import CLIENTS

import pteron
from pteron.controllers import ComputedTorque
from pteron.equations.drives import Drives
from pteron.motion import (
    Machines,
    Sensors,
    advance,
    machines_about,
    pick_and_place,
    simulate,
    simulate_many,
    with_payload,
)
from pteron.workspace import home_pose

DRIVE = pteron.legs.Drive(coulomb=2.0, viscous=4.0, rotor_inertia=0.05, max_force=80.0)


@pytest.fixture(scope="module")
def robot():
    drawn = pteron.load("quadrupteron")
    return replace(drawn, legs=tuple(replace(leg, drive=DRIVE) for leg in drawn.legs))


def one(machines, k):
    """Return a machine of many by itself."""
    robot = pteron.with_parameters(machines.robot, machines.parameters[k])
    rows = machines.drives[k].reshape(len(Drives._fields), -1)
    legs = tuple(
        replace(leg, drive=replace(DRIVE, coulomb=row.coulomb, viscous=row.viscous,
                                   rotor_inertia=row.inertia))
        for leg, row in zip(robot.legs, (Drives(*column) for column in rows.T), strict=True)
    )  # fmt: skip
    return with_payload(replace(robot, legs=legs), machines.payload[k])


@CLIENTS
def test_each_machine_is_what_simulate_makes_of_it(robot, tmp_path, monkeypatch):
    machines = machines_about(
        robot, 11, masses=0.2, friction=0.5, rotors=0.1, payload=(0.0, 0.5), seed=7
    )
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    given = {"duration": 0.02, "delay": 7e-4}
    many = {"sensors": Sensors(1e-6), **given}
    slow = simulate_many(machines.rows(slice(3)), motion, ComputedTorque(), **many)
    monkeypatch.delenv("PTERON_KERNELS")
    found = simulate_many(machines, motion, ComputedTorque(), out=tmp_path / "runs", **many)
    assert repr(found) == "<Batch of 11 'quadrupteron': 0 ended early>"
    table = pl.read_parquet(tmp_path / "runs" / "*.parquet")
    assert table.columns[:6] == ["machine", "t", "x", "y", "z", "phi"]
    assert len(table) == 11 * 21
    for k in (0, 7, 10):
        alone = simulate(
            one(machines, k), motion, ComputedTorque(), model=robot, sensors=Sensors(1e-6), **given
        )
        samples = table.filter(pl.col("machine") == k)
        for name, values in zip(robot.coordinates, alone.pose.T, strict=True):
            np.testing.assert_allclose(samples[name].to_numpy(), values, rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(found.largest[k], np.abs(alone.error).max(axis=0), rtol=1e-9)
        np.testing.assert_allclose(found.force[k], np.abs(alone.forces).max(axis=0), rtol=1e-9)
    for name in ("rms", "largest", "force"):
        np.testing.assert_array_equal(getattr(slow, name), getattr(found, name)[:3])
    threaded = simulate_many(machines, motion, ComputedTorque(), threads=2, **many)
    np.testing.assert_array_equal(threaded.rms, found.rms)
    noisy = {"sensors": Sensors(1e-6, noise=1e-6, seed=1), **given}
    first, part = (
        simulate_many(some, motion, ComputedTorque(), **noisy)
        for some in (machines, machines.rows(slice(4)))
    )
    np.testing.assert_array_equal(first.rms[:4], part.rms)
    with pytest.raises(pteron.DataError, match="give another folder"):
        simulate_many(machines, motion, ComputedTorque(), out=tmp_path / "runs", **many)


def test_machines_of_a_seed_do_not_depend_on_how_many_there_are(robot):
    few, more = (machines_about(robot, n, masses=0.1, friction=0.3, seed=2) for n in (3, 30))
    np.testing.assert_array_equal(few.parameters, more.parameters[:3])
    np.testing.assert_array_equal(few.drives, more.drives[:3])
    factors = more.parameters / pteron.parameters(robot)
    assert 0.9 <= np.nanmin(factors) < 0.93 < 1.07 < np.nanmax(factors) <= 1.1
    assert len({*more.drives[:, 4].tolist()}) == 30  # coulomb of joint 1


def test_states_go_on_as_their_machines_do(robot):
    machines = machines_about(robot, 3, masses=0.3, friction=0.5, seed=1)
    pose = np.tile(home_pose(robot), (3, 1))
    velocity = np.full_like(pose, 0.1)
    given = np.zeros_like(pose), 1e-4, 20
    ahead, fast, _, served = advance(robot, pose, velocity, *given, machines=machines)
    assert served.all()
    assert np.ptp(fast, axis=0).min() > 1e-4
    for k in range(3):
        alone, *_ = advance(one(machines, k), pose[k], velocity[k], np.zeros(4), 1e-4, 20)
        np.testing.assert_allclose(ahead[k], alone, rtol=0.0, atol=1e-15)


def test_environments_may_have_a_machine_each(robot):
    environments = pytest.importorskip("pteron.environments")
    machines = machines_about(robot, 2, masses=0.5, seed=1)
    envs = environments.PteronVectorEnv(robot, 2, machines=machines)
    given = {"pose": envs.world.home, "target": envs.world.home}
    envs.reset(seed=0, options=given)
    seen = envs.step(np.zeros((2, 4), np.float32))[0]
    assert (seen[0, :4] != seen[1, :4]).any()
    with pytest.raises(pteron.DataError, match="2 of quadrupteron given, 3 of"):
        environments.PteronVectorEnv(robot, 3, machines=machines)


def test_mistakes_are_told(robot):
    for wrong, message in (
        ({"count": 0}, "count: 0 given"),
        ({"count": 2, "masses": 1.0}, "masses: 1.0 given, a share"),
        ({"count": 2, "payload": (1.0, 0.5)}, "least and most expected"),
        ({"count": 2, "friction": np.nan}, "friction: nan given"),
    ):
        with pytest.raises(pteron.DataError, match=message):
            machines_about(robot, **wrong)
    many = machines_about(robot, 2)
    with pytest.raises(pteron.DataError, match=r"drives: shape \(2, 3\) given"):
        Machines(robot, many.parameters, np.zeros((2, 3)), many.payload)
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    with pytest.raises(pteron.DataError, match="controller"):
        simulate_many(many, motion, "pd")
    with pytest.raises(pteron.DataError, match="delay"):
        simulate_many(many, motion, ComputedTorque(), delay=-1.0)
    with pytest.raises(pteron.DataError, match="machines: 2 of quadrupteron given, 1 of"):
        advance(robot, *np.zeros((3, 4)), 1e-4, 1, machines=many)
